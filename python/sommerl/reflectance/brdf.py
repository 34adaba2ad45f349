"""What every material is: an object that answers `eval(wi, wo)`.

Conventions: directions are unit vectors in the surface frame, z along the normal; `wi` points to the light,
`wo` to the viewer. f_r [1/sr] is linear RGB (Rec. 709 primaries), without the cosine, and 0 if a direction is
below the horizon.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import asdict
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..system.errors import MaterialError
from .arrays import Triple, split
from .cells import MERL, Lattice
from .info import Counts, Info
from .lattice import AnyLattice, Interpolation
from .origin import Source, measured_against

if TYPE_CHECKING:
    from ..sampling.half_vector import HalfVectorSampler
    from .samples import Samples

Buffers = Mapping[str, Any]
Vectors = NDArray[np.float64]
LARGEST = float(np.finfo(np.float32).max)  # renderers calculate in single precision
AT_ONCE = 2**16  # pairs that a formula is evaluated for: bounds memory, and stays in the cache


class Brdf(ABC):
    """An isotropic BRDF. A subclass gives one formula, which runs on NumPy and on Dr.Jit arrays.

    name: for people. source: of its data. file_sha256: of the file that a compressed material was read from, or "".

    >>> nickel = sommerl.load("nickel")
    >>> isinstance(nickel, Brdf), nickel.kind, nickel.reciprocal
    (True, 'model', True)
    """

    kind: ClassVar[str] = "model"  #: "table", "som-man", "factored", "measurement" or "model"
    compressed: ClassVar[bool] = False  #: whether it was made from another BRDF, to take less space
    name: str
    source: Source = Source()
    file_sha256: str = ""

    @property
    def facts(self) -> dict[str, Any]:
        """What a reader has to report of the data, beyond what it is: see the classes in `formats`."""
        return {}

    @property
    def counts(self) -> Counts:
        """What had to be changed in the data."""
        return Counts()

    @property
    def reciprocal(self) -> bool:
        """Whether both orders of the directions give the same."""
        return True

    @property
    def signed(self) -> bool:
        """Whether a channel may be negative, as in measurements of saturated or dark colours."""
        return False

    @property
    def mirrored(self) -> bool:
        """Whether light from both sides of the viewer's plane gives the same by construction; data may do so, too."""
        return False

    @property
    def samples(self) -> Samples | None:
        """The measurements that it was fitted to; None if it was not, or if they are not known any more."""
        return None

    @property
    def lookup(self) -> str:
        """How a value is found: "formula", "factored", "measurement", or how a table is interpolated."""
        return "formula"

    @property
    def grid(self) -> Lattice | None:
        """The lattice of cells that hold its values; None if it has none."""
        return None

    @property
    def table_lattice(self) -> Lattice:
        """The cells of a table that is made of it: its own, or MERL's if it has none."""
        return MERL if self.grid is None else self.grid

    @property
    def bytes_memory(self) -> int:
        """The bytes that `f_r` reads from."""
        return sum(buffer.nbytes for buffer in self.buffers().values())

    def info(self) -> Info:
        """What the material is; the fields of `Info` that a kind of material does not have are None.

        >>> sommerl.load("nickel").info().kind
        'model'
        """
        facts = self.facts
        return Info(
            kind=self.kind,
            name=self.name,
            reciprocal=self.reciprocal,
            signed=self.signed,
            mirrored=self.mirrored,
            bytes_memory=self.bytes_memory,
            source_sha256=self.source.sha256 or None,
            **asdict(self.counts),
            made_from=[dict(link) for link in self.source.chain()] or None,
            measured_against=measured_against(self),
            facts=facts or None,
            **self.details(),
        )

    def details(self) -> dict[str, Any]:
        """The fields of `info` that this kind of material has beyond those of every BRDF."""
        return {}

    def with_interpolation(self, interpolation: str) -> Brdf:
        """The same values, looked up in another way. Raises MaterialError if there is no such way, or only one."""
        raise MaterialError(
            f"{self.name}: expected a table or a compressed material to interpolate, found another ({self.lookup})"
        )

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

    def eval(self, wi: ArrayLike, wo: ArrayLike) -> Vectors:
        """f_r [1/sr], linear RGB, shape (..., 3), for unit directions `wi` and `wo` of shape (..., 3).

        Shapes broadcast. NaN where a component of either is NaN or infinite; else 0 where either is not above the
        horizon, z > 0; else a finite number. Nothing is normalised: what vectors of other lengths give means nothing,
        but it is finite. Raises ValueError for other shapes, and for what are not real numbers.

        >>> sommerl.load("nickel").eval([0, 0, 1], [[0, 0, 1], [0, 0.6, 0.8]]).shape
        (2, 3)
        """
        light, viewer = vectors("eval", wi, wo)
        buffers = self.buffers()
        return evaluated(light, viewer, lambda wi, wo, _: self.f_r(wi, wo, buffers))

    def sample(self, wo: ArrayLike, u: ArrayLike) -> tuple[Vectors, Vectors, Vectors]:
        """Draws directions to the light `wi`, likelier where the BRDF reflects more.

        wo: directions to the viewer; u: uniform random numbers from 0 to 1; both of shape (..., 3).
        Returns wi (..., 3), their densities [1/sr] (...), and their weights f_r cos θ_i / density (..., 3), whose mean
        is the albedo. Density and weight are 0 where nothing was drawn; all three are NaN where `wo` or `u` is not
        finite. Raises ValueError for other shapes, for what are not real numbers, and for `u` outside of [0, 1].

        >>> wi, pdf, weight = sommerl.load("nickel").sample([0, 0.6, 0.8], [0.2, 0.5, 0.7])
        >>> wi.shape, pdf.shape, weight.shape
        ((3,), (), (3,))
        """
        return self.sampler.sample(wo, u)

    def pdf(self, wi: ArrayLike, wo: ArrayLike) -> Vectors:
        """The density [1/sr] with which `sample` draws `wi` for `wo`, shape (...).

        Shapes, NaN and errors are as in `eval`.

        >>> bool(sommerl.load("nickel").pdf([0, 0, 1], [0, 0.6, 0.8]) > 0)
        True
        """
        return self.sampler.pdf(wi, wo)

    def albedo(self, theta: ArrayLike) -> Vectors:
        """The directional-hemispherical reflectance, ∫ f_r cos θ_i dω_i: the share of even light that goes to a viewer
        at the polar angle `theta` [rad], from 0 to π/2, of any shape (...).

        Linear RGB, shape (..., 3), by quadrature. NaN where `theta` is not finite. Raises ValueError for angles out of
        range.

        >>> sommerl.load("nickel").albedo(0.5).shape
        (3,)
        """
        return self.sampler.albedo(theta)

    @cached_property
    def sampler(self) -> HalfVectorSampler:
        """What `sample`, `pdf` and `albedo` use, fitted when first asked for: see `sampling.half_vector`."""
        from ..sampling.half_vector import HalfVectorSampler

        return HalfVectorSampler.fitted(self)


