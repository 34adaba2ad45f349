"""ALTA's text files of samples (Belcour, Barla & Pacanowski, "ALTA: A BRDF Analysis Library", 2014).

Lines that begin with "#" say what the columns are: `#DIM n m`, `#PARAM_IN` how n numbers name a pair of directions,
`#PARAM_OUT` what m values mean, `#VS k`, how many numbers of each row after them give intervals. ALTA's view direction
V is our viewer, its light L our light.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.half_diff import directions, spherical
from ..reflectance.samples import Samples
from ..system import door
from ..system.errors import FormatError
from . import sample_text, samples
from .format import Format
from .reading import asked
from .spectra import from_xyz
from .text import LARGEST_FILE, decoded

Values = NDArray[np.float64]
Pair = tuple[Values, Values]
SMALLEST_COSINE = 0.01  # that a stored f_r cos θ_v is divided by, as in RGL's files
KEYWORD = re.compile(r"^#\s*(DIM|PARAM_IN|PARAM_OUT|VS)\s+(.*)$")
OUTPUTS = ("INV_STERADIAN", "INV_STERADIAN_COSINE_FACTOR", "RGB_COLOR", "XYZ_COLOR")


def _angles(theta_l: Values, phi_l: Values, theta_v: Values, phi_v: Values) -> Pair:
    return np.stack(spherical(theta_l, phi_l), -1), np.stack(spherical(theta_v, phi_v), -1)


def _half(theta_h: Values, phi_h: Values, theta_d: Values, phi_d: Values) -> Pair:
    """In ALTA it is V that lies at the difference angles."""
    viewer, light = (np.stack(w, -1).astype(np.float64) for w in directions(theta_h, theta_d, phi_d))
    turn, up = np.stack([np.cos(phi_h), np.sin(phi_h)], -1), np.zeros((len(phi_h), 1))
    turned = [
        np.concatenate([w[:, :1] * turn + w[:, 1:2] * turn[:, ::-1] * [-1, 1], w[:, 2:] + up], axis=1)
        for w in (light, viewer)
    ]
    return turned[0], turned[1]


def _projected(theta_l: Values, x: Values, y: Values) -> Pair:
    return _angles(theta_l, 0 * theta_l, np.hypot(x, y), np.arctan2(y, x))


def _viewer_first(theta_v: Values, theta_l: Values, phi: Values) -> Pair:
    return _angles(theta_l, 0 * phi, theta_v, phi)


def _isotropic(theta_h: Values, theta_d: Values, phi_d: Values) -> Pair:
    return _half(theta_h, 0 * theta_h, theta_d, phi_d)


def _without_azimuth(theta_h: Values, theta_d: Values) -> Pair:
    """ALTA takes φ_d for π/2 where there is none."""
    return _half(theta_h, 0 * theta_h, theta_d, 0 * theta_h + np.pi / 2)


def _cosines(cos_h: Values, cos_d: Values) -> Pair:
    return _without_azimuth(*(np.arccos(np.clip(cosine, -1, 1)) for cosine in (cos_h, cos_d)))


def _cartesian(x: Values, y: Values, z: Values, u: Values, v: Values, w: Values) -> Pair:
    return np.stack([u, v, w], -1), np.stack([x, y, z], -1)


# How the numbers of each parametrisation name a pair of directions: to the light, to the viewer.
PARAMETRISATIONS: dict[str, tuple[int, Callable[..., Pair]]] = {
    "ISOTROPIC_TL_TV_PROJ_DPHI": (3, _projected),
    "ISOTROPIC_TV_TL_DPHI": (3, _viewer_first),
    "SPHERICAL_TL_PL_TV_PV": (4, _angles),
    "RUSIN_TH_TD_PD": (3, _isotropic),
    "RUSIN_TH_PH_TD_PD": (4, _half),
    "RUSIN_TH_TD": (2, _without_azimuth),
    "COS_TH_TD": (2, _cosines),
    "CARTESIAN": (6, _cartesian),
}


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes says how its numbers name directions, as ALTA does."""
    return re.search(r"^#\s*PARAM_IN\s", decoded(head), re.MULTILINE) is not None and b"\0" not in head


