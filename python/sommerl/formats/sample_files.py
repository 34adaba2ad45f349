"""Writing f_r at directions: as text with the columns that `samples` reads, or as an array of NumPy's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.half_diff import spherical
from ..system.files import atomic_write
from .grids import AT_ONCE, axes_of

MARK = b"# Written by Sommerl\n"
HEADER = b"theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n"

Values = NDArray[np.float64]


def at_directions(brdf: Brdf, angles: Values) -> Values:
    """Rows of θ_i, φ_i, θ_o, φ_o [rad], (n, 4), with f_r there behind them, (n, 7); 0 below the horizon."""
    rows = np.empty((len(angles), 7))
    rows[:, :4] = angles
    for start in range(0, len(angles), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        wi, wo = (np.stack(spherical(*angles[part, k : k + 2].T), axis=-1) for k in (0, 2))
        rows[part, 4:] = brdf.eval(wi, wo)
    return rows


def grid_of(brdf: Brdf) -> Values:
    """The directions of a grid (`grids.axes_of`) with φ_i = 0, (n, 4)."""
    theta_i, theta_o, phi = (each.reshape(-1) for each in np.meshgrid(*axes_of(brdf), indexing="ij"))
    return np.stack([theta_i, np.zeros_like(phi), theta_o, phi], axis=-1)


def write(rows: Values, path: Path) -> None:
    """Writes rows of `at_directions`: .npy as they are, in radians; else as text, in degrees, with tabs in .tsv."""
    with atomic_write(path) as out:
        if path.suffix.lower() == ".npy":
            np.save(out, rows, allow_pickle=False)
            return
        delimiter = "\t" if path.suffix.lower() == ".tsv" else ","
        out.write(MARK + HEADER.replace(b",", delimiter.encode()))
        degrees = np.concatenate([np.degrees(rows[:, :4]), rows[:, 4:]], axis=1)
        np.savetxt(out, degrees, "%.9g", delimiter)


def write_grid(brdf: Brdf, path: Path) -> Brdf:
    """Writes a BRDF at the directions of a grid, and returns it."""
    write(at_directions(brdf, grid_of(brdf)), path)
    return brdf


def write_plan(angles: Values, path: Path) -> None:
    """Writes θ_i, φ_i, θ_o, φ_o [rad], (n, 4), as text in degrees, with columns for values that are empty."""
    with atomic_write(path) as out:
        out.write(MARK + HEADER)
        np.savetxt(out, np.degrees(angles), "%.4f", ",", newline=",,,\n")
