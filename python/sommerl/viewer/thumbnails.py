"""Small pictures of materials: a sphere in soft light, without Mitsuba, around which the picture is transparent."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..render.judge import softly_lit
from ..render.metrics import to_srgb8
from ..system.optional import optional

SIDE = 80  # pixels
SKY, OF_A_LIGHT = 32, 8  # lamps
EXPOSED_AT, EXPOSED_TO = 80, 0.5  # percentile of the pixels' largest channels, and the linear value that it becomes
QUALITY = 84  # of the file


def thumbnail(brdf: Brdf) -> bytes:
    """The picture as a WebP file, in some 70 ms. Raises MissingDependencyError without Pillow."""
    image = optional("PIL.Image", "Pillow", "thumbnails", "render")
    out = io.BytesIO()
    image.fromarray(pixels(brdf)).save(out, "WEBP", quality=QUALITY, method=4)
    return out.getvalue()


def pixels(brdf: Brdf) -> NDArray[np.uint8]:
    """The picture's pixels, sRGB and opacity, (SIDE, SIDE, 4), at an exposure of its own."""
    at = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    x, y = (c.reshape(-1) for c in np.meshgrid(at, -at))
    away = np.hypot(x, y)
    cover = np.clip((1 - away) * SIDE / 2, 0, 1)  # as much of a pixel as is within the sphere, about
    seen = cover > 0
    inward = np.minimum(1.0, (1 - 0.5 / SIDE) / np.maximum(away, 1e-9))
    x, y = x * inward, y * inward
    normals = np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1)[seen]
    found = np.maximum(softly_lit(brdf, normals, SKY, OF_A_LIGHT), 0.0)
    bright = float(np.percentile(found.max(axis=-1), EXPOSED_AT))
    shown = np.zeros((SIDE * SIDE, 4), np.uint8)
    shown[seen, :3] = to_srgb8((found * (EXPOSED_TO / max(bright, 1e-9))).astype(np.float32))
    shown[:, 3] = np.round(255 * cover)
    return shown.reshape(SIDE, SIDE, 4)
