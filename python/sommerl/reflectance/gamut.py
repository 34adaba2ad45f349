"""Colours with negative channels, which tables, palettes and models cannot hold, moved to where there are none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear RGB with Rec. 709's primaries


def without_negatives(rgb: Values) -> Values:
    """The nearest colours of the same luminance that have no negative channel: (..., 3), linear RGB.

    A colour is moved towards the grey of its luminance until its lowest channel is 0. One whose luminance is not
    positive becomes black. Other colours stay as they are, bit for bit.
    """
    lowest = rgb.min(axis=-1)
    outside = lowest < 0
    if not outside.any():
        return rgb
    found = rgb.copy()
    colours, low = rgb[outside], lowest[outside][:, None]
    grey = (colours @ LUMINANCE)[:, None]
    lit = grey > 0
    share = np.where(lit, grey / np.where(lit, grey - low, 1.0), 0.0)
    found[outside] = np.where(lit, np.maximum(grey + share * (colours - grey), 0.0), 0.0)
    return found
