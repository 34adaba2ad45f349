"""Lafortune, Foo, Torrance & Greenberg 1997, "Non-Linear Approximation of Reflectance Functions", SIGGRAPH, Eq. 6.

The isotropic lobe is [C_xy (x_i x_o + y_i y_o) + C_z z_i z_o]ⁿ. A factor common to C_xy and C_z only changes the
albedo, so C_z = 1 here, and the lobe is divided by the larger of |C_xy| and 1. C_xy = −1 is Phong's lobe; below −1, the
lobe is shifted towards grazing angles; above 0, it is retroreflective.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import TWO_PI, Angles, Family, Parameter, cosine_power


def lobe(a: Angles, c_xy: Array, n: Array) -> Array:
    """f_r [1/sr] = (n + 2) / 2π [(C_xy (x_i x_o + y_i y_o) + z_i z_o) / max(|C_xy|, 1)]ⁿ."""
    f = ops(a.cos_i)
    largest = f.maximum(f.maximum(c_xy, -c_xy), 1.0)
    return (n + 2.0) / TWO_PI * cosine_power((c_xy * a.along + a.cos_i * a.cos_o) / largest, n)


def exponent(c_xy: float, n: float) -> float:
    """As for Phong's lobe. For C_xy far from −1, sampling is less efficient."""
    return 4.0 * n


LAFORTUNE = Family(
    name="lafortune",
    source="Lafortune, Foo, Torrance & Greenberg 1997, Non-Linear Approximation of Reflectance Functions, SIGGRAPH",
    parameters=(Parameter("c_xy", -2.0, 2.0, -1.0), Parameter("n", 1.0, 1e5, 30.0, "logarithmic")),
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent,
)
