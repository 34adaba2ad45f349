"""Every family against its formula as it is printed, and against its own claims."""

from dataclasses import replace

import by_hand
import numpy as np
import pytest
from helpers import must_fail
from lobes import FAMILY_LIST, evaluated, label, pairs, scaled

from sommerl.models.lafortune import LAFORTUNE
from sommerl.models.multi_lobe import FAMILIES
from sommerl.models.phong import PHONG

WI, WO = pairs()
SHAPES = {
    "lambertian": [()],
    "oren-nayar": [(0.1,), (0.5,), (1.5,)],
    "phong": [(2.0,), (30.0,), (1000.5,)],
    "blinn-phong": [(1.0,), (100.0,), (5000.5,)],
    "ward": [(0.02,), (0.15,), (1.0,)],
    "ward-duer": [(0.02,), (0.15,), (1.0,)],
    "lafortune": [(-2.0, 2.0), (-1.1, 30.0), (-1.0, 500.0), (-0.5, 4.5), (0.7, 30.0), (1.5, 10.0)],
    "cook-torrance": [(0.02, 0.04), (0.15, 0.3), (1.0, 0.9)],
    "torrance-sparrow": [(0.02, 0.04), (0.15, 0.3), (1.0, 0.9)],
    "ashikhmin-shirley": [(1.0, 0.04), (100.0, 0.3), (5000.5, 0.9)],
    "ggx": [(0.02, 0.04), (0.15, 0.3), (1.0, 0.9)],
    "retro-ggx": [(0.02, 0.04), (0.15, 0.3), (1.0, 0.9)],
}
ALL = [(family, shape) for family in FAMILY_LIST for shape in SHAPES[family.name]]


def check_formula(family, shape, lobe=None):
    """Cosine powers do not vanish, but are as good as 0, where the printed ones are."""
    expected = getattr(by_hand, family.name.replace("-", "_"))(WI, WO, *shape)
    found = evaluated(lobe or family, shape, WI, WO)
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-11)


def nudged(family, number):
    """The family with one parameter a little larger than it is told."""

    def lobe(a, *shape):
        return family.lobe(a, *(value * (1.0001 if k == number else 1) for k, value in enumerate(shape)))

    return replace(family, lobe=lobe)


@pytest.mark.parametrize(("family", "shape"), ALL, ids=label)
def test_formulas_are_those_in_print(family, shape):
    check_formula(family, shape)
    must_fail(check_formula, family, shape, scaled(family, 1.0001))
    for number in range(len(shape)):
        must_fail(check_formula, family, shape, nudged(family, number))


def check_vanishes(family, shape):
    """On the side of the normal that the lobe turns away from."""
    behind = np.array([[np.sin(1.5), 0, np.cos(1.5)]])
    brightest = evaluated(family, shape, WI, WO).max()
    assert evaluated(family, shape, behind, behind)[0] < 1e-5 * brightest


@pytest.mark.parametrize(
    ("family", "shape"), [(PHONG, (1.0,)), (LAFORTUNE, (-2.0, 1.0)), (LAFORTUNE, (-1.0, 30.0))], ids=label
)
def test_behind_a_lobe_there_is_as_good_as_nothing(family, shape):
    check_vanishes(family, shape)
    must_fail(check_vanishes, LAFORTUNE, (1.0, 1.0))


def test_phong_is_a_lobe_of_lafortune():
    def check(c_xy):
        assert np.allclose(
            evaluated(LAFORTUNE, (c_xy, 40.0), WI, WO), evaluated(PHONG, (40.0,), WI, WO), rtol=1e-12, atol=1e-30
        )

    check(-1.0)
    must_fail(check, -0.999)


def check_reciprocal(family, shape):
    assert np.allclose(evaluated(family, shape, WI, WO), evaluated(family, shape, WO, WI), rtol=1e-12, atol=0)


def over_the_cosine(family):
    """Broken on purpose: divided by cos θ_i alone, as Phong's first lobe would be if made a BRDF."""
    return replace(family, lobe=lambda a, *shape: family.lobe(a, *shape) / a.cos_i)


@pytest.mark.parametrize(
    ("family", "shape"), [(family, shape) for family, shape in ALL if family.reciprocal], ids=label
)
def test_light_and_viewer_may_be_swapped(family, shape):
    check_reciprocal(family, shape)
    must_fail(check_reciprocal, over_the_cosine(family), shape)


def check_families(families):
    """Their names are what the command line and files say; diffuse ones are a base themselves."""
    assert list(families) == [family.name for family in families.values()] == list(SHAPES)
    assert [family.name for family in families.values() if family.diffuse] == ["lambertian", "oren-nayar"]


def test_there_are_twelve_families():
    check_families(FAMILIES)
    must_fail(check_families, {**FAMILIES, "phong": LAFORTUNE})
    must_fail(check_families, {**FAMILIES, "phong": replace(PHONG, exponent=None)})
