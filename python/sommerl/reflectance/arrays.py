"""The one place that knows NumPy from Dr.Jit.

Formulas in this package are written once, on single components (x, y and z of a direction, r, g and b of a
reflectance), and run on NumPy arrays and on Dr.Jit arrays alike. What differs between the two is here.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = Any  #: a NumPy array or a Dr.Jit array of one number per lane
Triple = tuple[Array, Array, Array]  #: x, y, z of directions, or r, g, b of reflectances


class NumpyOps:
    """Array functions, on NumPy arrays."""

    sqrt, sin, cos, exp, log, power = np.sqrt, np.sin, np.cos, np.exp, np.log, np.power
    atan2, floor = np.arctan2, np.floor
    minimum, maximum = np.minimum, np.maximum
    where = staticmethod(np.where)

    @staticmethod
    def bin(x: Array, count: int) -> Array:
        """Which of `count` bins of width 1 holds x, from 0 to count - 1; of what is no number, the first."""
        return np.asarray(np.fmin(np.fmax(x, 0.0), count - 1.0)).astype(np.int64)

    @staticmethod
    def to_index(x: Array) -> Array:
        """A whole number from a table, as an index."""
        return np.asarray(x).astype(np.int64)

    @staticmethod
    def gather(buffer: Any, index: Array) -> Array:
        """Entry `index` of a flat buffer, the first or last for what is beyond; an integer entry as one that can be
        calculated with, and does not wrap.
        """
        if isinstance(buffer, Section):
            return NumpyOps.gather(buffer.whole, buffer.start + index)
        value = buffer.take(index, mode="clip")
        return value.astype(np.int64) if value.dtype.kind == "u" else value

    @staticmethod
    def affine(inputs: list[Array], weights: NDArray[np.float64], bias: NDArray[np.float64]) -> list[Array]:
        """inputs · weights + bias: weights (inputs, outputs), bias (outputs)."""
        return list(np.moveaxis(np.stack(inputs, axis=-1) @ weights + bias, -1, 0))


@dataclass(frozen=True)
class Section:
    """A buffer that is a part of a longer one, and begins elsewhere in each lane: at `start`. See `concatenated`."""

    whole: Any
    start: Array


@dataclass(frozen=True)
class Packed16:
    """Unsigned 16-bit integers, two in each entry of a Dr.Jit array of 32 bits: Dr.Jit has none of its own."""

    pairs: Array


class DrjitOps:
    """The same functions, on Dr.Jit arrays.

    Lanes that are not active may hold anything, also what is no number: nothing that is computed from them may become
    an index out of range. So every index starts from `bin`.

    Where a function has no finite derivative (√x at 0, the azimuth of what has no length, powers of 0), its derivative
    is taken for 0: directions that coincide with the normal, the mirror's or each other are common in renderings, and
    one gradient that is no number spoils the sum over all.
    """

    def __init__(self, dr: Any) -> None:
        self._dr = dr
        self.sin, self.cos, self.exp, self.log, self.floor = dr.sin, dr.cos, dr.exp, dr.log, dr.floor
        self.minimum, self.maximum, self.where = dr.minimum, dr.maximum, dr.select

    def sqrt(self, x: Array) -> Array:
        above = x > 0.0
        return self.where(above, self._dr.sqrt(self.where(above, x, 1.0)), 0.0)

    def atan2(self, y: Array, x: Array) -> Array:
        nowhere = (y == 0.0) & (x == 0.0)
        return self._dr.atan2(y, self.where(nowhere, 1.0, x))

    def power(self, x: Array, exponent: Array) -> Array:
        above = x > 0.0
        return self.where(above, self._dr.power(self.where(above, x, 1.0), exponent), 0.0)

    def bin(self, x: Array, count: int) -> Array:
        # What is no number is not above 0.
        return self.to_index(self.where(x > 0.0, self.minimum(x, count - 1.0), 0.0))

    def to_index(self, x: Array) -> Array:
        return self._dr.uint32_array_t(type(x))(x)

    def gather(self, buffer: Any, index: Array) -> Array:
        if isinstance(buffer, Section):
            return self.gather(buffer.whole, buffer.start + index)
        if isinstance(buffer, Packed16):
            pair = self._dr.gather(type(buffer.pairs), buffer.pairs, index >> 1)
            return (pair >> ((index & 1) << 4)) & 0xFFFF
        value = self._dr.gather(type(buffer), buffer, index)
        return value if self._dr.is_float_v(value) else type(index)(value)

    def affine(self, inputs: list[Array], weights: NDArray[np.float64], bias: NDArray[np.float64]) -> list[Array]:
        outputs: list[Array] = []
        for column, constant in zip(weights.T.tolist(), bias.tolist(), strict=True):
            outputs.append(sum((x * w for x, w in zip(inputs, column, strict=True)), start=0.0 * inputs[0] + constant))
        return outputs


_NUMPY = NumpyOps()


def ops(x: Array) -> Any:
    """The array functions for `x`: those of NumPy, or of Dr.Jit if `x` is one of its arrays."""
    if type(x).__module__.partition(".")[0] in ("drjit", "mitsuba"):
        return DrjitOps(sys.modules["drjit"])
    return _NUMPY


def gather3(buffer: Any, index: Array) -> Triple:
    """Entry `index` of a flat buffer of triples (r0, g0, b0, r1, …)."""
    gather = ops(index).gather
    return gather(buffer, 3 * index), gather(buffer, 3 * index + 1), gather(buffer, 3 * index + 2)


def split(vectors: Array) -> Triple:
    """The components of NumPy vectors of shape (..., 3)."""
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]
