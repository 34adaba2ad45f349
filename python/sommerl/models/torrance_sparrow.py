"""Torrance & Sparrow 1967, "Theory for Off-Specular Reflection from Roughened Surfaces", JOSA 57(9).

The facets' angles to the normal have a Gaussian distribution. Blinn 1977 brought the model to graphics. F is Schlick's
approximation. The factor 1 / (π m²) normalises D only for small m. For larger ones ∫ D cos θ_h dω_h is less than 1:
0.94 for m = 0.3, 0.85 for 0.5, 0.55 for 1.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import PI, Angles, Family, exponent_of_width
from .microfacets import F0, SLOPE, fresnel, grooves


def gaussian(a: Angles, m: Array) -> Array:
    """D [1/sr] = exp(−(θ_h / m)²) / (π m²)."""
    m2 = m * m
    return ops(a.theta_h).exp(-(a.theta_h * a.theta_h) / m2) / (PI * m2)


def lobe(a: Angles, m: Array, f0: Array) -> Array:
    """f_r [1/sr] = D F G / (4 cos θ_i cos θ_o)."""
    return gaussian(a, m) * fresnel(a.cos_d, f0) * grooves(a) / (4.0 * a.cos_i * a.cos_o)


TORRANCE_SPARROW = Family(
    name="torrance-sparrow",
    source="Torrance & Sparrow 1967, Theory for Off-Specular Reflection from Roughened Surfaces, JOSA 57(9)",
    parameters=(SLOPE, F0),
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent_of_width,
)
