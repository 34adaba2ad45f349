"""Measures how much a rendered candidate differs from a rendered reference.

The metrics are computed on what a viewer sees: 8-bit sRGB pixels, at the exposure of the reference. Only one PSNR is
computed without the rounding to 8 bits, which hides some small differences and enlarges others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system.errors import MaterialError
from ..system.optional import optional

EXPOSURE_PERCENTILE, EXPOSED_TO = 90, 0.6  # of the object's pixels, and the linear value that it is brought to
PEAK_LUMINANCE = 100.0  # cd/m², of the display that shows the 8-bit image

Pixels = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class ImageMetrics:
    """Differences between two images at the reference's exposure. PSNRs of identical images are infinite.

    psnr_object_db, psnr_frame_db: over the object's pixels, and over all pixels; 8-bit sRGB, all three channels.
    psnr_unrounded_db: over the object's pixels, on the sRGB curve, but not rounded to 8 bits.
    ssim, delta_e_itp, flip: means over the object's pixels of structural similarity (Wang et al. 2004), of ΔE_ITP
        (ITU-R BT.2124) on a display of 100 cd/m², and of ꟻLIP (Andersson et al. 2020).
    """

    psnr_object_db: float
    psnr_frame_db: float
    psnr_unrounded_db: float
    ssim: float
    delta_e_itp: float
    flip: float


def image_metrics(reference: Pixels, candidate: Pixels, mask: Mask) -> ImageMetrics:
    """Compares two images in linear RGB, (height, width, 3). mask: the pixels that show the object, (height, width).

    Raises MissingDependencyError without the packages of sommerl[render], MaterialError as `exposure` does.
    """
    scale = exposure(reference, mask)
    a, b = to_srgb8(reference * scale), to_srgb8(candidate * scale)
    unrounded = (to_srgb(image[mask] * scale) for image in (reference, candidate))
    return ImageMetrics(
        psnr_object_db=psnr(a[mask], b[mask]),
        psnr_frame_db=psnr(a, b),
        psnr_unrounded_db=psnr(*unrounded, peak=1.0),
        ssim=ssim(a, b, mask),
        delta_e_itp=delta_e_itp(a, b, mask),
        flip=flip(a, b, mask),
    )


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
