"""The search for the inputs of a standard's surface model: sequential quadratic programming from many starts.

Layers do not add up, so nothing can be solved for: all inputs are searched. Dr.Jit gives the derivatives by all of them
in one pass backwards.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models.family import Angles
from ..models.standard import Surface, SurfaceModel
from ..reflectance.arrays import split
from ..reflectance.samples import Samples
from ..system.jit import drjit, float64
from .loss import Domain
from .options import FitOptions, Loss
from .search import AGAIN, EDGE, FEWEST, LONG, SHORT, WORTHWHILE, End, slsqp

Vector = NDArray[np.float64]
MORE = 100_000  # samples with which the best result is refined: numbers as few as these need no more
NONE = np.zeros((0, 3))  # albedos of its own


class SurfaceObjective:
    """The distance between samples and a surface model: the sum of squared differences divided by that of squared
    samples. Places are those of `Parameter.place`, one for each number of the inputs."""

    def __init__(self, model: SurfaceModel, samples: Samples, loss: Loss) -> None:
        self._dr: Any = drjit()
        self._float: Any = float64()
        self._model, self._domain = model, Domain(loss)
        wi, wo = (tuple(self._float(component.copy()) for component in split(w)) for w in (samples.wi, samples.wo))
        self._angles = a = Angles(wi, wo)
        self._weight = self._domain.weight(a.cos_i)
        self._target = [self._domain.mapped(self._float(c.copy()) * self._weight) for c in samples.f_r.T]
        self._nothing = self._dr.zeros(self._float, len(samples.wi))
        self._dr.make_opaque(self._nothing)
        self._dr.eval(a.cos_h, a.sin_h, a.cos_d, a.along, self._target)
        self._squared = sum(float((t.numpy() ** 2).sum()) for t in self._target)
        self._count = 3 * len(samples.wi)

    @property
    def scale(self) -> float:
        """The root mean square of the samples in the domain of the loss."""
        return sqrt(self._squared / self._count)

    def value(self, places: Vector) -> tuple[float, Vector]:
        """The distance, and its derivatives by the places."""
        dr = self._dr
        # A number for each sample, so that derivatives come for each sample, too, and NumPy adds them up: Dr.Jit would
        # sum those of each operation on its own.
        at = [self._float([place]) for place in places]
        dr.make_opaque(at)  # so that all places use the same compiled kernel
        wide = [place + self._nothing for place in at]
        for place in wide:
            dr.enable_grad(place)
        numbers = [chosen.at(place) for chosen, place in zip(self._model.places, wide, strict=True)]
        colour = self._model.f_r(self._angles, self._model.by_name(numbers))
        differences = [self._domain.mapped(c * self._weight) - t for c, t in zip(colour, self._target, strict=True)]
        squared = sum((d * d for d in differences), start=self._float(0.0))
        dr.backward(squared)
        found = [dr.detach(squared), *(dr.grad(place) for place in wide)]
        dr.eval(found)
        distance, *by_places = (float(values.numpy().sum()) / self._squared for values in found)
        return distance, np.array(by_places)

    def error(self, places: Vector) -> float:
        """The root mean square of the differences."""
        return sqrt(self.value(places)[0]) * self.scale


class SurfaceSearch:
    """A search for the inputs of one surface model."""

    def __init__(self, model: SurfaceModel, samples: Samples, options: FitOptions) -> None:
        self.whole = SurfaceObjective(model, samples, options.loss)
        self.part, self.more = (self._of(model, samples, options.loss, most) for most in (FEWEST, MORE))
        self._model, self._options = model, options

    def _of(self, model: SurfaceModel, samples: Samples, loss: Loss, most: int) -> SurfaceObjective:
        """The objective of about so many of the samples."""
        step = len(samples.wi) // most
        return SurfaceObjective(model, samples.some(slice(None, None, step)), loss) if step > 1 else self.whole

    def run(self, advance: Callable[[int], None]) -> tuple[End, list[End]]:
        """The best result, and the results from all starting points with a part of the samples; errors are of all."""
        ends: list[End] = []
        for start in self._starts():
            places = _descend(self.part, start, SHORT)
            ends.append(End(start, places, NONE, self.whole.error(places)))
            advance(len(ends))
        best = min(ends, key=lambda end: end.error)
        return min(best, self._refined(best), key=lambda end: end.error), ends

    def material(self, name: str, end: End) -> Surface:
        return Surface(name, self._model, self._values(end.places))

    def start(self, end: End) -> list[dict[str, Any]]:
        """Where a search began: the values of all inputs."""
        return [self._values(end.start)]

    def _values(self, places: Vector) -> dict[str, Any]:
        numbers = [
            min(max(float(chosen.at(place)), chosen.low), chosen.high)
            for chosen, place in zip(self._model.places, places, strict=True)
        ]
        return self._model.by_name(numbers)

    def _starts(self) -> list[Vector]:
        places = self._model.places
        random = np.random.Generator(np.random.PCG64([self._options.seed, 1]))
        first = np.array([chosen.place(chosen.start) for chosen in places])
        return [first, *(EDGE + (1 - 2 * EDGE) * random.random((self._options.starts - 1, len(places))))]

    def _refined(self, end: End) -> End:
        places, distance = end.places, self.more.value(end.places)[0]
        for _ in range(AGAIN):
            before = distance
            places = _descend(self.more, places, LONG)
            distance = self.more.value(places)[0]
            if distance > WORTHWHILE * before:
                break
        return End(end.start, places, NONE, self.whole.error(places))


def _descend(objective: SurfaceObjective, start: Vector, iterations: int) -> Vector:
    """The nearest minimum from one starting point."""
    unit = objective.value(start)[0] or 1.0

    def value(x: Vector) -> tuple[float, Vector]:
        distance, slopes = objective.value(x)
        return distance / unit, slopes / unit

    return slsqp(value, start, [(0.0, 1.0)] * len(start), iterations)
