"""The plug-in in every variant of Mitsuba that the machine can run: the same material, in other colours and types."""

import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from helpers import must_fail, random_directions
from kinds import KINDS

from sommerl.render import llvm
from sommerl.render.bsdf import make_bsdf
from sommerl.render.llvm import drjit, mitsuba, usable_variants
from sommerl.sampling.named import SAMPLERS, fitted
from sommerl.system.errors import MissingDependencyError, OptionError

mi, dr = mitsuba(), drjit()
VARIANTS = usable_variants()
JIT = [variant for variant in VARIANTS if variant.startswith("llvm")]
SCALAR = [variant for variant in VARIANTS if variant.startswith("scalar")]
LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
WO = random_directions(40, 2) * [1, 1, 0.5] + [0, 0, 0.5]
WO /= np.linalg.norm(WO, axis=-1, keepdims=True)
# About the mirror's direction, where lobes are.
WI = WO * [-1, -1, 1] + 0.1 * random_directions(40, 1)
WI /= np.linalg.norm(WI, axis=-1, keepdims=True)


# Once for all tests of a variant, since it takes its time.
@pytest.fixture(scope="module")
def variant(request):
    before = mi.variant()
    mi.set_variant(request.param)
    yield request.param
    mi.set_variant(before)


def each_in(variants):
    return pytest.mark.parametrize("variant", variants, indirect=True)


def interaction(wo, wavelengths=None):
    """Of one viewer (3), or of many (n, 3) in variants that calculate with arrays."""
    si = dr.zeros(mi.SurfaceInteraction3f) if wo.ndim == 1 else dr.zeros(mi.SurfaceInteraction3f, len(wo))
    si.wi = vector(wo)
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    if wavelengths is not None:
        si.wavelengths = wavelengths
    return si


def vector(w):
    return mi.Vector3f(*(map(float, w) if w.ndim == 1 else w.T.astype(np.float32)))


def unpolarised(value):
    """The colours in a value, (channels, n); of a Mueller matrix, the reflectance, if it is an ideal depolariser's."""
    if not mi.variant().endswith("polarized"):
        return np.array(value).reshape(len(value), -1)
    elements = [[np.array(value[row, column]) for column in range(4)] for row in range(4)]
    first = elements[0][0]
    assert not any(np.any(elements[row][column]) for row in range(4) for column in range(4) if row or column)
    return first.reshape(len(first), -1)


def evaluated(plugin, wi, wo):
    """Colours (channels, n) of pairs of directions; of spectral variants, linear sRGB in white light."""
    ctx = mi.BSDFContext()
    if mi.variant().startswith("scalar"):
        pairs = [(vector(a), b) for a, b in zip(wi, wo, strict=True)]
        return np.concatenate([in_rgb(lambda wl: plugin.eval(ctx, interaction(b, wl), a)) for a, b in pairs], axis=1)  # noqa: B023
    return in_rgb(lambda wavelengths: plugin.eval(ctx, interaction(wo, wavelengths), vector(wi)))


def in_rgb(value):
    """What a value is in linear sRGB. value: given wavelengths, if the variant is spectral."""
    if "spectral" not in mi.variant():
        return unpolarised(value(None))
    nanometres = np.arange(360, 832, 10.0).reshape(-1, 4)
    # Opaque, for one kernel that does for all wavelengths.
    found = np.concatenate([unpolarised(value(dr.opaque(mi.UnpolarizedSpectrum, row.tolist()))) for row in nanometres])
    return weights(nanometres.reshape(-1)) @ found


def weights(nanometres):
    """(3, n): of a reflectance at these wavelengths, in linear sRGB under D65."""
    import colour

    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(colour.SpectralShape(360, 830, 10))
    light = colour.SDS_ILLUMINANTS["D65"].copy().align(cmfs.shape)
    assert np.array_equal(cmfs.wavelengths, nanometres)
    xyz = (cmfs.values * light.values[:, None]).T
    return colour.XYZ_to_RGB((xyz / xyz[1].sum()).T, "sRGB", apply_cctf_encoding=False).T


def check_same(found, expected, tolerance):
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected) <= tolerance * scale + 1e-6).mean() > 0.97


def expected(brdf, wi, wo):
    rgb = np.maximum((brdf.eval(wi, wo) * wi[:, 2:]).T, 0)
    return LUMINANCE[None] @ rgb if "mono" in mi.variant() else rgb


