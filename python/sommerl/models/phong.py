"""Phong's lobe about the mirror direction, in the form that is reciprocal and conserves energy.

Phong 1975, "Illumination for Computer Generated Pictures", Communications of the ACM 18(6), gives the reflected light,
not a BRDF. Divided by cos θ_i, it would be a BRDF that is neither reciprocal nor bounded. Lafortune & Willems 1994,
"Using the Modified Phong Reflectance Model for Physically Based Rendering", KU Leuven CW 197, Eq. 3, leave the cosine
out and normalise the lobe.
"""

from __future__ import annotations

from ..reflectance.arrays import Array
from .family import TWO_PI, Angles, Family, Parameter, cosine_power


def lobe(a: Angles, n: Array) -> Array:
    """f_r [1/sr] = (n + 2) / 2π cosⁿ α, α the angle between wi and the mirror direction of wo."""
    return (n + 2.0) / TWO_PI * cosine_power(a.cos_i * a.cos_o - a.along, n)


def exponent(n: float) -> float:
    """Near the normal, α = 2 θ_h."""
    return 4.0 * n


PHONG = Family(
    name="phong",
    source="Lafortune & Willems 1994, Using the Modified Phong Reflectance Model, KU Leuven CW 197, Eq. 3",
    parameters=(Parameter("n", 1.0, 1e5, 30.0, "logarithmic"),),
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent,
)
