"""Oren & Nayar 1994, "Generalization of Lambert's Reflectance Model", SIGGRAPH: a surface of rough diffuse facets.

This is the approximation that they call "qualitative model" (Eq. 30), without interreflections. For σ below 0.326, it
reflects more light than arrives at grazing angles, by at most 1.5 %.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import PI, Angles, Family, Parameter


def lobe(a: Angles, sigma: Array) -> Array:
    """f_r [1/sr] = (A + B max(0, cos Δφ) sin α tan β) / π, α the larger of θ_i and θ_o, β the smaller.

    sigma: standard deviation of the facets' slope angles [rad].
    """
    f = ops(a.cos_i)
    sigma2 = sigma * sigma
    base = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    rough = 0.45 * sigma2 / (sigma2 + 0.09)
    # sin α tan β = sin θ_i sin θ_o / cos β, and cos β is the larger of both cosines.
    return (base + rough * (f.maximum(a.along, 0.0) / f.maximum(a.cos_i, a.cos_o))) / PI


OREN_NAYAR = Family(
    name="oren-nayar",
    source="Oren & Nayar 1994, Generalization of Lambert's Reflectance Model, SIGGRAPH, Eq. 30",
    parameters=(Parameter("sigma", 0.0, PI / 2, 0.3),),
    lobe=lobe,
    conserves_energy=False,
    exponent=None,
)
