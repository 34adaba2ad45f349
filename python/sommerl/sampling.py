"""Importance samplers: each draws a direction to the light for a direction to the viewer, and gives its density.

Formulas run on NumPy and on Dr.Jit arrays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Triple, ops
from .brdf import Brdf
from .half_diff import TWO_PI, directions

PI = TWO_PI / 2
SHARPEST = 1e4  # exponents beyond this lose their digits in single precision


@dataclass(frozen=True)
class BlinnPhongSampler:
    """Cosine-weighted directions mixed with those of half vectors from Blinn-Phong's lobe: the paper's sampler (§6).

    exponent: n of the density (n + 1) / 2π · cosⁿ θ_h of half vectors.
    specular: the probability of drawing from that lobe and not from the cosine.
    Either may be a Dr.Jit number.
    """

    exponent: Array
    specular: Array

    @classmethod
    def fitted(cls, brdf: Brdf) -> BlinnPhongSampler:
        """The sampler whose lobe holds half of the highlight's light within the angle that the material's does."""
        theta_h = np.linspace(0.0, 1.4, 1401) ** 2 / 1.4
        wi, wo = directions(theta_h, np.full_like(theta_h, PI / 8), np.full_like(theta_h, PI / 2))
        f_r = brdf.eval(np.stack(wi, -1), np.stack(wo, -1)).mean(axis=-1)
        base = f_r.min()
        light = (f_r - base) * np.sin(2 * theta_h) * np.gradient(theta_h)
        if light.sum() <= 1e-6 * base:  # no highlight: what looks like one is rounding
            return cls(1.0, 0.1)
        half = theta_h[np.searchsorted(np.cumsum(light), light.sum() / 2)]
        exponent = min(SHARPEST, max(1.0, math.log(0.5) / math.log(math.cos(max(half, 1e-3))) - 1))
        # A half vector's solid angle maps to one about four times as large around the light's direction.
        lobe = 4 * PI * light.sum()
        return cls(exponent, min(0.9, max(0.1, float(lobe / (lobe + PI * base + 1e-9)))))

    def sample(self, wo: Triple, u: Triple) -> tuple[Triple, Array]:
        """A direction wi for uniform random numbers u in [0, 1)³, and its density [1/sr].

        Where wi comes out below the horizon, the density is 0.
        """
        f = ops(wo[0])
        glossy = u[0] < self.specular
        cos_h = f.where(glossy, f.power(u[1], 1.0 / (self.exponent + 1.0)), f.sqrt(1.0 - u[1]))
        sin_h = f.sqrt(f.maximum(1.0 - cos_h * cos_h, 0.0))
        x, y, z = sin_h * f.cos(TWO_PI * u[2]), sin_h * f.sin(TWO_PI * u[2]), cos_h
        twice = 2.0 * (x * wo[0] + y * wo[1] + z * wo[2])
        mirrored = twice * x - wo[0], twice * y - wo[1], twice * z - wo[2]
        wi = (
            f.where(glossy, mirrored[0], x),
            f.where(glossy, mirrored[1], y),
            f.where(glossy, mirrored[2], z),
        )
        return wi, self.pdf(wi, wo)

    def pdf(self, wi: Triple, wo: Triple) -> Array:
        """Density [1/sr] of drawing wi for wo; 0 where either is below the horizon."""
        f = ops(wi[0])
        h = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
        length = f.sqrt((h[0] * h[0] + h[1] * h[1]) + h[2] * h[2])
        above = (wi[2] > 0.0) & (wo[2] > 0.0)
        length = f.where(above, length, 1.0)
        cos_h = f.where(above, h[2], 1.0) / length
        cos_d = (h[0] * wo[0] + h[1] * wo[1] + h[2] * wo[2]) / length
        lobe = (self.exponent + 1.0) / TWO_PI * f.power(cos_h, self.exponent)
        # dω_h = dω_i / (4 cos θ_d)
        glossy = lobe / (4.0 * f.where(above, cos_d, 1.0))
        return f.where(above, self.specular * glossy + (1.0 - self.specular) * (wi[2] / PI), 0.0)
