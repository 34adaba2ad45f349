"""Colours with negative channels, which tables, palettes and models cannot hold, moved to where there are none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear RGB with Rec. 709's primaries


def without_negatives(rgb: Values) -> Values:
    """The nearest colours of the same luminance that have no negative channel: (..., 3), linear RGB.

    Nearest is meant as the least sum of squared differences. A negative channel becomes 0; what that adds to the
    luminance is taken from the other channels in proportion to their weights in it, so that most of it comes from
    green. A colour whose luminance is not positive becomes black. Other colours stay as they are, bit for bit.
    """
    outside = rgb.min(axis=-1) < 0
    if not outside.any():
        return rgb
    found = rgb.copy()
    found[outside] = _projected(rgb[outside])
    return found


def _projected(colours: Values) -> Values:
    """Of colours (n, 3). Channels that have to be 0 are found one after the other (Michelot 1986)."""
    kept = colours > 0
    kept &= _foot(colours, kept) > 0  # without the negative channels, another one may have become negative
    lit = (colours @ LUMINANCE > 0)[:, None]
    return np.where(kept & lit, np.maximum(_foot(colours, kept), 0.0), 0.0)  # rounding may go below 0


def _foot(colours: Values, kept: NDArray[np.bool_]) -> Values:
    """The nearest colours of the same luminance, of which only the kept channels (n, 3) are not 0."""
    weights = np.where(kept, LUMINANCE, 0.0)
    norm = (weights**2).sum(axis=-1, keepdims=True)
    surplus = (weights * colours).sum(axis=-1, keepdims=True) - (colours @ LUMINANCE)[:, None]
    return colours - weights * surplus / np.where(norm > 0, norm, 1.0)
