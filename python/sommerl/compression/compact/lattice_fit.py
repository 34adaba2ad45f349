"""Fits a lattice of nodes to a material: chooses where the nodes go, and which values they hold.

Places are chosen for one axis at a time. For each number of nodes on an axis, dynamic programming finds the places for
which linear interpolation between the nodes has the least error. The total number of nodes is then divided among the
axes (θ_h, and θ_d and φ_d of each band of rows) with a Lagrange multiplier, the price of a node.

The values are a weighted least-squares fit of the interpolation to a million random directions of the source. A small
ridge holds them to the source's own values at the nodes, which decides where there are few directions.

The lattice folds φ_d as the source allows: where both orders of the directions, or light from both sides of the
viewer's plane, give the same, half of the nodes are enough.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.arrays import Triple
from ...reflectance.brdf import Brdf
from ...reflectance.distance import sidedness
from ...reflectance.half_diff import directions
from ...reflectance.nodes import ABOVE, BELOW, FINE, KNEE, SMALLEST_COSINE, NodeLattice, angles_at, damped
from ...system.errors import MaterialError
from .fitted_table import FittedTable
from .quantise import Problem

Array = NDArray[np.float64]
Choices = dict[int, tuple[list[int], float]]  #: for each number of nodes: their places, and the error left

# The measurements below are changes of the final error of nickel (SGD) and irid_flake_paint1 (RGL) in 2,700 bytes.

# Numbers of nodes
SMALLEST, LARGEST = 100, 100_000  # a file holds 131,072 at most (docs/format.md)
BANDS = 6  # 3, 4 and 9 are within 0.5 dB (docs/method.md)
# Of rows, and of nodes on an axis of a band. They bound the work; chrome comes to them from 42,000 nodes on.
MOST_ROWS, MOST_NODES = 90, 44
FEWEST_ROWS = 5  # fewer than are ever chosen: the smallest lattices have 8 (beige-fabric) to 19 rows (chrome)
LEAST_SHARE = 0.8  # of the nodes asked for; 0.5 and 0.95 give the same lattices

# The lines along an axis on which its errors are measured, in steps of the fine grid from one to the next
ROWS_EVERY_D, ROWS_EVERY_P = 3.0, 4.0  # along θ_h, in θ_d and φ_d: at most 2,745 lines,
LINES = 500  # of which this many are drawn at random; 100 cost 0.2 and 0.8 dB
BAND_ROWS = 10  # along θ_d and φ_d: in this many rows of a band,
THETA_D_EVERY_P = 9.0  # along θ_d, in φ_d: 200 lines
PHI_D_EVERY_D = 6.0  # along φ_d, in θ_d: 310 lines
ROWS_FOR_BANDS = 20  # in the best lattice of this many rows, all bands have about equally many

# The price of a node, by bisection
PRICES = -13.0, 3.0  # decades, in units of the error left with FEWEST_ROWS rows: from almost free to far too dear
BISECTIONS = 20  # 12 give the same lattices
TINY = 1e-30  # added to sums of weights that may be 0
UNKNOWN = 1e30  # stands for the error of numbers of nodes that were not examined: more than any error

# The least squares
DIRECTIONS = 1_000_000  # ten for each node of the largest lattice
# Powers of the solid angle and of the cosines in the weights (docs/method.md)
SOLID_POWER, COSINE_POWER = 0.75, 0.25
SYMMETRIC = 1e-3  # a source that differs by less (`distance.sidedness`) is mirrored; RGL's files differ by 10⁻⁵ at most
LOWEST_COSINE = 1e-4  # closer to the horizon, no directions are drawn: f_r may have no bound there
RIDGE = 0.05  # of the median of the matrix's diagonal; 0.5 costs 0.5 and 1.3 dB, 0.005 gains 0.5 and 0.7 dB
# Of the conjugate gradients. They converge in fewer than 50 iterations; a tolerance of 10⁻³ costs the fit 2.4 dB.
MOST_ITERATIONS, TOLERANCE = 200, 1e-5


@dataclass(frozen=True)
class _Grid:
    """A material on a part of the fine grid, given by three axes: y of shape (h, d, p, 3), and weights (h, d, p)."""

    y: Array
    weight: Array


class Fitter:
    """Prepares a material once, and then fits lattices of any size to it.

    seed: of the lines and directions that are drawn. Raises MaterialError for a black material.
    """

    def __init__(self, brdf: Brdf, *, seed: int = 0) -> None:
        self._brdf = brdf
        self.folds = folds_of(brdf)
        self._end = FINE + self.folds["mirrored"]  # of the steps in φ_d: the last place is one of its own, or the first
        self._random = np.random.Generator(np.random.PCG64(seed))
        axes = np.arange(FINE + 1.0), np.arange(0.0, FINE + 1, ROWS_EVERY_D), np.arange(0.0, self._end, ROWS_EVERY_P)
        wi, wo, f_damped = self._source(*axes)
        seen = np.minimum(wi[2], wo[2]) > SMALLEST_COSINE
        values = np.abs(f_damped[seen])
        if not values.any():
            raise MaterialError(f"{brdf.name}: it cannot be compressed, since it is black")
        # The median, or that of the positive values where more than half are 0 (a mirror, a pure colour). In single
        # precision, as a file stores it.
        median = np.median(values) or np.median(values[values > 0])
        self.scale = float(np.float32(median))
        grid = self._scaled(*axes, wi, wo, f_damped)
        self._rows = best_nodes(line_errors(grid.y, grid.weight, 0, self._random), MOST_ROWS)
        some = self._rows[ROWS_FOR_BANDS][0]
        starts = sorted({0, *(int(some[len(some) * g // BANDS]) for g in range(1, BANDS))})
        self._edges = [*starts, FINE + 1]
        self._theta_d: list[Choices] = []
        self._phi_d: list[Choices] = []
        for low, high in zip(self._edges[:-1], self._edges[1:], strict=True):
            theta_d, phi_d = self._band(low, min(high, FINE))
            self._theta_d.append(theta_d)
            self._phi_d.append(phi_d)
        self._samples()

    def fit(self, nodes: int) -> FittedTable:
        """The material, not quantised, on a lattice of at most `nodes` nodes (and at least LEAST_SHARE of them).

        Raises MaterialError if `nodes` is not from SMALLEST to LARGEST.
        """
        problem = self.problem(nodes)
        return FittedTable(problem.lattice, problem.best, self.scale, signed=self._brdf.signed, name=self._brdf.name)

    def problem(self, nodes: int) -> Problem:
        """The least-squares problem on such a lattice, with its solution. Raises MaterialError as `fit` does."""
        if not SMALLEST <= nodes <= LARGEST:
            raise MaterialError(f"nodes: expected {SMALLEST} to {LARGEST}, found {nodes}")
        return self._solved(self._lattice(nodes))

    def _band(self, low: int, high: int) -> tuple[Choices, Choices]:
        """The best nodes in θ_d and in φ_d for a band: the rows of the fine grid from `low` to `high`.

        Errors are measured on fewer lines than those of θ_h, and are scaled up to be comparable with them.
        """
        rows = np.unique(np.linspace(low, high, BAND_ROWS).astype(int)).astype(np.float64)
        thinned, a_line = (high - low + 1) / len(rows), ROWS_EVERY_D * ROWS_EVERY_P
        grid = self._grid(rows, np.arange(FINE + 1.0), np.arange(0.0, self._end, THETA_D_EVERY_P))
        errors = line_errors(grid.y, grid.weight, 1, self._random)
        theta_d = best_nodes(thinned * THETA_D_EVERY_P / a_line * errors, MOST_NODES)
        scale = thinned * PHI_D_EVERY_D / a_line
        grid = self._grid(rows, np.arange(0.0, FINE + 1, PHI_D_EVERY_D), np.arange(float(self._end)))
        if self.folds["mirrored"]:
            found = best_nodes(scale * line_errors(grid.y, grid.weight, 2, self._random), MOST_NODES)
            return theta_d, {1: ([0], scale * _variation(grid))} | found
        y, weight = (np.concatenate([part, part[:, :, :1]], axis=2) for part in (grid.y, grid.weight))
        found = best_nodes(scale * line_errors(y, weight, 2, self._random), MOST_NODES + 1)
        return theta_d, {count - 1: (nodes[:-1], error) for count, (nodes, error) in found.items()}

    def _source(self, x: Array, y: Array, z: Array) -> tuple[Triple, Triple, Array]:
        """The directions at all points of three axes, and f_r times `damped` there; 0 near and below the horizon."""
        wi, wo = directions(*angles_at(*np.meshgrid(x, y, z, indexing="ij"), **self.folds))
        f_r = np.zeros((*wi[0].shape, 3))
        seen = np.minimum(wi[2], wo[2]) > SMALLEST_COSINE
        f_r[seen] = self._brdf.eval(*(np.stack([c[seen] for c in w], axis=-1) for w in (wi, wo)))
        return wi, wo, f_r * damped(wi, wo, smooth=True)[..., None]

    def _grid(self, x: Array, y: Array, z: Array) -> _Grid:
        return self._scaled(x, y, z, *self._source(x, y, z))

    def _scaled(self, x: Array, y: Array, z: Array, wi: Triple, wo: Triple, f_damped: Array) -> _Grid:
        values = np.cbrt(f_damped / self.scale)
        seen = np.minimum(wi[2], wo[2]) > SMALLEST_COSINE
        for j in range(1, len(y)):  # below the horizon, the value of the last point above it in θ_d
            values[:, j] = np.where(seen[:, j, :, None], values[:, j], values[:, j - 1])
        return _Grid(values, _weight(*np.meshgrid(x, y, z, indexing="ij"), wi, wo) * seen)

    def _samples(self) -> None:
        """Draws random directions, uniform over the fine grid, and evaluates the source there."""
        x = (np.arange(DIRECTIONS) + self._random.random(DIRECTIONS)) * (FINE / DIRECTIONS)
        y, z = self._random.random((2, DIRECTIONS)) * FINE
        wi, wo = directions(*angles_at(x, y, z, **self.folds))
        above = np.minimum(wi[2], wo[2]) > LOWEST_COSINE
        x, y, z = x[above], y[above], z[above]
        self._places = np.stack([x, y, z], axis=-1)
        wi, wo = ((w[0][above], w[1][above], w[2][above]) for w in (wi, wo))
        f_r = self._brdf.eval(np.stack(wi, axis=-1), np.stack(wo, axis=-1))
        self._targets = np.cbrt(f_r * (damped(wi, wo, smooth=True) / self.scale)[:, None])
        weight = _weight(x, y, z, wi, wo)
        self._weights = weight / weight.mean()

    def _lattice(self, nodes: int) -> NodeLattice:
        """The lattice of the least error among those with LEAST_SHARE · nodes to `nodes` nodes.

        For each number of rows, the price of a node is found by bisection: at each price, every band takes the numbers
        of nodes in θ_d and φ_d that minimise its error plus the price of its nodes.
        """
        costs = [
            _costs(theta_d)[:, None] + _costs(phi_d) for theta_d, phi_d in zip(self._theta_d, self._phi_d, strict=True)
        ]
        counts_d, counts_p = (np.arange(1.0, size + 1) for size in costs[0].shape)
        product: Array = counts_d[:, None] * counts_p
        best: tuple[float, int, list[tuple[int, int]]] | None = None
        for rows, (places, error) in self._rows.items():
            share = np.histogram(places, bins=np.array(self._edges) - 0.5)[0]
            low, high = PRICES
            for _ in range(BISECTIONS if rows >= FEWEST_ROWS else 0):
                price = self._rows[FEWEST_ROWS][1] * 10 ** ((low + high) / 2)
                picked = [
                    np.unravel_index(int((c + price * n * product).argmin()), c.shape)
                    for c, n in zip(costs, share, strict=True)
                ]
                total = sum(int(n * product[at]) for n, at in zip(share, picked, strict=True))
                left = error + sum(float(c[at]) for c, n, at in zip(costs, share, picked, strict=True) if n)
                if LEAST_SHARE * nodes <= total <= nodes and (best is None or left < best[0]):
                    best = left, rows, [(int(i) + 1, int(j) + 1) for i, j in picked]
                low, high = ((low + high) / 2, high) if total > nodes else (low, (low + high) / 2)
        if best is None:
            raise MaterialError(f"{self._brdf.name}: no lattice of about {nodes} nodes was found for it")
        _, rows, counts = best
        places = self._rows[rows][0]
        bands = [bisect_right(self._edges, place) - 1 for place in places]
        used = sorted(set(bands))
        return NodeLattice(
            tuple(places),
            tuple(used.index(b) for b in bands),
            tuple(tuple(self._theta_d[b][counts[b][0]][0]) for b in used),
            tuple(tuple(self._phi_d[b][counts[b][1]][0]) for b in used),
            **self.folds,
        )

    def _solved(self, lattice: NodeLattice) -> Problem:
        """Solves the least-squares problem of a lattice at the random directions, by conjugate gradients."""
        equations = _core.NormalEquations.of(
            *lattice.axes(), self._places, self._weights, self._targets, **lattice.folds
        )
        sampled = np.concatenate(
            [
                self._grid(
                    np.array([float(x)]), np.array(lattice.theta_d[b], float), np.array(lattice.phi_d[b], float)
                ).y.reshape(-1, 3)
                for x, b in zip(lattice.theta_h, lattice.band, strict=True)
            ]
        )
        diagonal = equations.diagonal()
        held = equations.held(sampled, RIDGE * float(np.median(diagonal[diagonal > 0])))
        best = held.solved(sampled, TOLERANCE, MOST_ITERATIONS)
        error = float((best * (equations.product(best) - 2 * equations.right)).sum()) + equations.squares
        return Problem(lattice, held, best, error)


def line_errors(y: Array, weight: Array, axis: int, random: np.random.Generator) -> Array:
    """The error of linear interpolation between each two places on an axis.

    y: (…, 3) and weight: (…), values and weights on a grid. Returns (n, n) for the n places on the axis: at [i, j], the
    weighted squared error at all places between i and j, summed over the grid's lines along the axis (estimated from
    LINES of them); infinite unless i < j.
    """
    n = int(y.shape[axis])
    y, weight = np.moveaxis(y, axis, 0).reshape(n, -1, 3), np.moveaxis(weight, axis, 0).reshape(n, -1)
    lines = np.flatnonzero(weight.sum(axis=0) > 0)
    chosen = random.permutation(lines)[:LINES]
    y, weight = y[:, chosen], weight[:, chosen]
    errors = _core.line_errors(n, np.ascontiguousarray(y).reshape(-1, 3), np.ascontiguousarray(weight).reshape(-1))
    return errors * (len(lines) / max(1, len(chosen)))


def best_nodes(errors: Array, most: int) -> Choices:
    """For each number of nodes from 2 to `most`, the places with the least sum of errors, by dynamic programming.

    errors: (n, n), as from `line_errors`. The first and the last place are always among the nodes.
    """
    best = np.full(len(errors), np.inf)
    best[0] = 0.0
    before: list[NDArray[np.intp]] = []
    found: Choices = {}
    for count in range(2, most + 1):
        sums = best[:, None] + errors
        before.append(sums.argmin(axis=0))
        best = sums.min(axis=0)
        if np.isfinite(best[-1]):
            path = [len(errors) - 1]
            for step in reversed(before):
                path.append(int(step[path[-1]]))
            found[count] = path[::-1], float(best[-1])
    return found


def _costs(choices: Choices) -> Array:
    """The error left with 1, 2, … MOST_NODES nodes; UNKNOWN for numbers without a choice."""
    return np.array([choices[count][1] if count in choices else UNKNOWN for count in range(1, MOST_NODES + 1)])


def _variation(grid: _Grid) -> float:
    """The error of a constant along φ_d, summed over the grid."""
    weight = grid.weight[..., None]
    mean = (weight * grid.y).sum(axis=2, keepdims=True) / np.maximum(weight.sum(axis=2, keepdims=True), TINY)
    return float((weight * (grid.y - mean) ** 2).sum())


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
