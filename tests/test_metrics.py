import numpy as np
import pytest
from helpers import SMALL, must_fail

from sommerl.reflectance import distance
from sommerl.render import metrics
from sommerl.system.errors import MaterialError

RNG = np.random.default_rng(0)
MASK = np.zeros((64, 64), bool)
MASK[8:56, 8:56] = True


def image(level=0.3, noise=0.0):
    return (level * (1 + noise * RNG.standard_normal((64, 64, 3)))).clip(0).astype(np.float32)


def test_psnr_of_a_known_difference():
    a = np.zeros((10, 10, 3), np.uint8)
    assert metrics.psnr(a, a + 1) == pytest.approx(20 * np.log10(255))
    assert metrics.psnr(a, a + 255) == pytest.approx(0)
    assert metrics.psnr(a, a) == np.inf
    # No wrap-around of 8-bit differences, in either order.
    assert metrics.psnr(a + 255, a) == pytest.approx(0)


def test_psnr_over_object_and_frame_differ_by_the_share_of_the_object():
    a = image(0.3, 0.2)
    b = a.copy()
    b[MASK] *= 1.1
    found = metrics.image_metrics(a, b, MASK)
    assert found["psnr_frame_db"] - found["psnr_object_db"] == pytest.approx(-10 * np.log10(MASK.mean()))


def check_unrounded(found, expected):
    assert found == pytest.approx(expected, abs=0.05)


def test_the_unrounded_psnr_sees_what_rounding_hides():
    """A grey of 0.6, and one that is brighter by 0.1 %: the curve's slope times the difference."""
    a = image(0.3)
    found = metrics.image_metrics(a, a * np.float32(1.001), MASK)
    step = 1.055 / 2.4 * 0.6 ** (1 / 2.4) * 0.001
    check_unrounded(found["psnr_unrounded_db"], -20 * np.log10(step))
    must_fail(check_unrounded, found["psnr_object_db"], -20 * np.log10(step))
    far = image(0.3, 0.2)
    rounded = metrics.image_metrics(far, far * np.float32(1.2), MASK)
    assert rounded["psnr_unrounded_db"] == pytest.approx(rounded["psnr_object_db"], abs=0.1)


def test_exposure_comes_from_the_reference_object():
    a = image(7.0)
    a[~MASK] = 1e6
    assert metrics.exposure(a, MASK) == pytest.approx(0.6 / 7)
    ramp = np.linspace(0, 1, 101, dtype=np.float32)[None, :, None] * np.ones((3, 1, 3), np.float32)
    assert metrics.exposure(ramp, np.ones((3, 101), bool)) == pytest.approx(0.6 / 0.9, rel=1e-5)


def test_exposure_makes_metrics_independent_of_brightness():
    a, b = image(0.3, 0.1), image(0.3, 0.1)
    one, other = metrics.image_metrics(a, b, MASK), metrics.image_metrics(64 * a, 64 * b, MASK)
    assert one == other


@pytest.mark.parametrize("mask", [MASK, ~(MASK | True)])
def test_black_objects_have_no_exposure(mask):
    with pytest.raises(MaterialError, match="the object is black"):
        metrics.exposure(np.zeros((64, 64, 3), np.float32), mask)


def test_srgb_encoding():
    linear = np.array([-1, 0, 0.002, 0.0031308, 0.18, 0.5, 1, 2], np.float32)
    assert metrics.to_srgb8(linear).tolist() == [0, 0, 7, 10, 118, 188, 255, 255]


def test_identical_images():
    a = image(0.3, 0.3)
    found = metrics.image_metrics(a, a, MASK)
    assert (found["psnr_object_db"], found["psnr_frame_db"], found["psnr_unrounded_db"]) == (np.inf, np.inf, np.inf)
    assert found["ssim"] == pytest.approx(1)
    assert (found["delta_e_itp"], found["flip"]) == (0, 0)


def check_worse(near, far):
    assert far["psnr_object_db"] < near["psnr_object_db"]
    assert far["psnr_unrounded_db"] < near["psnr_unrounded_db"]
    assert far["ssim"] < near["ssim"]
    assert far["delta_e_itp"] > near["delta_e_itp"]
    assert far["flip"] > near["flip"]


def test_every_metric_gets_worse_with_the_image():
    a = image(0.3, 0.3)
    near, far = (metrics.image_metrics(a, a * np.float32(f), MASK) for f in (1.05, 1.5))
    check_worse(near, far)
    must_fail(check_worse, far, near)


def test_metrics_over_the_object_do_not_see_the_background():
    a = image(0.3, 0.3)
    b = a.copy()
    b[:2] = b[-2:] = 5  # further away than any window about an object's pixel is wide
    found = metrics.image_metrics(a, b, MASK)
    assert (found["psnr_object_db"], found["psnr_unrounded_db"]) == (np.inf, np.inf)
    assert found["psnr_frame_db"] < 30
    assert found["ssim"] == pytest.approx(1)
    assert found["delta_e_itp"] == 0


def test_delta_e_itp_of_black_and_white():
    """PQ of 100 cd/m² is 0.508 (SMPTE ST 2084), and ΔE_ITP is 720 times the difference in I for greys."""
    black, white = np.zeros((1, 1, 3), np.uint8), np.full((1, 1, 3), 255, np.uint8)
    assert metrics.delta_e_itp(black, white, np.ones((1, 1), bool)) == pytest.approx(720 * 0.5081, rel=1e-3)


def test_table_metrics_by_hand():
    a = np.full((*SMALL.shape, 3), 0.5)
    found = distance.table_metrics(a, a * 1.1, SMALL)
    assert found["rmse"] == pytest.approx(0.05)
    assert found["relative_error"] == pytest.approx(0.1)
    assert found["log_error_cosine"] == pytest.approx(np.log((0.55 + 1e-3) / (0.5 + 1e-3)))
    same = distance.table_metrics(a, a, SMALL)
    assert (same["rmse"], same["relative_error"], same["log_error_cosine"]) == (0, 0, 0)


def test_table_metrics_do_not_see_below_the_horizon():
    a = np.full((*SMALL.shape, 3), 0.5)
    b = np.where(SMALL.above_horizon[..., None], a, 9.0)
    assert distance.table_metrics(a, b, SMALL)["rmse"] == 0


def test_the_log_error_weighs_by_cosine_and_solid_angle():
    """The same fault costs little at grazing angles, much where light goes."""
    cosine = np.minimum(*SMALL.cosines())
    a = np.full((*SMALL.shape, 3), 0.5)
    grazing, steep = (np.where(cells[..., None], 2 * a, a) for cells in ((cosine > 0) & (cosine < 0.1), cosine > 0.5))
    errors = [distance.table_metrics(a, b, SMALL)["log_error_cosine"] for b in (grazing, steep)]
    assert errors[0] < errors[1] / 5
