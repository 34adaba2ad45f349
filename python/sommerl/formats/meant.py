"""From numbers in a file of samples, as they are meant, to f_r over the azimuth from the light."""

from __future__ import annotations

import numpy as np

from ..reflectance.samples import Samples
from .reading import Reading

PERCENT = 2.0  # reflectance factors whose median is more are in percent: white has 1
HORIZON = 1e-6  # cosines below are not divided by


def as_f_r(samples: Samples, how: Reading) -> Samples:
    """The samples, whose numbers are meant as `how` says, with f_r and directions as they are meant here. Where the
    viewer is at the horizon, values stay as they are."""
    f_r, wo = samples.f_r, samples.wo
    if how.values == "f_r-cos":
        f_r = f_r / np.where(wo[:, 2:] > HORIZON, wo[:, 2:], 1.0)
    elif how.values == "reflectance-factor":
        percent = float(np.median(f_r.max(axis=1))) > PERCENT
        f_r = f_r / (np.pi * (100.0 if percent else 1.0))
    if how.phi_from == "specular":
        wo = wo * [-1.0, -1.0, 1.0]
    return Samples(samples.wi, wo, f_r)
