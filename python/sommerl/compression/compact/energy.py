"""Keeps a compact material from reflecting more than it receives, or than its source does.

A lattice is fitted to reflectances and not to their integrals, so that a source with an albedo near 1 may come out
brighter than that, mostly for viewers near grazing. Then the values to be quantised are made darker there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...reflectance.arrays import Triple
from ...reflectance.brdf import Brdf
from ...reflectance.half_diff import directions
from ...reflectance.nodes import NodeLattice, angles_at
from ...sampling.half_vector import albedo
from .source import node_places

# Of viewers, closer together where albedos change fastest
ANGLES = np.radians((0, 10, 20, 30, 40, 50, 60, 68, 74, 78, 81, 84, 86, 87, 88, 88.5, 89, 89.3, 89.5))
ALLOWED = 1.02  # times the source's albedo, or 1 if that is more
# Along each side of a sampler's cell, points of the albedos' quadrature; the finer one where albedos may be too large.
COARSE, FINE, NEAR = 6, 16, 0.85
AIM = 0.985  # of what is allowed, since quadrature and interpolation between ANGLES are not exact
DARK = 1e-9  # an albedo below counts as that much

Floats = NDArray[np.float64]


class EnergyBound:
    """What a material made from a source may reflect to viewers at ANGLES."""

    def __init__(self, source: Brdf) -> None:
        self._most = np.maximum(1.0, ALLOWED * _albedos(source))

    def factors(self, brdf: Brdf) -> Floats:
        """By what f_r would have to be multiplied at each of ANGLES, at most 1."""
        found = _albedos(brdf)
        if (found <= self._most).all():
            return np.ones(len(ANGLES))
        return np.minimum(1.0, AIM * (self._most / np.maximum(found, DARK)).min(axis=-1))


def _albedos(brdf: Brdf) -> Floats:
    """The albedo for viewers at ANGLES, (angles, 3), exact where it is more than NEAR."""
    found = albedo(brdf, ANGLES, COARSE)
    near = found.max(axis=-1) > NEAR
    found[near] = albedo(brdf, ANGLES[near], FINE)
    return found


def at_nodes(factors: Floats, lattice: NodeLattice) -> Floats:
    """The factors for a lattice's nodes, (nodes): that of the viewer's angle, and on a reciprocal lattice that of the
    light's if it is smaller. factors: as from `EnergyBound`.
    """
    wi, wo = directions(*angles_at(*node_places(lattice), **lattice.folds))
    seen = _at(factors, wo)
    return np.minimum(seen, _at(factors, wi)) if lattice.reciprocal else seen


def _at(factors: Floats, w: Triple) -> Floats:
    theta: Floats = np.arctan2(np.hypot(w[0], w[1]), w[2])
    found: Floats = np.interp(theta, ANGLES, factors)
    return found
