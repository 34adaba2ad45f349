"""A candidate is shown at the reference's exposure: one that is darker is wrong, however it would look by itself."""

from math import log10

import numpy as np
import pytest
from helpers import lambertian_table, must_fail

from sommerl.render import compare
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment
from sommerl.render.frame import Image
from sommerl.render.metrics import exposure

GREY, DARKER = lambertian_table(0.5), lambertian_table(0.45)
# The reference's level goes to 0.6, and 0.9 of it to 0.54: 203 and 194 in 8-bit sRGB (255 · 0.7977 = 203.4 and
# 255 · 0.7611 = 194.1), which is 20 lg(255 / 9) = 29.05 dB.
BY_HAND = 20 * log10(255 / 9)


def shown(brdf):
    """The picture of an even object that fills half of the frame; nobody renders it."""
    pixels = np.zeros((8, 16, 3), np.float32)
    pixels[:, :8] = 0.7 * brdf.values.max()
    return Image(pixels, np.broadcast_to(np.arange(16) < 8, (8, 16)))


@pytest.fixture
def compared(monkeypatch):
    """Compares GREY with DARKER as `show` has them."""

    def of(show):
        monkeypatch.setattr(compare, "sphere", lambda brdf, *_, **__: brdf)
        monkeypatch.setattr(compare, "render_all", lambda scenes, **_: [show(scene()) for scene in scenes])
        return compare_on_sphere(GREY, [DARKER], default_environment(8))[0]

    return of


def check_psnr(found):
    assert found.metrics["psnr_object_db"] == pytest.approx(BY_HAND, abs=1e-6)


def test_a_comparison_exposes_the_candidate_as_the_reference(compared):
    found = compared(shown)
    check_psnr(found)
    assert [int(image[0, 0, 0]) for image in found.exposed()] == [203, 194]


def test_that_check_notices_a_candidate_exposed_by_itself(compared):
    def alone(brdf):
        image = shown(brdf)
        return Image(image.pixels * exposure(image.pixels, image.mask), image.mask)

    must_fail(check_psnr, compared(alone))
