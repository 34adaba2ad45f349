"""Surface models of standards, against what others make of the same inputs."""

import math

import numpy as np
import pytest
from helpers import must_fail, random_directions
from material_x import drawn, read

from sommerl.formats import standard_files
from sommerl.models import gltf
from sommerl.models.family import Angles
from sommerl.models.standard import Surface
from sommerl.models.standards import STANDARDS
from sommerl.render.llvm import mitsuba
from sommerl.system.errors import MaterialError

OPEN_PBR, PRINCIPLED, GLTF = (STANDARDS[name] for name in ("openpbr", "principled", "gltf"))
WI, WO = random_directions(300, 1), random_directions(300, 2)
SEEDS = range(4)


def material(model, seed, **fixed):
    """Random inputs, away from the narrowest highlights, of which random pairs see nothing."""
    random = np.random.default_rng([seed, len(model.name)])
    numbers = []
    for chosen in model.places:
        low = max(chosen.low, 0.15) if "oughness" in chosen.name else chosen.low
        numbers.append(random.uniform(low, min(chosen.high, 4.0)))
    return Surface("made", model, model.by_name(numbers) | fixed)


def changed(surface, name):
    """The same, but for one input."""
    value = np.clip(np.multiply(surface.values[name], 0.9), *_bounds(surface, name))
    return Surface("changed", surface.model, surface.values | {name: value.tolist()})


def _bounds(surface, name):
    return surface.model.by_key[name].low, surface.model.by_key[name].high


def check_close(surface, wanted, most):
    found = surface.eval(WI, WO)
    assert np.abs(found - wanted).max() <= most * np.abs(wanted).max()
    assert np.median(np.abs(found - wanted) / (wanted + 1e-9)) <= most


@pytest.mark.parametrize("seed", SEEDS)
def test_open_pbr_is_what_the_shader_of_materialx_draws(chromium, seed):
    """Of pairs whose angle is more than 90°, MaterialX takes the cosine for 0 in the rough diffuse lobe, and the
    standard does not: there it is left out."""
    obtuse = (WI * WO).sum(axis=-1) < 0
    surface = material(OPEN_PBR, seed, base_diffuse_roughness=0.0) if seed % 2 else material(OPEN_PBR, seed)
    kept = np.ones(len(WI), bool) if seed % 2 else ~obtuse
    seen = drawn(chromium, standard_files.material_x(surface), WI, WO)
    wanted = np.where(kept[:, None], seen / WI[:, 2:], surface.eval(WI, WO))
    check_close(surface, wanted, 1e-3)
    for name in ("base_color", "specular_roughness", "coat_ior", "fuzz_weight"):
        must_fail(check_close, changed(surface, name), wanted, 1e-3)


@pytest.mark.parametrize("seed", SEEDS)
def test_principled_is_what_mitsuba_has(seed):
    surface = material(PRINCIPLED, seed, clearcoat=0.7, sheen=0.6)
    mi = mitsuba()
    colour = {"type": "rgb", "value": list(surface.values["base_color"])}
    bsdf = mi.load_dict({"type": "principled", **surface.values, "base_color": colour})
    found = mi.SurfaceInteraction3f()
    found.wi = mi.Vector3f(*WO.T.astype(np.float32))
    value = bsdf.eval(mi.BSDFContext(), found, mi.Vector3f(*WI.T.astype(np.float32)))
    wanted = np.stack([np.array(channel) for channel in value], axis=-1) / WI[:, 2:]
    check_close(surface, wanted, 1e-4)
    for name in ("base_color", "roughness", "clearcoat", "sheen"):
        must_fail(check_close, changed(surface, name), wanted, 1e-4)


def by_hand(v, wi, wo):
    """glTF's material for one pair, step by step, as the specification's appendix and the extensions have it."""
    h = (wi + wo) / np.linalg.norm(wi + wo)
    nl, nv, nh, vh = wi[2], wo[2], h[2], wo @ h

    def specular(roughness):
        alpha = roughness**2
        d = alpha**2 / (math.pi * (nh**2 * (alpha**2 - 1) + 1) ** 2)
        g = [2 * c / (c + math.sqrt(alpha**2 + (1 - alpha**2) * c**2)) for c in (nl, nv)]
        return d * g[0] * g[1] / (4 * nl * nv)

    base = np.array(v["baseColorFactor"])
    f0 = np.minimum((0.5 / 2.5) ** 2 * np.array(v["specularColorFactor"]), 1)
    fresnel = f0 + (1 - f0) * (1 - vh) ** 5
    plastic = (1 - v["specularFactor"] * fresnel.max()) * base / math.pi
    plastic = plastic + v["specularFactor"] * fresnel * specular(v["roughnessFactor"])
    metal = specular(v["roughnessFactor"]) * (base + (1 - base) * (1 - vh) ** 5)
    material = (1 - v["metallicFactor"]) * plastic + v["metallicFactor"] * metal
    alpha = v["sheenRoughnessFactor"] ** 2
    charlie = (2 + 1 / alpha) * (1 - nh**2) ** (0.5 / alpha) / (2 * math.pi)
    over = [13.67300, -68.78018, 799.08825, -905.00061, 60.28956, 1086.96473]
    under = [1.0, 61.57746, 442.78211, 2597.49308, 121.81241, 3045.55075]
    powers = [1, nv, alpha, nv * alpha, nv**2, alpha**2]
    e = min(max(np.dot(over, powers) / np.dot(under, powers), 0), 1)
    sheen = np.array(v["sheenColorFactor"])
    material = sheen * charlie / (4 * (nl + nv - nl * nv)) + (1 - sheen.max() * e) * material
    coat = v["clearcoatFactor"] * (0.04 + 0.96 * (1 - nv) ** 5)
    return (1 - coat) * material + coat * specular(v["clearcoatRoughnessFactor"])


