"""Samples on a regular grid of θ_i, θ_o and Δφ: recognised, so that they are interpolated along their own axes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.grid import GridBrdf
from ..reflectance.half_diff import TWO_PI
from ..reflectance.samples import Samples, polar_angles
from ..system.errors import FormatError, MaterialError
from .grids import first_side

STEP = 1e-4  # [rad] angles that agree to that are one
AT_NORMAL = 1e-3  # [rad] from there on, Δφ means something
FEWEST = 4  # angles on each axis
MOST_MISSING = 0.05  # of a grid's points: these are interpolated along Δφ

Floats = NDArray[np.float64]


def grid_of(
    samples: Samples, *, name: str, source_sha256: str = "", facts: Mapping[str, Any] = MappingProxyType({})
) -> GridBrdf | None:
    """The material of samples that lie on a regular grid; None of others.

    samples: finite, none below the horizon. Where more than one are at a point of the grid, it has their mean.
    Its facts, beyond those of every grid: samples; samples_merged, how many repeated others; grid_points_missing, at
    which none was measured, and which are interpolated along Δφ. Raises FormatError if no sample is positive.
    """
    theta_i, theta_o, phi = angles_of(samples)
    (light, place_i), (viewer, place_o) = _axis(theta_i), _axis(theta_o)
    known = (theta_i > AT_NORMAL) & (theta_o > AT_NORMAL)
    if min(len(light), len(viewer)) < FEWEST or not known.any():
        return None
    azimuths, found = _axis(first_side(phi[known]))
    if azimuths[-1] > TWO_PI - STEP:  # the same as 0
        azimuths = azimuths[:-1]
        found = found % len(azimuths)
    shape = len(light), len(viewer), len(azimuths)
    points = shape[0] * shape[1] * shape[2]
    if len(azimuths) < FEWEST or points > 2 * len(theta_i):
        return None
    place = np.zeros(len(theta_i), np.int64)
    place[known] = found
    flat = (place_i * shape[1] + place_o) * shape[2] + place
    count = np.bincount(flat, minlength=points).reshape(shape)
    sums = np.stack([np.bincount(flat, weights=channel, minlength=points) for channel in samples.f_r.T], axis=-1)
    values = sums.reshape(*shape, 3) / np.maximum(count, 1)[..., None]
    missing = count == 0
    for axis, at in ((light, (0, slice(None))), (viewer, (slice(None), 0))):
        if axis[0] <= AT_NORMAL:  # Δφ means nothing there: what was measured at any stands for all
            total, seen = sums.reshape(*shape, 3)[at].sum(axis=-2), count[at].sum(axis=-1)
            values[at] = (total / np.maximum(seen, 1)[..., None])[..., None, :]
            missing[at] = seen[..., None] == 0
    if missing.mean() > MOST_MISSING or missing.all(axis=2).any():
        return None
    _fill(values, missing, azimuths)
    found_facts = {
        "samples": len(theta_i),
        "samples_merged": len(theta_i) - int((np.bincount(flat) > 0).sum()),
        "grid_points_missing": int(missing.sum()),
        **facts,
    }
    try:
        return GridBrdf(light, viewer, azimuths, values, name=name, source_sha256=source_sha256, facts=found_facts)
    except MaterialError as error:
        raise FormatError(str(error)) from error


def angles_of(samples: Samples) -> tuple[Floats, Floats, Floats]:
    """θ_i, θ_o, and Δφ from light to viewer, from 0 to 2π [rad]."""
    (theta_i, _), (theta_o, _) = map(polar_angles, (samples.wi, samples.wo))
    (x, y), (u, v) = samples.wi[:, :2].T, samples.wo[:, :2].T
    phi = np.arctan2(x * v - y * u, x * u + y * v)
    phi[phi < -STEP / 2] += TWO_PI
    return theta_i, theta_o, np.maximum(phi, 0.0)


def _axis(angle: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """The different angles, and which of them each is."""
    steps, first, place = np.unique(np.rint(angle / STEP).astype(np.int64), return_index=True, return_inverse=True)
    new = np.diff(steps, prepend=steps[0] - 2) > 1  # an angle between two steps is rounded to either
    return angle[first[new]], np.cumsum(new)[place] - 1


def _fill(values: Floats, missing: NDArray[np.bool_], phi: Floats) -> None:
    """Interpolates what is missing along φ."""
    for i, j in np.argwhere(missing.any(axis=2)).tolist():
        lost = missing[i, j]
        for channel in range(3):
            values[i, j, lost, channel] = np.interp(phi[lost], phi[~lost], values[i, j, ~lost, channel])
