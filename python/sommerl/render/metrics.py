"""Measures how much a rendered candidate differs from a rendered reference.

The metrics are computed on what a viewer sees: 8-bit sRGB pixels, at the exposure of the reference. Only one PSNR is
computed without the rounding to 8 bits, which hides some small differences and enlarges others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.metric import Metric, decibels, measured
from ..system.errors import MaterialError
from ..system.optional import optional

EXPOSURE_PERCENTILE, EXPOSED_TO = 90, 0.6  # of the object's pixels, and the linear value that it is brought to
PEAK_LUMINANCE = 100.0  # cd/m², of the display that shows the 8-bit image

Pixels = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Exposed:
    """Two images at the reference's exposure: linear, and in 8 bits on the curve of sRGB. mask: the object's pixels."""

    reference: Pixels
    candidate: Pixels
    reference8: NDArray[np.uint8]
    candidate8: NDArray[np.uint8]
    mask: Mask

    @classmethod
    def of(cls, reference: Pixels, candidate: Pixels, mask: Mask) -> Exposed:
        """From linear images. Raises MaterialError as `exposure` does."""
        scale = exposure(reference, mask)
        a, b = reference * scale, candidate * scale
        return cls(a, b, to_srgb8(a), to_srgb8(b), mask)


def image_metrics(reference: Pixels, candidate: Pixels, mask: Mask) -> dict[str, float]:
    """How far apart two linear images of shape (height, width, 3) are, by the keys of METRICS.

    mask: (height, width), where the object is. Raises MissingDependencyError without the packages of sommerl[render].
    """
    return measured(METRICS, Exposed.of(reference, candidate, mask))


def exposure(reference: Pixels, mask: Mask) -> float:
    """The factor that scales the 90th percentile of the object's pixels, in the mean of the channels, to 0.6.

    Raises MaterialError if the object is black, or if that percentile is not finite.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of infinite pixels
        level = float(np.percentile(reference[mask].mean(axis=-1), EXPOSURE_PERCENTILE)) if mask.any() else 0.0
    if not np.isfinite(level):
        raise MaterialError("exposure: the object's radiance is too large for single precision, or not a number")
    if not level > 0:
        raise MaterialError("exposure: the object is black, so no exposure can be taken from it")
    return EXPOSED_TO / level


def to_srgb(linear: Pixels) -> Pixels:
    """Applies the curve of sRGB (IEC 61966-2-1) to linear RGB, clipped to [0, 1]; results are in [0, 1]."""
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def to_srgb8(linear: Pixels) -> NDArray[np.uint8]:
    """Converts linear RGB, clipped to [0, 1], to 8-bit sRGB."""
    return np.round(255 * to_srgb(linear)).astype(np.uint8)


def psnr(a: NDArray[Any], b: NDArray[Any], peak: float = 255.0) -> float:
    """Peak signal-to-noise ratio [dB] of two arrays of values in [0, peak]; infinite if they are equal."""
    mse = float(np.mean((a.astype(np.float64) - b) ** 2))
    return 10 * np.log10(peak**2 / mse).item() if mse > 0 else float("inf")


def ssim(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: Mask) -> float:
    """Mean structural similarity (Wang et al. 2004) over the mask."""
    kept = optional("skimage.metrics", "scikit-image", "image metrics", "render")
    _, similarity = kept.structural_similarity(a, b, channel_axis=-1, data_range=255, full=True)
    return float(similarity[mask].mean())


def delta_e_itp(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: Mask) -> float:
    """Mean ΔE_ITP (ITU-R BT.2124) over the mask."""
    kept = optional("colour", "colour-science", "image metrics", "render")

    def ictcp(image: NDArray[np.uint8]) -> Any:
        linear = kept.cctf_decoding(image[mask] / 255.0, function="sRGB")
        wide = kept.RGB_to_RGB(linear, "sRGB", "ITU-R BT.2020")
        return kept.RGB_to_ICtCp(np.clip(wide, 0, None) * PEAK_LUMINANCE)

    distances: NDArray[np.float64] = kept.delta_E(ictcp(a), ictcp(b), method="ITP")
    return float(distances.mean())


def flip(a: NDArray[np.uint8], b: NDArray[np.uint8], mask: Mask) -> float:
    """Mean ꟻLIP (Andersson et al. 2020) over the mask, at the tool's default of 67 pixels per degree."""
    return float(_flip(a, b, False)[..., 0][mask].mean())


def flip_map(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture of each pixel's ꟻLIP in its authors' colours (magma: black for 0, white for 1), in 8 bits."""
    return np.round(255 * _flip(a, b, True)).astype(np.uint8)


def _flip(a: NDArray[np.uint8], b: NDArray[np.uint8], coloured: bool) -> NDArray[np.float32]:
    kept = optional("flip_evaluator", "flip-evaluator", "image metrics", "render")
    images = ((image / 255.0).astype(np.float32) for image in (a, b))
    return np.asarray(kept.evaluate(*images, "LDR", applyMagma=coloured, computeMeanError=False)[0])


def _psnr_object(pair: Exposed) -> float:
    return psnr(pair.reference8[pair.mask], pair.candidate8[pair.mask])


def _psnr_frame(pair: Exposed) -> float:
    return psnr(pair.reference8, pair.candidate8)


def _psnr_unrounded(pair: Exposed) -> float:
    return psnr(*(to_srgb(image[pair.mask]) for image in (pair.reference, pair.candidate)), peak=1.0)


def _of_8_bits(distance: Callable[[NDArray[np.uint8], NDArray[np.uint8], Mask], float]) -> Callable[[Exposed], float]:
    """A distance between two images in 8 bits, over a mask, as one between an exposed pair."""
    return lambda pair: distance(pair.reference8, pair.candidate8, pair.mask)


# What `image_metrics` measures. A value takes an Exposed pair. All are over the object's pixels but the frame's PSNR.
# PSNR: of 8-bit sRGB, three channels together; inf for identical images. SSIM: structural similarity (Wang et al.
# 2004). ΔE_ITP (ITU-R BT.2124): on a display of PEAK_LUMINANCE. FLIP: ꟻLIP (Andersson et al. 2020).
METRICS: list[Metric] = [
    Metric("psnr_object_db", "PSNR, object", _psnr_object, decibels),
    Metric("psnr_frame_db", "PSNR, frame", _psnr_frame, decibels),
    Metric("psnr_unrounded_db", "PSNR, object, not rounded to 8 bits", _psnr_unrounded, decibels),
    Metric("ssim", "SSIM", _of_8_bits(ssim), "{:.4f}".format),
    Metric("delta_e_itp", "ΔE_ITP", _of_8_bits(delta_e_itp), "{:.2f}".format),
    Metric("flip", "FLIP", _of_8_bits(flip), "{:.4f}".format),
]
