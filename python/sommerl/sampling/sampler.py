"""What every importance sampler is: directions to the light for a direction to the viewer, and their density."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..reflectance.arrays import Array, Triple, split
from ..reflectance.brdf import Brdf, Buffers, finite, told, vectors

PI = np.pi
UP = np.array([0.0, 0.0, 1.0])  # in the place of directions that are none


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
        the albedo. Density and weight are 0 where nothing was drawn. All three are NaN where `wo` or `u` is not finite.
        Raises ValueError for other shapes, for what are not real numbers, and for `u` outside of [0, 1].
        """
        viewer, numbers = vectors("sample", wo, u)
        if ((numbers < 0) | (numbers > 1)).any():
            raise ValueError("sample: expected random numbers from 0 to 1, found others")
        known = np.asarray(np.isfinite(viewer + numbers).all(axis=-1))
        above = known & (viewer[..., 2] > 0)
        viewer = np.where(above[..., None], viewer, UP)
        numbers = np.where(known[..., None], numbers, 0.5)
        with np.errstate(all="ignore"):
            wi, density = self.draw(split(viewer), split(numbers), self.buffers())
            drawn = above & (density > 0)
            light = np.where(drawn[..., None], np.stack(wi, axis=-1), UP)
            pdf = finite(np.where(drawn, density, 0.0))
            share = np.where(drawn, light[..., 2] / np.where(drawn, pdf, 1.0), 0.0)
            weight = finite(self.brdf.eval(light, viewer) * share[..., None])
        light, weight = (np.where(known[..., None], each, np.nan) for each in (light, weight))
        return light, np.where(known, pdf, np.nan), weight

    def pdf(self, wi: ArrayLike, wo: ArrayLike) -> NDArray[np.float64]:
        """The density [1/sr] of drawing `wi` for `wo`, unit directions of shape (..., 3), which broadcast.

        As in `Brdf.eval`, NaN where a component of either is not finite, else 0 where either is not above the horizon.
        Raises ValueError for other shapes, and for what are not real numbers.
        """
        light, viewer = vectors("pdf", wi, wo)
        known, above = told(light, viewer)
        light, viewer = (np.where(above[..., None], w, UP) for w in (light, viewer))
        with np.errstate(all="ignore"):
            density = finite(np.asarray(self.density(split(light), split(viewer), self.buffers())))
        return np.where(known, np.where(above & (density > 0), density, 0.0), np.nan)
