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

from . import _core
from .arrays import Triple, split
from .lattice import MERL, Interpolation, Lattice, checked

Buffers = Mapping[str, Any]
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

        Shapes broadcast. Zero where either direction is not above the horizon. Raises ValueError for other
        shapes.
        """
        light, viewer = _broadcast(wi, wo)
        above = (light[..., 2] > 0) & (viewer[..., 2] > 0)
        result = np.zeros(light.shape)
        pairs, buffers = (light[above], viewer[above]), self.buffers()
        parts = [slice(start, start + AT_ONCE) for start in range(0, len(pairs[0]), AT_ONCE)]
        values = [np.stack(self.f_r(split(pairs[0][part]), split(pairs[1][part]), buffers), axis=-1) for part in parts]
        if values:
            result[above] = np.concatenate(values)
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
        light, viewer = _broadcast(wi, wo)
        pairs = (np.ascontiguousarray(w).reshape(-1, 3) for w in (light, viewer))
        return self._found(*pairs).reshape(light.shape)

    def _found(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        """f_r of pairs of shape (n, 3)."""
        index, values = self.cells()
        lattice = self.grid or MERL
        return _core.lookup(
            wi,
            wo,
            lattice.shape,
            lattice.reciprocal,
            self.interpolation == "trilinear",
            values.reshape(-1),
            None if index is None else index.reshape(-1),
        )

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


def _broadcast(wi: ArrayLike, wo: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    light, viewer = np.asarray(wi, np.float64), np.asarray(wo, np.float64)
    if light.shape[-1:] != (3,) or viewer.shape[-1:] != (3,):
        raise ValueError(f"eval: expected directions of shape (..., 3), found {light.shape} and {viewer.shape}")
    light, viewer = np.broadcast_arrays(light, viewer)
    return light, viewer
