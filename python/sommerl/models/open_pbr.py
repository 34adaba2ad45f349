"""OpenPBR: the surface model of the Academy Software Foundation, for opaque materials.

The standard: Andersson, Brinck, Langlands, Portsmouth et al., "OpenPBR Surface" 1.1, 2024. What it leaves to
implementations (how layers keep energy) is as in its reference implementation, in MaterialX 1.39.5: each specular lobe
is brightened by what single scattering loses (Turquin 2019, "Practical Multiple Scattering Compensation for Microfacet
Models"), and what lies below a layer is darkened by the layer's directional albedo for the viewer. The layers are fuzz
over coat over a mixture of metal and of a dielectric over a diffuse base. Transmission, subsurface scattering, thin
films, emission and anisotropy have the weight 0.
"""

from __future__ import annotations

from ..reflectance.arrays import Array, Triple, ops
from . import ggx
from .family import PI, Angles
from .standard import Input, SurfaceModel, Values, at_normal, dielectric, fifth, mix

SMALLEST_ROUGHNESS = 0.045  # α = 0.002
SMALLEST = 1e-6
# MaterialX's fit of the directional albedo of GGX with Schlick's Fresnel term, A F0 + B F90: numerators of A and of B,
# and denominators, of the terms 1, x, y, xy, x², y², x²y, xy², x²y² for x = cos θ and y = α.
ALBEDO = (
    (0.1003, -0.6303, 9.748, -2.038, 29.34, -8.245, -26.44, 19.99, -5.448),
    (0.9345, -2.323, 2.229, -3.748, 1.424, -0.7684, 1.436, 0.2913, 0.6286),
    (1.0, -1.765, 8.263, 11.53, 28.96, -7.507, -36.11, 15.86, 33.37),
    (1.0, 0.2281, 15.94, -55.83, 13.08, 41.26, 54.9, 300.2, -285.1),
)
# Fujii's variant of Oren & Nayar's model, as the standard gives it.
SINGLE, AVERAGE = 0.5 - 2.0 / (3.0 * PI), 2.0 / 3.0 - 28.0 / (15.0 * PI)
EDGE = 1.0 / 7.0  # cos 82°, where `specular_color` is a metal's reflectance
OF_EDGE = EDGE * (1.0 - EDGE) ** 6


def f_r(a: Angles, v: Values) -> Triple:
    """f_r [1/sr]."""
    base, edge, coat = v["base_color"], v["specular_color"], v["coat_weight"]
    cosine, roughness = a.cos_o, roughness_below(v)
    alpha, metalness = roughness * roughness, v["base_metalness"]
    shape = ggx.distribution(a, alpha) * ggx.visibility(a, alpha)
    whole = albedo(cosine, alpha, 1.0)  # of GGX without Fresnel's losses
    lost = (1.0 - whole) / whole

    eta = _seen_through(v)
    mirrored = dielectric(a.cos_d, eta)
    brighter = 1.0 + mirrored * lost
    gloss = shape * mirrored * brighter
    through = 1.0 - albedo(cosine, alpha, at_normal(eta)) * brighter

    alpha_c = v["coat_roughness"] * v["coat_roughness"]
    f0_c = at_normal(v["coat_ior"])
    whole_c = albedo(cosine, alpha_c, 1.0)
    mirrored_c = dielectric(a.cos_d, v["coat_ior"])
    brighter_c = 1.0 + mirrored_c * (1.0 - whole_c) / whole_c
    over = coat * ggx.distribution(a, alpha_c) * ggx.visibility(a, alpha_c) * mirrored_c * brighter_c
    through_c = 1.0 - coat * albedo(cosine, alpha_c, f0_c) * brighter_c

    fuzz, through_f = _fuzz(a, v["fuzz_roughness"])
    away = 1.0 - a.cos_d
    colour: list[Array] = []
    for k in range(3):
        matte = diffuse(a, v["base_diffuse_roughness"], base[k])
        layered = gloss * edge[k] + through * matte
        near_edge = mix(base[k], 1.0, (1.0 - EDGE) ** 5) * (1.0 - edge[k]) / OF_EDGE
        reflected = mix(base[k], 1.0, fifth(away)) - near_edge * a.cos_d * fifth(away) * away
        metal = v["specular_weight"] * shape * reflected * (1.0 + reflected * lost)
        below = mix(layered, metal, metalness)
        tint = mix(1.0, v["coat_color"][k], coat)
        coated = over + through_c * darkening(v, k) * tint * below
        weight = v["fuzz_weight"]
        colour.append(weight * v["fuzz_color"][k] * fuzz + (1.0 - weight * through_f) * coated)
    return colour[0], colour[1], colour[2]


def roughness_below(v: Values) -> Array:
    """Of the highlight that is seen through the coat, which widens it: `specular_roughness` without one."""
    f = ops(v["specular_roughness"])
    under = f.sqrt(f.sqrt(f.minimum(2.0 * fourth(v["coat_roughness"]) + fourth(v["specular_roughness"]), 1.0)))
    return mix(v["specular_roughness"], under, v["coat_weight"])


def darkening(v: Values, channel: int) -> Array:
    """The share that the coat leaves of what lies below it, since it sends a part back, where it is absorbed."""
    inside = 1.0 - (1.0 - at_normal(v["coat_ior"])) / (v["coat_ior"] * v["coat_ior"])  # sent back, of even light
    sent_back = inside * v["base_color"][channel] * mix(1.0, v["specular_weight"], v["base_metalness"])
    return mix(1.0, (1.0 - inside) / (1.0 - sent_back), v["coat_weight"])


