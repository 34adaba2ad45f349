"""Fits a lattice of nodes to a material: chooses where the nodes go, and which values they hold.

Places are chosen for one axis at a time. For each number of nodes on an axis, dynamic programming finds the places for
which linear interpolation between the nodes has the least error. The total number of nodes is then divided among the
axes (θ_h, and θ_d and φ_d of each band of rows) with a Lagrange multiplier, the price of a node.

The values are a weighted least-squares fit of the interpolation to random directions of the source, many for each node.
A small ridge holds them to the source's own values at the nodes, which decides where there are few directions.

The lattice folds φ_d as the source allows: where both orders of the directions, or light from both sides of the
viewer's plane, give the same, half of the nodes are enough.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.arrays import Triple
from ...reflectance.brdf import Brdf
from ...reflectance.distance import sidedness
from ...reflectance.half_diff import directions
from ...reflectance.nodes import ABOVE, BELOW, FINE, KNEE, SMALLEST_COSINE, NodeLattice, angles_at, damped
from ...system.errors import MaterialError
from .effort import USUAL, Effort
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
ROWS_EVERY_D, ROWS_EVERY_P = 3.0, 4.0  # along θ_h, in θ_d and φ_d: at most 2,745 lines
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
DIRECTIONS_A_NODE = 12  # at least
# Powers of the solid angle and of the cosines in the weights (docs/method.md)
SOLID_POWER, COSINE_POWER = 0.75, 0.25
SYMMETRIC = 1e-3  # a source that differs by less (`distance.sidedness`) is mirrored; RGL's files differ by 10⁻⁵ at most
LOWEST_COSINE = 1e-4  # closer to the horizon, no directions are drawn: f_r may have no bound there
RIDGE = 0.05  # of the median of the matrix's diagonal; 0.5 costs 0.5 and 1.3 dB, 0.005 gains 0.5 and 0.7 dB
# Of the conjugate gradients. They converge in fewer than 50 iterations; a tolerance of 10⁻³ costs the fit 2.4 dB.
MOST_ITERATIONS, TOLERANCE = 200, 1e-5


@dataclass(frozen=True)
class _Lines:
    """A material on lines along an axis: y of shape (places, lines, 3), and weights (places, lines).

    thinned: how many lines each of them stands for.
    """

    y: Array
    weight: Array
    thinned: float

    def errors(self) -> Array:
        """The error of linear interpolation between each two places (`line_errors`), of all lines."""
        return self.thinned * line_errors(self.y, self.weight)

    def turned(self) -> _Lines:
        """The same with the first place once more at the end."""
        y, weight = (np.concatenate([part, part[:1]]) for part in (self.y, self.weight))
        return _Lines(y, weight, self.thinned)

    def variation(self) -> float:
        """The error of a constant along each line, summed over all lines."""
        weight = self.weight[..., None]
        mean = (weight * self.y).sum(axis=0) / np.maximum(weight.sum(axis=0), TINY)
        return self.thinned * float((weight * (self.y - mean) ** 2).sum())


class Fitter:
    """Prepares a material once, and then fits lattices of any size to it.

    seed: of the lines and directions that are drawn. effort: how many there are. Raises MaterialError for a black
    material.
    """

    def __init__(self, brdf: Brdf, *, seed: int = 0, effort: Effort = USUAL) -> None:
        self._brdf, self._effort = brdf, effort
        self.folds = folds_of(brdf)
        self._end = FINE + self.folds["mirrored"]  # of the steps in φ_d: the last place is one of its own, or the first
        self._random = np.random.Generator(np.random.PCG64(seed))
        self.scale = 1.0
        axes = np.arange(FINE + 1.0), np.arange(0.0, FINE + 1, ROWS_EVERY_D), np.arange(0.0, self._end, ROWS_EVERY_P)
        lines = self._lines(0, *axes)
        self.scale = self._usual(lines)
        self._rows = best_nodes(replace(lines, y=lines.y / np.cbrt(self.scale)).errors(), MOST_ROWS)
        some = self._rows[ROWS_FOR_BANDS][0]
        starts = sorted({0, *(int(some[len(some) * g // BANDS]) for g in range(1, BANDS))})
        self._edges = [*starts, FINE + 1]
        self._theta_d: list[Choices] = []
        self._phi_d: list[Choices] = []
        for low, high in zip(self._edges[:-1], self._edges[1:], strict=True):
            theta_d, phi_d = self._band(low, min(high, FINE))
            self._theta_d.append(theta_d)
            self._phi_d.append(phi_d)
        self._draw(effort.directions)

    def _usual(self, lines: _Lines) -> float:
        """The usual size of f_r · `damped`, by which all is divided. Raises MaterialError for a black material."""
        values = np.abs(lines.y[lines.weight > 0]) ** 3
        if not values.any():
            raise MaterialError(f"{self._brdf.name}: it cannot be compressed, since it is black")
        # The median, or that of the positive values where more than half are 0 (a mirror, a pure colour). In single
        # precision, as a file stores it.
        return float(np.float32(np.median(values) or np.median(values[values > 0])))

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
        if len(self._places) < DIRECTIONS_A_NODE * nodes / 2:  # of the directions drawn, at least half are above
            self._draw(DIRECTIONS_A_NODE * nodes)
        return self._solved(self._lattice(nodes))

    def _band(self, low: int, high: int) -> tuple[Choices, Choices]:
        """The best nodes in θ_d and in φ_d for a band: the rows of the fine grid from `low` to `high`.

        Errors are measured on fewer lines than those of θ_h, and are scaled up to be comparable with them.
        """
        rows = np.unique(np.linspace(low, high, BAND_ROWS).astype(int)).astype(np.float64)
        thinned, a_line = (high - low + 1) / len(rows), ROWS_EVERY_D * ROWS_EVERY_P
        lines = self._lines(1, rows, np.arange(FINE + 1.0), np.arange(0.0, self._end, THETA_D_EVERY_P))
        theta_d = best_nodes(thinned * THETA_D_EVERY_P / a_line * lines.errors(), MOST_NODES)
        scale = thinned * PHI_D_EVERY_D / a_line
        lines = self._lines(2, rows, np.arange(0.0, FINE + 1, PHI_D_EVERY_D), np.arange(float(self._end)))
        if self.folds["mirrored"]:
            found = best_nodes(scale * lines.errors(), MOST_NODES)
            return theta_d, {1: ([0], scale * lines.variation())} | found
        found = best_nodes(scale * lines.turned().errors(), MOST_NODES + 1)
        return theta_d, {count - 1: (nodes[:-1], error) for count, (nodes, error) in found.items()}

    def _lines(self, axis: int, x: Array, y: Array, z: Array) -> _Lines:
        """The material on lines along an axis of the grid with these axes, drawn at random from those above the
        horizon somewhere."""
        x, y, z, weight, seen = self._above(x, y, z)
        x, y, z, weight = (np.moveaxis(part, axis, 0).reshape(seen.shape[axis], -1) for part in (x, y, z, weight))
        lines = np.flatnonzero(weight.sum(axis=0) > 0)
        chosen = self._random.permutation(lines)[: self._effort.lines]
        x, y, z, weight = (part[:, chosen] for part in (x, y, z, weight))
        return _Lines(self._values(x, y, z), weight, len(lines) / max(1, len(chosen)))

    def _above(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array, Array, NDArray[np.bool_]]:
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

    def _values(self, x: Array, y: Array, z: Array) -> Array:
        """The material's values in the cube-root domain at places (…) on the fine grid, (…, 3); 0 below the horizon."""
        wi, wo = directions(*angles_at(x, y, z, **self.folds))
        f_r = self._brdf.eval(np.stack(wi, axis=-1), np.stack(wo, axis=-1))
        f_r[np.minimum(wi[2], wo[2]) <= LOWEST_COSINE] = 0.0  # on the horizon, rounding decides what is above it
        return np.cbrt(f_r * (damped(wi, wo, smooth=True) / self.scale)[..., None])

    def _draw(self, count: int) -> None:
        """Draws random directions, uniform over the fine grid, and evaluates the source there."""
        x = (np.arange(count) + self._random.random(count)) * (FINE / count)
        y, z = self._random.random((2, count)) * FINE
        wi, wo = directions(*angles_at(x, y, z, **self.folds))
        above = np.minimum(wi[2], wo[2]) > LOWEST_COSINE
        x, y, z = x[above], y[above], z[above]
        self._places = np.stack([x, y, z], axis=-1)
        self._targets = self._values(x, y, z)
        weight = _weight(x, y, z, *((w[0][above], w[1][above], w[2][above]) for w in (wi, wo)))
        self._weights = weight / weight.mean()

    def _lattice(self, nodes: int) -> NodeLattice:
        """The lattice of the least error among those with LEAST_SHARE · nodes to `nodes` nodes.

        For each number of rows, the price of a node is found by bisection: at each price, every band takes the numbers
        of nodes in θ_d and φ_d that minimise its error plus the price of its nodes.
        """
        costs = np.stack(
            [
                (_costs(theta_d)[:, None] + _costs(phi_d)).reshape(-1)
                for theta_d, phi_d in zip(self._theta_d, self._phi_d, strict=True)
            ]
        )
        counts = np.arange(1.0, MOST_NODES + 1)
        product: Array = (counts[:, None] * counts).reshape(-1)
        some = {rows: found for rows, found in self._rows.items() if rows >= FEWEST_ROWS}
        errors = np.array([error for _, error in some.values()])
        bins = np.array(self._edges) - 0.5
        share = np.stack([np.histogram(places, bins=bins)[0] for places, _ in some.values()])  # (rows, bands)
        low, high = (np.full(len(some), end) for end in PRICES)
        best: tuple[float, int, NDArray[np.intp]] | None = None
        bands = np.arange(len(costs))
        for _ in range(BISECTIONS):
            price = self._rows[FEWEST_ROWS][1] * 10 ** ((low + high) / 2)
            picked = (costs + (price[:, None] * share)[..., None] * product).argmin(axis=-1)
            total = (share * product[picked]).sum(axis=1)
            left = errors + np.where(share > 0, costs[bands, picked], 0.0).sum(axis=1)
            left[(total < LEAST_SHARE * nodes) | (total > nodes)] = np.inf
            least = int(left.argmin())
            if np.isfinite(left[least]) and (best is None or left[least] < best[0]):
                best = float(left[least]), list(some)[least], picked[least]
            dear = total > nodes
            low, high = np.where(dear, (low + high) / 2, low), np.where(dear, high, (low + high) / 2)
        if best is None:
            raise MaterialError(f"{self._brdf.name}: no lattice of about {nodes} nodes was found for it")
        _, rows, picked = best
        places = self._rows[rows][0]
        band = [bisect_right(self._edges, place) - 1 for place in places]
        used = sorted(set(band))
        many = {b: divmod(int(picked[b]), MOST_NODES) for b in used}
        return NodeLattice(
            tuple(places),
            tuple(used.index(b) for b in band),
            tuple(tuple(self._theta_d[b][many[b][0] + 1][0]) for b in used),
            tuple(tuple(self._phi_d[b][many[b][1] + 1][0]) for b in used),
            **self.folds,
        )

    def _solved(self, lattice: NodeLattice) -> Problem:
        """Solves the least-squares problem of a lattice at the random directions, by conjugate gradients."""
        equations = _core.NormalEquations.of(
            *lattice.axes(), self._places, self._weights, self._targets, **lattice.folds
        )
        sampled = self._values(*self._nodes(lattice))
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
            x, y, z, *_ = self._above(np.array([float(row)]), theta_d, phi_d)
            parts.append([part.reshape(-1) for part in (x, y, z)])
        x, y, z = (np.concatenate(part) for part in zip(*parts, strict=True))
        return x, y, z


def line_errors(y: Array, weight: Array) -> Array:
    """The error of linear interpolation between each two places on an axis.

    y: (n, lines, 3) and weight: (n, lines), for lines of n places. Returns (n, n): at [i, j], the weighted squared
    error at all places between i and j, summed over the lines; infinite unless i < j.
    """
    return _core.line_errors(len(y), np.ascontiguousarray(y).reshape(-1, 3), np.ascontiguousarray(weight).reshape(-1))


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
