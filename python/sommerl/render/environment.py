"""Environments that light a scene: latitude-longitude images in linear RGB."""

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
    """The environment that needs no download: a dim sky, and five lights from large and soft to small and very bright.

    Returns radiance of shape (height, 2 · height, 3). The first row is the zenith; the middle column is behind the
    camera of the scenes here. Each light is a Gaussian in angle.
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
    """A latitude-longitude image (OpenEXR, Radiance HDR, PFM), linear RGB, of shape (height, width, 3).

    warn: is told of an image that is not twice as wide as high, which then lights the scene distorted. Raises
    FormatError if it cannot be read, is larger than 2²⁶ pixels, is an image of low dynamic range (PNG, JPEG), or holds
    values that no light has.
    """
    data = door.read(path, LARGEST_FILE, "an environment image")
    kind = image_heads.kind_of(data)
    if kind == "LDR":
        # It would light the scene all the same, with lamps no brighter than paper.
        raise FormatError(f"{path}: expected radiance in numbers that go beyond white (.exr, .hdr), found an LDR image")
    try:
        image_heads.check(kind, data)
        linear = hdr.decode(data) if kind == "RGBE" else _decoded(data, kind)
    except FormatError:
        raise
    except Exception as error:  # of many kinds, as UnicodeDecodeError where its own sentence quotes the file
        raise FormatError(f"{path}: expected an environment image, found something unreadable") from error
    if not (np.isfinite(linear).all() and (linear >= 0).all() and linear.any()):
        raise FormatError(f"{path}: expected finite, non-negative radiance, found other values or only black")
    height, width, _ = linear.shape
    if width != 2 * height:
        warn(f"{path}: expected an environment twice as wide as high, found {width} × {height}: it is stretched")
    return linear


def _decoded(data: bytes, kind: str) -> NDArray[np.float32]:
    """Linear RGB, by Mitsuba. Raises whatever it does."""
    mi = mitsuba()
    # From a file, and not from memory: Mitsuba's streams of memory have no end, and it would wait for one.
    with door.copied(data, ".image") as copy:
        bitmap = mi.Bitmap(str(copy), getattr(mi.Bitmap.FileFormat, kind))
    return np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False))
