"""What Mitsuba's integrators, denoisers and optimisers ask of a BSDF besides its values."""

import numpy as np
import pytest
from helpers import must_fail, random_directions
from kinds import KINDS

from sommerl.reflectance.arrays import DrjitOps
from sommerl.render.bsdf import make_bsdf, register
from sommerl.render.llvm import drjit, mitsuba
from sommerl.sampling.named import SAMPLERS, fitted
from sommerl.system.errors import OptionError

mi, dr = mitsuba(), drjit()
COUNT = 500
WI, WO = random_directions(COUNT, 1), random_directions(COUNT, 2)


def interaction(wo, uv=(0.5, 0.5)):
    si = dr.zeros(mi.SurfaceInteraction3f, len(wo))
    si.wi, si.uv, si.t = mi.Vector3f(*wo.T), mi.Point2f(*uv), 1.0
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    return si


def value(plugin, wi=WI, wo=WO, **context):
    ctx = mi.BSDFContext()
    for name, asked in context.items():
        setattr(ctx, name, asked)
    return np.array(plugin.eval(ctx, interaction(wo), mi.Vector3f(*wi.T)))


def everything(plugin, **context):
    """Value, density, and the density and weight of what is drawn."""
    ctx = mi.BSDFContext()
    for name, asked in context.items():
        setattr(ctx, name, asked)
    si, wi = interaction(WO), mi.Vector3f(*WI.T)
    sample, weight = plugin.sample(ctx, si, 0.3, mi.Point2f(0.3, 0.4))
    found = plugin.eval(ctx, si, wi), plugin.pdf(ctx, si, wi), sample.pdf, weight, *plugin.eval_pdf(ctx, si, wi)
    return [np.array(numbers) for numbers in found]


@pytest.mark.parametrize("kind", ["table-nearest", "nodes"])
def test_what_is_not_asked_for_is_not_there(kind):
    plugin = make_bsdf(KINDS[kind])
    flags = mi.BSDFFlags
    for asked in ({}, {"type_mask": +flags.Glossy}, {"type_mask": +flags.GlossyReflection}, {"component": 0}):
        assert all(numbers.any() for numbers in everything(plugin, **asked)), asked
    for other in (
        {"type_mask": +flags.DiffuseReflection},
        {"type_mask": +flags.Delta},
        {"type_mask": +flags.GlossyTransmission},
        {"component": 1},
    ):
        assert not any(numbers.any() for numbers in everything(plugin, **other)), other


def test_flags_say_what_it_is():
    flags = mi.BSDFFlags
    plain = make_bsdf(KINDS["nodes"])
    assert plain.component_count() == 1
    assert plain.flags() == plain.flags(0) == flags.GlossyReflection | flags.FrontSide
    assert not plain.needs_differentials()
    register()
    tint = {"type": "bitmap", "bitmap": mi.Bitmap(np.full((2, 2, 3), 0.5, np.float32)), "raw": True}
    varied = mi.load_dict({"type": "sommerl", "filename": "nickel", "tint": tint})
    assert mi.has_flag(varied.flags(), flags.SpatiallyVarying)


# --- what denoisers ask for


def check_is_the_albedo(plugin, brdf, degrees):
    """Against the mean weight of directions that follow the cosine, which does without our quadrature."""
    wo = np.array([[np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))]])
    u = np.random.default_rng(0).random((200_000, 3))
    _, _, weight = fitted("cosine", brdf).sample(wo, u)
    mean, error = weight.mean(axis=0), weight.std(axis=0) / np.sqrt(len(u))
    found = np.array(plugin.eval_diffuse_reflectance(interaction(wo)))[:, 0]
    assert (np.abs(found - mean) < 0.03 * mean + 5 * error).all()


