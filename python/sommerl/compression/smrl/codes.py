"""Codes: the whole numbers that gains and shapes are stored as, and the values that they stand for (docs/format.md)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Codes = NDArray[np.int64]

OCTAVE = 128  # codes for each doubling of gain + ½; within a doubling, gains are equally spaced
LARGEST_GAIN = 2**12 - 1  # the largest code of a gain; the smallest is its negative
UNIT = 64  # codes for a step of 1 in a coordinate of a shape
LARGEST_SHAPE = 2**10  # the largest code of a coordinate; the smallest is its negative


def gain_values(codes: NDArray[Any]) -> Floats:
    """The gains that codes stand for: 0, 1/256, … up to nearly 2³¹; negative ones for negative codes."""
    sign, size = np.sign(codes), np.abs(np.asarray(codes, np.int64))
    octave, step = np.divmod(size, OCTAVE)
    return sign * (0.5 * ((1 << octave) * (1.0 + step / OCTAVE) - 1.0))


def gain_codes(gains: NDArray[Any]) -> Codes:
    """The codes nearest to gains; negative ones for negative gains."""
    mantissa, exponent = np.frexp(2.0 * np.abs(np.asarray(gains, np.float64)) + 1.0)
    codes = np.rint((exponent - 1 + (2.0 * mantissa - 1.0)) * OCTAVE)
    return np.copysign(np.minimum(codes, LARGEST_GAIN), gains).astype(np.int64)


def shape_values(codes: NDArray[Any]) -> Floats:
    """The shapes (r, g, b), (n, 3), that codes (n, 2) of their coordinates stand for. The mean of r, g and b is 1."""
    first, second = np.moveaxis(np.asarray(codes, np.float64) / UNIT, -1, 0)
    green = 1.0 + second * 2.0 / 3.0
    return np.stack([(3.0 - green + first) / 2.0, green, (3.0 - green - first) / 2.0], axis=-1)


def coordinates(shapes: NDArray[Any]) -> Floats:
    """The two coordinates of shapes: r − b and g − (r + b) / 2. shapes: (n, 3). Returns (n, 2)."""
    r, g, b = np.moveaxis(np.asarray(shapes, np.float64), -1, 0)
    return np.stack([r - b, g - 0.5 * (r + b)], axis=-1)


def shape_codes(places: NDArray[Any]) -> Codes:
    """The codes (n, 2) nearest to coordinates (n, 2) of shapes."""
    return np.rint(np.clip(np.asarray(places, np.float64) * UNIT, -LARGEST_SHAPE, LARGEST_SHAPE)).astype(np.int64)
