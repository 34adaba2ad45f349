"""The scenes of global illumination against stored renderings: a z-test, since noise and machines differ.

`python tests/render/test_golden.py` makes the stored ones anew.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers import must_fail
from histograms import sidak
from scipy import stats

from sommerl import builtin
from sommerl.reflectance.brdf import Brdf
from sommerl.render import scenes
from sommerl.render.environment import LIGHTS, default_environment
from sommerl.render.llvm import drjit, mitsuba
from sommerl.render.passes import render
from sommerl.render.scene_registry import SCENES, make_scene
from sommerl.sampling.half_vector import HalfVectorSampler

GOLDEN = Path(__file__).parent.parent / "golden"
NAMES = ("statue", "still-life")
SIZE, BLOCK = 64, 8
BATCHES, SPP = 128, 128  # of what is stored
TEST_SPP = 256
HALF = 2.0**-11  # the largest relative error of numbers stored in 16 bits


class Brighter(Brdf):
    """Broken on purpose: 3 % more light."""

    def __init__(self, brdf):
        self._brdf, self.name = brdf, "brighter"

    def buffers(self):
        return self._brdf.buffers()

    def f_r(self, wi, wo, buffers):
        return tuple(1.03 * channel for channel in self._brdf.f_r(wi, wo, buffers))


def made(name, wrap=lambda brdf: brdf, **options):
    brdfs = [builtin(material) for material in SCENES[name].materials]
    samplers = [HalfVectorSampler.fitted(brdf) for brdf in brdfs]
    return make_scene(name, [wrap(brdf) for brdf in brdfs], samplers=samplers, size=SIZE, **options)


def in_blocks(values):
    """Means over blocks of pixels, whose noise is nearly Gaussian."""
    count = SIZE // BLOCK
    return values.reshape(count, BLOCK, count, BLOCK, -1).mean(axis=(1, 3))


@cache
def golden(name):
    """Of each block and channel: the mean, its variance, and the variance of a mean of one sample a pixel."""
    with np.load(GOLDEN / f"{name}.npz") as file:
        mean, deviation = file["mean"].astype(float), file["deviation"].astype(float)
    one = in_blocks(deviation**2) / BLOCK**2
    rounding = in_blocks((HALF * mean) ** 2) / BLOCK**2
    return in_blocks(mean), one / (BATCHES * SPP) + rounding, one


def check_golden(name, scene):
    """χ² of all blocks of each channel, one of three tests of two scenes."""
    mean, variance, one = golden(name)
    found = in_blocks(render(scene, spp=TEST_SPP, seed=12345).pixels.astype(float))
    z = (found - mean) / np.sqrt(variance + one / TEST_SPP)
    p = stats.chi2.sf((z**2).sum(axis=(0, 1)), z[..., 0].size)
    assert p.min() > sidak(3 * len(NAMES))


@pytest.mark.parametrize("name", NAMES)
def test_scenes_look_as_they_did(name):
    check_golden(name, made(name))
    must_fail(check_golden, name, made(name, Brighter))


@pytest.mark.parametrize("name", NAMES)
def test_that_check_notices_light_that_bounces_once_only(name, monkeypatch):
    monkeypatch.setattr(scenes, "BOUNCES", 1)
    must_fail(check_golden, name, made(name))


def test_that_check_notices_a_lamp_that_is_out(monkeypatch):
    dark = made("still-life")
    parameters = mitsuba().traverse(dark.mitsuba)
    parameters["rim.emitter.radiance.value"] = 0
    parameters.update()
    must_fail(check_golden, "still-life", dark)
    monkeypatch.setattr("sommerl.render.environment.LIGHTS", LIGHTS[:2] + LIGHTS[3:])
    must_fail(check_golden, "statue", made("statue", environment=default_environment()))


def make_golden():
    for name in NAMES:
        scene = made(name)
        total = squares = 0
        for batch in range(BATCHES):
            pixels = render(scene, spp=SPP, seed=batch).pixels.astype(float)
            total, squares = total + pixels, squares + pixels**2
        mean = total / BATCHES
        variance = np.maximum(squares / BATCHES - mean**2, 0) * BATCHES / (BATCHES - 1) * SPP
        path = GOLDEN / f"{name}.npz"
        np.savez_compressed(path, mean=mean.astype(np.float16), deviation=np.sqrt(variance).astype(np.float16))
        print(path, path.stat().st_size, "bytes")
    drjit().sync_thread()


if __name__ == "__main__":
    make_golden()