@pytest.mark.parametrize("degrees", [0, 40, 75])
@pytest.mark.parametrize("kind", ["sgd", "ggx", "lambertian", "ashikhmin-shirley", "oren-nayar"])
def test_the_diffuse_reflectance_is_the_albedo_at_the_viewers_angle(kind, degrees):
    plugin = make_bsdf(KINDS[kind])
    check_is_the_albedo(plugin, KINDS[kind], degrees)
    must_fail(check_is_the_albedo, make_bsdf(KINDS["neural"]), KINDS[kind], degrees)


def test_it_is_a_reflectance_for_every_kind_and_viewer():
    cos = np.append(np.linspace(-1, 1, 200), [0, 1e-6, 1e-30])
    wo = np.stack([np.sqrt(1 - cos**2), 0 * cos, cos], axis=-1)
    for kind, brdf in KINDS.items():
        found = np.array(make_bsdf(brdf).eval_diffuse_reflectance(interaction(wo)))
        assert ((found >= 0) & (found <= 1)).all(), kind
        assert not found[:, cos <= 0].any(), kind
        assert found[:, cos > 0].any(), kind


# --- light that is traced from the lamps


@pytest.mark.parametrize("kind", ["table-handed", "factored", "nodes"])
def test_a_path_from_a_lamp_sees_light_and_viewer_as_they_are(kind):
    plugin = make_bsdf(KINDS[kind])
    cos = WI[:, 2], WO[:, 2]
    backward = value(plugin, WO, WI, mode=mi.TransportMode.Importance) / cos[1]
    assert np.allclose(backward, value(plugin) / cos[0], rtol=1e-4, atol=1e-6)
    swapped = value(plugin, WO, WI) / cos[1]
    assert np.allclose(backward, swapped, rtol=1e-4, atol=1e-6) == KINDS[kind].reciprocal


# --- parameters


def loaded(**properties):
    register()
    return mi.load_dict({"type": "sommerl", "filename": "red-fabric", **properties})


def test_tint_and_scale_multiply():
    plain = value(loaded())
    assert np.allclose(value(loaded(scale=0.5)), 0.5 * plain, rtol=1e-5)
    tint = {"type": "rgb", "value": [1.0, 0.5, 0.25]}
    assert np.allclose(value(loaded(tint=tint, scale=2.0)), plain * np.array([[2.0], [1.0], [0.5]]), rtol=1e-5)
    texture = {"type": "checkerboard", "color0": 0.0, "color1": 1.0}
    textured = loaded(tint=texture)
    ctx, wi = mi.BSDFContext(), mi.Vector3f(*WI.T)
    assert not np.array(textured.eval(ctx, interaction(WO, (0.25, 0.25)), wi)).any()
    assert np.allclose(np.array(textured.eval(ctx, interaction(WO, (0.75, 0.25)), wi)), plain, rtol=1e-5)
    with pytest.raises((OptionError, RuntimeError), match="scale: expected a number of at least 0, found -1"):
        loaded(scale=-1.0)


def test_they_can_be_set_later_and_followed_by_gradients():
    plugin = loaded(tint={"type": "rgb", "value": [0.5, 0.5, 0.5]})
    before = value(plugin)
    parameters = mi.traverse(plugin)
    assert {"tint.value", "scale"} <= set(parameters.keys())
    parameters["scale"] = 3.0
    parameters["tint.value"] = mi.Color3f(1.0, 0.5, 0.0)
    parameters.update()
    assert np.allclose(value(plugin), before * np.array([[6.0], [3.0], [0.0]]), rtol=1e-5)
    for name in ("scale", "tint.value"):
        dr.enable_grad(parameters[name])
    parameters.update()
    total = dr.sum(plugin.eval(mi.BSDFContext(), interaction(WO), mi.Vector3f(*WI.T)), axis=None)
    dr.backward(total)
    sums = before.sum(axis=1) / 0.5
    assert np.allclose(np.array(dr.grad(parameters["tint.value"])).ravel(), 3 * sums, rtol=1e-3)
    assert np.allclose(np.array(dr.grad(parameters["scale"])), sums @ [1.0, 0.5, 0.0], rtol=1e-3)


