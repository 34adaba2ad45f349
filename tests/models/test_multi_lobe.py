"""Sums of lobes: in NumPy, and as Mitsuba's materials."""

from functools import cache

import numpy as np
import pytest
from helpers import complaint, must_fail
from lobes import FAMILY_LIST, evaluated, label, pairs
from quadrature import albedo

from sommerl.models.ggx import GGX
from sommerl.models.lafortune import LAFORTUNE
from sommerl.models.lambertian import LAMBERTIAN
from sommerl.models.multi_lobe import Lobe, MultiLobe
from sommerl.models.oren_nayar import OREN_NAYAR
from sommerl.models.phong import PHONG
from sommerl.models.ward import WARD
from sommerl.render.bsdf import make_bsdf
from sommerl.render.llvm import drjit, mitsuba
from sommerl.render.passes import render
from sommerl.render.scenes import sphere

WI, WO = pairs()
BASE = Lobe(LAMBERTIAN, (0.4, 0.2, 0.1), {})
GLOSS = Lobe(GGX, (0.3, 0.5, 0.7), {"alpha": 0.2, "f0": 0.3})
SHINE = Lobe(PHONG, (0.1, 0.0, 0.2), {"n": 50})
LEAN = Lobe(LAFORTUNE, (0.05, 0.2, 0.1), {"c_xy": -1.2, "n": 20})


def start(family, albedo=(0.6, 0.4, 0.2), **shape):
    """A lobe as searches begin with it, but for what is given."""
    return Lobe(family, albedo, {p.name: p.start for p in family.parameters} | shape)


def under(family, **shape):
    """A base with a lobe on top."""
    return MultiLobe("x", [BASE, start(family, (0.3, 0.5, 0.7), **shape)])


def check_sum(brdf, lobes):
    """By hand, each channel by itself."""
    found = brdf.eval(WI, WO)
    for channel in range(3):
        terms = [lobe.albedo[channel] * evaluated(lobe.family, lobe.values, WI, WO) for lobe in lobes]
        assert np.allclose(found[:, channel], sum(terms), rtol=1e-12, atol=0)


def test_a_material_is_the_sum_of_its_lobes():
    lobes = [BASE, GLOSS, SHINE, LEAN]
    for count in range(1, 5):
        check_sum(MultiLobe("x", lobes[:count]), lobes[:count])
    check_sum(MultiLobe("x", lobes), lobes[::-1])
    must_fail(check_sum, MultiLobe("x", lobes[:3]), lobes)
    must_fail(check_sum, MultiLobe("x", [BASE, GLOSS]), [BASE, Lobe(GGX, (0.5, 0.3, 0.7), GLOSS.shape)])
    must_fail(check_sum, MultiLobe("x", [GLOSS]), [Lobe(GGX, GLOSS.albedo, {"alpha": 0.2001, "f0": 0.3})])


def check_black_below(brdf):
    down = WI * [1, 1, -1]
    for wi, wo in ((down, WO), (WI, -WO), (down, -WO)):
        assert (brdf.eval(wi, wo) == 0).all()


def test_nothing_is_reflected_below_the_horizon():
    class Everywhere(MultiLobe):
        """Broken on purpose: a formula that is asked about all directions."""

        def eval(self, wi, wo):
            return np.stack(self.f_r(tuple(wi.T), tuple(wo.T), self.buffers()), -1)

    check_black_below(MultiLobe("x", [BASE, SHINE]))
    must_fail(check_black_below, Everywhere("x", [BASE, SHINE]))


def check_buffer(lobes):
    """Each lobe's albedo, then its numbers in the family's order, whatever order they were given in."""
    buffers = MultiLobe("x", lobes).buffers()
    assert list(buffers) == ["parameters"]
    assert buffers["parameters"].tolist() == [0.4, 0.2, 0.1, 0.3, 0.5, 0.7, 0.2, 0.3]


def test_numbers_lie_in_one_buffer():
    turned = Lobe(GGX, GLOSS.albedo, {"f0": 0.3, "alpha": 0.2})
    check_buffer([BASE, GLOSS])
    check_buffer([BASE, turned])
    must_fail(check_buffer, [GLOSS, BASE])
    must_fail(check_buffer, [BASE, Lobe(GGX, GLOSS.albedo, {"f0": 0.2, "alpha": 0.3})])