class Native(Protocol):
    """A lookup in the core, prepared once: `_core.CellLookup` or `_core.NodeLookup`."""

    def eval(self, wi: Vectors, wo: Vectors) -> Vectors:
        """f_r (n, 3) of pairs of directions (n, 3)."""
        ...


class OnLattice(Brdf):
    """A BRDF that looks up values of a lattice. The core evaluates it, as `Brdf.eval` does in NumPy."""

    lattice: AnyLattice
    interpolation: Interpolation

    @property
    def reciprocal(self) -> bool:
        return self.lattice.reciprocal

    @property
    def mirrored(self) -> bool:
        return self.lattice.mirrored

    @property
    def lookup(self) -> str:
        return self.interpolation

    @property
    def grid(self) -> Lattice | None:
        return self.lattice.grid

    def eval(self, wi: ArrayLike, wo: ArrayLike) -> Vectors:
        light, viewer = vectors("eval", wi, wo)
        pairs = (np.ascontiguousarray(w).reshape(-1, 3) for w in (light, viewer))
        return self._native.eval(*pairs).reshape(light.shape)

    @abstractmethod
    def native(self) -> Native:
        """A lookup in the core for the material as it is."""

    @cached_property
    def _native(self) -> Native:
        return self.native()

    def __getstate__(self) -> dict[str, Any]:
        """Without what was prepared of it: a copy may be looked up in another way, or live in another process."""
        return {name: value for name, value in self.__dict__.items() if name not in ("_native", "sampler")}

    def with_interpolation(self, interpolation: str) -> Self:
        other = copy(self)
        other.interpolation = self.lattice.checked(self.name, interpolation)
        return other


def evaluated(wi: Vectors, wo: Vectors, f_r: Callable[[Triple, Triple, NDArray[np.intp]], Triple]) -> Vectors:
    """What `Brdf.eval` gives for pairs of vectors, both of one shape (..., 3).

    f_r: a formula for components of directions above the horizon; it is also told their places among all pairs.
    """
    known, above = finite_and_above(wi, wo)
    result = np.zeros(wi.shape)
    result[~known] = np.nan
    light, viewer, places = wi[above], wo[above], np.flatnonzero(above)
    parts = [slice(start, start + AT_ONCE) for start in range(0, len(places), AT_ONCE)]
    with np.errstate(all="ignore"):
        values = [np.stack(f_r(split(light[part]), split(viewer[part]), places[part]), axis=-1) for part in parts]
    if values:
        result[above] = finite(np.concatenate(values))
    return result


def vectors(caller: str, *given: ArrayLike) -> list[Vectors]:
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


def _real(caller: str, given: ArrayLike) -> Vectors:
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


def finite_and_above(wi: Vectors, wo: Vectors) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of pairs of vectors (..., 3): whether all components are finite; and whether, besides, both have z > 0."""
    known = np.asarray((np.isfinite(wi) & np.isfinite(wo)).all(axis=-1))
    return known, known & (wi[..., 2] > 0) & (wo[..., 2] > 0)


def finite(values: Vectors) -> Vectors:
    """The same, with 0 for what is no number, and LARGEST for infinity: with vectors that are long, or next to the
    horizon, formulas overflow."""
    return values if np.isfinite(values).all() else np.nan_to_num(values, nan=0.0, posinf=LARGEST, neginf=-LARGEST)