def test_a_render_gives_them_finite_gradients():
    sphere = {"type": "sphere", "bsdf": loaded()}
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    view = mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0])
    camera = {"type": "perspective", "fov": 40, "to_world": view, "film": film}
    scene = {"type": "scene", "integrator": {"type": "prb"}, "sky": {"type": "constant"}, "s": sphere, "camera": camera}
    scene = mi.load_dict(scene)
    parameters = mi.traverse(scene)
    names = [name for name in parameters.keys() if name.endswith(("tint.value", "scale"))]  # noqa: SIM118
    assert len(names) == 2
    for name in names:
        dr.enable_grad(parameters[name])
    parameters.update()
    dr.backward(dr.mean(mi.render(scene, parameters, spp=16), axis=None))
    for name in names:
        gradient = np.array(dr.grad(parameters[name]))
        assert np.isfinite(gradient).all()
        assert gradient.any()


# --- gradients of geometry


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


GRAZING = unit(WO * [1, 1, 1e-3])
NORMAL = np.tile([0.0, 0, 1], (COUNT, 1))
# Light and viewer the same; each other's mirror direction; both along the normal; one of them; near the horizon.
PLACES = (
    (WO, WO),
    (WO * [-1, -1, 1], WO),
    (NORMAL, NORMAL),
    (WI, NORMAL),
    (NORMAL, WO),
    (GRAZING, WO),
    (GRAZING, GRAZING * [-1, -1, 1]),
    (WI, WO),
)


def check_gradients(brdf):
    """All derivatives of the value by both directions are numbers."""
    wi, wo = (np.concatenate(directions) for directions in zip(*PLACES, strict=True))
    light, si = mi.Vector3f(*wi.T), interaction(wo)
    dr.enable_grad(light, si.wi)
    dr.backward(dr.sum(make_bsdf(brdf).eval(mi.BSDFContext(), si, light), axis=None))
    assert np.isfinite(np.array(dr.grad(light))).all()
    assert np.isfinite(np.array(dr.grad(si.wi))).all()


@pytest.mark.parametrize("kind", KINDS)
def test_gradients_of_geometry_are_numbers_everywhere(kind):
    check_gradients(KINDS[kind])


def test_that_check_notices_a_root_without_a_derivative(monkeypatch):
    monkeypatch.setattr(DrjitOps, "sqrt", lambda self, x: dr.sqrt(x))
    must_fail(check_gradients, KINDS["neural"])


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_directions_and_densities_are_not_differentiated(sampler):
    plugin = make_bsdf(KINDS["nodes"], fitted(sampler, KINDS["nodes"]))
    light, si = mi.Vector3f(*WI.T), interaction(WO)
    dr.enable_grad(light, si.wi)
    sample, weight = plugin.sample(mi.BSDFContext(), si, 0.3, mi.Point2f(0.3, 0.4))
    assert dr.grad_enabled(weight)
    assert not dr.grad_enabled(sample.wo, sample.pdf, plugin.pdf(mi.BSDFContext(), si, light))


def test_gradients_are_the_slope():
    """Against differences of the value, where it is smooth."""
    brdf = KINDS["ggx"]
    step = 1e-3 * np.array([[0.6, -0.8, 0]])
    turned = [unit(WI + sign * step) for sign in (1, -1)]
    slopes = (brdf.eval(turned[0], WO) * turned[0][:, 2:] - brdf.eval(turned[1], WO) * turned[1][:, 2:]).sum(axis=1)
    light, plugin = mi.Vector3f(*WI.T), make_bsdf(brdf)
    dr.enable_grad(light)
    dr.backward(dr.sum(plugin.eval(mi.BSDFContext(), interaction(WO), light), axis=None))
    found = (np.array(dr.grad(light)).T * (turned[0] - turned[1])).sum(axis=1)
    assert (np.abs(found - slopes) < 0.02 * np.abs(slopes) + 2e-5).mean() > 0.97
