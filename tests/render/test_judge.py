"""The judge that renders nothing."""

import numpy as np
import pytest
from helpers import lambertian_table, must_fail

from sommerl import builtin
from sommerl.models.builtin import builtin_table
from sommerl.reflectance.brdf import Brdf
from sommerl.render import judge
from sommerl.render.judge import Judge, score


class Scaled(Brdf):
    name = "scaled"

    def __init__(self, brdf, factor):
        self._brdf, self._factor = brdf, factor

    def f_r(self, wi, wo, buffers):
        return tuple(self._factor * c for c in self._brdf.f_r(wi, wo, self._brdf.buffers()))


def test_the_same_is_identical():
    found = Judge(builtin("nickel")).metrics(builtin("nickel"))
    assert found == {
        "psnr_soft_db": float("inf"),
        "psnr_lamp_db": float("inf"),
        "log_error": 0,
        "log_error_grazing": 0,
        "albedo_ratio": 1,
    }
    assert np.isfinite(score(found))


def check_twice_as_bright(found, f):
    """Of a Lambertian with f_r = f: all logarithms differ by log((2 f + 0.001) / (f + 0.001))."""
    difference = np.log((2 * f + 0.001) / (f + 0.001))
    assert found["log_error"] == pytest.approx(difference, rel=1e-9)
    assert found["log_error_grazing"] == pytest.approx(difference, rel=1e-9)
    assert found["albedo_ratio"] == pytest.approx(2, rel=1e-6)


def test_a_lambertian_by_hand():
    grey = lambertian_table(0.3)
    found = Judge(grey).metrics(lambertian_table(0.6))
    check_twice_as_bright(found, 0.3 / np.pi)
    must_fail(check_twice_as_bright, Judge(grey).metrics(lambertian_table(0.61)), 0.3 / np.pi)
    assert 10 < found["psnr_soft_db"] < 25


def lambertian_under(lamps, power, albedo):
    """A diffuse sphere's pixels, straight from Lambert's law."""
    at = (np.arange(judge.SIDE) + 0.5) / judge.SIDE * 2 - 1
    pixels = [(x, -y) for y in at for x in at if x * x + y * y < 1 - 1 / judge.SIDE]
    normals = np.array([[x, y, np.sqrt(1 - x * x - y * y)] for x, y in pixels])
    return albedo / np.pi * np.maximum(normals @ lamps.T, 0) @ power


def test_lamps_light_a_sphere_by_lamberts_law():
    seen = judge.seen(lambertian_table(0.5))
    for found, lamps in ((seen.soft, judge._lamps()), (seen.lamp, judge._key_lamp())):
        assert np.allclose(found, lambertian_under(*lamps, 0.5), rtol=1e-9)
    assert np.allclose(seen.albedo, 0.5, rtol=0.02)
    picture = judge.under_one_lamp(lambertian_table(0.5), judge.SIDE)
    assert picture.pixels.shape == (judge.SIDE, judge.SIDE, 3)
    assert picture.mask.sum() == len(seen.lamp) > 1000
    assert np.array_equal(picture.pixels[picture.mask], seen.lamp.astype(np.float32))
    assert not picture.pixels[~picture.mask].any()


def test_nearer_is_better():
    source = builtin("blue-metallic-paint")
    of = Judge(source)
    table = builtin_table("blue-metallic-paint")
    found = [of.metrics(each) for each in (table, table.with_interpolation("nearest"), Scaled(source, 1.3))]
    assert found[0]["psnr_soft_db"] > found[1]["psnr_soft_db"] > found[2]["psnr_soft_db"] > 15
    assert score(found[0]) > score(found[1]) > score(found[2])
    assert found[2]["albedo_ratio"] == pytest.approx(1.3, rel=1e-6)
