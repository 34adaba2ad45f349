"""Renders a reference and candidates in the same way, and measures how much they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..sampling.half_vector import HalfVectorSampler
from .frame import Image
from .images import difference
from .metrics import exposure, image_metrics, to_srgb8
from .passes import DEFAULT_SIZE, DEFAULT_SPP, Progress, render_all
from .scenes import sphere


@dataclass(frozen=True)
class Comparison:
    """Two renderings of one scene, and how much they differ, by the keys of `metrics.METRICS`."""

    reference: Image
    candidate: Image
    metrics: dict[str, float]

    @classmethod
    def of(cls, reference: Image, candidate: Image) -> Comparison:
        """Measures the difference of two images whose objects cover the same pixels."""
        return cls(reference, candidate, image_metrics(reference.pixels, candidate.pixels, reference.mask))

    def exposed(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Reference and candidate as 8-bit sRGB, both at the reference's exposure."""
        scale = exposure(self.reference.pixels, self.reference.mask)
        return to_srgb8(self.reference.pixels * scale), to_srgb8(self.candidate.pixels * scale)

    def pictures(self) -> list[NDArray[np.uint8]]:
        """Reference, candidate, and 8 times their absolute difference, as 8-bit sRGB at the reference's exposure."""
        a, b = self.exposed()
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
    """Renders the scene `sphere` with the reference and with each candidate, and compares them.

    All are rendered with the reference's sampler and the same seed, and so with the same directions. The differences
    then show the representation and not the noise. environment: radiance of shape (height, width, 3). size: of the
    images, in pixels. spp: samples a pixel.
    """
    sampler = HalfVectorSampler.fitted(reference)
    scenes = [partial(sphere, brdf, environment, sampler=sampler, size=size) for brdf in (reference, *candidates)]
    first, *others = render_all(scenes, spp=spp, seed=seed, progress=progress)
    return [Comparison.of(first, image) for image in others]