@each_in(VARIANTS)
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_the_same_in_every_variant(kind, variant):
    """In spectral variants, its spectra have its colours; their gamut's edge is smoothed, by some per cent."""
    count = 3 if variant.startswith("scalar") else len(WI)
    brdf, wi, wo = KINDS[kind], WI[:count], WO[:count]
    found = evaluated(make_bsdf(brdf), wi, wo)
    tolerance = 0.03 if "spectral" in variant else 2e-3
    check_same(found, expected(brdf, wi, wo), tolerance)
    must_fail(check_same, found, 1.05 * expected(brdf, wi, wo), tolerance)


@cache
def sampler(name):
    return fitted(name, KINDS["nodes"])


@each_in(VARIANTS)
@pytest.mark.parametrize("name", SAMPLERS)
def test_every_sampler_is_the_same_in_every_variant(name, variant):
    found = sampler(name)
    plugin, ctx = make_bsdf(KINDS["nodes"], found), mi.BSDFContext()
    si, wo = interaction(WO[0]), WO[0].astype(np.float32).astype(float)
    numbers = np.random.default_rng(0).random((4, 3)).astype(np.float32).astype(float)
    for u in numbers:
        first, *others = (dr.opaque(mi.Float, float(number)) for number in u)  # for one kernel that does for all
        sample, weight = plugin.sample(ctx, si, first, mi.Point2f(*others))
        wi, pdf, _ = found.sample(wo, u)
        drawn = np.array(sample.pdf).item()
        assert not drawn or np.allclose(np.array(sample.wo).ravel(), wi, atol=2e-3)
        assert np.isclose(drawn, pdf, rtol=5e-3)
        value = unpolarised(plugin.eval(ctx, si, sample.wo))
        assert np.allclose(unpolarised(weight) * drawn, value, rtol=1e-3, atol=1e-7)
        density = np.array(plugin.pdf(ctx, si, sample.wo)).item()
        assert np.isclose(density, drawn, rtol=1e-2)


@each_in([variant for variant in VARIANTS if "spectral" in variant and "polarized" not in variant])
def test_a_grey_material_has_a_flat_spectrum_as_mitsubas_own_have(variant):
    grey, ctx = make_bsdf(KINDS["lambertian"].__class__("grey", [_grey()])), mi.BSDFContext()
    own = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]}})
    wavelengths = mi.UnpolarizedSpectrum(400, 500, 600, 700)
    si, wi = interaction(WO[0], wavelengths), vector(WI[0])
    assert np.allclose(np.array(grey.eval(ctx, si, wi)), np.array(own.eval(ctx, si, wi)), rtol=1e-3)


def _grey():
    return type(KINDS["lambertian"].lobes[0])(KINDS["lambertian"].lobes[0].family, (0.5, 0.5, 0.5), {})


@pytest.mark.parametrize("name", ["llvm_ad_rgb_double", "metal_ad_rgb", ""])
def test_a_variant_that_is_not_supported_is_refused_with_those_that_are(name):
    with pytest.raises(OptionError, match=r"variant: expected scalar_rgb or .* or llvm_ad_spectral or .*, found"):
        mitsuba(name)
    with pytest.raises(MissingDependencyError, match=r"Mitsuba's variant: expected scalar_rgb or .*, found"):
        llvm._check.__wrapped__(name)


def test_an_llvm_that_will_not_do_is_told_before_mitsuba_ends_the_process(monkeypatch):
    monkeypatch.setattr(llvm.jit, "has_llvm", lambda dr: False)
    with pytest.raises(MissingDependencyError, match="Mitsuba's variant llvm_ad_rgb needs libLLVM 17 or newer"):
        llvm._check.__wrapped__("llvm_ad_rgb")


def test_a_variant_that_is_set_stays():
    code = """
import mitsuba as mi
from sommerl.render.bsdf import register
for variant in ("scalar_rgb", "scalar_spectral"):
    mi.set_variant(variant)
    register()
    print(mi.variant(), mi.load_dict({"type": "sommerl", "filename": "nickel"}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "scalar_rgb SommerlBsdf[nickel (SGD stand-in)]",
        "scalar_spectral SommerlBsdf[nickel (SGD stand-in)]",
    ]
