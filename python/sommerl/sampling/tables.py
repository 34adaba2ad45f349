"""Cumulative distributions in tables, and their inversion."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Array, ops

BELOW_ONE = 1 - 2**-24


def cumulative(light: NDArray[np.float64], even: NDArray[np.float64], floor: float) -> NDArray[np.float32]:
    """The CDFs along the last axis, from 0 to 1, of `light` and a share `floor` of `even`; of `even` alone if black."""
    total = light.sum(axis=-1, keepdims=True)
    share = np.where(total > 0, light / np.where(total > 0, total, 1.0), even)
    cdf = np.cumsum((1 - floor) * share + floor * even, axis=-1)
    cdf = np.pad(cdf, [(0, 0)] * (cdf.ndim - 1) + [(1, 0)])
    cdf[..., -1] = 1
    return cdf.astype(np.float32)


def probability(cdf: Any, index: Array) -> Array:
    """The probability of a bin: exactly what inverting the CDF gives it."""
    gather = ops(index).gather
    return gather(cdf, index + 1) - gather(cdf, index)


def inverted(cdf: Any, start: Array, count: int, u: Array) -> tuple[Array, Array, Array]:
    """The bin of a CDF that begins at `start` that holds u; how far u is in it, from 0 to 1; and its probability."""
    f = ops(u)
    u = f.minimum(u, BELOW_ONE)  # of numbers that were calculated, rounding may have made a 1
    bin_ = 0 * start
    for bit in reversed(range((count - 1).bit_length())):
        further = bin_ + (1 << bit)
        # Beyond the last bin there is a 1, which no u reaches.
        bin_ = f.where(f.gather(cdf, start + f.minimum(further, count)) <= u, further, bin_)
    share = probability(cdf, start + bin_)
    return bin_, (u - f.gather(cdf, start + bin_)) / share, share
