"""The plug-in inside Mitsuba's own BSDFs, which call it with anything in lanes that are not active."""

from functools import cache

import numpy as np
import pytest
from helpers import must_fail, random_directions
from kinds import KINDS

from sommerl.reflectance.arrays import DrjitOps
from sommerl.render.bsdf import make_bsdf
from sommerl.render.llvm import drjit, mitsuba
from sommerl.sampling.named import SAMPLERS, fitted

mi, dr = mitsuba(), drjit()
SHARE = 0.3  # of a blend's second BSDF
GREY = 0.4  # albedo of what is blended with ours
OPAQUE = 0.6
DIFFUSE = {"type": "diffuse", "reflectance": GREY}
INTEGRATORS = ("path", "direct", "volpath", "ptracer", "prb", "aov")
SIZE = 12  # pixels of a sample


def bsdf(kind, sampler="half-vector"):
    return make_bsdf(KINDS[kind], fitted(sampler, KINDS[kind]))


def reads_out_of_bounds(capfd):
    """How many Dr.Jit told of. (Of Mitsuba's own packets that are written into a film it tells wrongly.)"""
    dr.sync_thread()
    return sum("out-of-bounds read" in line for line in capfd.readouterr().err.splitlines())


# --- lanes that hold anything

ODD = [np.nan, np.inf, -np.inf, 1e30, -1e30, -0.5, 7.0, 0.0, -1.0, 1e-40]
LANES = 4096


def anything(seed, ordinary):
    """Numbers per lane, three of them, of which most are odd."""
    rng = np.random.default_rng(seed)
    odd = rng.random((LANES, 3)) < 0.6
    return np.where(odd, rng.choice(ODD, (LANES, 3)), ordinary).astype(np.float32)


def called(plugin, active):
    """All that the plug-in gives for such lanes, by what it is, with Dr.Jit's checks of memory accesses."""
    with dr.scoped_set_flag(dr.JitFlag.Debug, True):
        found = _called(plugin, active)
        dr.eval(found)
    return {name: np.array(numbers).reshape(-1, LANES) for name, numbers in found.items()}


def _called(plugin, active):
    si = dr.zeros(mi.SurfaceInteraction3f, LANES)
    si.wi = mi.Vector3f(*anything(0, random_directions(LANES, 0)).T)
    wo = mi.Vector3f(*anything(1, random_directions(LANES, 1)).T)
    u = mi.Vector3f(*anything(2, np.random.default_rng(3).random((LANES, 3))).T)
    ctx = mi.BSDFContext()
    sample, weight = plugin.sample(ctx, si, u.x, mi.Point2f(u.y, u.z), active)
    value, pdf = plugin.eval_pdf(ctx, si, wo, active)
    found = {"weight": weight, "drawn": sample.pdf, "value": value, "pdf": pdf, "wo": sample.wo}
    found["reflectance"] = plugin.eval_diffuse_reflectance(si, active)
    return found | {"eval": plugin.eval(ctx, si, wo, active), "density": plugin.pdf(ctx, si, wo, active)}


# A sampler calculates alike for all kinds of materials, and a material for all samplers.
@pytest.mark.parametrize(
    ("kind", "sampler"), [(kind, "half-vector") for kind in KINDS] + [("table-handed", sampler) for sampler in SAMPLERS]
)
def test_inactive_lanes_give_zero_whatever_they_hold(kind, sampler):
    active = np.random.default_rng(4).random(LANES) < 0.5
    for name, found in called(bsdf(kind, sampler), mi.Bool(active)).items():
        if name != "wo":
            assert not found[:, ~active].any(), name
        assert (np.abs(found[:, ~active]) <= 1).all(), name


def check_within_bounds(plugin, capfd):
    called(plugin, mi.Bool(True))
    assert reads_out_of_bounds(capfd) == 0


@pytest.mark.parametrize(
    ("kind", "sampler"),
    [(kind, "half-vector") for kind in ("table-trilinear", "cells-nearest", "nodes", "rgl", "factored")]
    + [("table-handed", sampler) for sampler in SAMPLERS],
)
def test_no_table_is_read_out_of_bounds_whatever_active_lanes_hold(kind, sampler, capfd):
    check_within_bounds(bsdf(kind, sampler), capfd)


@pytest.mark.parametrize("sampler", ["half-vector", "matusik"])
def test_that_check_notices_an_index_that_is_not_clamped(sampler, capfd, monkeypatch):
    def unclamped(self, x, count):
        return self.to_index(self.minimum(x, count - 1.0))

    monkeypatch.setattr(DrjitOps, "bin", unclamped)
    must_fail(check_within_bounds, bsdf("table-nearest", sampler), capfd)