def read(path: str | Path) -> Brdf:
    """The material of a file. Raises FormatError if it is not one, MissingDependencyError without SciPy."""
    return parse(Path(path), door.read(path, LARGEST_FILE))


def parse(path: Path, data: bytes) -> Brdf:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    found = samples_of(path, data)
    return samples.material_of(path, hashlib.sha256(data).hexdigest(), found.samples, found.facts)


def samples_of(path: Path, data: bytes) -> samples.Found:
    """The samples in a file's bytes. Raises FormatError."""
    said: dict[str, tuple[int, str]] = {}
    for number, line in enumerate(sample_text.END_OF_LINE.split(decoded(data)), 1):
        if found := KEYWORD.match(line.strip()):
            said[found[1]] = number, found[2].strip()
    number, parametrisation = said.get("PARAM_IN", (1, "none"))
    if parametrisation not in PARAMETRISATIONS:
        wanted = ", ".join(PARAMETRISATIONS)
        raise FormatError(f"{path}: line {number}: #PARAM_IN: expected {wanted}, found {parametrisation}")
    line, output = said.get("PARAM_OUT", (number, "INV_STERADIAN"))
    if output not in OUTPUTS:
        raise FormatError(f"{path}: line {line}: #PARAM_OUT: expected {', '.join(OUTPUTS)}, found {output}")
    inputs, convert = PARAMETRISATIONS[parametrisation]
    line, dimensions = said.get("DIM", (number, f"{inputs} 1"))
    values = 3 if "COLOR" in output else None
    wanted = re.fullmatch(rf"{inputs}\s+([13])", dimensions)
    if not wanted or (values or int(wanted[1])) != int(wanted[1]):
        expected = f"{inputs} {values or '1 or 3'}"
        raise FormatError(
            f"{path}: line {line}: #DIM: expected {expected} for {parametrisation}, found {dimensions[:40]}"
        )
    outputs = int(wanted[1])
    names = [f"x{n}" for n in range(1, inputs + 1)] + [f"y{n}" for n in range(1, outputs + 1)]
    table = sample_text.rows_of(path, data, names)
    with np.errstate(invalid="ignore"):
        wi, wo = convert(*table.numbers[:, :inputs].T)
    f_r = table.numbers[:, inputs : inputs + outputs]
    if output == "XYZ_COLOR":
        f_r = from_xyz(f_r)
    if output == "INV_STERADIAN_COSINE_FACTOR":
        f_r = f_r / np.maximum(wo[:, 2:], SMALLEST_COSINE)
    return _samples(path, table, wi, wo, np.broadcast_to(f_r, (len(f_r), 3)), f"{parametrisation}, {output}")


def _samples(path: Path, table: sample_text.Table, wi: Values, wo: Values, f_r: Values, what: str) -> samples.Found:
    """Raises FormatError for too many rows without numbers or below the horizon."""
    known = np.isfinite(wi).all(axis=1) & np.isfinite(wo).all(axis=1) & np.isfinite(f_r).all(axis=1)
    length = np.abs(np.stack([np.linalg.norm(w, axis=1) for w in (wi, wo)]) - 1).max(axis=0)
    above = known & (np.minimum(wi[:, 2], wo[:, 2]) >= -samples.BELOW) & (length < 1e-3)
    share = float((~above).mean())
    if share > asked().max_dropped:
        raise FormatError(
            f"{path}: expected at most {asked().max_dropped:.0%} of the rows to be left out (--max-dropped), found "
            f"{share:.0%}, the first in line {table.lines[int(np.argmax(~above))]}"
        )
    counts = {"rows_without_numbers": int((~known).sum()), "rows_below_the_horizon": int((known & ~above).sum())}
    facts = {"rows": len(above), "values": what} | {name: count for name, count in counts.items() if count}
    return samples.Found(Samples(wi, wo, f_r).some(above), facts)


FORMAT = Format(
    "ALTA",
    (".dat", ".alta"),
    "samples below #DIM, #PARAM_IN and #PARAM_OUT",
    needs="lab",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
)
