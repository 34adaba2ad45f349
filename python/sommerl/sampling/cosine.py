"""Cosine-weighted directions: the sampler that does not depend on the material."""

from __future__ import annotations

from dataclasses import dataclass

from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.half_diff import TWO_PI
from .sampler import PI, Sampler


@dataclass(frozen=True)
class CosineSampler(Sampler):
    """Draws directions with the density cos θ_i / π."""

    brdf: Brdf
    name = "cosine"

    @classmethod
    def fitted(cls, brdf: Brdf) -> CosineSampler:
        return cls(brdf)

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        f = ops(wo[0])
        sin = f.sqrt(u[1])
        wi = sin * f.cos(TWO_PI * u[2]), sin * f.sin(TWO_PI * u[2]), f.sqrt(1.0 - u[1])
        return wi, self.density(wi, wo, buffers)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        return ops(wi[0]).where((wi[2] > 0.0) & (wo[2] > 0.0), wi[2] / PI, 0.0)
