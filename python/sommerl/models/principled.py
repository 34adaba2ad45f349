"""Disney's principled model, for opaque, isotropic materials, as Mitsuba's `principled` has it.

Burley 2012, "Physically-Based Shading at Disney", and 2015, "Extending the Disney BRDF to a BSDF with Integrated
Subsurface Scattering" (both in SIGGRAPH courses). As there, microfacets that scatter more than once lose light.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, Triple, ops
from . import ggx
from .family import PI, Angles
from .microfacets import fresnel
from .standard import Input, SurfaceModel, Values, dielectric, fifth, mix

LUMINANCE = (0.212671, 0.715160, 0.072169)
COAT = 0.04  # of a clear coat at normal incidence
WIDTHS = 0.1, 0.001  # of a clear coat of gloss 0, and of gloss 1
MASKED = 0.25  # the roughness α by which a clear coat masks


def f_r(a: Angles, v: Values) -> Triple:
    """f_r [1/sr]."""
    f = ops(a.cos_i)
    base, metallic, roughness = v["base_color"], v["metallic"], v["roughness"]
    alpha = f.maximum(roughness * roughness, 0.001)
    facets = ggx.distribution(a, alpha) * ggx.separable_visibility(a, alpha)
    root = f.sqrt(0.08 * v["specular"])
    clear = dielectric(a.cos_d, (1.0 + root) / (1.0 - root))
    away_d, away_i, away_o = (fifth(1.0 - cosine) for cosine in (a.cos_d, a.cos_i, a.cos_o))
    luminance = sum(weight * channel for weight, channel in zip(LUMINANCE, base, strict=True))

    width2 = mix(*WIDTHS, v["clearcoat_gloss"])
    width2 = width2 * width2
    rough = a.sin_h * a.sin_h + width2 * (a.cos_h * a.cos_h)
    narrow = (width2 - 1.0) / (PI * f.log(width2) * rough)
    coat = 0.25 * v["clearcoat"] * fresnel(a.cos_d, COAT) * narrow * _masked(a.cos_i) * _masked(a.cos_o)

    back = 2.0 * roughness * a.cos_d * a.cos_d
    matte = (1.0 - 0.5 * away_i) * (1.0 - 0.5 * away_o) + back * (away_i + away_o + away_i * away_o * (back - 1.0))
    colour: list[Array] = []
    for k in range(3):
        tint = f.where(luminance > 0.0, base[k] / f.where(luminance > 0.0, luminance, 1.0), 1.0)
        tinted = tint * root * root
        gloss = (1.0 - metallic) * mix(clear, fresnel(a.cos_d, tinted), v["spec_tint"])
        gloss = gloss + metallic * fresnel(a.cos_d, base[k])
        sheen = v["sheen"] * away_d * mix(1.0, tint, v["sheen_tint"])
        colour.append(facets * gloss + coat + (1.0 - metallic) * (base[k] * matte / PI + sheen))
    return colour[0], colour[1], colour[2]


def _masked(cosine: Array) -> Array:
    """Smith's masking of a clear coat."""
    f, cosine2 = ops(cosine), cosine * cosine
    return 2.0 * cosine / (cosine + f.sqrt(cosine2 + MASKED * MASKED * (1.0 - cosine2)))


PRINCIPLED = SurfaceModel(
    name="principled",
    source="Burley 2015, Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering, SIGGRAPH course",
    inputs=(
        Input("base_color", 0.0, 1.0, 0.3, colour=True),
        Input("metallic", 0.0, 1.0, 0.2),
        Input("roughness", 0.045, 1.0, 0.35, "logarithmic"),
        Input("specular", 0.0, 1.0, 0.5),
        Input("spec_tint", 0.0, 1.0, 0.1),
        Input("sheen", 0.0, 1.0, 0.05),
        Input("sheen_tint", 0.0, 1.0, 0.5),
        Input("clearcoat", 0.0, 1.0, 0.1),
        Input("clearcoat_gloss", 0.0, 1.0, 0.5),
    ),
    f_r=f_r,
    reciprocal=True,
)
