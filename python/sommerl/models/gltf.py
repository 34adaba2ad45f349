"""glTF's metallic-roughness material with the extensions for specular reflection, clear coat and sheen.

Khronos Group, "glTF 2.0 Specification", Appendix B, and KHR_materials_specular, KHR_materials_clearcoat and
KHR_materials_sheen, the latter with its simpler visibility (Neubelt & Pettineo 2013). As there, microfacets that
scatter more than once lose light.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, Triple, ops
from . import ggx
from .family import PI, Angles
from .microfacets import fresnel
from .standard import Input, SurfaceModel, Values, mix

F0 = 0.04  # of a dielectric whose index of refraction is 1.5
# MaterialX's fit of the directional albedo of this sheen: numerators and denominators of the terms 1, x, y, xy, x², y²
# for x = cos θ and y = α.
SHEEN_ALBEDO = (
    (13.67300, -68.78018, 799.08825, -905.00061, 60.28956, 1086.96473),
    (1.0, 61.57746, 442.78211, 2597.49308, 121.81241, 3045.55075),
)


def f_r(a: Angles, v: Values) -> Triple:
    """f_r [1/sr]."""
    f = ops(a.cos_i)
    base, metallic, specular = v["baseColorFactor"], v["metallicFactor"], v["specularFactor"]
    facets = _facets(a, v["roughnessFactor"])
    reflected = [fresnel(a.cos_d, f.minimum(F0 * channel, 1.0)) for channel in v["specularColorFactor"]]
    below = 1.0 - specular * _largest(reflected)

    fibres, dimming = sheen(a, v["sheenRoughnessFactor"])
    under_sheen = 1.0 - dimming * _largest(v["sheenColorFactor"])
    coat = v["clearcoatFactor"] * fresnel(a.cos_o, F0)
    facets_c = _facets(a, v["clearcoatRoughnessFactor"])
    colour: list[Array] = []
    for k in range(3):
        plastic = below * base[k] / PI + specular * reflected[k] * facets
        metal = facets * fresnel(a.cos_d, base[k])
        material = v["sheenColorFactor"][k] * fibres + under_sheen * mix(plastic, metal, metallic)
        colour.append(mix(material, facets_c, coat))
    return colour[0], colour[1], colour[2]


def _facets(a: Angles, roughness: Array) -> Array:
    """D G / (4 cos θ_i cos θ_o) of GGX."""
    alpha = roughness * roughness
    return ggx.distribution(a, alpha) * ggx.separable_visibility(a, alpha)


def _largest(colour: tuple[Array, ...] | list[Array]) -> Array:
    f = ops(colour[0])
    return f.maximum(f.maximum(colour[0], colour[1]), colour[2])


def sheen(a: Angles, roughness: Array) -> tuple[Array, Array]:
    """Estevez & Kulla's sheen, and its directional albedo."""
    f, alpha = ops(a.cos_i), roughness * roughness
    lobe = (2.0 + 1.0 / alpha) * f.power(a.sin_h, 1.0 / alpha) / (2.0 * PI)
    visible = 0.25 / (a.cos_i + a.cos_o - a.cos_i * a.cos_o)
    x, y = a.cos_o, alpha
    terms = (1.0, x, y, x * y, x * x, y * y)
    over, under = (sum(c * term for c, term in zip(row, terms, strict=True)) for row in SHEEN_ALBEDO)
    return lobe * visible, f.minimum(f.maximum(over / under, 0.0), 1.0)


GLTF = SurfaceModel(
    name="gltf",
    source="Khronos Group, glTF 2.0 Specification, Appendix B; KHR_materials_specular, _clearcoat and _sheen",
    inputs=(
        Input("baseColorFactor", 0.0, 1.0, 0.3, colour=True),
        Input("metallicFactor", 0.0, 1.0, 0.2),
        Input("roughnessFactor", 0.045, 1.0, 0.35, "logarithmic"),
        Input("specularFactor", 0.0, 1.0, 0.9),
        Input("specularColorFactor", 0.0, 25.0, 1.0, colour=True),
        Input("clearcoatFactor", 0.0, 1.0, 0.1),
        Input("clearcoatRoughnessFactor", 0.045, 1.0, 0.15, "logarithmic"),
        Input("sheenColorFactor", 0.0, 1.0, 0.05, colour=True),
        Input("sheenRoughnessFactor", 0.1, 1.0, 0.5),
    ),
    f_r=f_r,
    reciprocal=False,
)
