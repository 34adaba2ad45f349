"""Traits order materials as people do."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import must_fail

from sommerl import NAMES, builtin
from sommerl.library.traits import traits
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe

ROUGHNESS = (0.002, 0.005, 0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
METALLIC = {"nickel", "chrome", "blue-metallic-paint", "green-metallic-paint", "gold-metallic-paint"}
MATTE = {"beige-fabric", "red-fabric"}


def material(*, body=(0, 0, 0), coat=(0.9, 0.6, 0.3), alpha=0.1):
    lobes = [Lobe(FAMILIES["ggx"], coat, {"alpha": alpha, "f0": 1.0})]
    return MultiLobe("made", ([Lobe(FAMILIES["lambertian"], body, {})] if any(body) else []) + lobes)


def check_falls(gloss):
    """From smooth to rough."""
    assert all(0 <= value <= 1 for value in gloss)
    assert all(a > b for a, b in pairwise(gloss))


@pytest.mark.parametrize("body", [(0, 0, 0), (0.5, 0.1, 0.1)])
def test_gloss_falls_with_roughness(body):
    gloss = [
        traits(material(body=body, coat=(0.05,) * 3 if any(body) else (0.9,) * 3, alpha=a)).gloss for a in ROUGHNESS
    ]
    check_falls(gloss)
    assert gloss[0] > 0.85
    assert gloss[-1] < 0.1
    must_fail(check_falls, gloss[::-1])


def test_chalk_is_matte_and_no_metal_and_has_its_albedo():
    chalk = MultiLobe("chalk", [Lobe(FAMILIES["lambertian"], (0.8, 0.4, 0.2), {})])
    found = traits(chalk)
    assert found.gloss == 0
    assert found.metalness < 1e-3  # the albedo is by quadrature
    assert found.colour == pytest.approx((0.8, 0.4, 0.2), abs=2e-3)


def check_metals(metalness):
    assert {name for name, value in metalness.items() if value > 0.5} == METALLIC
    assert all(value < 0.2 or value > 0.7 for value in metalness.values())


def test_metals_are_told_from_the_rest():
    found = {name: traits(builtin(name)) for name in NAMES}
    check_metals({name: each.metalness for name, each in found.items()})
    must_fail(check_metals, {name: each.gloss for name, each in found.items()})
    assert all((found[name].gloss < 0.1) == (name in MATTE) for name in NAMES)
    assert max(found, key=lambda name: found[name].gloss) == "chrome"


def test_a_white_coat_is_no_metal_and_a_coloured_one_is():
    black, body = (0.02,) * 3, (0.02, 0.02, 0.3)
    assert traits(material(body=black, coat=(0.04,) * 3)).metalness < 0.05
    assert traits(material(body=body, coat=(0.04,) * 3)).metalness < 0.05
    assert traits(material(body=black, coat=(0.5, 0.4, 0.1))).metalness > 0.6


def test_what_is_dark_has_traits():
    class Black(MultiLobe):
        def f_r(self, wi, wo, buffers):
            return tuple(0.0 * c for c in super().f_r(wi, wo, buffers))

    found = traits(Black("black", [Lobe(FAMILIES["lambertian"], (1, 1, 1), {})]))
    assert (found.colour, found.gloss, found.metalness) == ((0, 0, 0), 0, 0)
    assert np.isfinite(found.colour).all()
