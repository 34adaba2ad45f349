"""What every material is: an object that answers `eval(wi, wo)`.

Conventions: directions are unit vectors in the surface frame, z along the normal; `wi` points to the light,
`wo` to the viewer. f_r [1/sr] is linear RGB (Rec. 709 primaries), without the cosine, and 0 if a direction is
below the horizon.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .arrays import Triple, split
from .cells import MERL, Interpolation, Lattice, checked

Buffers = Mapping[str, Any]
LARGEST = float(np.finfo(np.float32).max)  # renderers calculate in single precision
AT_ONCE = 2**16  # pairs that a formula is evaluated for: bounds memory, and stays in the cache


class Brdf(ABC):
    """An isotropic BRDF. A subclass gives one formula, which runs on NumPy and on Dr.Jit arrays."""

    name: str
    compressed_as: ClassVar[str] = ""  #: the kind of a compressed material; see `origin`
    file_sha256: str = ""  #: of the file that a compressed material was read from
    made_from: tuple[Mapping[str, str], ...] = ()  #: what was known of its source; see `origin`

    @property
    def facts(self) -> dict[str, Any]:
        """What a reader has to report of the data, beyond what it is: see the classes in `formats`."""
        return {}

    @property
    def reciprocal(self) -> bool:
        """Whether both orders of the directions give the same."""
        return True

    def unclamped(self) -> Brdf:
        """The same before anything was set to 0 that no material reflects, as negative numbers of measurements: itself,
        unless the class says otherwise."""
        return self

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"

    def buffers(self) -> dict[str, NDArray[Any]]:
        """The flat NumPy arrays that `f_r` reads, by name; a renderer uploads them once."""
        return {}

    @abstractmethod
    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        """Linear RGB [1/sr] for components of directions above the horizon.

        buffers: those of `buffers()`, as they are or uploaded to the device that holds `wi` and `wo`.
        """

    def eval(self, wi: ArrayLike, wo: ArrayLike) -> NDArray[np.float64]:
        """f_r [1/sr], linear RGB, shape (..., 3), for unit directions `wi` and `wo` of shape (..., 3).

        Shapes broadcast. NaN where a component of either is NaN or infinite; else 0 where either is not above the
        horizon, z > 0; else a finite number. Nothing is normalised: what vectors of other lengths give means nothing,
        but it is finite. Raises ValueError for other shapes, and for what are not real numbers.
        """
        light, viewer = vectors("eval", wi, wo)
        known, above = told(light, viewer)
        result = np.zeros(light.shape)
        result[~known] = np.nan
        pairs, buffers = (light[above], viewer[above]), self.buffers()
        parts = [slice(start, start + AT_ONCE) for start in range(0, len(pairs[0]), AT_ONCE)]
        with np.errstate(all="ignore"):
            values = [
                np.stack(self.f_r(split(pairs[0][part]), split(pairs[1][part]), buffers), axis=-1) for part in parts
            ]
        if values:
            result[above] = finite(np.concatenate(values))
        return result

    def eval_both_orders(self, wi: ArrayLike, wo: ArrayLike) -> NDArray[np.float64]:
        """The mean of f_r for both orders of the directions: what a reciprocal representation can hold of it."""
        f_r = self.eval(wi, wo)
        return f_r if self.reciprocal else 0.5 * (f_r + self.eval(wo, wi))


class OnLattice(Brdf):
    """A BRDF that looks up values of a lattice. The core evaluates it, as `Brdf.eval` does in NumPy."""

    interpolation: Interpolation
    source_sha256: str

    @property
    def reciprocal(self) -> bool:
        return self.grid is None or self.grid.reciprocal

    def eval(self, wi: ArrayLike, wo: ArrayLike) -> NDArray[np.float64]:
        light, viewer = vectors("eval", wi, wo)
        pairs = (np.ascontiguousarray(w).reshape(-1, 3) for w in (light, viewer))
        return self._found(*pairs).reshape(light.shape)

    def _found(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        """f_r of pairs of shape (n, 3)."""
        index, values = self.cells()
        lattice = self.grid or MERL
        return _core.CellLookup(
            lattice.shape,
            lattice.reciprocal,
            self.interpolation == "trilinear",
            values.reshape(-1),
            None if index is None else index.reshape(-1),
        ).eval(wi, wo)

    @property
    @abstractmethod
    def grid(self) -> Lattice | None:
        """The lattice of cells; None if values belong to nodes."""

    @abstractmethod
    def cells(self) -> tuple[NDArray[Any] | None, NDArray[np.float64]]:
        """The LUT entry of each cell, and the LUT; or None, and the cells' values."""

    def with_interpolation(self, interpolation: Interpolation) -> Self:
        """The same values, looked up in another way. Raises MaterialError if there is no such way."""
        other = copy(self)
        other._interpolate(interpolation)
        return other

    def _interpolate(self, interpolation: Interpolation) -> None:
        self.interpolation = checked(interpolation)


def vectors(caller: str, *given: ArrayLike) -> list[NDArray[np.float64]]:
    """Arrays of shape (..., 3), broadcast to one shape. Raises ValueError, which names the caller, for other shapes,
    and for what are not real numbers.
    """
    arrays = [_real(caller, each) for each in given]
    shapes = [array.shape for array in arrays]
    found = " and ".join(map(str, shapes))
    if any(shape[-1:] != (3,) for shape in shapes):
        raise ValueError(f"{caller}: expected directions of shape (..., 3), found {found}")
    try:
        return list(np.broadcast_arrays(*arrays)) if len(set(shapes)) > 1 else arrays
    except ValueError as error:
        raise ValueError(f"{caller}: expected shapes that broadcast, found {found}") from error


def _real(caller: str, given: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.asarray(given)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{caller}: expected an array of real numbers, found {type(given).__name__}") from error
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{caller}: expected real numbers, found {array.dtype}")
    if array.dtype == np.float64:
        return array
    with np.errstate(over="ignore"):  # of what has more digits
        return array.astype(np.float64)


def told(wi: NDArray[np.float64], wo: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of pairs of vectors (..., 3): whether all components are finite; and whether, besides, both have z > 0."""
    known = np.asarray((np.isfinite(wi) & np.isfinite(wo)).all(axis=-1))
    return known, known & (wi[..., 2] > 0) & (wo[..., 2] > 0)


def finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same, with 0 for what is no number, and LARGEST for infinity: with vectors that are long, or next to the
    horizon, formulas overflow."""
    return values if np.isfinite(values).all() else np.nan_to_num(values, nan=0.0, posinf=LARGEST, neginf=-LARGEST)
