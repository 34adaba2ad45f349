"""A material as the fit of a lattice sees it: its values in the cube-root domain at places on the fine grid, the
weights of their errors, and the values at a lattice's nodes that fit it best.

The values of nodes are a weighted least-squares fit of the interpolation to random directions of the source, many for
each node. A small ridge holds them to the source's own values at the nodes, which decides where there are few
directions.

A lattice folds φ_d as the source allows: where both orders of the directions, or light from both sides of the viewer's
plane, give the same, half of the nodes are enough.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.arrays import Triple
from ...reflectance.brdf import Brdf
from ...reflectance.distance import sidedness
from ...reflectance.half_diff import directions
from ...reflectance.nodes import ABOVE, BELOW, FINE, KNEE, SMALLEST_COSINE, NodeLattice, angles_at, damped
from ...system.errors import MaterialError
from .quantise import Problem

Array = NDArray[np.float64]

# The measurements below are changes of the final error of nickel (SGD) and irid_flake_paint1 (RGL) in 2,700 bytes.

# At least. With 12, files of 32,000 bytes have 0.4 to 1.1 dB less (chm_orange, aurora_white), and take 6 % less time.
DIRECTIONS_A_NODE = 36
# Powers of the solid angle and of the cosines in the weights (docs/compact.md)
SOLID_POWER, COSINE_POWER = 0.75, 0.25
SYMMETRIC = 1e-3  # a source that differs by less (`distance.sidedness`) is mirrored; RGL's files differ by 10⁻⁵ at most
LOWEST_COSINE = 1e-4  # closer to the horizon, no directions are drawn: f_r may have no bound there
RIDGE = 0.05  # of the median of the matrix's diagonal; 0.5 costs 0.5 and 1.3 dB, 0.005 gains 0.5 and 0.7 dB
# Of the conjugate gradients. They converge in fewer than 50 iterations; a tolerance of 10⁻³ costs the fit 2.4 dB.
MOST_ITERATIONS, TOLERANCE = 200, 1e-5


class FittedSource:
    """A material, its `scale`, and the folds with which its places on the fine grid are read.

    scale: the usual size of f_r · `damped`, by which all is divided; 1 until `rescale` is called. random: what
    directions are drawn by.
    """

    def __init__(self, brdf: Brdf, folds: dict[str, bool], random: np.random.Generator) -> None:
        self.brdf, self.folds, self._random = brdf, folds, random
        self.scale = 1.0
        self._places = np.empty((0, 3))

    def rescale(self, values: Array) -> None:
        """Takes the scale from values of `values`, (…, 3), with a scale of 1. Raises MaterialError if all are 0."""
        values = np.abs(values) ** 3
        if not values.any():
            raise MaterialError(f"{self.brdf.name}: it cannot be compressed, since it is black")
        # The median, or that of the positive values where more than half are 0 (a mirror, a pure colour). In single
        # precision, as a file stores it.
        self.scale = float(np.float32(np.median(values) or np.median(values[values > 0])))

    def above(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array, Array, NDArray[np.bool_]]:
        """The places (h, d, p) of the grid with these axes, where those below the horizon are moved to the last one
        above it in θ_d; their weights, 0 below the horizon; and which are above."""
        axis = y
        x, y, z = np.meshgrid(x, y, z, indexing="ij")
        wi, wo = directions(*angles_at(x, y, z, **self.folds))
        seen = np.minimum(wi[2], wo[2]) > SMALLEST_COSINE
        weight = _weight(x, y, z, wi, wo) * seen
        count = seen.sum(axis=1, keepdims=True)  # along θ_d, what is above ends once
        last = np.where(count > 0, axis[np.maximum(count, 1) - 1], float(FINE))
        return x, np.minimum(y, last), z, weight, seen

    def values(self, x: Array, y: Array, z: Array) -> Array:
        """The material's values in the cube-root domain at places (…) on the fine grid, (…, 3); 0 below the horizon."""
        wi, wo = directions(*angles_at(x, y, z, **self.folds))
        f_r = self.brdf.eval(np.stack(wi, axis=-1), np.stack(wo, axis=-1))
        f_r[np.minimum(wi[2], wo[2]) <= LOWEST_COSINE] = 0.0  # on the horizon, rounding decides what is above it
        return np.cbrt(f_r * (damped(wi, wo, smooth=True) / self.scale)[..., None])

    def draw(self, count: int) -> None:
        """Draws random directions, uniform over the fine grid, and evaluates the source there."""
        x = (np.arange(count) + self._random.random(count)) * (FINE / count)
        y, z = self._random.random((2, count)) * FINE
        wi, wo = directions(*angles_at(x, y, z, **self.folds))
        above = np.minimum(wi[2], wo[2]) > LOWEST_COSINE
        x, y, z = x[above], y[above], z[above]
        self._places = np.stack([x, y, z], axis=-1)
        self._targets = self.values(x, y, z)
        weight = _weight(x, y, z, *((w[0][above], w[1][above], w[2][above]) for w in (wi, wo)))
        self._weights = weight / weight.mean()

    def prepare(self, count: int) -> None:
        """Draws directions, and takes the scale from what the source is there. Raises MaterialError if it is black."""
        self.draw(count)
        self.rescale(self._targets)
        self._targets = self._targets / np.cbrt(self.scale)

    def problem(self, lattice: NodeLattice) -> Problem:
        """The least-squares problem of a lattice at random directions, with its solution by conjugate gradients."""
        if len(self._places) < DIRECTIONS_A_NODE * lattice.size / 2:  # of the directions drawn, at least half are above
            self.draw(DIRECTIONS_A_NODE * lattice.size)
        equations = _core.NormalEquations.of(
            *lattice.axes(), self._places, self._weights, self._targets, **lattice.folds
        )
        sampled = self.values(*self._nodes(lattice))
        diagonal = equations.diagonal()
        held = equations.held(sampled, RIDGE * float(np.median(diagonal[diagonal > 0])))
        best = held.solved(sampled, TOLERANCE, MOST_ITERATIONS)
        error = float((best * (equations.product(best) - 2 * equations.right)).sum()) + equations.squares
        return Problem(lattice, held, best, error)

    def _nodes(self, lattice: NodeLattice) -> Triple:
        """The places of a lattice's nodes; of those below the horizon, that of the last node above it in θ_d."""
        parts: list[list[Array]] = []
        for row, b in zip(lattice.theta_h, lattice.band, strict=True):
            theta_d, phi_d = (np.array(axes[b], np.float64) for axes in (lattice.theta_d, lattice.phi_d))
            x, y, z, *_ = self.above(np.array([float(row)]), theta_d, phi_d)
            parts.append([part.reshape(-1) for part in (x, y, z)])
        x, y, z = (np.concatenate(part) for part in zip(*parts, strict=True))
        return x, y, z


def _weight(x: Array, y: Array, z: Array, wi: Triple, wo: Triple) -> Array:
    """What an error counts at a place on the fine grid: the solid angles dω_i dω_o of one step, up to a constant
    factor, and the cosines (`damped`), each to its power."""
    theta_h, theta_d, _ = angles_at(x, y, z)
    steps = np.where(x < KNEE, 1 / BELOW, 1 / ABOVE)
    solid = np.sqrt(theta_h) * np.sin(theta_h) * np.sin(theta_d) * np.cos(theta_d) * steps
    return solid**SOLID_POWER * damped(wi, wo, smooth=True) ** COSINE_POWER


def folds_of(brdf: Brdf) -> dict[str, bool]:
    """How a lattice may fold φ_d for a source, as `NodeLattice` takes it: whether both orders of the directions give
    the same; and whether light from both sides of the viewer's plane does, by construction or as far as can be seen."""
    buffers = brdf.buffers()
    mirrored = brdf.mirrored or sidedness(lambda wi, wo: brdf.f_r(wi, wo, buffers)) < SYMMETRIC
    return {"reciprocal": brdf.reciprocal, "mirrored": mirrored}