def check_reads_buffer(brdf, other):
    """The numbers of another material of the same families, if a renderer puts those in."""
    found = np.stack(brdf.f_r(tuple(WI.T), tuple(WO.T), other.buffers()), -1)
    assert np.array_equal(found, other.eval(WI, WO))


def test_formulas_read_their_numbers_from_the_buffer():
    other = under(GGX, alpha=0.5)

    class Fixed(MultiLobe):
        """Broken on purpose: reads its own numbers, whatever it is given."""

        def f_r(self, wi, wo, buffers):
            return super().f_r(wi, wo, self.buffers())

    check_reads_buffer(under(GGX), other)
    must_fail(check_reads_buffer, Fixed("x", under(GGX).lobes), other)


ALBEDO = (0.5, 0.5, 0.5)
BAD = [
    (GGX, ALBEDO, {"alpha": 0.2}, "ggx: expected parameters ['alpha', 'f0'], found ['alpha']"),
    (PHONG, ALBEDO, {"n": 2, "m": 1}, "phong: expected parameters ['n'], found ['m', 'n']"),
    (LAMBERTIAN, ALBEDO, {"n": 2}, "lambertian: expected parameters [], found ['n']"),
    (WARD, ALBEDO, {"alpha": 1.5}, "ward: alpha: expected 0.004 to 1, found 1.5"),
    (WARD, ALBEDO, {"alpha": 0.0}, "ward: alpha: expected 0.004 to 1, found 0"),
    (PHONG, ALBEDO, {"n": np.inf}, "phong: n: expected 1 to 100000, found inf"),
    (OREN_NAYAR, ALBEDO, {"sigma": np.nan}, "oren-nayar: sigma: expected 0 to 1.5708, found nan"),
    (LAFORTUNE, ALBEDO, {"c_xy": -2.5, "n": 2}, "lafortune: c_xy: expected -2 to 2, found -2.5"),
    (
        LAMBERTIAN,
        (0.1, -0.1, 0.1),
        {},
        "lambertian: albedo: expected three numbers of at least 0, at most 1e+30, found (0.1, -0.1, 0.1)",
    ),
    (
        LAMBERTIAN,
        (0.1, 0.1, np.nan),
        {},
        "lambertian: albedo: expected three numbers of at least 0, at most 1e+30, found (0.1, 0.1, nan)",
    ),
    (
        LAMBERTIAN,
        (np.inf, 1, 1),
        {},
        "lambertian: albedo: expected three numbers of at least 0, at most 1e+30, found (inf, 1, 1)",
    ),
    (
        LAMBERTIAN,
        (0.1, 0.1),
        {},
        "lambertian: albedo: expected three numbers of at least 0, at most 1e+30, found (0.1, 0.1)",
    ),
]


def check_complains(sentence, call, *arguments):
    assert complaint(call, *arguments) == sentence


@pytest.mark.parametrize(("family", "albedo", "shape", "sentence"), BAD, ids=label)
def test_lobes_that_cannot_be_are_refused_in_one_sentence(family, albedo, shape, sentence):
    check_complains(sentence, Lobe, family, albedo, shape)
    must_fail(check_complains, sentence, Lobe, GGX, ALBEDO, GLOSS.shape)


def test_a_material_without_lobes_is_refused():
    check_complains("grey: expected one lobe or more, found none", MultiLobe, "grey", [])
    must_fail(check_complains, "grey: expected one lobe or more, found none", MultiLobe, "grey", [BASE])


def check_bounds(family, change):
    """A lobe with one parameter at its bounds, moved outwards by a share of the range."""
    for p in family.parameters:
        for bound, outwards in ((p.low, -1), (p.high, 1)):
            assert complaint(lambda p=p, value=bound + change * outwards: start(family, **{p.name: value})) is None