# --- mixtures


def bitmap(*values):
    """A raw texture of these values, one texel each."""
    texels = np.array(values, np.float32).reshape(1, len(values), -1)
    return {"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True, "filter_type": "nearest"}


def blend(first, second, weight=SHARE):
    return {"type": "blendbsdf", "weight": weight, "a": first, "b": second}


def bumpy(ours):
    return {"type": "bumpmap", "t": bitmap(0.5, 0.5), "b": ours}


def flat(ours):
    return {"type": "normalmap", "normalmap": bitmap([0.5, 0.5, 1.0]), "b": ours}


# Each nesting, and the shares of our BSDF, of the grey one, and of what is behind.
NESTINGS = {
    "first": (lambda ours: blend(ours, DIFFUSE), (1 - SHARE, SHARE, 0)),
    "second": (lambda ours: blend(DIFFUSE, ours), (SHARE, 1 - SHARE, 0)),
    "textured": (lambda ours: blend(ours, DIFFUSE, bitmap(SHARE, SHARE)), (1 - SHARE, SHARE, 0)),
    "masked": (lambda ours: {"type": "mask", "opacity": OPAQUE, "b": ours}, (OPAQUE, 0, 1 - OPAQUE)),
    "twosided": (lambda ours: {"type": "twosided", "b": ours}, (1, 0, 0)),
    "normalmap": (flat, (1, 0, 0)),
    "bumpmap": (bumpy, (1, 0, 0)),
    "both": (lambda ours: blend(ours, ours), (1, 0, 0)),
    "nested": (
        lambda ours: {"type": "mask", "opacity": OPAQUE, "b": blend(blend(ours, DIFFUSE), flat(bumpy(ours)))},
        (OPAQUE * (1 - SHARE * (1 - SHARE)), OPAQUE * SHARE * (1 - SHARE), 1 - OPAQUE),
    ),
    "on both sides": (
        lambda ours: {"type": "twosided", "b": blend(DIFFUSE, blend(ours, DIFFUSE))},
        (SHARE * (1 - SHARE), 1 - SHARE * (1 - SHARE), 0),
    ),
}


def interaction(wo, uv=(0.25, 0.5)):
    si = dr.zeros(mi.SurfaceInteraction3f, wo.shape[0])
    si.wi, si.uv, si.t = mi.Vector3f(*wo.T), mi.Point2f(*uv), 1.0
    si.sh_frame, si.n = mi.Frame3f(mi.Vector3f(0, 0, 1)), mi.Normal3f(0, 0, 1)
    si.dp_du, si.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
    return si


def check_is_the_mixture(nested, kind, shares):
    """Value and density for pairs of directions; and what is drawn weighs its value over its density."""
    ours, grey = bsdf(kind), mi.load_dict(DIFFUSE)
    si, wi = interaction(random_directions(2000, 1)), mi.Vector3f(*random_directions(2000, 2).T)
    ctx = mi.BSDFContext()
    for asked in ("eval", "pdf"):
        parts = [np.array(getattr(b, asked)(ctx, si, wi)) for b in (ours, grey)]
        mixed = shares[0] * parts[0] + shares[1] * parts[1]
        assert np.allclose(np.array(getattr(nested, asked)(ctx, si, wi)), mixed, rtol=1e-3, atol=1e-5)
    u = np.random.default_rng(0).random((3, 2000)).astype(np.float32)
    sample, weight = nested.sample(ctx, si, mi.Float(u[0]), mi.Point2f(u[1], u[2]))
    smooth = ~mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null) & (sample.pdf > 0)
    again = nested.eval(ctx, si, sample.wo) / dr.maximum(nested.pdf(ctx, si, sample.wo), 1e-20)
    drawn = np.array(smooth)
    assert drawn.mean() > 0.3
    assert np.isclose(np.array(weight), np.array(again), rtol=2e-2, atol=1e-3)[:, drawn].mean() > 0.99


@pytest.mark.parametrize(
    ("kind", "nesting"), [("table-nearest", nesting) for nesting in NESTINGS] + [("nodes", "nested"), ("rgl", "first")]
)
def test_a_nested_bsdf_is_the_mixture_of_its_parts(nesting, kind):
    nest, shares = NESTINGS[nesting]
    nested = mi.load_dict(nest(bsdf(kind)))
    check_is_the_mixture(nested, kind, shares)
    must_fail(check_is_the_mixture, nested, kind, (shares[0] * 0.97, shares[1], 0))


