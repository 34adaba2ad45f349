"""Keeps a compact material from reflecting more than it receives, or than its source does.

A lattice is fitted to reflectances and not to their integrals, so that a source with an albedo near 1 may come out
brighter than that, mostly for viewers near grazing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...reflectance.arrays import Triple
from ...reflectance.brdf import Brdf
from ...reflectance.half_diff import directions
from ...reflectance.nodes import NodeLattice, angles_at

ANGLES = np.radians((0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 77.0, 82.0, 85.0, 87.0, 88.0, 88.8, 89.2, 89.5))  # of viewers
POINTS = 6  # along each side of a sampler's cell, of the albedos' quadrature
ALLOWED = 1.02  # times the source's albedo, or 1 if that is more
AIM = 0.997  # of what is allowed, since quadrature and interpolation between ANGLES are not exact

Floats = NDArray[np.float64]


class EnergyBound:
    """What a material made from a source may reflect to viewers at ANGLES."""

    def __init__(self, source: Brdf) -> None:
        self._most = np.maximum(1.0, ALLOWED * source.sampler.albedo(ANGLES, points=POINTS))

    def factors(self, brdf: Brdf) -> Floats:
        """By what f_r would have to be multiplied at each of ANGLES, at most 1."""
        found = brdf.sampler.albedo(ANGLES, points=POINTS)
        within = (found <= self._most).all()
        return np.ones(len(ANGLES)) if within else np.minimum(1.0, AIM * (self._most / found).min(axis=-1))


def darkened(gains: Floats, gain_index: NDArray[np.uint16], lattice: NodeLattice, factors: Floats) -> NDArray[np.uint16]:
    """Other gains for the nodes that are seen from where `factors` are below 1: of each, the largest entry that is as
    much darker, or the next smaller one at least.

    gains: increasing; gain_index: of the nodes; factors: as from `EnergyBound`, to be reached by f_r.
    """
    wi, wo = _node_directions(lattice)
    by_node = _at(factors, wo)
    if lattice.reciprocal:
        by_node = np.minimum(by_node, _at(factors, wi))
    now = gains[gain_index]
    wanted = np.searchsorted(gains, now * np.cbrt(by_node), side="right") - 1
    least = int(np.searchsorted(gains, 0.0))  # a gain below 0 is no darker
    lower = np.clip(np.minimum(wanted, gain_index.astype(np.int64) - 1), min(least, len(gains) - 1), None)
    return np.where((by_node < 1.0) & (now > 0), lower, gain_index).astype(np.uint16)


def _at(factors: Floats, w: Triple) -> Floats:
    """The factors for directions to a viewer: of the two angles beside it, the smaller one."""
    theta = np.arctan2(np.hypot(w[0], w[1]), w[2])
    upper = np.clip(np.searchsorted(ANGLES, theta), 1, len(ANGLES) - 1)
    return np.minimum(factors[upper - 1], factors[upper])


def _node_directions(lattice: NodeLattice) -> tuple[Triple, Triple]:
    """The pair of directions of each node."""
    places = [
        np.stack(np.meshgrid([float(x)], lattice.theta_d[b], lattice.phi_d[b], indexing="ij")).reshape(3, -1)
        for x, b in zip(lattice.theta_h, lattice.band, strict=True)
    ]
    return directions(*angles_at(*np.concatenate(places, axis=1), **lattice.folds))
