"""What integrates to one, and how wide lobes are: the numbers that samplers and fits rely on."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import must_fail
from lobes import FAMILY_LIST, evaluated, label, scaled
from quadrature import albedo, radii

from sommerl.models import cook_torrance, ggx, torrance_sparrow
from sommerl.models.blinn_phong import BLINN_PHONG
from sommerl.models.family import Angles
from sommerl.models.ggx import GGX
from sommerl.models.phong import PHONG
from sommerl.reflectance.half_diff import spherical

WIDTHS = (0.002, 0.02, 0.15, 0.5, 1.0)
GLOSSY = [family for family in FAMILY_LIST if not family.diffuse]


def coverage(distribution, width):
    """∫ D cos θ_h dω_h: the facets' area, as seen along the normal, over the surface's."""
    theta, step = radii(np.float64(np.pi / 2), width, 200)
    h = spherical(theta, 0.0 * theta)
    return (distribution(Angles(h, h), width) * np.cos(theta) * np.sin(theta) * step).sum() * 2 * np.pi


def check_covers(distribution, width):
    assert coverage(distribution, width) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("distribution", [cook_torrance.beckmann, ggx.distribution])
@pytest.mark.parametrize("width", WIDTHS)
def test_facets_cover_the_surface(distribution, width):
    check_covers(distribution, width)
    must_fail(check_covers, lambda a, m: 1.00001 * distribution(a, m), width)
    must_fail(check_covers, lambda a, m: distribution(a, m) / a.cos_h, 0.5)


def check_covers_nearly(distribution, width):
    """By hand, with sin 2θ = 2θ − 4/3 θ³: 1 − 2/3 m² for small m."""
    assert coverage(distribution, width) == pytest.approx(1 - 2 / 3 * width**2, abs=width**4)


@pytest.mark.parametrize("width", [0.004, 0.02, 0.1, 0.3])
def test_a_gaussian_of_narrow_angles_nearly_covers_the_surface(width):
    check_covers_nearly(torrance_sparrow.gaussian, width)
    must_fail(check_covers_nearly, lambda a, m: (1 + m**2) * torrance_sparrow.gaussian(a, m), width)
    must_fail(check_covers_nearly, cook_torrance.beckmann, width)


def check_leaves_gaps(distribution):
    found = [coverage(distribution, width) for width in (0.15, 0.5, 1.0)]
    assert 1 > found[0] > found[1] > found[2]
    assert 0.5 < found[2] < 0.6


def test_a_gaussian_of_wide_angles_does_not():
    check_leaves_gaps(torrance_sparrow.gaussian)
    must_fail(check_leaves_gaps, cook_torrance.beckmann)
    must_fail(check_leaves_gaps, ggx.distribution)


def check_reflects_all(family, n):
    """Along the normal; from elsewhere, less."""
    assert albedo(family, (n,), 0.0) == pytest.approx(1, abs=1e-9)
    assert max(albedo(family, (n,), elevation) for elevation in (0.1, 0.4, 0.8, 1.2, 1.5)) < 0.999


@pytest.mark.parametrize("family", [PHONG, BLINN_PHONG], ids=label)
@pytest.mark.parametrize("n", [1.0, 7.3, 100.0, 2500.0, 1e4])
def test_phongs_lobes_reflect_all_along_the_normal(family, n):
    check_reflects_all(family, n)
    must_fail(check_reflects_all, scaled(family, 1 + 1e-8), n)
    must_fail(check_reflects_all, replace(family, lobe=lambda a, n: (n + 1) / (n + 2) * family.lobe(a, n)), n)
    must_fail(check_reflects_all, replace(family, lobe=lambda a, n: 0 * a.along + 1 / np.pi), n)


def check_roughest(alpha):
    """By hand: for α = 1 and wo along the normal, D = 1/π and G = 2 cos θ_i / (1 + cos θ_i)."""
    assert albedo(GGX, (alpha, 1.0), 0.0) == pytest.approx(1 - np.log(2), abs=1e-6)


def test_the_albedo_of_the_roughest_mirror():
    check_roughest(1.0)
    must_fail(check_roughest, 0.9999)


def half_width(family, shape):
    """The θ_h at which a lobe, seen along the normal, has fallen to half."""
    low, high = 0.0, np.pi / 4
    top = np.array([[0.0, 0.0, 1.0]])
    for _ in range(50):
        middle = (low + high) / 2
        wi = np.array([spherical(2 * middle, 0.0)])
        fallen = evaluated(family, shape, wi, top) < evaluated(family, shape, top, top) / 2
        low, high = (low, middle) if fallen else (middle, high)
    return low


def check_as_wide(family, shape, exponent):
    """Blinn-Phong's lobe with that exponent, to a factor."""
    ratio = half_width(family, shape) / half_width(BLINN_PHONG, (exponent,))
    assert 1 / 1.5 < ratio < 1.5


def narrow(family, value):
    """A shape whose width or exponent is `value`: where Lafortune's lobe is about the mirror direction, under mirrors'
    reflectance."""
    others = {"c_xy": -1.0, "f0": 1.0}
    return tuple(others.get(p.name, value) for p in family.parameters)


@pytest.mark.parametrize("family", GLOSSY, ids=label)
@pytest.mark.parametrize("width", [0.004, 0.02, 0.1])
def test_the_sampler_draws_from_a_lobe_as_wide(family, width):
    powers = any(p.name == "n" for p in family.parameters)
    shape = narrow(family, 2 / width**2 if powers else width)
    found = family.exponent(*shape)
    check_as_wide(family, shape, found)
    for wrong in (4 * found, found / 4):
        must_fail(check_as_wide, family, shape, wrong)
