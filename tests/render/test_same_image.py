"""Whichever sampler draws the directions, the image is the same but for noise."""

from functools import cache

import numpy as np
import pytest
from helpers import must_fail
from histograms import check_same_image

from sommerl import BrdfTable, Lattice, builtin
from sommerl.render.environment import default_environment
from sommerl.render.passes import render
from sommerl.render.scenes import sphere
from sommerl.sampling.half_vector import HalfVectorSampler
from sommerl.sampling.named import OURS, SAMPLERS

SIZE, BLOCK, BATCHES, SPP = 24, 4, 32, 128
OTHERS = [kind for kind in SAMPLERS.values() if kind is not OURS]
# Which has both a highlight and a diffuse part; as a table, which Mitsuba compiles faster than a formula.
PAINT = BrdfTable.sampled(builtin("blue-metallic-paint"), Lattice(45, 30, 36))


@cache
def images(kind):
    """Renderings with independent random numbers, (batches, blocks, 3): means over blocks of pixels that show nothing
    but the object, whose noise is nearly Gaussian."""
    scene = sphere(PAINT, default_environment(64), sampler=kind.fitted(PAINT), size=SIZE)
    # Another seed for every sampler: the same numbers could give the same noise.
    first = BATCHES * [*SAMPLERS.values(), TooDense].index(kind)
    batches = [render(scene, spp=SPP, seed=first + batch) for batch in range(BATCHES)]
    inside = in_blocks(batches[0].mask[..., None])[..., 0] == 1
    return np.stack([in_blocks(batch.pixels)[inside] for batch in batches])


def in_blocks(pixels):
    return pixels.astype(float).reshape(SIZE // BLOCK, BLOCK, SIZE // BLOCK, BLOCK, -1).mean(axis=(1, 3))


class TooDense(HalfVectorSampler):
    """Broken on purpose: says a density 10 % too large."""

    def draw(self, wo, u, buffers):
        wi, pdf = super().draw(wo, u, buffers)
        return wi, 1.1 * pdf

    def density(self, wi, wo, buffers):
        return 1.1 * super().density(wi, wo, buffers)


@pytest.mark.parametrize("kind", OTHERS, ids=lambda kind: kind.name)
def test_every_sampler_gives_the_same_image(kind):
    check_same_image(images(kind), images(OURS), len(OTHERS))
    must_fail(check_same_image, images(kind), images(TooDense), len(OTHERS))
