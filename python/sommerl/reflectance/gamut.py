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
    luminance = (colours @ LUMINANCE)[:, None]
    kept = colours > 0
    for _ in range(2):  # a colour of positive luminance keeps at least one of its three channels
        weights = np.where(kept, LUMINANCE, 0.0)
        norm = (weights**2).sum(axis=-1, keepdims=True)
        surplus = (weights * colours).sum(axis=-1, keepdims=True) - luminance
        moved = np.where(kept, colours - weights * surplus / np.where(norm > 0, norm, 1.0), 0.0)
        kept &= moved > 0
    return np.where(kept & (luminance > 0), moved, 0.0)
