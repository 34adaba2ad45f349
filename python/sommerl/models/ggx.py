"""A rough surface of GGX microfacets, the model that most renderers use.

D: Walter, Marschner, Li & Torrance 2007, "Microfacet Models for Refraction through Rough Surfaces", EGSR, Eq. 33.
G: Heitz 2014, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), Eq. 72 and 99.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import PI, Angles, Family, Parameter, exponent_of_width
from .microfacets import F0, fresnel


def distribution(a: Angles, alpha: Array) -> Array:
    """D [1/sr], the density of the microfacets' normals: ∫ D cos θ_h dω_h = 1."""
    # Not 1 - cos², which would lose precision in the highlight.
    cosine = alpha * a.cos_h
    width = cosine * cosine + a.sin_h * a.sin_h
    return (alpha * alpha / PI) / (width * width)


def visibility(a: Angles, alpha: Array) -> Array:
    """G / (4 cos θ_i cos θ_o), with Smith's masking and shadowing correlated by height."""
    f, alpha2 = ops(a.cos_i), alpha * alpha

    def slanted(cosine: Array) -> Array:
        return f.sqrt(alpha2 + (1.0 - alpha2) * (cosine * cosine))

    return 0.5 / (a.cos_o * slanted(a.cos_i) + a.cos_i * slanted(a.cos_o))


def separable_visibility(a: Angles, alpha: Array) -> Array:
    """The same, with masking and shadowing independent of each other: the product of two of Heitz's Eq. 43."""
    f, alpha2 = ops(a.cos_i), alpha * alpha

    def unmasked(cosine: Array) -> Array:
        return cosine + f.sqrt(alpha2 + (1.0 - alpha2) * (cosine * cosine))

    return 1.0 / (unmasked(a.cos_i) * unmasked(a.cos_o))


def lobe(a: Angles, alpha: Array, f0: Array) -> Array:
    """f_r [1/sr] = D F G / (4 cos θ_i cos θ_o)."""
    return distribution(a, alpha) * visibility(a, alpha) * fresnel(a.cos_d, f0)


GGX = Family(
    name="ggx",
    source="Walter, Marschner, Li & Torrance 2007, Microfacet Models for Refraction through Rough Surfaces, EGSR",
    parameters=(Parameter("alpha", 0.002, 1.0, 0.15, "logarithmic"), F0),
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent_of_width,
)
