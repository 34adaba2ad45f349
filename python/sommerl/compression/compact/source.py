"""A material as the fit of a lattice sees it: its values in the cube-root domain at places on the fine grid, the
weights of their errors, and the values at a lattice's nodes that fit it best.

The values of nodes are a weighted least-squares fit of the interpolation to random directions of the source, many for
each node. A small ridge holds them to the source's own values at the nodes, which decides where there are few
directions.

A source that was fitted to samples (`Brdf.samples`) is fitted at these, too, as they were measured, and not only at
what the source makes of them; errors count where samples are dense, since that is where somebody looked closely.

A lattice folds φ_d as the source allows: where both orders of the directions, or light from both sides of the viewer's
plane, give the same, half of the nodes are enough.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.arrays import Triple, split
from ...reflectance.brdf import Brdf
from ...reflectance.distance import SYMMETRIC, asymmetry, sidedness
from ...reflectance.half_diff import directions
from ...reflectance.nodes import ABOVE, BELOW, FINE, KNEE, SMALLEST_COSINE, NodeLattice, angles_at, damped, place
from ...reflectance.samples import Samples
from ...system.errors import MaterialError
from .quantise import Problem

Array = NDArray[np.float64]

# The measurements below are changes of the final error of nickel (SGD) and irid_flake_paint1 (RGL) in 2,700 bytes.

# At least. With 12, files of 32,000 bytes have 0.4 to 1.1 dB less (chm_orange, aurora_white), and take 6 % less time.
DIRECTIONS_A_NODE = 36
# Powers of the solid angle and of the cosines in the weights (docs/compact.md)
SOLID_POWER, COSINE_POWER = 0.75, 0.25
LOWEST_COSINE = 1e-4  # closer to the horizon, no directions are drawn: f_r may have no bound there
RIDGE = 0.05  # of the median of the matrix's diagonal; 0.5 costs 0.5 and 1.3 dB, 0.005 gains 0.5 and 0.7 dB
# Of all samples together, in units of all random directions together
SAMPLES_COUNT = 2.0
BINS = 45, 90, 6  # of the density of samples, along the axes of the fine grid
# What holds a node to the source, where it is fitted to samples alone: in units of what samples say of it, and of the
# median of that
HOLD, LEAST_HOLD = 0.05, 0.05
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
        self._measured = None if brdf.samples is None else _Measured(brdf.samples, folds)

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
        weight = self._weight(x, y, z, wi, wo) * seen
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
        if self._measured:
            self._add_samples(self._measured)

    def _add_samples(self, measured: _Measured) -> None:
        """Puts the samples between the directions that were drawn, in the order of θ_h."""
        count = len(measured.places)
        share = SAMPLES_COUNT * max(len(self._places), 1) / count
        self._places = np.concatenate([self._places, measured.places])
        self._targets = np.concatenate([self._targets, np.cbrt(measured.values / self.scale)])
        self._weights = np.concatenate([self._weights, np.full(count, share)])
        self._sort()

    def _weight(self, x: Array, y: Array, z: Array, wi: Triple, wo: Triple) -> Array:
        """`_weight`, and for a source that was fitted to samples their density there."""
        weight = _weight(x, y, z, wi, wo)
        return weight if self._measured is None else weight + SAMPLES_COUNT * self._measured.weight(x, y, z)

    def prepare(self, count: int) -> None:
        """Draws directions, and takes the scale from what the source is there. Raises MaterialError if it is black."""
        self.draw(count)
        self.rescale(self._targets)
        self._targets = self._targets / np.cbrt(self.scale)

    def problem(self, lattice: NodeLattice) -> Problem:
        """The least-squares problem of a lattice at random directions, with its solution by conjugate gradients."""
        if len(self._places) < DIRECTIONS_A_NODE * lattice.size / 2:  # of the directions drawn, at least half are above
            self.draw(DIRECTIONS_A_NODE * lattice.size)
        equations = self._equations(lattice)
        sampled = self.values(*self._nodes(lattice))
        diagonal = equations.diagonal()
        held = equations.held(sampled, RIDGE * float(np.median(diagonal[diagonal > 0])))
        best = held.solved(sampled, TOLERANCE, MOST_ITERATIONS)
        error = float((best * (equations.product(best) - 2 * equations.right)).sum()) + equations.squares
        return Problem(lattice, held, best, error)

    def at_samples(self, lattice: NodeLattice) -> Array:
        """The values of a lattice's nodes, (nodes, 3), that fit the samples best, and are the source's own where there
        are none. Raises MaterialError if the source has no samples."""
        if self._measured is None:
            raise MaterialError(f"{self.brdf.name}: expected a material that was fitted to samples, found another")
        sampled = self.values(*self._nodes(lattice))
        at_nodes = np.stack(node_places(lattice), axis=-1)
        self._places, self._targets, self._weights = np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
        self._add_samples(self._measured)
        own = self._equations(lattice).diagonal()
        self._places = np.concatenate([self._places, at_nodes])
        self._targets = np.concatenate([self._targets, sampled])
        # In proportion to what samples say of each node: nodes that are near each other would swing apart else.
        self._weights = np.concatenate([self._weights, HOLD * own + LEAST_HOLD * float(np.median(own[own > 0]))])
        self._sort()
        found = self._equations(lattice).solved(sampled, TOLERANCE, MOST_ITERATIONS)
        return np.clip(found, self._targets.min(axis=0), self._targets.max(axis=0))

    def _equations(self, lattice: NodeLattice) -> _core.NormalEquations:
        return _core.NormalEquations.of(*lattice.axes(), self._places, self._weights, self._targets, **lattice.folds)

    def _sort(self) -> None:
        """Puts places in the order of θ_h."""
        order = np.argsort(self._places[:, 0], kind="stable")
        self._places, self._targets, self._weights = (
            part[order] for part in (self._places, self._targets, self._weights)
        )

    def _nodes(self, lattice: NodeLattice) -> Triple:
        """The places of a lattice's nodes; of those below the horizon, that of the last node above it in θ_d."""
        parts: list[list[Array]] = []
        for row, b in zip(lattice.theta_h, lattice.band, strict=True):
            theta_d, phi_d = (np.array(axes[b], np.float64) for axes in (lattice.theta_d, lattice.phi_d))
            x, y, z, *_ = self.above(np.array([float(row)]), theta_d, phi_d)
            parts.append([part.reshape(-1) for part in (x, y, z)])
        x, y, z = (np.concatenate(part) for part in zip(*parts, strict=True))
        return x, y, z


