"""What a family of lobes consists of: a formula, its parameters, and what importance sampling needs to know."""

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
    """A number that determines the shape of a lobe, the same for all channels.

    low, high: its bounds. start: the value at which a search begins if nothing is known about the material. scale:
        whether a search's steps and random starts are uniform in the value or in its logarithm.
    """

    name: str
    low: float
    high: float
    start: float
    scale: Literal["linear", "logarithmic"] = "linear"

    def at(self, place: Array) -> Array:
        """The value at a place in [0, 1], where 0 and 1 are the bounds; also for arrays of places."""
        if self.scale == "linear":
            return self.low + (self.high - self.low) * place
        return self.low * ops(place).exp(math.log(self.high / self.low) * place)

    def place(self, value: float) -> float:
        """The place in [0, 1] of a value: the inverse of `at`."""
        if self.scale == "linear":
            return (value - self.low) / (self.high - self.low)
        return math.log(value / self.low) / math.log(self.high / self.low)


@dataclass(frozen=True)
class Family:
    """A family of lobes.

    source: the publication.
    lobe: a function of Angles and of one number for each parameter that gives f_r [1/sr] for the albedo 1, on NumPy and
        on Dr.Jit arrays. f_r is proportional to the albedo; with a Fresnel term, less than the albedo is reflected.
    conserves_energy: whether a lobe never reflects more than its albedo's share of the light, from any direction.
    exponent: for importance sampling, a function of the parameters that gives the exponent of the Blinn-Phong lobe
        whose half vectors are about as widely spread; None for a diffuse lobe, for which directions follow the cosine.
    reciprocal: whether f_r is the same for wi and wo swapped.
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
    """Angles of pairs of directions above the horizon, as formulas need them. Each is computed when it is first used.

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
        # In single precision, π/2 is rounded up, and its cosine is negative.
        return f.maximum(f.cos(self.theta_h), 1e-7)

    @cached_property
    def sin_h(self) -> Array:
        return ops(self.theta_h).sin(self.theta_h)

    @cached_property
    def tan2_h(self) -> Array:
        """tan² θ_h, precise near the highlight, where 1 − cos² θ_h would lose digits."""
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
    """cosine^exponent. Where the cosine is not positive, it is nearly 0, and its derivative is finite."""
    f = ops(cosine)
    # Not `power`: in double precision, Dr.Jit's gives infinity for some results that are close to 0.
    return f.exp(exponent * f.log(f.maximum(cosine, 1e-6)))
