"""Converts f_r to colours on a screen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..render.metrics import to_srgb8

DARK, BRIGHT = 25, 99  # percentiles of what is shown
HEADROOM = 10.0  # white is at least this many times `base`, so that a material without a highlight is a mid grey


@dataclass(frozen=True)
class Tone:
    """A logarithmic curve that shows a highlight and a base ten thousand times darker in one picture.

    The largest channel c of a colour becomes log(1 + c / base) / log(1 + white / base), at most 1; the other channels
    keep their ratio to it, so that hues stay the same. Well below `base`, the curve is linear. base, white: f_r [1/sr].
    """

    base: float
    white: float

    @classmethod
    def of(cls, f_r: NDArray[np.float64]) -> Tone:
        """The curve for colours (n, 3). It uses percentiles, since a few values near grazing angles may be huge."""
        brightest = f_r.max(axis=-1)
        positive = brightest[brightest > 0]
        if not positive.size:
            return cls(1.0, HEADROOM)
        base, white = (float(np.percentile(positive, q)) for q in (DARK, BRIGHT))
        return cls(base, max(white, HEADROOM * base))

    def linear(self, f_r: NDArray[np.float64]) -> NDArray[np.float64]:
        """Linear RGB in [0, 1] for f_r of shape (..., 3); negative channels are shown as 0."""
        f_r = np.maximum(f_r, 0.0)
        brightest = f_r.max(axis=-1, keepdims=True)
        shown = np.minimum(np.log1p(brightest / self.base) / np.log1p(self.white / self.base), 1.0)
        return f_r * shown / np.where(brightest > 0, brightest, 1.0)

    def srgb8(self, f_r: NDArray[np.float64]) -> NDArray[np.uint8]:
        """8-bit sRGB for f_r of shape (..., 3)."""
        return to_srgb8(self.linear(f_r))  # pyright: ignore