@pytest.mark.parametrize("seed", SEEDS)
def test_gltf_is_what_its_specification_says(seed):
    surface = material(GLTF, seed)
    wanted = np.stack([by_hand(surface.values, *pair) for pair in zip(WI, WO, strict=True)])
    check_close(surface, wanted, 1e-10)
    for name in ("baseColorFactor", "roughnessFactor", "clearcoatFactor", "sheenRoughnessFactor"):
        must_fail(check_close, changed(surface, name), wanted, 1e-10)


def sheen_albedo(alpha, cosine):
    """By quadrature."""
    theta, phi = np.meshgrid((np.arange(400) + 0.5) * np.pi / 800, (np.arange(400) + 0.5) * np.pi / 400)
    z, sine = np.cos(theta), np.sin(theta)
    x = sine * np.cos(phi) + math.sqrt(1 - cosine**2)
    half = (z + cosine) / np.sqrt(x**2 + (sine * np.sin(phi)) ** 2 + (z + cosine) ** 2)
    lobe = (2 + 1 / alpha) * (1 - half**2) ** (0.5 / alpha) / (2 * np.pi) / (4 * (z + cosine - z * cosine))
    return 2 * (lobe * z * sine).sum() * (np.pi / 800) * (np.pi / 400)


@pytest.mark.parametrize("roughness", [0.4, 0.7, 1.0])
@pytest.mark.parametrize("cosine", [0.2, 0.5, 0.9])
def test_the_albedo_of_sheen_is_the_integral(roughness, cosine):
    """To a few hundredths: the fit is of real time."""
    wo = (math.sqrt(1 - cosine**2), 0.0, cosine)
    assert gltf.sheen(Angles(wo, wo), roughness)[1] == pytest.approx(sheen_albedo(roughness**2, cosine), abs=0.04)


@pytest.mark.parametrize("model", STANDARDS.values(), ids=lambda model: model.name)
def test_of_reciprocity_no_more_is_said_than_holds(model):
    surface = material(model, 0)
    found, swapped = surface.eval(WI, WO), surface.eval(WO, WI)
    assert np.allclose(found, swapped, rtol=1e-9) == model.reciprocal


@pytest.mark.parametrize("model", STANDARDS.values(), ids=lambda model: model.name)
def test_inputs_are_checked(model):
    good = material(model, 0).values
    name = next(iter(good))
    number = next(key for key, chosen in model.by_key.items() if not chosen.colour)
    more = [good | {name: 0.5}, good | {number: (0.5, 0.5, 0.5)}, good | {number: math.nan}]
    for bad in ({name: good[name]}, good | {"x": 1.0}, good | {name: (2.0, 0.0, 0.0)}, good | {name: (0.5,)}, *more):
        with pytest.raises(MaterialError, match=model.name):
            Surface("", model, bad)


def test_materialx_finds_nothing_wrong_with_what_is_written():
    surface = material(OPEN_PBR, 3)
    surface.name = "100 % “paint” <&>"
    document = read(standard_files.material_x(surface))
    valid, why = document.validate()
    assert valid, why
    (node,) = document.getMaterialNodes()
    shader = node.getInput("surfaceshader").getConnectedNode()
    for key, value in surface.values.items():
        written = shader.getInputValue(key)
        found = list(written.asTuple()) if hasattr(written, "asTuple") else [written]
        assert found == pytest.approx(list(np.atleast_1d(value)), rel=1e-5)
    broken = standard_files.material_x(surface).replace(b'name="base_metalness" type="float"', b'name="x" type="float"')
    assert not read(broken).validate()[0]


def test_blender_has_a_socket_for_every_input():
    surface = material(OPEN_PBR, 3)
    sockets = standard_files.blender(surface)
    assert set(standard_files.BLENDER.values()) == set(surface.values) - {"specular_weight"}
    assert sockets["Specular IOR Level"] == pytest.approx(surface.values["specular_weight"] / 2, rel=1e-5)
    assert sockets["Coat Tint"] == pytest.approx([*surface.values["coat_color"], 1.0], rel=1e-5)


def check_seen_through_the_coat(sockets, values):
    """By hand, from the standard's text: a half coat of index 1.5 and roughness 0.4 on a base of roughness 0.2."""
    assert sockets["Roughness"] == pytest.approx((0.2 + (2 * 0.4**4 + 0.2**4) ** 0.25) / 2, rel=1e-5)
    inside = 1 - 0.96 / 2.25
    expected = [0.5 * c * (1 + (1 - inside) / (1 - inside * c)) for c in values["base_color"]]
    assert sockets["Base Color"] == pytest.approx([*expected, 1.0], rel=1e-5)


def test_blender_gets_the_base_as_it_is_seen_through_the_coat():
    values = dict(material(OPEN_PBR, 3).values) | {"base_metalness": 0.0, "base_color": np.array([0.8, 0.4, 0.0])}
    values |= {"specular_roughness": 0.2, "coat_weight": 0.5, "coat_roughness": 0.4, "coat_ior": 1.5}
    check_seen_through_the_coat(standard_files.blender(Surface("x", OPEN_PBR, values)), values)
    values["coat_weight"] = 0.0
    bare = standard_files.blender(Surface("x", OPEN_PBR, values))
    assert (bare["Roughness"], bare["Base Color"][:3]) == (0.2, pytest.approx([0.8, 0.4, 0.0]))
    must_fail(check_seen_through_the_coat, bare, values)
