"""Environments, which light a scene: latitude-longitude images in linear RGB."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..system import door
from ..system.errors import FormatError
from . import hdr, image_heads
from .llvm import mitsuba

LARGEST_FILE = 2**30  # bytes

# Elevation [degrees], azimuth [degrees, 0 behind the camera, growing to its left], angular size σ [degrees], radiance.
LIGHTS = (
    (35.0, -75.0, 18.0, (2.6, 2.4, 2.1)),
    (55.0, 40.0, 7.0, (14.0, 13.0, 12.0)),
    (20.0, 75.0, 2.5, (60.0, 66.0, 75.0)),
    (48.0, -25.0, 0.9, (520.0, 480.0, 420.0)),
    (-15.0, 115.0, 5.0, (7.0, 4.5, 2.6)),
)
GROUND, HORIZON, ZENITH = (0.020, 0.017, 0.014), (0.070, 0.072, 0.078), (0.028, 0.042, 0.080)


def default_environment(height: int = 512) -> NDArray[np.float32]:
    """The built-in environment: a dim sky, and five lights, from large and soft ones to small and very bright ones.

    Returns radiance of shape (height, 2 · height, 3). The first row is the zenith, and the middle column is behind the
    camera of our scenes. The radiance of each light is a Gaussian in the angle from its centre.
    """
    elevation = np.pi / 2 - (np.arange(height) + 0.5) / height * np.pi
    azimuth = (np.arange(2 * height) + 0.5) / height * np.pi - np.pi
    azimuth, elevation = np.meshgrid(azimuth, elevation)
    up = np.sin(elevation)[..., None]
    sky = np.array(HORIZON) + (np.array(ZENITH) - HORIZON) * np.clip(up, 0, 1)
    blend = np.clip(0.5 + up / 0.1, 0, 1)  # a soft horizon, 6 degrees high
    radiance = blend * sky + (1 - blend) * np.array(GROUND)
    for light_elevation, light_azimuth, sigma, colour in LIGHTS:
        at, around, sigma = np.radians((light_elevation, light_azimuth, sigma))
        cosine = np.sin(elevation) * np.sin(at) + np.cos(elevation) * np.cos(at) * np.cos(azimuth - around)
        angle = np.arccos(np.clip(cosine, -1, 1))
        radiance = radiance + np.exp(-0.5 * (angle / sigma) ** 2)[..., None] * np.array(colour)
    return radiance.astype(np.float32)


def load_environment(path: Path, warn: Callable[[str], None] = lambda sentence: None) -> NDArray[np.float32]:
    """Reads a latitude-longitude image (OpenEXR, Radiance HDR, PFM); returns linear RGB, (height, width, 3).

    warn: called with one sentence if the image is not twice as wide as high, so that it is stretched. Raises
    FormatError if it cannot be read, has more than 2²⁶ pixels, has a low dynamic range (PNG, JPEG), is black, or has
    values that are negative or not finite.
    """
    data = door.read(path, LARGEST_FILE, "an environment image")
    kind = image_heads.kind_of(data)
    if kind == "LDR":
        # It could be decoded, but its lamps would be no brighter than white paper.
        raise FormatError(f"{path}: expected an image of high dynamic range (.exr, .hdr, .pfm), found an LDR image")
    try:
        image_heads.check(kind, data)
        linear = hdr.decode(data) if kind == "RGBE" else _decoded(data, kind)
    except FormatError:
        raise
    except Exception as error:  # of many classes, even UnicodeDecodeError if Mitsuba's message quotes the file
        raise FormatError(f"{path}: it is not an OpenEXR, Radiance HDR or PFM image that can be read") from error
    if not (np.isfinite(linear).all() and (linear >= 0).all() and linear.any()):
        raise FormatError(f"{path}: the image is black, or has radiance that is negative or not finite")
    height, width, _ = linear.shape
    if width != 2 * height:
        warn(f"{path}: the image has {width} × {height} pixels, and is stretched to be twice as wide as high")
    return linear


def _decoded(data: bytes, kind: str) -> NDArray[np.float32]:
    """Linear RGB, decoded by Mitsuba. Raises errors of any class."""
    mi = mitsuba()
    # From a file: Mitsuba would never reach the end of a stream in memory.
    with door.copied(data, ".image") as copy:
        bitmap = mi.Bitmap(str(copy), getattr(mi.Bitmap.FileFormat, kind))
    return np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False))
