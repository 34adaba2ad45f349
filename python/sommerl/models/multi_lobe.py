"""Analytic models: sums of lobes, each with an albedo for each channel.

Ngan, Durand & Matusik 2005, "Experimental Analysis of BRDF Models", EGSR: a Lambertian base under one or more specular
lobes; albedos differ between channels, shapes do not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import Triple, ops
from ..reflectance.brdf import Brdf, Buffers
from ..system.errors import MaterialError
from .ashikhmin_shirley import ASHIKHMIN_SHIRLEY
from .blinn_phong import BLINN_PHONG
from .cook_torrance import COOK_TORRANCE
from .family import Angles, Family
from .ggx import GGX
from .lafortune import LAFORTUNE
from .lambertian import LAMBERTIAN
from .oren_nayar import OREN_NAYAR
from .phong import PHONG
from .retro_ggx import RETRO_GGX
from .torrance_sparrow import TORRANCE_SPARROW
from .ward import WARD
from .ward_duer import WARD_DUER

FAMILIES: dict[str, Family] = {
    family.name: family
    for family in (
        LAMBERTIAN,
        OREN_NAYAR,
        PHONG,
        BLINN_PHONG,
        WARD,
        WARD_DUER,
        LAFORTUNE,
        COOK_TORRANCE,
        TORRANCE_SPARROW,
        ASHIKHMIN_SHIRLEY,
        GGX,
        RETRO_GGX,
    )
}

LARGEST_ALBEDO = 1e30  # renderers calculate in single precision


@dataclass(frozen=True)
class Lobe:
    """One lobe: a family's formula times an albedo (r, g, b).

    shape: a number for each of the family's parameters, by name. Raises MaterialError for missing or unknown names, for
    parameters out of their bounds, and for albedos that are negative, too large or not finite.
    """

    family: Family
    albedo: tuple[float, float, float]
    shape: Mapping[str, float]

    def __post_init__(self) -> None:
        name, bounds = self.family.name, {p.name: p for p in self.family.parameters}
        if set(self.shape) != set(bounds):
            raise MaterialError(f"{name}: expected parameters {sorted(bounds)}, found {sorted(self.shape)}")
        for key, value in self.shape.items():
            if not bounds[key].low <= value <= bounds[key].high:
                raise MaterialError(
                    f"{name}: {key}: expected {bounds[key].low:g} to {bounds[key].high:g}, found {value:g}"
                )
        if len(self.albedo) != 3 or not all(0 <= value <= LARGEST_ALBEDO for value in self.albedo):
            raise MaterialError(
                f"{name}: albedo: expected three numbers of at least 0, at most {LARGEST_ALBEDO:g}, found {self.albedo}"
            )

    def as_json(self) -> dict[str, Any]:
        return {"family": self.family.name, "albedo": list(self.albedo), **self.shape}

    @property
    def exponent(self) -> float:
        """How narrow the lobe is: the exponent of a Blinn-Phong lobe of about the same width; 0 for a diffuse lobe."""
        return self.family.exponent(*self.values) if self.family.exponent else 0.0

    @property
    def values(self) -> tuple[float, ...]:
        """The numbers of the shape, in the order of the family's parameters."""
        return tuple(self.shape[p.name] for p in self.family.parameters)


class MultiLobe(Brdf):
    """The BRDF f_r = Σ albedo · lobe. Raises MaterialError if there is no lobe."""

    def __init__(self, name: str, lobes: Sequence[Lobe]) -> None:
        if not lobes:
            raise MaterialError(f"{name}: expected one lobe or more, found none")
        self.name = name
        self.lobes = tuple(lobes)

    def buffers(self) -> dict[str, NDArray[Any]]:
        # In a buffer and not in the formula, so that materials with the same families share one compiled kernel.
        return {"parameters": np.array([x for lobe in self.lobes for x in (*lobe.albedo, *lobe.values)])}

    def details(self) -> dict[str, Any]:
        return {"lobes": [lobe.as_json() for lobe in self.lobes]}

    @property
    def mirrored(self) -> bool:
        return True

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        angles, parameters, gather = Angles(wi, wo), buffers["parameters"], ops(wi[0]).gather
        total, start = [0.0, 0.0, 0.0], 0
        for lobe in self.lobes:
            count = 3 + len(lobe.family.parameters)
            found = [gather(parameters, start + k) for k in range(count)]
            start += count
            value = lobe.family.lobe(angles, *found[3:])
            total = [sum_ + albedo * value for sum_, albedo in zip(total, found[:3], strict=True)]
        r, g, b = total
        return r, g, b
