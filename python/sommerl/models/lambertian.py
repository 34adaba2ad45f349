"""Lambert 1760, "Photometria": the same radiance in all directions."""

from __future__ import annotations

from ..reflectance.arrays import Array
from .family import PI, Angles, Family


def lobe(a: Angles) -> Array:
    """f_r [1/sr] = 1 / π."""
    return 0.0 * a.cos_i + 1.0 / PI


LAMBERTIAN = Family(
    name="lambertian",
    source="Lambert 1760, Photometria",
    parameters=(),
    lobe=lobe,
    conserves_energy=True,
    exponent=None,
)
