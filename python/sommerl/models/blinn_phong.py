"""Blinn 1977, "Models of Light Reflection for Computer Synthesized Pictures", SIGGRAPH: a cosine power of θ_h.

The factor makes the albedo 1 for wo along the normal, where it is largest (derived in Giesen 2009, "Phong Normalization
Factor derivation").
"""

from __future__ import annotations

import math

from ..reflectance.arrays import Array, ops
from .family import PI, Angles, Family, Parameter, cosine_power


def lobe(a: Angles, n: Array) -> Array:
    """f_r [1/sr] = (n + 2) (n + 4) / (8π (2^(−n/2) + n)) cosⁿ θ_h."""
    factor = (n + 2.0) * (n + 4.0) / (8.0 * PI * (ops(n).exp(-0.5 * math.log(2) * n) + n))
    return factor * cosine_power(a.cos_h, n)


def exponent(n: float) -> float:
    return n


BLINN_PHONG = Family(
    name="blinn-phong",
    source="Blinn 1977, Models of Light Reflection for Computer Synthesized Pictures, SIGGRAPH",
    parameters=(Parameter("n", 1.0, 1e5, 100.0, "logarithmic"),),
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent,
)
