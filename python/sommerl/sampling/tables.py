"""Tabulated cumulative distribution functions (CDFs), and drawing from them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Array, ops

BELOW_ONE = 1 - 2**-24  # the largest number below 1 in single precision


def cumulative(light: NDArray[np.float64], even: NDArray[np.float64], floor: float) -> NDArray[np.float32]:
    """CDFs, from 0 to 1, along the last axis of `light`, which gets one element longer.

    The probabilities are those of `light` with a share `floor` of those of `even`; where `light` is 0, of `even` alone.
    """
    total = light.sum(axis=-1, keepdims=True)
    share = np.where(total > 0, light / np.where(total > 0, total, 1.0), even)
    cdf = np.cumsum((1 - floor) * share + floor * even, axis=-1)
    cdf = np.pad(cdf, [(0, 0)] * (cdf.ndim - 1) + [(1, 0)])
    cdf[..., -1] = 1
    return cdf.astype(np.float32)


def probability(cdf: Any, index: Array) -> Array:
    """The probability of the bin at `index` in a CDF: exactly the one with which `inverted` draws it."""
    gather = ops(index).gather
    return gather(cdf, index + 1) - gather(cdf, index)


def inverted(cdf: Any, start: Array, count: int, u: Array) -> tuple[Array, Array, Array]:
    """Draws from a CDF of `count` bins that begins at `start`, with a random number u, by bisection.

    Returns the bin that holds u, the place of u in it from 0 to 1, and its probability.
    """
    f = ops(u)
    u = f.minimum(u, BELOW_ONE)  # u may have been rounded to 1
    bin_ = 0 * start
    for bit in reversed(range((count - 1).bit_length())):
        further = bin_ + (1 << bit)
        # Beyond the last bin the CDF is 1, and u is less.
        bin_ = f.where(f.gather(cdf, start + f.minimum(further, count)) <= u, further, bin_)
    share = probability(cdf, start + bin_)
    return bin_, (u - f.gather(cdf, start + bin_)) / share, share
