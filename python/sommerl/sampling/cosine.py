"""Cosine-weighted directions: the sampler that knows nothing of the material."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array, Triple, ops
from ..brdf import Brdf, Buffers
from ..half_diff import TWO_PI
from .sampler import PI, Sampler


def cosine_weighted(u: Array, v: Array) -> Triple:
    """A direction of density cos θ / π for uniform random numbers in [0, 1)."""
    f = ops(u)
    sin, z = f.sqrt(u), f.sqrt(1.0 - u)
    return sin * f.cos(TWO_PI * v), sin * f.sin(TWO_PI * v), z


@dataclass(frozen=True)
class CosineSampler(Sampler):
    """Directions of density cos θ_i / π."""

    brdf: Brdf
    name = "cosine"

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        wi = cosine_weighted(u[1], u[2])
        return wi, self.density(wi, wo, buffers)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        return ops(wi[0]).where((wi[2] > 0.0) & (wo[2] > 0.0), wi[2] / PI, 0.0)