def fourth(x: Array) -> Array:
    return (x * x) * (x * x)


def albedo(cosine: Array, alpha: Array, f0: Array) -> Array:
    """The directional albedo of GGX with Schlick's Fresnel term from f0 to 1."""
    f = ops(cosine)
    x2, y2 = cosine * cosine, alpha * alpha
    terms = (1.0, cosine, alpha, cosine * alpha, x2, y2, x2 * alpha, cosine * y2, x2 * y2)
    a, b, under_a, under_b = (sum(c * term for c, term in zip(row, terms, strict=True)) for row in ALBEDO)
    first, second = (f.minimum(f.maximum(ratio, 0.0), 1.0) for ratio in (a / under_a, b / under_b))
    return f0 * first + second


def diffuse(a: Angles, roughness: Array, colour: Array) -> Array:
    """The energy-preserving Oren-Nayar lobe: single and multiple scattering."""
    f = ops(a.cos_i)
    scale = 1.0 / (1.0 + SINGLE * roughness)
    # s / t, of which t is the larger cosine where s is positive.
    slope = a.along / f.where(a.along > 0.0, f.maximum(a.cos_i, a.cos_o), 1.0)
    mean = scale * (1.0 + AVERAGE * roughness)
    missing = f.maximum(1.0 - mean, SMALLEST)
    several = colour * colour * mean / (1.0 - colour * f.maximum(1.0 - mean, 0.0))
    rest = [f.maximum(1.0 - _scattered(cosine, roughness, scale), SMALLEST) for cosine in (a.cos_i, a.cos_o)]
    return (colour * scale * (1.0 + roughness * slope) + several * rest[0] * rest[1] / missing) / PI


def _scattered(cosine: Array, roughness: Array, scale: Array) -> Array:
    """The directional albedo of single scattering."""
    f = ops(cosine)
    sine = f.sqrt(f.maximum(1.0 - cosine * cosine, 0.0))
    angle = f.atan2(sine, cosine)
    steep = sine / f.maximum(cosine, SMALLEST) * (1.0 - sine * sine * sine) - sine
    return scale * (1.0 + roughness * (sine * (angle - sine * cosine) + 2.0 / 3.0 * steep) / PI)


def _seen_through(v: Values) -> Array:
    """The index of refraction of the base, relative to the coat above it and scaled by `specular_weight`."""
    f = ops(v["specular_ior"])
    ratio = v["specular_ior"] / v["coat_ior"]
    eta = mix(v["specular_ior"], f.maximum(ratio, 1.0 / ratio), v["coat_weight"])
    root = f.sqrt(f.minimum(v["specular_weight"] * at_normal(eta), 0.99999))
    return (1.0 + root) / (1.0 - root)


def _fuzz(a: Angles, roughness: Array) -> tuple[Array, Array]:
    """A layer of fibres, and its directional albedo: Zeltner, Burley & Chiang 2022, "Practical Multiple-Scattering
    Sheen Using Linearly Transformed Cosines", with the rational fits of its tables in MaterialX."""
    f = ops(a.cos_i)
    x, y = a.cos_o, f.maximum(roughness, 0.01)
    width = y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y))
    middle = y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y)
    offset = y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y))
    away = (x - middle) / width
    reflected = f.exp(-0.5 * away * away) / (width * (2.0 * PI) ** 0.5) + offset
    across = (2.58126 * x + 0.813703 * y) * y / (1.0 + 0.310327 * x * x + 2.60994 * x * y)
    bent = f.sqrt(f.maximum(1.0 - x, 0.0)) * (y - 1.0) * y * y * y
    bent = bent / (0.0000254053 + 1.71228 * x - 1.71506 * x * y + 1.34174 * y * y)
    # wi in the frame whose first axis is the viewer's azimuth.
    sine_o = f.maximum(f.sqrt(f.maximum(1.0 - x * x, 0.0)), SMALLEST)
    along = a.along / sine_o
    sideways2 = f.maximum(1.0 - a.cos_i * a.cos_i - along * along, 0.0)
    forth = across * along + bent * a.cos_i
    length2 = forth * forth + across * across * sideways2 + a.cos_i * a.cos_i
    ratio = across / length2
    return reflected * ratio * ratio / PI, reflected


OPEN_PBR = SurfaceModel(
    name="openpbr",
    source="Andersson, Brinck, Langlands, Portsmouth et al. 2024, OpenPBR Surface 1.1; MaterialX 1.39.5",
    inputs=(
        Input("base_color", 0.0, 1.0, 0.3, colour=True),
        Input("base_diffuse_roughness", 0.0, 1.0, 0.2),
        Input("base_metalness", 0.0, 1.0, 0.2),
        Input("specular_weight", 0.0, 1.0, 0.9),
        Input("specular_color", 0.0, 1.0, 0.9, colour=True),
        Input("specular_roughness", SMALLEST_ROUGHNESS, 1.0, 0.35, "logarithmic"),
        Input("specular_ior", 1.0, 3.0, 1.5),
        Input("coat_weight", 0.0, 1.0, 0.1),
        Input("coat_color", 0.0, 1.0, 0.9, colour=True),
        Input("coat_roughness", SMALLEST_ROUGHNESS, 1.0, 0.15, "logarithmic"),
        Input("coat_ior", 1.0, 3.0, 1.6),
        Input("fuzz_weight", 0.0, 1.0, 0.05),
        Input("fuzz_color", 0.0, 1.0, 0.8, colour=True),
        Input("fuzz_roughness", 0.01, 1.0, 0.5),
    ),
    f_r=f_r,
    reciprocal=False,
)
