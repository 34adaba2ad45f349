"""A candidate is shown at the reference's exposure: one that is darker is wrong, however it would look by itself."""

from math import log10

import numpy as np
import pytest
from helpers import lambertian_table, must_fail

from sommerl.render import compare
from sommerl.render.compare import compare_on_sphere, judge_on_sphere
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
def judged(monkeypatch):
    """The PSNR over the object of the darker one, by the function that the search is handed."""
    monkeypatch.setattr(compare, "sphere", lambda brdf, *_, **__: brdf)
    monkeypatch.setattr(compare, "render", shown)
    return lambda: judge_on_sphere(GREY, default_environment(8))(DARKER)


def check_psnr(psnr):
    assert psnr == pytest.approx(BY_HAND, abs=1e-6)


def test_the_judge_exposes_a_candidate_as_the_reference(judged):
    check_psnr(judged())


def test_so_does_a_comparison(monkeypatch):
    monkeypatch.setattr(compare, "sphere", lambda brdf, *_, **__: brdf)
    monkeypatch.setattr(compare, "render_all", lambda scenes, **_: [shown(scene()) for scene in scenes])
    found = compare_on_sphere(GREY, [DARKER], default_environment(8))[0]
    check_psnr(found.metrics["psnr_object_db"])
    assert [int(image[0, 0, 0]) for image in found.exposed()] == [203, 194]


def test_that_check_notices_a_candidate_exposed_by_itself(judged, monkeypatch):
    def alone(image):
        return image.pixels * exposure(image.pixels, image.mask)

    monkeypatch.setattr(compare, "exposure", lambda *_: 1.0)
    monkeypatch.setattr(compare, "render", lambda brdf: Image(alone(shown(brdf)), shown(brdf).mask))
    must_fail(check_psnr, judged())
