"""What every family of lobes is: a formula, its parameters, and where it sends the light."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.half_diff import TWO_PI, half_diff

PI = TWO_PI / 2


@dataclass(frozen=True)
class Parameter:
    """A number that shapes a lobe, the same for all channels.

    low, high: its bounds. start: where a search begins that knows nothing. scale: of the axis on which values are
        evenly spread, for a search's steps and its random starts.
    """

    name: str
    low: float
    high: float
    start: float
    scale: Literal["linear", "logarithmic"] = "linear"

    def at(self, place: Array) -> Array:
        """The value at a place in [0, 1] between the bounds; an array of places gives one of values."""
        if self.scale == "linear":
            return self.low + (self.high - self.low) * place
        return self.low * ops(place).exp(math.log(self.high / self.low) * place)

    def place(self, value: float) -> float:
        """The place, in [0, 1], of a value between the bounds."""
        if self.scale == "linear":
            return (value - self.low) / (self.high - self.low)
        return math.log(value / self.low) / math.log(self.high / self.low)


@dataclass(frozen=True)
class Family:
    """A family of lobes.

    source: who published it, where.
    lobe: f_r [1/sr] for an albedo of one, which is a factor (with a Fresnel term, less comes back), from Angles and one
        number a parameter, on NumPy and on Dr.Jit arrays.
    reciprocal: whether it promises the same for wi and wo swapped. conserves_energy: whether it promises to reflect no
        more than its albedo's share of the light, from wherever it comes.
    exponent: for importance sampling, the exponent of Blinn-Phong's lobe whose half vectors are about as wide, from the
        same parameters; None if the lobe is diffuse, and directions are best drawn by the cosine.
    """

    name: str
    source: str
    parameters: tuple[Parameter, ...]
    lobe: Callable[..., Array]
    conserves_energy: bool
    exponent: Callable[..., float] | None
    reciprocal: bool = True

    @property
    def diffuse(self) -> bool:
        return self.exponent is None


@dataclass(frozen=True)
class Angles:
    """What formulas ask about pairs of directions above the horizon; what none asks for is not calculated.

    wi, wo: components (x, y, z) of unit vectors, z along the normal.
    """

    wi: Triple
    wo: Triple

    @property
    def cos_i(self) -> Array:
        return self.wi[2]

    @property
    def cos_o(self) -> Array:
        return self.wo[2]

    @cached_property
    def along(self) -> Array:
        """sin θ_i sin θ_o cos (φ_i − φ_o)."""
        return self.wi[0] * self.wo[0] + self.wi[1] * self.wo[1]

    @cached_property
    def _half_diff(self) -> tuple[Array, Array]:
        theta_h, theta_d, _ = half_diff(self.wi, self.wo)
        return theta_h, theta_d

    @property
    def theta_h(self) -> Array:
        return self._half_diff[0]

    @cached_property
    def cos_h(self) -> Array:
        f = ops(self.theta_h)
        return f.maximum(f.cos(self.theta_h), 1e-7)  # in single precision, π/2 is more than it should be

    @cached_property
    def sin_h(self) -> Array:
        return ops(self.theta_h).sin(self.theta_h)

    @cached_property
    def tan2_h(self) -> Array:
        """tan² θ_h, which keeps the digits near the highlight that 1 − cos² θ_h loses."""
        tangent = self.sin_h / self.cos_h
        return tangent * tangent

    @cached_property
    def cos_d(self) -> Array:
        theta_d = self._half_diff[1]
        return ops(theta_d).cos(theta_d)


def exponent_of_width(width: float, *_: float) -> float:
    """Blinn-Phong's exponent for a lobe of exp(−(θ_h / width)²), since cosⁿ θ ≈ exp(−n θ² / 2)."""
    return 2.0 / (width * width)


def cosine_power(cosine: Array, exponent: Array) -> Array:
    """cosine^exponent; where the cosine is not positive, as good as 0, with a derivative that is a number."""
    f = ops(cosine)
    # Not `power`: Dr.Jit's, in double precision, gives infinities for some results near the smallest numbers.
    return f.exp(exponent * f.log(f.maximum(cosine, 1e-6)))
