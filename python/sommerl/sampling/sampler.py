"""The base class of all importance samplers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..reflectance.arrays import Array, Triple, split
from ..reflectance.brdf import Brdf, Buffers, Vectors, finite, finite_and_above, vectors

PI = np.pi
UP = np.array([0.0, 0.0, 1.0])  # takes the place of directions that are not valid


class Sampler(ABC):
    """An importance sampler of one BRDF: it draws a direction to the light for a direction to the viewer.

    A subclass implements `draw` and `density`, which run on NumPy and on Dr.Jit arrays. brdf: the BRDF that the sampler
    is fitted to, and from which `sample` computes weights.
    """

    name: str  #: the name that users write: see `named`
    brdf: Brdf

    @classmethod
    @abstractmethod
    def fitted(cls, brdf: Brdf) -> Self:
        """A sampler for a BRDF."""

    def buffers(self) -> dict[str, NDArray[Any]]:
        """The NumPy arrays that `draw` and `density` read, by name; an array of shape () is a number.

        A renderer uploads them once.
        """
        return {}

    @property
    def bytes_memory(self) -> int:
        """The size of these arrays [bytes]."""
        return sum(buffer.nbytes for buffer in self.buffers().values())

    @abstractmethod
    def draw(self, wo: Triple, u: Triple, buffers: Buffers) -> tuple[Triple, Array]:
        """Draws a direction wi for `wo` with uniform random numbers u in [0, 1)³; returns it and its density [1/sr].

        A density of 0 means that the draw failed: `wo` or the drawn direction is below the horizon.
        """

    @abstractmethod
    def density(self, wi: Triple, wo: Triple, buffers: Buffers) -> Array:
        """The density [1/sr] of drawing `wi` for `wo`; 0 if either is below the horizon."""

    def sample(self, wo: ArrayLike, u: ArrayLike) -> tuple[Vectors, Vectors, Vectors]:
        """Draws directions to the light for directions to the viewer `wo` with random numbers `u`, both (..., 3).

        Returns directions wi (..., 3), their densities [1/sr] (...), and weights f_r cos θ_i / pdf (..., 3), whose mean
        is the albedo. Density and weight are 0 where a draw failed (see `draw`). All three are NaN where `wo` or `u` is
        not finite. Raises ValueError for other shapes, for values that are not real numbers, and for `u` outside [0,
        1].
        """
        viewer, numbers = vectors("sample", wo, u)
        buffers = self.buffers()
        return sampled(viewer, numbers, lambda wo, u: self.draw(wo, u, buffers), self.brdf.eval)

    def pdf(self, wi: ArrayLike, wo: ArrayLike) -> Vectors:
        """The density [1/sr] of drawing `wi` for `wo`, unit vectors of shape (..., 3), which broadcast.

        As in `Brdf.eval`, it is NaN where a component is not finite, and 0 where a direction is not above the horizon.
        Raises ValueError for other shapes, and for values that are not real numbers.
        """
        light, viewer = vectors("pdf", wi, wo)
        buffers = self.buffers()
        return densities(light, viewer, lambda wi, wo: self.density(wi, wo, buffers))


def sampled(
    viewer: Vectors,
    numbers: Vectors,
    draw: Callable[[Triple, Triple], tuple[Triple, Array]],
    f_r: Callable[[Vectors, Vectors], Vectors],
) -> tuple[Vectors, Vectors, Vectors]:
    """What `Sampler.sample` gives for viewers and random numbers, both of one shape (..., 3).

    draw: as `Sampler.draw`, without buffers. f_r: as `Brdf.eval`. Both are given one pair for each viewer.
    """
    if ((numbers < 0) | (numbers > 1)).any():
        raise ValueError("sample: random numbers have to be from 0 to 1, and some are not")
    known = np.asarray(np.isfinite(viewer + numbers).all(axis=-1))
    above = known & (viewer[..., 2] > 0)
    viewer = np.where(above[..., None], viewer, UP)
    numbers = np.where(known[..., None], numbers, 0.5)
    with np.errstate(all="ignore"):
        wi, density = draw(split(viewer), split(numbers))
        towards = np.stack(wi, axis=-1)
        drawn = above & (density > 0) & np.isfinite(towards).all(axis=-1)  # which overflow may have undone
        light = np.where(drawn[..., None], towards, UP)
        pdf = finite(np.where(drawn, density, 0.0))
        share = np.where(drawn, light[..., 2] / np.where(drawn, pdf, 1.0), 0.0)
        weight = finite(f_r(light, viewer) * share[..., None])
    light, weight = (np.where(known[..., None], each, np.nan) for each in (light, weight))
    return light, np.where(known, pdf, np.nan), weight


def densities(light: Vectors, viewer: Vectors, density: Callable[[Triple, Triple], Array]) -> Vectors:
    """What `Sampler.pdf` gives for pairs of directions, both of one shape (..., 3).

    density: as `Sampler.density`, without buffers; it is given each pair.
    """
    known, above = finite_and_above(light, viewer)
    light, viewer = (np.where(above[..., None], w, UP) for w in (light, viewer))
    with np.errstate(all="ignore"):
        found = finite(np.asarray(density(split(light), split(viewer))))
    return np.where(known, np.where(above & (found > 0), found, 0.0), np.nan)
