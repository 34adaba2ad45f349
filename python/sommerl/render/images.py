"""Writes image files, and makes pictures of differences."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system.files import atomic_write
from .llvm import mitsuba

DIFFERENCE_GAIN = 8
GREY = (128, 128, 128)
# Two colours each: for half of the largest difference that is shown, and for the largest.
BRIGHTER, DARKER = (205, 45, 35, 255, 225, 120), (40, 75, 200, 130, 235, 255)


def encode(pixels: NDArray[Any]) -> bytes:
    """The bytes of a PNG for 8-bit sRGB pixels (height, width, 3), of an OpenEXR file for linear float32 pixels."""
    mi = mitsuba()
    stream = mi.MemoryStream()
    kind = mi.Bitmap.FileFormat.PNG if pixels.dtype == np.uint8 else mi.Bitmap.FileFormat.OpenEXR
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels))
    bitmap.set_srgb_gamma(pixels.dtype == np.uint8)
    bitmap.metadata()["Software"] = "Sommerl"  # the mark that lets commands replace it: see `system.files`
    bitmap.write(stream, kind)
    return bytes(stream.raw_buffer())


def write_image(path: Path, pixels: NDArray[Any]) -> None:
    """Writes 8-bit pixels as PNG, float32 pixels as OpenEXR."""
    with atomic_write(path) as out:
        out.write(encode(pixels))


def difference(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """8 times the absolute difference of two 8-bit images: black where they are equal."""
    magnified = DIFFERENCE_GAIN * np.abs(a.astype(np.int32) - b.astype(np.int32))
    return np.minimum(magnified, 255).astype(np.uint8)


def signed_difference(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture of 8 times the difference b − a, in the mean of the channels, of two 8-bit images.

    It is grey where they are equal, red to yellow where b is brighter, and blue to cyan where b is darker.
    """
    change = (b.astype(np.float64) - a).mean(axis=-1)[..., None]
    size = np.minimum(DIFFERENCE_GAIN * np.abs(change) / 255, 1)
    steps = np.where(change > 0, BRIGHTER, DARKER)
    half = size < 0.5
    low, high = np.where(half, GREY, steps[..., :3]), np.where(half, steps[..., :3], steps[..., 3:])
    colour: NDArray[np.float64] = low + (2 * size - np.where(half, 0, 1)) * (high - low)
    return np.round(colour).astype(np.uint8)


def side_by_side(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Pictures of equal height, joined from left to right."""
    return np.concatenate(pictures, axis=1)
