"""A reference and a candidate, rendered alike, and how far they are apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..brdf import Brdf
from ..metrics import ImageMetrics, exposure, image_metrics, psnr, to_srgb8
from ..sampling.half_vector import HalfVectorSampler
from .images import difference
from .scenes import DEFAULT_SIZE, DEFAULT_SPP, Image, Progress, render, sphere


@dataclass(frozen=True)
class Comparison:
    """Two renderings of one scene, and their distance."""

    reference: Image
    candidate: Image
    metrics: ImageMetrics

    def pictures(self) -> list[NDArray[np.uint8]]:
        """Reference, candidate and their difference (×8), in 8 bits at the reference's exposure."""
        scale = exposure(self.reference.pixels, self.reference.mask)
        a, b = (to_srgb8(image.pixels * scale) for image in (self.reference, self.candidate))
        return [a, b, difference(a, b)]


def compare_on_sphere(
    reference: Brdf,
    candidates: Sequence[Brdf],
    environment: NDArray[np.float32],
    *,
    size: int = DEFAULT_SIZE,
    spp: int = DEFAULT_SPP,
    seed: int = 0,
    progress: Progress | None = None,
) -> list[Comparison]:
    """Renders the scene `sphere` with the reference and with each candidate, and measures.

    All are rendered with the reference's sampler and seed, hence with the same directions: what differs is the
    representation and not the noise.
    """
    sampler = HalfVectorSampler.fitted(reference)
    images: list[Image] = []
    for brdf in (reference, *candidates):

        def advance(done: int, passes: int) -> None:
            if progress:
                progress(len(images) * passes + done, (1 + len(candidates)) * passes)

        scene = sphere(brdf, environment, sampler=sampler, size=size)
        images.append(render(scene, spp=spp, seed=seed, progress=advance))
    first, *others = images
    return [Comparison(first, image, image_metrics(first.pixels, image.pixels, first.mask)) for image in others]


def judge_on_sphere(reference: Brdf, environment: NDArray[np.float32]) -> Callable[[Brdf], float]:
    """A function that gives a candidate's PSNR over the object [dB], as `compare_on_sphere` does with its defaults.

    The reference is rendered once.
    """
    sampler = HalfVectorSampler.fitted(reference)
    first = render(sphere(reference, environment, sampler=sampler))
    scale = exposure(first.pixels, first.mask)
    target = to_srgb8(first.pixels[first.mask] * scale)

    def quality(candidate: Brdf) -> float:
        image = render(sphere(candidate, environment, sampler=sampler))
        return psnr(target, to_srgb8(image.pixels[first.mask] * scale))

    return quality
