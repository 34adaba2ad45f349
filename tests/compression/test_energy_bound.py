"""No compact material reflects more than it receives, or than its source does."""

import numpy as np
import pytest
from helpers import must_fail
from kinds import KINDS
from rgl_files import content

from sommerl.compression.compact import search
from sommerl.compression.compact.search import CompactOptions, compress
from sommerl.formats.rgl import parse as parse_rgl
from sommerl.reflectance.brdf import Brdf

ANGLES = np.radians([0.0, 12.0, 35.0, 55.0, 72.0, 80.0, 83.0, 85.5, 87.3, 88.3, 89.0, 89.4, 89.5])


class White(Brdf):
    name = "white"
    mirrored = True

    def f_r(self, wi, wo, buffers):
        value = 0.0 * wi[0] + 0.9999 / np.pi
        return value, value, 0.9 * value


def check_bounded(material, source):
    assert (material.albedo(ANGLES) <= np.maximum(1.0, 1.02 * source.albedo(ANGLES))).all()


@pytest.mark.parametrize("size", [500, 1500])
def test_a_white_material(monkeypatch, size):
    check_bounded(compress(White(), CompactOptions(target_size=size, effort=1))[0], White())
    monkeypatch.setattr(search.EnergyBound, "factors", lambda *_: np.ones(1))
    must_fail(check_bounded, compress(White(), CompactOptions(target_size=size, effort=1))[0], White())


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "fitted"])
def test_every_kind_of_material(kind):
    source = KINDS[kind]
    check_bounded(compress(source, CompactOptions(target_size=1000, effort=1))[0], source)


def test_a_measurement_keeps_its_sides_and_signs(tmp_path):
    rgb = np.random.default_rng(3).normal(0.2, 0.2, (1, 4, 3, 5, 5)).astype(np.float32)
    source = parse_rgl(tmp_path / "x.bsdf", content(rgb=rgb))
    material, _ = compress(source, CompactOptions(target_size=4000, effort=1))
    assert (material.reciprocal, material.signed) == (False, True)
    check_bounded(material, source)