def test_a_texture_decides_where_which_bsdf_is():
    nested = mi.load_dict(blend(bsdf("nodes"), DIFFUSE, bitmap(0.0, 1.0)))
    wo, wi = random_directions(500, 1), mi.Vector3f(*random_directions(500, 2).T)
    for uv, part in (((0.25, 0.5), bsdf("nodes")), ((0.75, 0.5), mi.load_dict(DIFFUSE))):
        si = interaction(wo, uv)
        expected = np.array(part.eval(mi.BSDFContext(), si, wi))
        assert np.allclose(np.array(nested.eval(mi.BSDFContext(), si, wi)), expected, rtol=1e-4, atol=1e-7)


# --- renders

SHOWN = ("table-trilinear", "table-handed", "cells-nearest", "nodes", "rgl", "neural", "sgd", "factored", "ggx")


def samples_of(number):
    """Three kinds, each with a sampler and in a nesting, for each integrator others: the six of them show every kind,
    sampler and nesting. benchmarks/nestings.py draws from all combinations."""
    for place, kind in enumerate(SHOWN[number % 3 :: 3], 3 * number):
        yield kind, list(SAMPLERS)[place // 2 % len(SAMPLERS)], NESTINGS[list(NESTINGS)[place % len(NESTINGS)]]


def squares(bsdfs, integrator):
    """Square samples in a row, which do not see each other, under an even sky; each is SIZE pixels wide."""
    count, transform = len(bsdfs), mi.ScalarTransform4f
    film = {"type": "hdrfilm", "width": SIZE * count, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    view = {"to_world": transform().look_at([0, 0, 50], [0, 0, 0], [0, 1, 0]), "fov_axis": "x"}
    view["fov"] = 2 * np.degrees(np.arctan(count / 50))
    kind = {"type": integrator} | ({"aovs": "albedo:albedo", "image": {"type": "path"}} if integrator == "aov" else {})
    scene = {"type": "scene", "sky": {"type": "constant"}, "integrator": kind}
    scene["camera"] = {"type": "perspective", **view, "film": film}
    for number, each in enumerate(bsdfs):
        # From the camera's left to its right, leaning back.
        place = transform().translate([2 * number + 1 - count, 0, 0]).rotate([1, 0, 0], 40).scale(0.9)
        scene[f"sample {number}"] = {"type": "rectangle", "to_world": place, "bsdf": each}
    return mi.load_dict(scene)


def rendered(bsdfs, integrator, spp=16, rounds=8):
    """The mean about each sample and its standard error: (samples, channels) each, from several renders."""
    scene = squares(bsdfs, integrator)
    images = np.stack([np.array(mi.render(scene, spp=spp, seed=seed)) for seed in range(rounds)])
    assert np.isfinite(images).all()
    means = images.reshape(rounds, SIZE, len(bsdfs), SIZE, -1).mean(axis=(1, 3))
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(rounds)


@cache
def background():
    """The share of what is seen about a sample that it leaves free."""
    mean, _ = rendered([{"type": "diffuse", "reflectance": 0.0}], "path", spp=256)
    return mean[0, 0]


@cache
def alone():
    """What each kind's sample alone adds to what is seen, and the standard error: by the path tracer, from directions
    that follow the cosine."""
    mean, error = rendered([bsdf(kind, "cosine") for kind in SHOWN], "path", spp=64)
    return dict(zip(SHOWN, zip(mean - background(), error, strict=True), strict=True))


def check_shows_the_mixtures(kinds, found, errors, shares):
    for kind, mean, error, (ours, grey, behind) in zip(kinds, found, errors, shares, strict=True):
        part, part_error = alone()[kind]
        free = background()
        expected = ours * part + (1 - free) * (grey * GREY + behind) + free
        assert (np.abs(mean[:3] - expected) < 6 * np.hypot(error[:3], part_error) + 2e-3).all(), kind


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_renders_of_nested_bsdfs_are_mixtures_of_their_parts(integrator):
    shown = list(samples_of(INTEGRATORS.index(integrator)))
    kinds, shares = [kind for kind, _, _ in shown], [shares for _, _, (_, shares) in shown]
    # Of a light tracer's particles few are seen.
    spp, noticed = (4096, 0.3) if integrator == "ptracer" else (16, 0.9)
    found, errors = rendered([nest(bsdf(kind, sampler)) for kind, sampler, (nest, _) in shown], integrator, spp)
    check_shows_the_mixtures(kinds, found, errors, shares)
    broken = [(noticed * ours, noticed * grey, behind) for ours, grey, behind in shares]
    must_fail(check_shows_the_mixtures, kinds, found, errors, broken)
    if integrator == "aov":
        assert (found[:, 3:] >= 0).all()
        assert (found[:, 3:] <= 1).all()