@pytest.mark.parametrize("family", [family for family in FAMILY_LIST if family.parameters], ids=label)
def test_bounds_themselves_are_allowed(family):
    check_bounds(family, 0)
    must_fail(check_bounds, family, 1e-6)


@cache
def lights_and_viewers():
    """In Mitsuba. Made once: compiled code depends on how its arguments lie in memory."""
    mi, dr = mitsuba(), drjit()
    si = dr.zeros(mi.SurfaceInteraction3f, len(WO))
    si.wi = mi.Vector3f(*WO.T.astype(np.float32))
    return mi.Vector3f(*WI.T.astype(np.float32)), si


def mitsubas(brdf):
    """f_r of the BSDF, in single precision."""
    light, si = lights_and_viewers()
    return np.array(make_bsdf(brdf).eval(mitsuba().BSDFContext(), si, light)).T / WI[:, 2:]


def check_renders(found, brdf):
    """As good as single precision is; exponents multiply its rounding."""
    expected = brdf.eval(WI, WO)
    assert np.allclose(found, expected, rtol=5e-5, atol=1e-9 * expected.max())


@pytest.mark.parametrize("family", FAMILY_LIST, ids=label)
def test_mitsuba_sees_the_same(family):
    brdf, brighter = (
        under(family),
        MultiLobe("x", [Lobe(LAMBERTIAN, (0.401, 0.201, 0.1005), {}), *under(family).lobes[1:]]),
    )
    check_renders(mitsubas(brdf), brdf)
    must_fail(check_renders, mitsubas(brighter), brdf)
    turned = MultiLobe("x", [Lobe(lobe.family, lobe.albedo[::-1], lobe.shape) for lobe in brdf.lobes])
    must_fail(check_renders, mitsubas(turned), brdf)


def test_mitsuba_sees_all_lobes():
    check_renders(mitsubas(MultiLobe("x", [BASE, GLOSS, SHINE, LEAN])), MultiLobe("x", [BASE, GLOSS, SHINE, LEAN]))
    must_fail(check_renders, mitsubas(MultiLobe("x", [BASE, GLOSS, SHINE])), MultiLobe("x", [BASE, GLOSS, SHINE, LEAN]))


def kernels(brdf):
    """The compiled code that evaluates a material, by what it does and not by its numbers."""
    dr = drjit()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        mitsubas(brdf)
        return {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}


def check_shares(one, other):
    assert kernels(one) == kernels(other)
    assert not np.allclose(mitsubas(one), mitsubas(other), rtol=1e-2)
    check_renders(mitsubas(one), one)
    check_renders(mitsubas(other), other)


@pytest.mark.parametrize("family", [GGX, LAFORTUNE, WARD], ids=label)
def test_materials_of_one_family_share_a_kernel_but_not_their_numbers(family):
    last = family.parameters[-1]
    other = under(family, **{last.name: 0.5 * last.start})
    check_shares(under(family), other)
    must_fail(check_shares, under(family), under(family))
    must_fail(check_shares, under(family), under(PHONG))


def furnace(brdf):
    """A sphere in an environment of ones: what it shows at its centre are albedos, seen along the normal."""
    image = render(sphere(brdf, np.ones((4, 8, 3), np.float32), size=16), spp=1024)
    assert image.mask[7:9, 7:9].all()
    return image


def check_furnace(image, lobe):
    """The four pixels at the centre look at the normal from within 8 degrees."""
    assert np.isfinite(image.pixels).all()
    assert (image.pixels[image.mask] > 0).all()
    expected = np.array(lobe.albedo) * albedo(lobe.family, lobe.values, np.radians(5))
    assert np.allclose(image.pixels[7:9, 7:9].mean(axis=(0, 1)), expected, rtol=0.02)


@pytest.mark.parametrize("family", FAMILY_LIST, ids=label)
def test_spheres_show_albedos(family):
    lobe = start(family)
    check_furnace(furnace(MultiLobe("x", [lobe])), lobe)
    must_fail(check_furnace, furnace(MultiLobe("x", [start(family, (0.66, 0.44, 0.22))])), lobe)
    must_fail(check_furnace, furnace(MultiLobe("x", [start(family, (0.2, 0.4, 0.6))])), lobe)
