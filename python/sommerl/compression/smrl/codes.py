"""The whole numbers that a palette of gains and shapes is written as, and what they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Codes = NDArray[np.int64]

OCTAVE = 128  # codes until gain + ½ doubles; between, they are equal steps
LARGEST_GAIN = 2**12 - 1
UNIT = 64  # codes to 1 in a shape's coordinates
LARGEST_SHAPE = 2**10


def gain_values(codes: NDArray[Any]) -> Floats:
    """What codes of gains stand for: 0, 1/256, … up to 2³¹."""
    octave, step = np.divmod(np.asarray(codes, np.int64), OCTAVE)
    return 0.5 * ((1 << octave) * (1.0 + step / OCTAVE) - 1.0)


def gain_codes(gains: NDArray[Any]) -> Codes:
    """The codes nearest to gains that are not negative."""
    mantissa, exponent = np.frexp(2.0 * np.asarray(gains, np.float64) + 1.0)
    codes = np.rint((exponent - 1 + (2.0 * mantissa - 1.0)) * OCTAVE)
    return np.clip(codes, 0, LARGEST_GAIN).astype(np.int64)


def shape_values(codes: NDArray[Any]) -> Floats:
    """(r, g, b), (n, 3), of codes (n, 2) of the coordinates r − b and g − (r + b)/2; the mean of r, g and b is 1."""
    first, second = np.moveaxis(np.asarray(codes, np.float64) / UNIT, -1, 0)
    green = 1.0 + second * 2.0 / 3.0
    return np.stack([(3.0 - green + first) / 2.0, green, (3.0 - green - first) / 2.0], axis=-1)


def coordinates(shapes: NDArray[Any]) -> Floats:
    """The two coordinates (n, 2) of shapes (n, 3)."""
    r, g, b = np.moveaxis(np.asarray(shapes, np.float64), -1, 0)
    return np.stack([r - b, g - 0.5 * (r + b)], axis=-1)


def shape_codes(places: NDArray[Any]) -> Codes:
    """The codes nearest to coordinates (n, 2)."""
    return np.rint(np.clip(np.asarray(places, np.float64) * UNIT, -LARGEST_SHAPE, LARGEST_SHAPE)).astype(np.int64)
