"""What cells (`cells.Lattice`) and nodes (`nodes.NodeLattice`) have in common: places in half/difference angles that
hold values, and which of them a pair of directions asks for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from numpy.typing import NDArray

from ..system.errors import MaterialError
from .arrays import Array, Triple

if TYPE_CHECKING:
    from .cells import Lattice

Interpolation = Literal["nearest", "trilinear"]
INTERPOLATIONS: tuple[Interpolation, ...] = ("nearest", "trilinear")

Corners = Iterable[tuple[Array, Array]]  #: numbers of cells or nodes, and their weights, which add up to 1


class AnyLattice(ABC):
    """A lattice of cells or of nodes.

    Its formulas run on NumPy and on Dr.Jit arrays.
    """

    interpolations: ClassVar[tuple[Interpolation, ...]]  #: those that it has, the usual one first
    reciprocal: bool  #: whether a pair of directions asks for the same in both orders
    mirrored: bool = False  #: whether light from both sides of the viewer's plane asks for the same

    @property
    @abstractmethod
    def size(self) -> int:
        """The number of cells or nodes."""

    @property
    @abstractmethod
    def shape(self) -> tuple[int, int, int]:
        """Cells along θ_h, θ_d, φ_d; or rows of nodes, and the most nodes in θ_d and in φ_d that a row has."""

    @property
    @abstractmethod
    def grid(self) -> Lattice | None:
        """Itself if it is one of cells; None if it is one of nodes."""

    @property
    @abstractmethod
    def array_shape(self) -> tuple[int, ...]:
        """The shape of an array with one entry for each cell or node."""

    def buffers(self) -> dict[str, NDArray[Any]]:
        """The arrays that `corners` reads, by name; see `Brdf.buffers`."""
        return {}

    @abstractmethod
    def place(self, wi: Triple, wo: Triple) -> Triple:
        """Where pairs of directions lie, as coordinates that `corners` takes."""

    @abstractmethod
    def corners(self, x: Array, y: Array, z: Array, buffers: Mapping[str, Any]) -> list[tuple[Array, Array]]:
        """The 8 cells or nodes about a place, and their weights, which add up to 1."""

    def lookup(
        self,
        wi: Triple,
        wo: Triple,
        interpolation: Interpolation,
        buffers: Mapping[str, Any],
        fetch: Callable[[Array], Triple],
    ) -> Triple:
        """The values of the cells or nodes about pairs of directions, blended. fetch: gives the values of numbers."""
        return blended(self.corners(*self.place(wi, wo), buffers), fetch)

    def checked(self, name: str, interpolation: str) -> Interpolation:
        """The interpolation of that name. Raises MaterialError, with the material's name, if this lattice has none."""
        for known in self.interpolations:
            if known == interpolation:
                return known
        expected = " or ".join(self.interpolations)
        between = "" if self.grid else " between nodes"
        raise MaterialError(f"{name}: expected {expected} interpolation{between}, found {interpolation}")


def blended(corners: Corners, fetch: Callable[[Array], Triple]) -> Triple:
    """The weighted sum of what `fetch` gives for each corner."""
    (number, weight), *others = corners
    x, y, z = (weight * value for value in fetch(number))
    for number, weight in others:
        more = fetch(number)
        x, y, z = x + weight * more[0], y + weight * more[1], z + weight * more[2]
    return x, y, z
