"""Pairs of directions that show all of a lobe, and lobes evaluated on them."""

from dataclasses import replace
from itertools import product

import numpy as np
from helpers import random_directions

from sommerl.models.family import Angles
from sommerl.models.multi_lobe import FAMILIES
from sommerl.reflectance.arrays import split

FAMILY_LIST = list(FAMILIES.values())


def label(value):
    """A family's name, for pytest; other values as pytest names them."""
    return getattr(value, "name", None)


def pairs(count=300, seed=0):
    """Directions to light and viewer: anywhere; close to the mirror's pairs, at all scales; close to each other; and
    both along the normal, which all lobes but those that Lafortune's leans away see at its brightest."""
    rng = np.random.default_rng(seed)
    wo = random_directions(3 * count, seed)
    spread = 10 ** rng.uniform(-3, 0, (3 * count, 1))
    near = spread * rng.standard_normal((3 * count, 3))
    h = near + np.array([0, 0, 1])
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    mirrored = 2 * (h * wo).sum(axis=-1, keepdims=True) * h - wo
    close = (wo + near) / np.linalg.norm(wo + near, axis=-1, keepdims=True)
    wi = np.concatenate([random_directions(count, seed + 1), mirrored[count : 2 * count], close[2 * count :]])
    above = wi[:, 2] > 0
    return np.append(wi[above], [[0, 0, 1]], axis=0), np.append(wo[above], [[0, 0, 1]], axis=0)


def evaluated(family, shape, wi, wo):
    """f_r of the family's lobe in NumPy."""
    return family.lobe(Angles(split(wi), split(wo)), *shape)


def shapes(family, places=(0.0, 1.0), **fixed):
    """The start, and all combinations of the parameters at these places between their bounds, but for fixed ones."""
    values = [[min(max(float(p.at(place)), p.low), p.high) for place in places] for p in family.parameters]
    values = [[fixed[p.name]] if p.name in fixed else v for p, v in zip(family.parameters, values, strict=True)]
    start = tuple(fixed.get(p.name, p.start) for p in family.parameters)
    return [start, *product(*values)] if values else [start]


def scaled(family, factor):
    """The same lobe, brighter or darker."""
    return replace(family, lobe=lambda a, *shape: factor * family.lobe(a, *shape))