def node_places(lattice: NodeLattice) -> Triple:
    """The places of a lattice's nodes on the fine grid, below the horizon or not."""
    parts = [
        np.stack(np.meshgrid([float(x)], lattice.theta_d[b], lattice.phi_d[b], indexing="ij")).reshape(3, -1)
        for x, b in zip(lattice.theta_h, lattice.band, strict=True)
    ]
    x, y, z = np.concatenate(parts, axis=1)
    return x, y, z


class _Measured:
    """Samples as a fit takes them. places: on the fine grid (n, 3). values: f_r · `damped`, (n, 3)."""

    def __init__(self, samples: Samples, folds: dict[str, bool]) -> None:
        wi, wo = split(samples.wi), split(samples.wo)
        self.places = np.stack(place(wi, wo, **folds), axis=-1)
        self.values: Array = samples.f_r * damped(wi, wo, smooth=True)[:, None]
        counts = np.histogramdd(self.places, BINS, [(0, FINE)] * 3)[0]
        axes = [np.asarray((np.arange(count) + 0.5) * (FINE / count), np.float64) for count in BINS]
        x, y, z = np.meshgrid(*axes, indexing="ij")
        wi, wo = directions(*angles_at(x, y, z, **folds))
        above = np.minimum(wi[2], wo[2]) > SMALLEST_COSINE
        mean = float(np.mean(_weight(x, y, z, wi, wo)[above]))
        self._density: Array = counts * (mean * above.sum() / counts.sum())

    def weight(self, x: Array, y: Array, z: Array) -> Array:
        """The density of samples at places on the fine grid; its mean is that of `_weight`."""
        return self._density[
            tuple(
                np.minimum((c * (count / FINE)).astype(np.intp), count - 1)
                for c, count in zip((x, y, z), BINS, strict=True)
            )
        ]


def _weight(x: Array, y: Array, z: Array, wi: Triple, wo: Triple) -> Array:
    """What an error counts at a place on the fine grid: the solid angles dω_i dω_o of one step, up to a constant
    factor, and the cosines (`damped`), each to its power."""
    theta_h, theta_d, _ = angles_at(x, y, z)
    steps = np.where(x < KNEE, 1 / BELOW, 1 / ABOVE)
    solid = np.sqrt(theta_h) * np.sin(theta_h) * np.sin(theta_d) * np.cos(theta_d) * steps
    return solid**SOLID_POWER * damped(wi, wo, smooth=True) ** COSINE_POWER


def folds_of(brdf: Brdf) -> dict[str, bool]:
    """How a lattice may fold φ_d for a source, as `NodeLattice` takes it: whether both orders of the directions give
    the same, and whether light from both sides of the viewer's plane does, by construction or as far as can be seen."""
    buffers = brdf.buffers()

    def f_r(wi: Triple, wo: Triple) -> Triple:
        return brdf.f_r(wi, wo, buffers)

    reciprocal = brdf.reciprocal or asymmetry(f_r) < SYMMETRIC
    return {"reciprocal": reciprocal, "mirrored": brdf.mirrored or sidedness(f_r) < SYMMETRIC}
