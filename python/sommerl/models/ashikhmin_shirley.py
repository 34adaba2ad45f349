"""Ashikhmin & Shirley 2000, "An Anisotropic Phong BRDF Model", Journal of Graphics Tools 5(2): the specular term, with
one exponent for both directions of the surface.

Their diffuse term, which reflects what the specular one leaves, is replaced by a Lambertian lobe in fits (Kurt &
Cinsdikici 2008, after Ngan, Durand & Matusik 2005).
"""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import PI, Angles, Family, Parameter, cosine_power
from .microfacets import F0, fresnel


def lobe(a: Angles, n: Array, f0: Array) -> Array:
    """f_r [1/sr] = (n + 1) / 8π cosⁿ θ_h F / (cos θ_d max(cos θ_i, cos θ_o)): Eq. 4 with n_u = n_v."""
    width = a.cos_d * ops(a.cos_i).maximum(a.cos_i, a.cos_o)
    return (n + 1.0) / (8.0 * PI) * cosine_power(a.cos_h, n) * fresnel(a.cos_d, f0) / width


def exponent(n: float, f0: float) -> float:
    return n


ASHIKHMIN_SHIRLEY = Family(
    name="ashikhmin-shirley",
    source="Ashikhmin & Shirley 2000, An Anisotropic Phong BRDF Model, Journal of Graphics Tools 5(2), Eq. 4",
    parameters=(Parameter("n", 1.0, 1e5, 100.0, "logarithmic"), F0),
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent,
)
