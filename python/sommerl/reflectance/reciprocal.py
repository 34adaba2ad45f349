"""A reciprocal BRDF from one that is not: what a representation holds that gives the same for both orders."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, Triple, ops
from .brdf import Brdf, Buffers
from .distance import moved_share
from .info import Counts

VIEWERS = 16  # elevations at which the albedo is bounded, at equal steps of √cos θ_o
LOWEST = 1e-4  # cos θ_o of the lowest one
POINTS = 5  # along each side of a sampler's cell, of the albedos' quadrature: within 1 %
EVEN = 0.1  # cosines above that count alike in the mean
ROUNDING = 1e-6  # by how much a mean may exceed the bound before it is made darker


def reciprocal(brdf: Brdf) -> Brdf:
    """The BRDF itself if it is reciprocal; else the mean of both orders of the directions.

    Near grazing, each order counts by the cosine of its light:

        f'(ω_i, ω_o) = (f(ω_i, ω_o) c_i + f(ω_o, ω_i) c_o) / (c_i + c_o),  c = min(cos θ, EVEN),

    since instruments measure f cos θ_i, whose noise a division by a small cosine turns into peaks. Where the mean would
    still reflect more than the larger of 1 and the BRDF's own albedo, it is multiplied by a factor for the light's
    elevation or the viewer's, the smaller of the two, so that it does not.

    >>> both = reciprocal(sommerl.load("nickel"))
    >>> both.reciprocal
    True
    """
    return brdf if brdf.reciprocal else ReciprocalBrdf(brdf)


class ReciprocalBrdf(Brdf):
    """The mean of both orders of the directions of another BRDF: see `reciprocal`. It is of the other's kind, and what
    is made from it counts as made from the other.
    """

    def __init__(self, brdf: Brdf) -> None:
        self._one_sided = brdf
        self.name, self.source, self.file_sha256 = brdf.name, brdf.source, brdf.file_sha256
        self._factors = np.ones(VIEWERS)
        self._factors = self._bounded()
        del self.sampler  # of what was not bounded yet

    @property
    def kind(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride] # that of an object, here
        return self._one_sided.kind

    @property
    def compressed(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._one_sided.compressed

    @property
    def signed(self) -> bool:
        return self._one_sided.signed

    @property
    def lookup(self) -> str:
        return self._one_sided.lookup

    @property
    def facts(self) -> dict[str, Any]:
        """Those of the other one, and by how much its mean was darkened at most."""
        return self._one_sided.facts | {"reciprocal": True, "darkened": 1.0 - float(self._factors.min())}

    @property
    def mirrored(self) -> bool:
        return self._one_sided.mirrored

    @cached_property
    def counts(self) -> Counts:  # pyright: ignore[reportIncompatibleMethodOverride] # a property, too
        """Those of the other one, and how much energy the mean moved."""
        moved = moved_share(self._one_sided.f_r, self.f_r, self.buffers())
        return replace(self._one_sided.counts, energy_averaged=moved)

    def buffers(self) -> dict[str, NDArray[Any]]:
        return self._one_sided.buffers() | {"reciprocal_factors": self._factors}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        f = ops(wi[0])
        forward, backward = self._one_sided.f_r(wi, wo, buffers), self._one_sided.f_r(wo, wi, buffers)
        factor = f.minimum(*(_factor(w[2], buffers["reciprocal_factors"]) for w in (wi, wo)))
        c_i, c_o = (f.minimum(w[2], EVEN) for w in (wi, wo))
        share = c_i / (c_i + c_o)
        r, g, b = ((y + (x - y) * share) * factor for x, y in zip(forward, backward, strict=True))
        return r, g, b

    def _bounded(self) -> NDArray[np.float64]:
        """For each elevation the factor that bounds the albedo there."""
        theta = np.arccos(np.maximum((np.arange(VIEWERS) / (VIEWERS - 1)) ** 2, LOWEST))
        source, mean = (brdf.sampler.albedo(theta, points=POINTS) for brdf in (self._one_sided, self))
        factors = np.minimum(1.0, (np.maximum(source, 1.0) / np.maximum(mean, 1e-9)).min(axis=-1))
        factors[factors > 1.0 - ROUNDING] = 1.0
        # Between two elevations, the smaller factor of the two bounds both.
        return np.minimum(factors, np.minimum(np.append(factors[1:], 1.0), np.append(1.0, factors[:-1])))


def _factor(cosine: Array, factors: Any) -> Array:
    """The factor for a direction, interpolated."""
    f = ops(cosine)
    x = f.sqrt(f.maximum(cosine, 0.0)) * (VIEWERS - 1)
    node = f.bin(x, VIEWERS - 1)
    here, next_ = f.gather(factors, node), f.gather(factors, node + 1)
    return here + (x - node) * (next_ - here)
