"""Cook & Torrance 1982, "A Reflectance Model for Computer Graphics", ACM Transactions on Graphics 1(1).

Two things differ from the paper. F is Schlick's approximation, as in the fits of Ngan, Durand & Matusik 2005,
"Experimental Analysis of BRDF Models", EGSR. The denominator has 4 where π is printed, which is correct for a
normalised distribution of facets (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", EGSR).
"""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import PI, Angles, Family, exponent_of_width
from .microfacets import F0, SLOPE, fresnel, grooves


def beckmann(a: Angles, m: Array) -> Array:
    """D [1/sr] = exp(−tan² θ_h / m²) / (π m² cos⁴ θ_h)."""
    m2, cos2 = m * m, a.cos_h * a.cos_h
    return ops(a.cos_i).exp(-a.tan2_h / m2) / (PI * m2 * cos2 * cos2)


def lobe(a: Angles, m: Array, f0: Array) -> Array:
    """f_r [1/sr] = D F G / (4 cos θ_i cos θ_o)."""
    return beckmann(a, m) * fresnel(a.cos_d, f0) * grooves(a) / (4.0 * a.cos_i * a.cos_o)


COOK_TORRANCE = Family(
    name="cook-torrance",
    source="Cook & Torrance 1982, A Reflectance Model for Computer Graphics, ACM Transactions on Graphics 1(1)",
    parameters=(SLOPE, F0),
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent_of_width,
)
