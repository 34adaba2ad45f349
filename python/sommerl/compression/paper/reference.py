"""The kernels of the method again, in plain NumPy: the executable specification of the Rust core.

Same classes, functions and contracts as `sommerl._core` (see `_core.pyi`), and the same results bit for bit: all
arithmetic is on float32, one operation after the other as written. Far too slow for a whole table.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

STORED = 3
EMPTY = 2**32 - 1

F32 = NDArray[np.float32]


def squared_distance(x: F32, c: F32) -> F32:
    """Squared Euclidean distance along the last axis, summed as (r² + g²) + b²."""
    d = x - c
    total = (d[..., 0] * d[..., 0] + d[..., 1] * d[..., 1]) + d[..., 2] * d[..., 2]
    return np.asarray(total, np.float32)  # which it already is


class Learner:
    """Units of the SOM and their MANs, in training (phases 1 and 2)."""

    def __init__(
        self,
        triples: F32,
        cells: NDArray[np.uint32],
        weights: F32,
        rule: Literal["paper", "kohonen"],
        columns: int,
        *,
        distinct: bool = False,
    ) -> None:
        self._x = triples
        self._cells = cells
        self._c = weights.copy()
        self._stored = np.full((len(weights), STORED), EMPTY, np.uint32)
        self._originals = np.full((len(weights), STORED, 3), np.inf, np.float32)
        self._moved, self._before = False, self._stored.copy()
        self._rule = rule
        self._columns = columns
        self._distinct = distinct

    def present(self, start: int, stop: int, alpha: float, falloff: F32) -> float:
        total = 0.0
        for x, cell in zip(self._x[start:stop], self._cells[start:stop], strict=True):
            squared = squared_distance(x, self._c)  # Eq. 1
            winner = int(squared.argmin())
            total += float(np.sqrt(np.float64(squared[winner])))
            self._learn(winner, x, np.float32(alpha), falloff)
            self._attract(winner, x, cell, np.float32(alpha))
        return total

    def _learn(self, winner: int, x: F32, alpha: np.float32, falloff: F32) -> None:
        row, column = divmod(winner, self._columns)
        for unit in range(len(self._c)):
            down, across = abs(unit // self._columns - row), abs(unit % self._columns - column)
            if max(down, across) < len(falloff):
                weight = falloff[down] * falloff[across]
                self._move(unit, x, alpha if unit == winner else alpha * weight)

    def _attract(self, winner: int, x: F32, cell: np.uint32, alpha: np.float32) -> None:
        c, originals = self._c[winner], self._originals[winner]
        distances = squared_distance(originals, c)  # infinite where nothing is stored yet
        farthest = int(distances.argmax())  # Eq. 3
        if self._distinct and cell in self._stored[winner]:  # it takes its own place, which changes nothing
            farthest = self._stored[winner].tolist().index(cell)
        if squared_distance(x, c) <= distances[farthest]:  # Eq. 5
            originals[farthest], self._stored[winner, farthest] = x, cell  # Eq. 4
        self._move(winner, originals[farthest], alpha)  # Eq. 6

    def _move(self, unit: int, x: F32, alpha: np.float32) -> None:
        rate = alpha * x if self._rule == "paper" else alpha
        moved = self._c[unit] + rate * (x - self._c[unit])  # Eq. 2
        self._moved |= bool((moved != self._c[unit]).any())
        self._c[unit] = moved

    def settled(self) -> bool:
        settled = not self._moved and np.array_equal(self._stored, self._before)
        self._moved, self._before = False, self._stored.copy()
        return settled

    def weights(self) -> F32:
        return self._c.copy()

    def stored_cells(self) -> NDArray[np.uint32]:
        return self._stored.copy()


class Quantiser:
    """The LUT, asked for the nearest of its entries (phase 3)."""

    def __init__(self, lut: F32) -> None:
        self._lut = lut

    def query(self, triples: F32) -> NDArray[np.uint32]:
        return np.array([squared_distance(x, self._lut).argmin() for x in triples], np.uint32)
