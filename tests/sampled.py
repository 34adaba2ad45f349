"""Materials of all kinds, the samplers fitted to them, and samplers that are broken on purpose."""

from functools import cache

import numpy as np
from helpers import compact_material, lambertian_table

from sommerl import BrdfTable, Lattice
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.nodes import NodeLattice
from sommerl.sampling.named import SAMPLERS

ANGLES = (0, 45, 80, 88)  # of the viewer [degrees]
NODES = NodeLattice((0, 20, 60, 120, 180), (0, 0, 1, 1, 1), ((0, 60, 180), (0, 180)), ((0, 90), (0,)))
HANDED = Lattice(8, 8, 24, reciprocal=False)


def lobe(name, albedo, **shape):
    return Lobe(FAMILIES[name], albedo, shape)


MATERIALS = {
    "glossy": MultiLobe(
        "glossy", [lobe("lambertian", (0.3, 0.2, 0.1)), lobe("ggx", (0.4, 0.5, 0.6), alpha=0.2, f0=0.1)]
    ),
    # Nothing but a highlight of 2°.
    "mirror": MultiLobe("mirror", [lobe("cook-torrance", (0.9, 0.9, 0.9), m=0.03, f0=0.9)]),
    "chalk": lambertian_table(0.5),
    # Random values, bright at grazing angles, black in places.
    "compact": compact_material(NODES),
    # Not the same on both sides of the viewer's plane, nor in both orders.
    "handed": BrdfTable(np.random.default_rng(0).random((*HANDED.shape, 3)) ** 6, HANDED),
}
LOSSLESS = ("half-vector", "matusik", "cosine")  # draw nothing below the horizon
CASES = [(name, material, degrees) for name in SAMPLERS for material in MATERIALS for degrees in ANGLES]


@cache
def sampler(name, material):
    return SAMPLERS[name].fitted(MATERIALS[material])


class Dim(Brdf):
    """Lambertian for viewers whose cosine is between two numbers, and black for all others."""

    name = "dim"

    def __init__(self, low, high):
        self.low, self.high = low, high

    def f_r(self, wi, wo, buffers):
        value = np.where((wo[2] > self.low) & (wo[2] < self.high), 1 / np.pi, 0.0)
        return value, value, value


class Broken:
    """A sampler that draws with other random numbers, or says another density: `factor` times its own."""

    def __init__(self, sampler, numbers=lambda u: u, factor=lambda wi, wo: 1.0):
        self.sampler, self.numbers, self.factor = sampler, numbers, factor

    def sample(self, wo, u):
        wi, pdf, weight = self.sampler.sample(wo, self.numbers(u))
        factor = self.factor(wi, wo) + np.zeros(len(wi))
        return wi, pdf * factor, weight / factor[:, None]

    def pdf(self, wi, wo):
        return self.sampler.pdf(wi, wo) * self.factor(wi, wo)


def uneven(sampler):
    """As if the derivative of a change of variables had been forgotten in drawing."""
    return Broken(sampler, numbers=lambda u: u**1.1)


def without_jacobian(sampler):
    """As if dω_i = dω_h."""

    def factor(wi, wo):
        h = wi + wo
        return 4 * (h * wo).sum(axis=-1) / np.linalg.norm(h, axis=-1)

    return Broken(sampler, factor=factor)


def scaled(sampler, by):
    """The density, by a factor."""
    return Broken(sampler, factor=lambda wi, wo: by)
