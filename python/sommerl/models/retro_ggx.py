"""A retro-reflective lobe: GGX microfacets that send light back to where it came from, as tapes and road signs do.

The viewer is mirrored about the normal before the half vector is formed: the back vector of Belcour, Pacanowski,
Delahaie, Laville-Geay & Eupherte 2014, "Bidirectional Reflectance Distribution Function Measurements and Analysis of
Retroreflective Materials", JOSA A 31(12); the retroreflective mode of MaterialX's GGX nodes does the same. The albedo
is that of GGX.
"""

from __future__ import annotations

from ..reflectance.arrays import Array
from . import ggx
from .family import Angles, Family, exponent_of_width


def mirrored(a: Angles) -> Angles:
    """The same pair, with the viewer mirrored about the normal."""
    return Angles(a.wi, (-a.wo[0], -a.wo[1], a.wo[2]))


def lobe(a: Angles, alpha: Array, f0: Array) -> Array:
    """f_r [1/sr] = D F G / (4 cos θ_i cos θ_o) of the mirrored viewer."""
    return ggx.lobe(mirrored(a), alpha, f0)


RETRO_GGX = Family(
    name="retro-ggx",
    source="Belcour, Pacanowski, Delahaie, Laville-Geay & Eupherte 2014, Bidirectional Reflectance "
    "Distribution Function Measurements and Analysis of Retroreflective Materials, JOSA A 31(12)",
    parameters=ggx.GGX.parameters,
    lobe=lobe,
    conserves_energy=True,
    exponent=exponent_of_width,
)
