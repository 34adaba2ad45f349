"""The model that gives each entry of a palette its weight, or probability, for the next node.

This is docs/format.md, *The entries*, in plain Python, with the same names. It uses only +, −, ×, ÷, √ and ⌊⌋ of IEEE
754 doubles, in the order given there, so that every decoder gets the same bits.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable

FINE = 180
OCTAVE, UNIT = 128, 64  # codes for a step of 1 in the coordinates of gains and of shapes
NEIGHBOURS = range(10)
FORGET = 1.0005  # how fast the least squares forget: by this factor of P at each node
WHOLE = 65536.0  # the sum of weights, nearly
REACH = 16.0  # expected errors from the prediction, beyond which an entry has the weight 1

Floats = list[float]
Grid = list[Floats]  # [coordinate][node of a row]
Plane = tuple[Grid, Grid]  # values, and errors of their predictions
Way = tuple[int, int, float]  # two neighbouring nodes on an axis, and the share of the second one


class Model:
    """Predicts one node after the other, in the order of the stream.

    lattice: theta_h, band, theta_d, phi_d. mirrored: whether φ_d has ends, and does not turn.
    """

    def __init__(
        self,
        lattice: tuple[list[int], list[int], list[list[int]], list[list[int]]],
        mirrored: bool,
        gains: list[int],
        shapes: list[tuple[int, int]],
        prior: tuple[list[Floats], Floats] | None = None,
    ) -> None:
        _, self._band, self._theta_d, self._phi_d = lattice
        self._mirrored = mirrored
        places = [[code / OCTAVE for code in gains], *([shape[axis] / UNIT for shape in shapes] for axis in (0, 1))]
        self._places = places
        self._predictors = [Predictor(values) for values in places]
        if prior:
            for predictor, weights, level in zip(self._predictors, *prior, strict=True):
                predictor.begin_with(weights, level)
        self._gains, self._shapes = Entries(places[0], [0.0] * len(gains)), Entries(places[1], places[2])
        self._present = self._above = self._higher = _plane(0)

    def begin(self, row: int) -> None:
        """To be called before the first node of a row."""
        self._row, band = row, self._band[row]
        if row > 0:
            self._higher, self._above = self._above, self._present
            before = self._band[row - 1]
            if before != band:
                self._above = self._moved(self._above, before, band)
                self._higher = self._moved(self._higher, before, band) if row > 1 else self._higher
        self._width, self._height = len(self._phi_d[band]), len(self._theta_d[band])
        self._present = _plane(self._width * self._height)

    def _moved(self, plane: Plane, old: int, new: int) -> Plane:
        """A row of one band, interpolated to the nodes of another band."""
        width, moved, about = len(self._phi_d[old]), _plane(0), _between if self._mirrored else _around
        for y in self._theta_d[new]:
            d0, d1, v = _between(self._theta_d[old], y)
            for x in self._phi_d[new]:
                p0, p1, u = about(self._phi_d[old], x)
                for grid, to in zip(plane, moved, strict=True):
                    for a, out in zip(grid, to, strict=True):
                        low = a[d0 * width + p0] * (1.0 - u) + a[d0 * width + p1] * u
                        high = a[d1 * width + p0] * (1.0 - u) + a[d1 * width + p1] * u
                        out.append(low * (1.0 - v) + high * v)
        return moved

    def expect(self, d: int, p: int) -> None:
        """Predicts the coordinates of node [d, p] of the row. To be called before its weights are asked for."""
        phi_d, at, under = self._phi_d[self._band[self._row]], d * self._width + p, self._row > 0
        mirror = _between(phi_d[:p], FINE - phi_d[p]) if p and FINE - phi_d[p] <= phi_d[p - 1] else None
        for c, predictor in enumerate(self._predictors):
            up, values = self._neighbours(c, d, p, mirror)
            present, above = self._present[1][c], self._above[1][c]
            errors = [
                *([present[at - 1]] if p > 0 else []),
                *([present[at - self._width]] if d > 0 else []),
                *([above[at]] if under else []),
            ]
            predictor.predict(up, values, errors)

    def _neighbours(self, c: int, d: int, p: int, mirror: Way | None) -> tuple[float, Floats]:
        """Coordinate c of the neighbours of node [d, p]: `up`, and values 0 to 9."""
        width, under = self._width, self._row > 0
        now, above, higher = (plane[0][c] for plane in (self._present, self._above, self._higher))
        line, at = d * width, d * width + p
        west, east = (line + q for q in self._beside(p))
        if under:
            up = above[at]
        elif p > 0 and d > 0:
            up = 0.5 * (now[at - 1] + now[at - width])
        else:
            up = now[at - 1] if p > 0 else now[at - width] if d > 0 else 0.0
        news = 0.0
        if mirror:
            q0, q1, u = mirror
            before = above[line + q0] * (1.0 - u) + above[line + q1] * u if under else up
            news = now[line + q0] * (1.0 - u) + now[line + q1] * u - before
        return up, [
            now[at - 1] if p > 0 else above[west] if under else up,
            now[at - width] if d > 0 else up,
            now[west - width] if d > 0 else up,
            now[east - width] if d > 0 else up,
            above[west] if under else up,
            above[at - width] if under and d > 0 else up,
            above[east] if under else up,
            above[at + width] if under and d + 1 < self._height else up,
            higher[at] if self._row > 1 else up,
            up + news,
        ]

    def _beside(self, p: int) -> tuple[int, int]:
        """The nodes on either side of node p in φ_d."""
        last = self._width - 1
        if self._mirrored:
            return p - 1 if p > 0 else min(1, last), p + 1 if p < last else max(last - 1, 0)
        return (p - 1) % self._width, (p + 1) % self._width

    def gain_weights(self) -> list[int]:
        """The weights of all gains for the present node."""
        return self._gains.weigh(*self._predictors[0].expected(), 0.0, 0.0)

    def shape_weights(self) -> list[int]:
        """The weights of all shapes for the present node."""
        return self._shapes.weigh(*self._predictors[1].expected(), *self._predictors[2].expected())

    @property
    def reached(self) -> int:
        """The number of entries within reach in both palettes, added up over all nodes so far."""
        return self._gains.reached + self._shapes.reached

    def learn(self, d: int, p: int, gain: int, shape: int) -> None:
        """Adapts to the entries of node [d, p]."""
        self._gains.learn(gain)
        self._shapes.learn(shape)
        at, (values, errors) = d * self._width + p, self._present
        for c, entry in enumerate((gain, shape, shape)):
            values[c][at] = self._places[c][entry]
            errors[c][at] = self._predictors[c].learn(values[c][at])


class Predictor:
    """Predicts one coordinate from its neighbours by recursive least squares. values: those in the palette."""

    def __init__(self, values: Floats) -> None:
        mean = _sum(values) / len(values)
        variance = _sum([(value - mean) * (value - mean) for value in values]) / len(values) + 1e-4
        self._w = [0.5, 0.5, 0.0, 0.0, -0.5, -0.5, 0.0, 0.0, 0.0, 0.0]
        self._matrix = [[25.0 / variance if i == j else 0.0 for j in NEIGHBOURS] for i in NEIGHBOURS]
        self._level = 0.15 * math.sqrt(variance)

    def begin_with(self, weights: Floats, level: float) -> None:
        """Takes over what was learnt before. To be called before the first node."""
        self._w, self._level = list(weights), level
        self._matrix = [[0.1 * entry for entry in row] for row in self._matrix]

    def predict(self, up: float, values: Floats, errors: Floats) -> None:
        """Makes a prediction. up, values: of the neighbours. errors: of earlier predictions at neighbouring nodes."""
        self._x = [value - up for value in values]
        self._predicted = _product(self._w, self._x, up)
        total, count = 0.7 * self._level, 0.7
        for error in errors:
            total, count = total + error, count + 1.0
        self._scale = total / count + 0.02 * self._level + 1e-4

    def expected(self) -> tuple[float, float]:
        """The prediction, and 1 / (its expected error)."""
        return self._predicted, 1.0 / self._scale

    def learn(self, value: float) -> float:
        """Adapts to the true value; returns the absolute error of the prediction."""
        error, matrix, x = value - self._predicted, self._matrix, self._x
        g = [_product(column, x) for column in zip(*matrix, strict=True)]
        r = _ratio(1.0, _product(g, x, 1.0))
        for i in NEIGHBOURS:
            one = g[i]
            self._w[i] += one * r * error
            matrix[i] = [(entry - one * other * r) * FORGET for entry, other in zip(matrix[i], g, strict=True)]
        self._level = 0.98 * self._level + 0.02 * abs(error)
        return abs(error)


class Entries:
    """The entries of a palette by their two coordinates, sorted by the first, and how often each has been picked."""

    def __init__(self, first: Floats, second: Floats) -> None:
        self._places = list(zip(first, second, strict=True))
        self._steps = [_step(place) for place in first]
        self._counts, self._roots = [1.0] * len(first), [1.0] * len(first)
        self._narrow = 0.5
        self.reached = 0

    def weigh(self, p0: float, s0: float, p1: float, s1: float) -> list[int]:
        """The weights of all entries. p0, p1: predicted coordinates. s0, s1: 1 / (their expected errors)."""
        self._expected = p0, s0, p1, s1
        reach = _ratio(REACH, s0)
        first, end = bisect_left(self._steps, _step(p0 - reach)), bisect_right(self._steps, _step(p0 + reach))
        self.reached += end - first
        heights = self._kernels(first, end)
        near, far = _sum4([near for near, _ in heights]), _sum4([far for _, far in heights])
        self._f, self._g = self._narrow / near, (1.0 - self._narrow) / far
        f, g = self._f * WHOLE, self._g * WHOLE
        weights = [1] * len(self._places)
        weights[first:end] = [1 + _whole(near * f + far * g) for near, far in heights]
        return weights

    def _kernels(self, first: int, end: int) -> list[tuple[float, float]]:
        """The narrow and the wide kernel at the entries from the first one on, before the end."""
        p0, s0, p1, s1 = self._expected
        heights: list[tuple[float, float]] = []
        for (x, y), root in zip(self._places[first:end], self._roots[first:end], strict=True):
            x, y = (x - p0) * s0, (y - p1) * s1
            x, y = x * x, y * y
            a = (1.0 + x * 2.25) * (1.0 + y * 2.25)
            b = (1.0 + x * 0.25) * (1.0 + y * 0.25)
            a, b = a * a, b * b
            c = root / (a * b)
            heights.append((c * b, c * a))
        return heights

    def learn(self, entry: int) -> None:
        """Adapts to the entry that was picked."""
        [(near, far)] = self._kernels(entry, entry + 1)
        near, far = near * self._f, far * self._g
        self._narrow = 0.96 * _ratio(near, near + far) + 0.02
        self._counts[entry] += 1.0
        self._roots[entry] = math.sqrt(self._counts[entry])


def _plane(nodes: int) -> Plane:
    return [[0.0] * nodes for _ in range(3)], [[0.0] * nodes for _ in range(3)]


def _between(axis: list[int], place: int) -> Way:
    """The two nodes around a place on an axis, and the share of the second one."""
    upper = bisect_right(axis, place)
    if upper == len(axis):
        return upper - 1, upper - 1, 0.0
    a, b = axis[upper - 1], axis[upper]
    return upper - 1, upper, (place - a) / (b - a)


def _around(axis: list[int], place: int) -> Way:
    """The same on the periodic axis of φ_d, which begins again at FINE."""
    if place < axis[-1]:
        return _between(axis, place)
    return len(axis) - 1, 0, (place - axis[-1]) / (FINE - axis[-1])


def _step(place: float) -> int:
    return _whole(min(max(place * 64.0 + 2048.0, 0.0), 4096.0))


def _whole(x: float) -> int:
    return int(x) if x == x else 0  # it is not if it is no number


def _ratio(a: float, b: float) -> float:
    """a / b as IEEE 754 defines it, also for b = 0, where Python raises an error."""
    return a / b if b else math.copysign(math.inf, b) * a if a else math.nan


def _sum(values: Floats) -> float:
    """The sum, one value after the other. Python's own `sum` corrects rounding errors (since 3.12)."""
    total = 0.0
    for value in values:
        total += value
    return total


def _product(some: Iterable[float], others: Iterable[float], total: float = 0.0) -> float:
    """The sum of products, one after the other, from a total on."""
    for one, other in zip(some, others, strict=True):
        total += one * other
    return total


def _sum4(values: Floats) -> float:
    a, b, c, d = (_sum(values[lane::4]) for lane in range(4))
    return (a + b) + (c + d) + 1e-300
