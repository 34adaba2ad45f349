"""Chooses where the nodes of a lattice go, for one material or for several that share it.

Places are chosen for one axis at a time. For each number of nodes on an axis, dynamic programming finds the places for
which linear interpolation between the nodes has the least error. The total number of nodes is then divided among the
axes (θ_h, and θ_d and φ_d of each band of rows) with a Lagrange multiplier, the price of a node.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.nodes import FINE, NodeLattice
from ...system.errors import MaterialError
from .source import FittedSource

Array = NDArray[np.float64]
Choices = dict[int, tuple[list[int], float]]  #: for each number of nodes: their places, and the error left

# The measurements below are changes of the final error of nickel (SGD) and irid_flake_paint1 (RGL) in 2,700 bytes.

# Numbers of nodes
SMALLEST, LARGEST = 100, 100_000  # a file holds 131,072 at most (docs/format.md)
BANDS = 6  # 3, 4 and 9 are within 0.5 dB (docs/compact.md)
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


class LatticeChoice:
    """Looks at materials once, and then chooses lattices of any size for all of them together.

    sources: all with the same folds; their scales are set. Where there are several, the errors of each count in units
    of what a lattice of ROWS_FOR_BANDS rows leaves of them, so that no material outweighs another one. random: what
    lines are drawn by. lines: how many at most, on each axis and of all materials together. Raises MaterialError for a
    black material.
    """

    def __init__(self, sources: Sequence[FittedSource], random: np.random.Generator, lines: int) -> None:
        self._sources, self._random = sources, random
        self._most_lines = max(1, lines // len(sources))
        self.folds = sources[0].folds
        self._end = FINE + self.folds["mirrored"]  # of the steps in φ_d: the last place is one of its own, or the first
        self._shares = [1.0] * len(sources)
        self._rows = best_nodes(self._of_rows(), MOST_ROWS)
        some = self._rows[ROWS_FOR_BANDS][0]
        starts = sorted({0, *(int(some[len(some) * g // BANDS]) for g in range(1, BANDS))})
        self._edges = [*starts, FINE + 1]
        self._theta_d: list[Choices] = []
        self._phi_d: list[Choices] = []
        for low, high in zip(self._edges[:-1], self._edges[1:], strict=True):
            theta_d, phi_d = self._band(low, min(high, FINE))
            self._theta_d.append(theta_d)
            self._phi_d.append(phi_d)

    def _of_rows(self) -> Array:
        """The errors along θ_h of all sources. Sets their scales, and what each counts."""
        axes = np.arange(FINE + 1.0), np.arange(0.0, FINE + 1, ROWS_EVERY_D), np.arange(0.0, self._end, ROWS_EVERY_P)
        errors: list[Array] = []
        for number, source in enumerate(self._sources):
            lines = self._lines(source, 0, *axes)
            source.rescale(lines.y[lines.weight > 0])
            errors.append(replace(lines, y=lines.y / np.cbrt(source.scale)).errors())
            if len(self._sources) > 1:
                left = best_nodes(errors[-1], ROWS_FOR_BANDS)[ROWS_FOR_BANDS][1]
                self._shares[number] = 1 / max(left, TINY)
        return self._sum(errors)

    def _sum(self, errors: list[Array]) -> Array:
        """Those of all sources together."""
        total: Array = sum(
            (share * error for share, error in zip(self._shares[1:], errors[1:], strict=True)),
            start=self._shares[0] * errors[0],
        )
        return total

    def _band(self, low: int, high: int) -> tuple[Choices, Choices]:
        """The best nodes in θ_d and in φ_d for a band: the rows of the fine grid from `low` to `high`.

        Errors are measured on fewer lines than those of θ_h, and are scaled up to be comparable with them.
        """
        rows = np.unique(np.linspace(low, high, BAND_ROWS).astype(int)).astype(np.float64)
        thinned, a_line = (high - low + 1) / len(rows), ROWS_EVERY_D * ROWS_EVERY_P
        axes = rows, np.arange(FINE + 1.0), np.arange(0.0, self._end, THETA_D_EVERY_P)
        lines = [self._lines(source, 1, *axes) for source in self._sources]
        scale = thinned * THETA_D_EVERY_P / a_line
        theta_d = best_nodes(scale * self._sum([each.errors() for each in lines]), MOST_NODES)
        axes = rows, np.arange(0.0, FINE + 1, PHI_D_EVERY_D), np.arange(float(self._end))
        lines = [self._lines(source, 2, *axes) for source in self._sources]
        scale = thinned * PHI_D_EVERY_D / a_line
        if self.folds["mirrored"]:
            found = best_nodes(scale * self._sum([each.errors() for each in lines]), MOST_NODES)
            constant = float(self._sum([np.array(each.variation()) for each in lines]))
            return theta_d, {1: ([0], scale * constant)} | found
        found = best_nodes(scale * self._sum([each.turned().errors() for each in lines]), MOST_NODES + 1)
        return theta_d, {count - 1: (nodes[:-1], error) for count, (nodes, error) in found.items()}

    def _lines(self, source: FittedSource, axis: int, x: Array, y: Array, z: Array) -> _Lines:
        """A material on lines along an axis of the grid with these axes, drawn at random from those above the horizon
        somewhere."""
        x, y, z, weight, seen = source.above(x, y, z)
        x, y, z, weight = (np.moveaxis(part, axis, 0).reshape(seen.shape[axis], -1) for part in (x, y, z, weight))
        lines = np.flatnonzero(weight.sum(axis=0) > 0)
        chosen = self._random.permutation(lines)[: self._most_lines]
        x, y, z, weight = (part[:, chosen] for part in (x, y, z, weight))
        return _Lines(source.values(x, y, z), weight, len(lines) / max(1, len(chosen)))

    def lattice(self, nodes: int) -> NodeLattice:
        """The lattice of the least error among those with LEAST_SHARE · nodes to `nodes` nodes.

        For each number of rows, the price of a node is found by bisection: at each price, every band takes the numbers
        of nodes in θ_d and φ_d that minimise its error plus the price of its nodes. Raises MaterialError if `nodes` is
        not from SMALLEST to LARGEST, and if there is no such lattice.
        """
        if not SMALLEST <= nodes <= LARGEST:
            raise MaterialError(f"nodes: expected {SMALLEST} to {LARGEST}, found {nodes}")
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
            raise MaterialError(f"{self._sources[0].brdf.name}: no lattice of about {nodes} nodes was found for it")
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
