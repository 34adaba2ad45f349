"""How the numbers in a file of samples are meant, where they are not f_r over Δφ from the light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..reflectance.samples import Samples

Values = Literal["f_r", "f_r-cos", "reflectance-factor"]
PhiFrom = Literal["retro", "specular"]

PERCENT = 2.0  # reflectance factors whose median is more are in percent: white has 1


@dataclass(frozen=True)
class Meant:
    """values: f_r [1/sr]; f_r-cos, f_r times the cosine of the viewer's angle; or reflectance-factor, π f_r, also in
    percent, which its size tells. phi_from: where the viewer's azimuth is measured from: the side of the light (retro),
    or that of the mirror's direction (specular)."""

    values: Values = "f_r"
    phi_from: PhiFrom = "retro"

    def f_r(self, samples: Samples) -> Samples:
        """The samples with values in f_r, and azimuths from the light. Where a cosine to divide by is below 10⁻⁶, a
        sample is at the horizon, and stays as it is."""
        f_r, wo = samples.f_r, samples.wo
        if self.values == "f_r-cos":
            f_r = f_r / np.where(wo[:, 2:] > 1e-6, wo[:, 2:], 1.0)
        elif self.values == "reflectance-factor":
            percent = float(np.median(f_r.max(axis=1))) > PERCENT
            f_r = f_r / (np.pi * (100.0 if percent else 1.0))
        if self.phi_from == "specular":
            wo = wo * [-1.0, -1.0, 1.0]
        return Samples(samples.wi, wo, f_r)


AS_WRITTEN = Meant()
