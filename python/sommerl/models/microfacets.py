"""What microfacet models share: f_r = D F G / (4 cos θ_i cos θ_o), with ∫ D cos θ_h dω_h = 1."""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import Angles, Parameter

SLOPE = Parameter("m", 0.004, 1.0, 0.15, "logarithmic")  # the root mean square slope of the facets
F0 = Parameter("f0", 0.0, 1.0, 0.1)  # the reflectance of a facet at normal incidence


def fresnel(cos_d: Array, f0: Array) -> Array:
    """F: the approximation of Schlick 1994, "An Inexpensive BRDF Model for Physically-based Rendering", CGF 13(3)."""
    away = 1.0 - cos_d
    return f0 + (1.0 - f0) * ((away * away) * (away * away) * away)


def grooves(a: Angles) -> Array:
    """G: masking and shadowing in V-shaped grooves (Torrance & Sparrow 1967; as Blinn 1977 writes it)."""
    f = ops(a.cos_i)
    return f.minimum(2.0 * a.cos_h * f.minimum(a.cos_i, a.cos_o) / a.cos_d, 1.0)
