"""The search for the shapes and albedos of a sum of lobes: sequential quadratic programming from many starts.

As in Ngan, Durand & Matusik 2005, "Experimental Analysis of BRDF Models", EGSR, and in the paper, parameters have
bounds, and channels have their own albedos but share the shapes. If the loss is linear in f_r, the best albedos for
given shapes are computed directly, and only the shapes are searched; docs/models.md compares this with searching for
both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models.family import Family
from ..models.multi_lobe import Lobe, MultiLobe
from ..reflectance.samples import Samples
from ..system.optional import optional
from .objective import Matrix, Objective
from .options import FitOptions

Vector = NDArray[np.float64]

FEWER = 10  # the first search, from all starting points, uses one sample in ten,
FEWEST = 20_000  # but no fewer than this
REFINED = 3  # the number of best results, all different, that are refined with all samples
DIFFERENT = 0.02  # results are different if a parameter differs by this share of its range
SHORT, LONG = 150, 300  # most iterations of a search; 40 are too few if albedos are searched, too
AGAIN = 4  # most searches with all samples, each scaled by the error before it, as SLSQP stops at an absolute change
WORTHWHILE = 0.99  # … which end when one leaves more than this share of the error
EDGE = 0.02  # share of a parameter's range, next to its bounds, in which no random start lies
SMALLEST_STEP = 1e-3  # of the largest albedo: the unit in which smaller albedos are searched


@dataclass(frozen=True)
class End:
    """The result of a search: where it started and ended (see `Parameter.place`), albedos (lobes, 3), and the error."""

    start: Vector
    places: Vector
    albedos: Matrix
    error: float


class Search:
    """A search for one model. families: of its lobes."""

    def __init__(self, families: Sequence[Family], samples: Samples, options: FitOptions) -> None:
        step = max(1, min(FEWER, len(samples.wi) // FEWEST))
        self.whole = Objective(families, samples, options.loss)
        self.part = (
            self.whole if step == 1 else Objective(families, samples.some(slice(None, None, step)), options.loss)
        )
        self.solves = self.whole.linear  #: whether albedos are computed directly and not searched
        self._options = options
        self._most = 1.0 if options.conserve_energy else None

    def run(self, advance: Callable[[int], None]) -> tuple[End, list[End]]:
        """The best result, and the results from all starting points with a part of the samples."""
        ends: list[End] = []
        for start in self._starts():
            places, albedos = self._descend(self.part, start, None, SHORT)
            if self.solves:
                albedos = self.whole.solved(places, self._most)[0]
            ends.append(End(start, places, albedos, self.whole.error(places, albedos)))
            advance(len(ends))
        refined: list[End] = []
        for end in _different(ends):
            refined.append(self._refined(end))
            advance(len(ends) + len(refined))
        return min([*refined, *ends], key=lambda end: end.error), ends

    def material(self, name: str, end: End) -> MultiLobe:
        return MultiLobe(name, self.lobes(end.places, end.albedos))

    def start(self, end: End) -> list[dict[str, float]]:
        """Where a search began: the shapes of all lobes."""
        return [dict(lobe.shape) for lobe in self.lobes(end.start, end.albedos)]

    def lobes(self, places: Vector, albedos: Matrix) -> list[Lobe]:
        """Lobes with these shapes and albedos, the widest first."""
        found: list[Lobe] = []
        remaining = list(places)
        for family, albedo in zip(self.whole.families, albedos, strict=True):
            shape: dict[str, float] = {}
            for p in family.parameters:
                shape[p.name] = min(max(float(p.at(remaining.pop(0))), p.low), p.high)
            r, g, b = map(float, albedo)
            found.append(Lobe(family, (r, g, b), shape))
        return sorted(found, key=lambda lobe: lobe.exponent)

    def _starts(self) -> list[Vector]:
        parameters = self.whole.parameters
        if not parameters:
            return [np.empty(0)]
        random = np.random.Generator(np.random.PCG64([self._options.seed, 1]))
        first = np.array([p.place(p.start) for p in parameters])
        others = EDGE + (1 - 2 * EDGE) * random.random((self._options.starts - 1, len(parameters)))
        return [first, *others]

    def _refined(self, end: End) -> End:
        places, albedos = end.places, end.albedos
        distance = self.whole.value(places, albedos).distance
        for _ in range(AGAIN):
            before = distance
            places, albedos = self._descend(self.whole, places, albedos, LONG)
            distance = self.whole.value(places, albedos).distance
            if distance > WORTHWHILE * before:
                break
        return End(end.start, places, albedos, self.whole.error(places, albedos))

    def _descend(
        self, objective: Objective, places: Vector, albedos: Matrix | None, iterations: int
    ) -> tuple[Vector, Matrix]:
        """Searches for the nearest minimum from one starting point."""
        if self.solves:
            return self._descend_shapes(objective, places, iterations)
        if albedos is None:
            albedos = objective.first_albedos(places, self._most)
        return self._descend_all(objective, places, albedos, iterations)

    def _descend_shapes(self, objective: Objective, places: Vector, iterations: int) -> tuple[Vector, Matrix]:
        """Searches over the shapes; the albedos are the best for each."""
        unit = objective.solved(places, self._most)[1].distance or 1.0

        def value(x: Vector) -> tuple[float, Vector]:
            found = objective.solved(x, self._most)[1]
            return found.distance / unit, found.by_places / unit

        if len(places):
            places = slsqp(value, places, [(0.0, 1.0)] * len(places), iterations)
        return places, objective.solved(places, self._most)[0]

    def _descend_all(
        self, objective: Objective, places: Vector, albedos: Matrix, iterations: int
    ) -> tuple[Vector, Matrix]:
        """Searches over shapes and albedos."""
        count, shape = len(places), albedos.shape
        unit = objective.value(places, albedos).distance or 1.0
        size = np.maximum(albedos, SMALLEST_STEP * (albedos.max() or 1.0))

        def value(x: Vector) -> tuple[float, Vector]:
            found = objective.value(x[:count], x[count:].reshape(shape) * size)
            return found.distance / unit, np.append(found.by_places, found.by_albedos * size) / unit

        sums: list[Vector] = []  # for each channel, the sum of its albedos, which must not exceed 1
        for channel in range(3 if self._most else 0):
            row = np.zeros(shape)
            row[:, channel] = size[:, channel]
            sums.append(np.append(np.zeros(count), row))
        bounds: list[tuple[float, float | None]] = [*[(0.0, 1.0)] * count, *[(0.0, None)] * albedos.size]
        x = slsqp(value, np.append(places, albedos / size), bounds, iterations, sums)
        return x[:count], x[count:].reshape(shape) * size


def slsqp(
    value: Callable[[Vector], tuple[float, Vector]],
    start: Vector,
    bounds: Sequence[tuple[float, float | None]],
    iterations: int,
    sums: Sequence[Vector] = (),
) -> Vector:
    """Minimises with SciPy's SLSQP (Kraft 1988) to full precision; returns the best allowed x that it evaluated.

    value: gives the function and its derivative. sums: vectors whose products with x must not exceed 1.
    """
    lowest, best = np.inf, start

    def watched(x: Vector) -> tuple[float, Vector]:
        nonlocal lowest, best
        found, slope = value(x)
        if found < lowest and all(row @ x <= 1 + 1e-9 for row in sums):
            lowest, best = found, x.copy()
        return found, slope

    constraints: list[dict[str, Any]] = []
    if sums:
        rows = np.stack(sums)
        constraints.append({"type": "ineq", "fun": lambda x: 1 - rows @ x, "jac": lambda x: -rows})  # pyright: ignore
    optional("scipy.optimize", "SciPy", "fitting", "fit").minimize(
        watched,
        start,
        jac=True,
        method="SLSQP",
        bounds=bounds,
        constraints=constraints,
        options={"ftol": 1e-15, "maxiter": iterations},
    )
    return best


def _different(ends: Sequence[End]) -> list[End]:
    """The best results, at most REFINED of them, no two of which are the same (DIFFERENT)."""
    chosen: list[End] = []
    for end in sorted(ends, key=lambda end: end.error):
        if all(np.abs(end.places - other.places).max(initial=0) > DIFFERENT for other in chosen):
            chosen.append(end)
    return chosen[:REFINED]
