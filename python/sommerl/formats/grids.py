"""Grids of directions: BRDFs evaluated on one, and samples that lie on one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.grid import SAME, GridBrdf
from ..reflectance.half_diff import TWO_PI, spherical

Values = NDArray[np.float64]
Axes = tuple[Values, Values, Values]

AT_ONCE = 2**18  # directions evaluated at once
STEP, HIGHEST = 5.0, 85.0  # [deg] of a grid that is written of what has none
IN_PLANE = np.radians(0.5)  # azimuths between 0 and this, or this and π, lie on neither side of the plane of incidence


def on_grid(brdf: Brdf, axes: Axes, *, both_sides: bool = False) -> Values:
    """f_r at all combinations of θ_i, θ_o and φ [rad], (n, m, k, 3). both_sides: the mean of those at φ and −φ."""
    angles = np.meshgrid(*axes, indexing="ij")
    theta_i, theta_o, phi = (angle.reshape(-1) for angle in angles)
    found = np.empty((len(phi), 3))
    for start in range(0, len(phi), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        light = np.stack(spherical(theta_i[part], np.zeros_like(phi[part])), axis=-1)
        values = [
            brdf.eval(light, np.stack(spherical(theta_o[part], side * phi[part]), axis=-1))
            for side in ((1.0, -1.0) if both_sides else (1.0,))
        ]
        found[part] = np.mean(values, axis=0)
    return found.reshape(*angles[0].shape, 3)


def axes_of(brdf: Brdf) -> Axes:
    """θ_i, θ_o and φ [rad] at which a BRDF is written: its own, if it has such a grid; else every 5°, up to 85°, over a
    half turn if it is mirrored, else over a full one."""
    if isinstance(brdf, GridBrdf) and not brdf.about_mirror:
        theta_i, theta_o, phi = brdf.axes
        return theta_i, theta_o, phi
    theta = np.radians(np.arange(0, HIGHEST + STEP / 2, STEP))
    phi = np.radians(np.arange(0, 180 + STEP / 2 if brdf.mirrored else 360 - STEP / 2, STEP))
    return theta, theta, phi


def regular(theta_i: Values, theta_o: Values, phi: Values, values: Values) -> tuple[Axes, Values] | None:
    """The axes, and the values (n, m, k, …), of samples that lie on a whole grid, each once; None if they do not.

    Angles [rad] (count,), values (count, …). Azimuths are taken between 0 and 2π, and on the `first_side` if all lie on
    the other; a second end of a full turn is left out.
    """
    around = np.mod(phi, TWO_PI)
    around[around > TWO_PI - SAME] = 0.0
    whole = np.abs(phi - TWO_PI) < SAME
    known = ~whole if (around[~whole] < SAME).any() else np.ones(len(phi), bool)
    (first, i), (second, j), (third, k) = (_axis(angle[known]) for angle in (theta_i, theta_o, first_side(around)))
    shape = len(first), len(second), len(third)
    if int(np.prod(shape)) != int(known.sum()):
        return None
    flat = (i * shape[1] + j) * shape[2] + k
    if len(np.unique(flat)) < len(flat):
        return None
    found = np.empty((len(flat), *values.shape[1:]))
    found[flat] = values[known]
    return (first, second, third), found.reshape(*shape, *values.shape[1:])


def first_side(phi: Values) -> Values:
    """Azimuths from 0 to 2π [rad]; where all lie on the second side of the plane of incidence, those of their mirror
    images, which stand for both sides: instruments that rely on mirror symmetry measure one side alone."""
    return phi if (np.sin(phi) > IN_PLANE).any() else np.minimum(phi, TWO_PI - phi)


def _axis(angles: Values) -> tuple[Values, NDArray[np.intp]]:
    """The different ones of some angles, and which of them each is."""
    order = np.argsort(angles, kind="stable")
    new = np.diff(angles[order], prepend=-np.inf) >= SAME
    place = np.empty(len(angles), np.intp)
    place[order] = np.cumsum(new) - 1
    return angles[order][new], place
