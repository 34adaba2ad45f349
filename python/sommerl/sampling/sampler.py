"""What every importance sampler is: directions to the light for a direction to the viewer, and their density."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, Triple, split
from ..brdf import Brdf, Buffers

PI = np.pi


class Sampler(ABC):
    """An importance sampler of one BRDF. A subclass gives two formulas, which run on NumPy and on Dr.Jit arrays.

    brdf: the one whose light it follows, and whose light `sample` weighs.
    """

    name: str  #: as users write it: see `named`
    brdf: Brdf

    @classmethod
    @abstractmethod
    def fitted(cls, brdf: Brdf) -> Self:
        """The sampler for a BRDF."""

    def buffers(self) -> dict[str, NDArray[Any]]:
        """The NumPy arrays that the formulas read, by name; one of shape () is a number.

        A renderer uploads them once.
        """
        return {}

    @property
    def bytes_memory(self) -> int:
        """The bytes of these arrays."""
        return sum(buffer.nbytes for buffer in self.buffers().values())

    @abstractmethod
    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        """A direction wi for `wo` and uniform random numbers u in [0, 1)³, and its density [1/sr].

        Where the density is 0, nothing was drawn: `wo`, or what came out, is below the horizon.
        """

    @abstractmethod
    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        """The density [1/sr] of drawing `wi` for `wo`; 0 where either is below the horizon."""

    def sample(
        self, wo: ArrayLike, u: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Directions to the light for directions to the viewer `wo` and random numbers `u`, both of shape (..., 3).

        Returns wi (..., 3), their densities [1/sr] (...), and their weights f_r cos θ_i / pdf (..., 3), whose mean is
        the albedo. Density and weight are 0 where nothing was drawn. Raises ValueError for other shapes.
        """
        viewer, numbers = _triples(wo, u)
        wi, pdf = self.draw(split(viewer), split(numbers), self.buffers())
        light = np.stack(wi, axis=-1)
        drawn = pdf > 0
        light = np.where(drawn[..., None], light, [0.0, 0.0, 1.0])
        share = np.where(drawn, light[..., 2] / np.where(drawn, pdf, 1.0), 0.0)
        return light, pdf, self.brdf.eval(light, viewer) * share[..., None]

    def pdf(self, wi: ArrayLike, wo: ArrayLike) -> NDArray[np.float64]:
        """The density [1/sr] of drawing `wi` for `wo`, unit directions of shape (..., 3), which broadcast.

        0 where either is not above the horizon. Raises ValueError for other shapes.
        """
        light, viewer = _triples(wi, wo)
        return np.asarray(self.density(split(light), split(viewer), self.buffers()))


def _triples(*arrays: ArrayLike) -> list[NDArray[np.float64]]:
    given = [np.asarray(array, np.float64) for array in arrays]
    if any(array.shape[-1:] != (3,) for array in given):
        raise ValueError(f"expected arrays of shape (..., 3), found {' and '.join(str(a.shape) for a in given)}")
    return np.broadcast_arrays(*given)  # pyright: ignore[reportReturnType]
