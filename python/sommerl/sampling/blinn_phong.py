"""The paper's sampler: half vectors from a Blinn-Phong lobe."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.half_diff import TWO_PI, directions
from .sampler import PI, Sampler

SHARPEST = 1e4  # exponents beyond this lose their digits in single precision


@dataclass(frozen=True)
class BlinnPhongSampler(Sampler):
    """A mixture of cosine-weighted directions and of half vectors from a Blinn-Phong lobe: the paper's sampler (§6).

    exponent: n of the density (n + 1) / 2π · cosⁿ θ_h of half vectors.
    specular: the probability of drawing from that lobe and not from the cosine.
    """

    brdf: Brdf
    exponent: float
    specular: float
    name = "blinn-phong"

    @classmethod
    def fitted(cls, brdf: Brdf) -> BlinnPhongSampler:
        """The sampler whose lobe has half of its light within the same θ_h as the material's highlight.

        The highlight is measured across the plane of incidence at θ_d = 22.5° (docs/sampling.md).
        """
        theta_h = np.linspace(0.0, 1.4, 1401) ** 2 / 1.4
        wi, wo = directions(theta_h, np.full_like(theta_h, PI / 8), np.full_like(theta_h, PI / 2))
        f_r = np.maximum(brdf.eval(np.stack(wi, -1), np.stack(wo, -1)).mean(axis=-1), 0.0)
        base = f_r.min()
        light = (f_r - base) * np.sin(2 * theta_h) * np.gradient(theta_h)
        if light.sum() <= 1e-6 * base:  # only rounding errors: there is no highlight
            return cls(brdf, 1.0, 0.1)
        half = theta_h[np.searchsorted(np.cumsum(light), light.sum() / 2)]
        exponent = min(SHARPEST, max(1.0, math.log(0.5) / math.log(math.cos(max(half, 1e-3))) - 1))
        # A half vector's solid angle maps to one about four times as large around the light's direction.
        lobe = 4 * PI * light.sum()
        return cls(brdf, exponent, min(0.9, max(0.1, float(lobe / (lobe + PI * base + 1e-9)))))

    def buffers(self) -> dict[str, NDArray[Any]]:
        return {"exponent": np.asarray(self.exponent), "specular": np.asarray(self.specular)}

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        f = ops(wo[0])
        exponent, specular = buffers["exponent"], buffers["specular"]
        glossy = u[0] < specular
        cos_h = f.where(glossy, f.power(u[1], 1.0 / (exponent + 1.0)), f.sqrt(1.0 - u[1]))
        sin_h = f.sqrt(f.maximum(1.0 - cos_h * cos_h, 0.0))
        x, y, z = sin_h * f.cos(TWO_PI * u[2]), sin_h * f.sin(TWO_PI * u[2]), cos_h
        twice = 2.0 * (x * wo[0] + y * wo[1] + z * wo[2])
        mirrored = twice * x - wo[0], twice * y - wo[1], twice * z - wo[2]
        wi = (
            f.where(glossy, mirrored[0], x),
            f.where(glossy, mirrored[1], y),
            f.where(glossy, mirrored[2], z),
        )
        return wi, self.density(wi, wo, buffers)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        f = ops(wi[0])
        exponent, specular = buffers["exponent"], buffers["specular"]
        h = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
        length = f.sqrt((h[0] * h[0] + h[1] * h[1]) + h[2] * h[2])
        above = (wi[2] > 0.0) & (wo[2] > 0.0)
        length = f.where(above, length, 1.0)
        cos_h = f.where(above, h[2], 1.0) / length
        lobe = (exponent + 1.0) / TWO_PI * f.power(cos_h, exponent)
        # dω_h = dω_i / (4 cos θ_d), with cos θ_d = |ω_i + ω_o| / 2, which cannot become negative by rounding.
        glossy = lobe / (2.0 * length)
        return f.where(above, specular * glossy + (1.0 - specular) * (wi[2] / PI), 0.0)
