"""A table of samples beside what a material says there, as text."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..reflectance.brdf import Brdf
from ..reflectance.samples import Samples, polar_angles
from ..system.files import atomic_write
from .compared import relative_errors

MARK = "# Written by Sommerl: residuals"
COLUMNS = (
    *("theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg"),
    *("r", "g", "b", "r_written", "g_written", "b_written", "relative_error"),
)


def write(samples: Samples, brdf: Brdf, path: Path) -> None:
    """Writes a line for each sample, in the order in which they are in the file they are from, repeated ones once: its
    directions, its value, that of the material, and the relative error (`compared.relative_errors`)."""
    angles = [np.degrees(angle) for w in (samples.wi, samples.wo) for angle in polar_angles(w)]
    found = brdf.eval(samples.wi, samples.wo)
    table = np.column_stack([*angles, samples.f_r, found, relative_errors(samples, brdf)])
    with atomic_write(path) as out:
        out.write(f"{MARK}\n{','.join(COLUMNS)}\n".encode())
        np.savetxt(out, table, fmt="%.6g", delimiter=",")
