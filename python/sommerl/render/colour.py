"""Converts linear RGB to the colours of Mitsuba's present variant: RGB, luminance, or a spectrum."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Triple, gather3, ops
from .llvm import mitsuba

LUMINANCE = 0.212671, 0.715160, 0.072169  # of Rec. 709 primaries: Mitsuba's numbers
SIDE = 64  # of the table of spectra
BRIGHTEST = 0.5  # colours are scaled so that their largest channel is this before they are looked up, as in Mitsuba


def converter(upload: Callable[[NDArray[Any]], Any]) -> Callable[[Triple, Any], Any]:
    """A function from RGB components and wavelengths [nm] to a value of the variant's type `mi.UnpolarizedSpectrum`.

    upload: makes an array that can be gathered from out of a flat NumPy array. It is called now, not while rendering.
    """
    mi = mitsuba()
    variant = mi.variant()
    if "spectral" in variant:
        table = upload(_spectra())
        return lambda rgb, wavelengths: mi.UnpolarizedSpectrum(spectrum(rgb, wavelengths, table))
    if "mono" in variant:
        return lambda rgb, _: mi.Color1f(sum(y * c for y, c in zip(LUMINANCE, rgb, strict=True)))
    return lambda rgb, _: mi.Color3f(*rgb)


def spectrum(rgb: Triple, wavelengths: Any, table: Any) -> list[Any]:
    """The smooth spectrum of a colour at wavelengths [nm]: Jakob & Hanika 2019, "A Low-Dimensional Function Space for
    Efficient Spectral Upsampling". The colour is scaled to BRIGHTEST for the lookup, and its spectrum is scaled back.

    rgb: three components; negative ones count as 0. table: from `_spectra`, uploaded.
    """
    f = ops(rgb[0])
    r, g, b = (f.maximum(c, 0.0) for c in rgb)
    largest = f.maximum(f.maximum(r, g), b)
    which = f.where(r >= largest, 0.0, f.where(g >= largest, 1.0, 2.0))
    scale = (SIDE - 1.0) / f.maximum(largest, 1e-30)
    x = scale * f.where(which == 0.0, g, f.where(which == 1.0, b, r))
    y = scale * f.where(which == 0.0, b, f.where(which == 1.0, r, g))
    i, j, first = f.bin(x, SIDE - 1), f.bin(y, SIDE - 1), f.bin(which, 3)
    s, t = x - i, y - j
    at = i + SIDE * (j + SIDE * first)
    corners = [(at, (1.0 - s) * (1.0 - t)), (at + 1, s * (1.0 - t)), (at + SIDE, (1.0 - s) * t), (at + SIDE + 1, s * t)]
    found = [[w * c for c in gather3(table, k)] for k, w in corners]
    c0, c1, c2 = (sum(parts) for parts in zip(*found, strict=True))
    bright = largest * (1 / BRIGHTEST)
    values: list[Any] = []
    for k in range(len(wavelengths)):
        polynomial = (c0 * wavelengths[k] + c1) * wavelengths[k] + c2
        values.append(bright * (0.5 + 0.5 * polynomial / f.sqrt(1.0 + polynomial * polynomial)))
    return values


@cache
def _spectra() -> NDArray[np.float32]:
    """The coefficients of the spectra of colours whose largest channel is BRIGHTEST, as a flat array.

    Its axes are: which channel is the largest; the channel before that one, from 0 to BRIGHTEST; the channel after it,
    likewise (both cyclically in r, g, b); and the three coefficients.
    """
    fetch, shares = mitsuba().srgb_model_fetch, np.linspace(0.0, BRIGHTEST, SIDE)
    colours = [np.roll([BRIGHTEST, x, y], k).tolist() for k in range(3) for y in shares for x in shares]
    return np.array([fetch(colour) for colour in colours], np.float32).reshape(-1)
