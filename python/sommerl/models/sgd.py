"""The Shifted Gamma Distribution model: the closest analytic fit known to the materials of the MERL database.

Bagher, Soler & Holzschuch 2012, "Accurate fitting of measured reflectances using a Shifted Gamma micro-facet
distribution", Computer Graphics Forum 31(4).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.half_diff import TWO_PI, half_diff

PI = TWO_PI / 2
PARAMETERS = ("rho_d", "rho_s", "alpha", "p", "f0", "f1", "kappa", "lambda", "c", "k", "theta0")


class ShiftedGamma(Brdf):
    """f_r = (ρ_d + ρ_s D F G / (cos θ_i cos θ_o)) / π, with separate parameters for each channel.

    parameters: three numbers (r, g, b) for each name in PARAMETERS.
    """

    def __init__(self, name: str, parameters: Mapping[str, Sequence[float]]) -> None:
        self.name = name
        self._channels = [{key: parameters[key][channel] for key in PARAMETERS} for channel in range(3)]

    @property
    def mirrored(self) -> bool:
        return True

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        seen = Angles.of(wi, wo)
        r, g, b = (channel(q, seen) for q in self._channels)
        return r, g, b


@dataclass(frozen=True)
class Angles:
    """The angles of a pair of directions that the formula needs. cosines: cos θ_i cos θ_o."""

    cos_h: Array
    cos_d: Array
    theta_i: Array
    theta_o: Array
    cosines: Array

    @classmethod
    def of(cls, wi: Triple, wo: Triple) -> Angles:
        f = ops(wi[0])
        theta_h, theta_d, _ = half_diff(wi, wo)
        theta_i, theta_o = (f.atan2(f.sqrt(w[0] * w[0] + w[1] * w[1]), w[2]) for w in (wi, wo))
        return cls(f.cos(theta_h), f.cos(theta_d), theta_i, theta_o, f.maximum(wi[2] * wo[2], 1e-30))


def channel(q: Mapping[str, float], seen: Angles) -> Array:
    """f_r [1/sr] of one channel, whose parameters are `q`."""
    f = ops(seen.cos_h)

    def shadowing(theta: Array) -> Array:
        # c (θ - θ0)^k with c inside the power, since the published values of c go up to 1e66.
        beyond = f.power(q["c"] ** (1.0 / q["k"]) * f.maximum(theta - q["theta0"], 0.0), q["k"])
        return f.minimum(f.maximum(1.0 + q["lambda"] * (1.0 - f.exp(f.minimum(beyond, 80.0))), 0.0), 1.0)

    cos2 = seen.cos_h * seen.cos_h
    a = q["alpha"] + (1.0 - cos2) / cos2 / q["alpha"]
    distribution = q["kappa"] * f.exp(-a) / (PI * f.power(a, q["p"]) * cos2 * cos2)
    away = 1.0 - seen.cos_d
    fresnel = q["f0"] - q["f1"] * seen.cos_d + (1.0 - q["f0"]) * (away * away) * (away * away) * away
    specular = q["rho_s"] * distribution * fresnel * shadowing(seen.theta_i) * shadowing(seen.theta_o) / seen.cosines
    return f.maximum(q["rho_d"] + specular, 0.0) / PI
