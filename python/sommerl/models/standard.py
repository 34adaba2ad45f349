"""Surface models of the standards that engines and scene formats share: formulas whose inputs have names and bounds.

Unlike sums of lobes (`multi_lobe`), these layer what they consist of: what the upper layer reflects does not reach the
lower one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..system.errors import MaterialError
from .family import Angles, Parameter

Values = Mapping[str, Any]  #: of each input, by name: a number, or a colour as a tuple of three


@dataclass(frozen=True)
class Input(Parameter):
    """An input of a surface model. colour: whether it is three numbers (linear RGB), each within the bounds."""

    colour: bool = False

    @property
    def count(self) -> int:
        return 3 if self.colour else 1


@dataclass(frozen=True)
class SurfaceModel:
    """A surface model of a standard.

    source: the publication. inputs: those that a fit searches; all others of the standard have its default values.
    f_r: a function of Angles and of the values of all inputs, by name, that gives linear RGB [1/sr], on NumPy and on
    Dr.Jit arrays. reciprocal: whether f_r is the same for wi and wo swapped.
    """

    name: str
    source: str
    inputs: tuple[Input, ...]
    f_r: Callable[[Angles, Values], Triple]
    reciprocal: bool

    @cached_property
    def by_key(self) -> dict[str, Input]:
        return {chosen.name: chosen for chosen in self.inputs}

    @property
    def places(self) -> list[Input]:
        """The input of each number, in order: three times that of a colour."""
        return [chosen for chosen in self.inputs for _ in range(chosen.count)]

    def by_name(self, numbers: list[Any]) -> dict[str, Any]:
        """The values of the inputs, from all numbers in order."""
        values: dict[str, Any] = {}
        for chosen in self.inputs:
            values[chosen.name] = tuple(numbers[:3]) if chosen.colour else numbers[0]
            numbers = numbers[chosen.count :]
        return values


class Surface(Brdf):
    """A material of a surface model.

    values: of all inputs. Raises MaterialError for missing or unknown names, and for values out of bounds.
    """

    def __init__(self, name: str, model: SurfaceModel, values: Values) -> None:
        expected = model.by_key
        if set(values) != set(expected):
            raise MaterialError(f"{model.name}: expected inputs {sorted(expected)}, found {sorted(values)}")
        for key, value in values.items():
            chosen = expected[key]
            numbers, shape = np.asarray(value), (3,) if chosen.colour else ()
            if numbers.shape != shape or not ((chosen.low <= numbers) & (numbers <= chosen.high)).all():
                what = "three numbers" if chosen.colour else "a number"
                raise MaterialError(
                    f"{model.name}: {key}: expected {what} from {chosen.low:g} to {chosen.high:g}, found {value}"
                )
        self.name, self.model = name, model
        self.values = {chosen.name: values[chosen.name] for chosen in model.inputs}

    @property
    def reciprocal(self) -> bool:
        return self.model.reciprocal

    @property
    def mirrored(self) -> bool:
        return True

    def details(self) -> dict[str, Any]:
        return {"surface": self.as_json()}

    def as_json(self) -> dict[str, Any]:
        return {"model": self.model.name, **{key: _plain(value) for key, value in self.values.items()}}

    def buffers(self) -> dict[str, NDArray[Any]]:
        # In a buffer and not in the formula, so that all materials of a model share one compiled kernel.
        return {"inputs": np.array([x for value in self.values.values() for x in np.atleast_1d(value)], float)}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        f = ops(wi[0])
        numbers = [f.gather(buffers["inputs"], k) for k in range(len(self.model.places))]
        # Approximations of albedos can take more from the layer below than there is.
        r, g, b = (f.maximum(c, 0.0) for c in self.model.f_r(Angles(wi, wo), self.model.by_name(numbers)))
        return r, g, b


def _plain(value: Any) -> Any:
    return np.asarray(value, float).tolist()


def mix(a: Array, b: Array, t: Array) -> Array:
    """a for t = 0, b for t = 1."""
    return a + t * (b - a)


def fifth(x: Array) -> Array:
    return (x * x) * (x * x) * x


def dielectric(cosine: Array, ior: Array) -> Array:
    """Fresnel's equations: the reflectance of a smooth dielectric for unpolarised light. ior: relative, at least 1."""
    f = ops(cosine)
    g = f.sqrt(ior * ior + cosine * cosine - 1.0)
    inner = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    outer = (g - cosine) / (g + cosine)
    return 0.5 * outer * outer * (1.0 + inner * inner)


def at_normal(ior: Array) -> Array:
    """The reflectance of a dielectric at normal incidence."""
    root = (ior - 1.0) / (ior + 1.0)
    return root * root
