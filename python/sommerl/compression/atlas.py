"""Atlas: many compact materials as one, with the number of a material for each pair of directions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..reflectance.arrays import Array, Triple, ops
from ..reflectance.brdf import Brdf, Buffers, Vectors, evaluated, vectors
from ..reflectance.concatenated import Concatenated
from ..reflectance.lattice import blended
from ..reflectance.nodes import NodeLattice
from ..sampling.half_vector import HalfVectorSampler, albedos
from ..sampling.sampler import densities, sampled
from ..system.errors import MaterialError
from .material import SomManBrdf
from .palette import GainsAndShapes

Part = TypeVar("Part")


class Atlas:
    """Compact materials that are looked up, and drawn from, by one formula with the number of a material.

    Materials are numbered from 0, in the order in which they are given. They may differ in all that a compact material
    has: nodes, palettes, folds of φ_d, signs.

    materials: compressed by the preset compact. samplers: one for each material, fitted to it if None.

    Raises MaterialError if there is no material, for one that is not compact, and for another number of samplers.

    >>> nickel, paint = (sommerl.compress(sommerl.load(name), target_size=600, effort=1)[0]
    ...                  for name in ("nickel", "blue-metallic-paint"))
    >>> atlas = Atlas([nickel, paint])
    >>> atlas.eval([0, 0, 1], [0, 0, 1], [0, 1]).shape  # the same directions, of both materials
    (2, 3)
    """

    names: tuple[str, ...]  #: of the materials

    def __init__(self, materials: Iterable[Brdf], samplers: Sequence[HalfVectorSampler] | None = None) -> None:
        given = [_compact(material) for material in materials]
        if not given:
            raise MaterialError("atlas: expected materials, found none")
        if samplers is None:
            samplers = [HalfVectorSampler.fitted(material) for material, _, _ in given]
        if len(samplers) != len(given):
            raise MaterialError(f"atlas: expected {len(given)} samplers, one a material, found {len(samplers)}")
        self.names = tuple(material.name for material, _, _ in given)
        self._lattices, fold = _kinds([lattice for _, lattice, _ in given], lambda each: tuple(each.folds.values()))
        self._palettes, root = _kinds([palette for _, _, palette in given], lambda each: (each.signed, each.smooth))
        self._sampler = samplers[0]
        self._parts = Concatenated(
            material.buffers()
            | sampler.buffers()
            | {"albedos": albedos(material).reshape(-1), "fold": fold[number], "root": root[number]}
            for number, ((material, _, _), sampler) in enumerate(zip(given, samplers, strict=True))
        )

    def __len__(self) -> int:
        return len(self.names)

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.names[0]} … {self.names[-1]}: {len(self)} materials"

    def __repr__(self) -> str:
        return f"Atlas({self.name!r})"

    def buffers(self) -> dict[str, NDArray[Any]]:
        """The flat arrays that everything is looked up in, by name; a renderer uploads them once."""
        return self._parts.buffers

    @property
    def bytes_memory(self) -> int:
        """The bytes of these arrays."""
        return sum(buffer.nbytes for buffer in self.buffers().values())

    def of(self, number: Array, buffers: Buffers) -> dict[str, Any]:
        """What `f_r`, `draw` and `density` read in each lane, of the material of that number.

        number: as an index, or as a real number, which is rounded; whatever is out of range becomes one in range, so
        that nothing beyond the arrays is read. buffers: those of `buffers()`, as they are or uploaded.
        """
        return self._parts.of(ops(number).bin(number + 0.5, len(self)), buffers)

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        """Linear RGB [1/sr] for components of directions above the horizon. buffers: from `of`."""
        lattice, palette = self._lattices[0], self._palettes[0]
        place = _of_kind(buffers["fold"], [each.place(wi, wo) for each in self._lattices])
        value = blended(lattice.corners(*place, buffers), lambda node: palette.fetch(node, buffers))
        return _of_kind(buffers["root"], [each.reflectance(value, wi, wo, buffers) for each in self._palettes])

    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        """As `Sampler.draw`. buffers: from `of`."""
        return self._sampler.draw(wo, u, buffers)

    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        """As `Sampler.density`. buffers: from `of`."""
        return self._sampler.density(wi, wo, buffers)

    def eval(self, wi: ArrayLike, wo: ArrayLike, number: ArrayLike) -> Vectors:
        """f_r [1/sr] of the material of each number, (..., 3), as `Brdf.eval` gives it.

        number: whole numbers (...), which broadcast with the directions. Raises ValueError for those out of range.
        """
        light, viewer, which = self._broadcast("eval", number, wi, wo)
        which, buffers = which.reshape(-1), self.buffers()
        return evaluated(light, viewer, lambda wi, wo, pairs: self.f_r(wi, wo, self.of(which[pairs], buffers)))

    def sample(self, wo: ArrayLike, u: ArrayLike, number: ArrayLike) -> tuple[Vectors, Vectors, Vectors]:
        """Directions, densities and weights, as `Brdf.sample` gives them, of the material of each number (...)."""
        viewer, numbers, which = self._broadcast("sample", number, wo, u)
        here = self.of(which, self.buffers())
        return sampled(viewer, numbers, lambda wo, u: self.draw(wo, u, here), lambda wi, wo: self.eval(wi, wo, which))

    def pdf(self, wi: ArrayLike, wo: ArrayLike, number: ArrayLike) -> Vectors:
        """The density [1/sr] with which `sample` draws `wi` for `wo` and the material of each number, shape (...)."""
        light, viewer, which = self._broadcast("pdf", number, wi, wo)
        here = self.of(which, self.buffers())
        return densities(light, viewer, lambda wi, wo: self.density(wi, wo, here))

    def _broadcast(self, caller: str, number: ArrayLike, *given: ArrayLike) -> list[NDArray[Any]]:
        """The vectors and the numbers, of one shape; the numbers checked."""
        which = np.asarray(number)
        if which.dtype.kind not in "iu" or ((which < 0) | (which >= len(self))).any():
            raise ValueError(f"{caller}: expected whole numbers of materials from 0 to {len(self) - 1}, found others")
        one, other = vectors(caller, *given)
        try:
            shape = np.broadcast_shapes(one.shape[:-1], which.shape)
        except ValueError as error:
            found = f"{one.shape} and {which.shape}"
            raise ValueError(f"{caller}: expected shapes that broadcast, found {found}") from error
        return [*(np.broadcast_to(each, (*shape, 3)) for each in (one, other)), np.broadcast_to(which, shape)]


def is_compact(material: Brdf) -> bool:
    """Whether an atlas can hold a material."""
    return isinstance(material, SomManBrdf) and isinstance(material.palette, GainsAndShapes)


def _compact(material: Brdf) -> tuple[SomManBrdf, NodeLattice, GainsAndShapes]:
    """A material and its parts. Raises MaterialError for one that is not compact."""
    if isinstance(material, SomManBrdf):
        lattice, palette = material.lattice, material.palette
        if isinstance(lattice, NodeLattice) and isinstance(palette, GainsAndShapes):
            return material, lattice, palette
    found = "one of cells, of the preset paper" if isinstance(material, SomManBrdf) else f"a {material.kind}"
    raise MaterialError(f"{material.name}: expected a compact material for an atlas, found {found}")


def _kinds(parts: Sequence[Part], kind: Callable[[Part], tuple[bool, ...]]) -> tuple[list[Part], list[NDArray[Any]]]:
    """One part of each kind that there is; and for each part the number of its kind."""
    known: dict[tuple[bool, ...], int] = {}
    numbers = [known.setdefault(kind(part), len(known)) for part in parts]
    return [parts[numbers.index(k)] for k in range(len(known))], [np.array(k, np.uint8) for k in numbers]


def _of_kind(number: Array, values: Sequence[Triple]) -> Triple:
    """Of the values that each kind gives, those of the lane's kind."""
    x, y, z = values[0]
    for kind, (a, b, c) in enumerate(values[1:], start=1):
        here = number == kind
        where = ops(x).where
        x, y, z = where(here, a, x), where(here, b, y), where(here, c, z)
    return x, y, z
