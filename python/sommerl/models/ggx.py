"""A Lambertian base under a rough surface of GGX microfacets: what renderers' own materials are made of.

D: Walter, Marschner, Li & Torrance 2007, "Microfacet Models for Refraction through Rough Surfaces", EGSR, Eq. 33.
G: Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), Eq. 72 and 99.
F: Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering", Computer Graphics Forum 13(3).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..arrays import Array, Triple, ops
from ..brdf import Brdf, Buffers
from ..half_diff import TWO_PI, half_diff

PI = TWO_PI / 2


class Ggx(Brdf):
    """f_r = albedo / π + D G F / (4 cos θ_i cos θ_o).

    albedo, f0: three numbers (r, g, b) each: of the base, and the mirror's reflectance along its normal. The two are
        added: together they may reflect more than comes in.
    alpha: the roughness, above 0, the same for all channels.
    """

    def __init__(self, name: str, albedo: Sequence[float], f0: Sequence[float], alpha: float) -> None:
        self.name = name
        self._albedo, self._f0, self._alpha = tuple(map(float, albedo)), tuple(map(float, f0)), float(alpha)

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        theta_h, theta_d, _ = half_diff(wi, wo)
        facets = distribution(self._alpha, theta_h) * visibility(self._alpha, wi[2], wo[2])
        r, g, b = (
            albedo / PI + facets * fresnel(f0, theta_d) for albedo, f0 in zip(self._albedo, self._f0, strict=True)
        )
        return r, g, b


def distribution(alpha: float, theta_h: Array) -> Array:
    """D [1/sr], the density of the microfacets' normals: ∫ D cos θ_h dω_h = 1."""
    f = ops(theta_h)
    # No 1 - cos²: it would lose the digits that matter in the highlight.
    cosine, sine = alpha * f.cos(theta_h), f.sin(theta_h)
    width = cosine * cosine + sine * sine
    return (alpha * alpha / PI) / (width * width)


def visibility(alpha: float, cos_i: Array, cos_o: Array) -> Array:
    """G / (4 cos θ_i cos θ_o), with Smith's masking and shadowing correlated by height."""
    f = ops(cos_i)

    def slanted(cosine: Array) -> Array:
        return f.sqrt(alpha * alpha + (1.0 - alpha * alpha) * (cosine * cosine))

    return 0.5 / (cos_o * slanted(cos_i) + cos_i * slanted(cos_o))


def fresnel(f0: float, theta_d: Array) -> Array:
    """F: Schlick's approximation."""
    away = 1.0 - ops(theta_d).cos(theta_d)
    return f0 + (1.0 - f0) * ((away * away) * (away * away) * away)
