"""Scattered samples of a reflectance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system.errors import FormatError
from .half_diff import spherical


@dataclass(frozen=True)
class Samples:
    """wi, wo: unit directions (n, 3) to light and viewer. f_r: linear RGB [1/sr] (n, 3)."""

    wi: NDArray[np.float64]
    wo: NDArray[np.float64]
    f_r: NDArray[np.float64]

    @classmethod
    def at_angles(cls, angles: NDArray[np.float64], f_r: NDArray[np.float64]) -> Samples:
        """angles: (n, 4), θ_i, φ_i, θ_o, φ_o [rad]. Raises FormatError if one is not finite."""
        if not np.isfinite(angles).all():
            raise FormatError("expected finite angles in every sample, found NaN or infinity")
        wi, wo = (np.stack(spherical(angles[:, k], angles[:, k + 1]), axis=-1) for k in (0, 2))
        return cls(wi, wo, f_r)

    def some(self, which: NDArray[Any] | slice) -> Samples:
        """Those of a mask, of a slice, or with the given numbers."""
        return Samples(self.wi[which], self.wo[which], self.f_r[which])


def polar_angles(directions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """θ and φ [rad] of directions (n, 3), as `Samples.at_angles` takes them. φ is from −π to π."""
    x, y, z = directions.T
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
