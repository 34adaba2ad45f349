"""Ward 1992, "Measuring and Modeling Anisotropic Reflection", SIGGRAPH: a Gaussian of tan θ_h. The isotropic form.

Its albedo falls towards grazing angles, but just above the horizon it grows without bound, as 1 / √cos θ_o. For α =
0.5, it reflects more light than arrives beyond 89.8°; for narrower lobes, only still closer to the horizon.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, ops
from .family import PI, Angles, Family, Parameter, exponent_of_width

ALPHA = Parameter("alpha", 0.004, 1.0, 0.15, "logarithmic")  # the standard deviation of the surface's slope


def gaussian(a: Angles, alpha: Array) -> Array:
    """exp(−tan² θ_h / α²) / (4π α²) [1/sr]."""
    alpha2 = alpha * alpha
    return ops(a.cos_i).exp(-a.tan2_h / alpha2) / (4.0 * PI * alpha2)


def lobe(a: Angles, alpha: Array) -> Array:
    """f_r [1/sr]: Eq. 4."""
    return gaussian(a, alpha) / ops(a.cos_i).sqrt(a.cos_i * a.cos_o)


WARD = Family(
    name="ward",
    source="Ward 1992, Measuring and Modeling Anisotropic Reflection, SIGGRAPH, Eq. 4",
    parameters=(ALPHA,),
    lobe=lobe,
    conserves_energy=False,
    exponent=exponent_of_width,
)
