"""Tables of samples: what a gonioreflectometer gives. CSV files, and NumPy arrays with the same columns.

Columns, in any order: theta_i, phi_i, theta_o, phi_o, r, g, b; others are ignored. A column of angles names its unit,
`theta_i_deg` or `theta_i [rad]`; radians if none does. f_r [1/sr] is linear RGB. Commas, semicolons, tabs or spaces
separate columns; "#" starts a comment. A .npy file holds an array with these names as fields, or one of shape (n, 7) in
this order and radians; an .npz file an array for each name.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.samples import Samples
from ..system import door
from ..system.errors import FormatError
from ..system.visible import visible
from . import numpy_files
from .format import Format
from .meant import AS_WRITTEN, Meant
from .scattered import from_samples
from .text import LARGEST_FILE, rows, text_of, uncommented

ANGLES = ("theta_i", "phi_i", "theta_o", "phi_o")
COLUMNS = (*ANGLES, "r", "g", "b")
_ANGLE = re.compile(r"(theta|phi)[\s_]*(i|o)(?:n|ut)?[\s_(\[]*(deg|degrees?|°|rad|radians?)?[)\]]?")
GREEK = str.maketrans({"θ": "theta", "ϑ": "theta", "φ": "phi", "ϕ": "phi"})
NAMES = {"red": "r", "green": "g", "blue": "b"}


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes is a text that names columns of angles, and no JSON."""
    text = head.decode("utf-8-sig", "replace")
    return "\0" not in text and not text.lstrip().startswith("{") and _header(text)[0] is not None


def are_columns(names: Any) -> bool:
    """Whether arrays of these names hold samples."""
    return any(_column(name)[0] in ANGLES for name in names)


def read(path: str | Path) -> Brdf:
    """The material of a file of samples. Raises FormatError if it is not one, MissingDependencyError without SciPy."""
    return parse(Path(path), door.read(path, max(LARGEST_FILE, numpy_files.LARGEST_FILE)))


def parse(path: Path, data: bytes, meant: Meant = AS_WRITTEN) -> Brdf:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    if data.startswith(numpy_files.MAGIC):
        columns = _fields(path, numpy_files.read_npy(path, data))
    elif data.startswith(numpy_files.ZIP_MAGIC):
        columns = numpy_files.read_npz(path, data)
    else:
        columns = _text(path, data)
    try:
        samples = _samples(columns)
        return from_samples(
            samples, name=visible(path.stem), source_sha256=hashlib.sha256(data).hexdigest(), meant=meant
        )
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error


def _text(path: Path, data: bytes) -> dict[str, NDArray[Any]]:
    header, lines = _header(text_of(path, data))
    if header is None:
        raise FormatError(f"{path}: expected a first line with the names of columns, as theta_i_deg, found none")
    names = _split(header)
    known = [k for k, name in enumerate(names) if _column(name)[0] in COLUMNS]
    table = rows(path, lines, len(names), _delimiter(header), known)
    return _named(path, [names[k] for k in known], table)


def _header(text: str) -> tuple[str | None, list[str]]:
    """The line with the names of columns, which may be a comment before the first row, and the rows."""
    plain = uncommented(text)
    comments = [line.strip().lstrip("#").strip() for line in text.splitlines() if line.lstrip().startswith("#")]
    for number, line in enumerate((*plain[:1], *comments)):
        if any(_column(name)[0] in ANGLES for name in _split(line)):
            return line, plain[1:] if number == 0 and plain else plain
    return None, plain


def _fields(path: Path, array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    if array.dtype.names:
        return {name: array[name] for name in array.dtype.names}
    if array.ndim != 2 or array.shape[1] != len(COLUMNS):
        raise FormatError(f"{path}: expected an array of shape (n, {len(COLUMNS)}), found {array.shape}")
    return _named(path, list(COLUMNS), array)


def _named(path: Path, names: list[str], table: NDArray[Any]) -> dict[str, NDArray[Any]]:
    if len(set(names)) < len(names):
        raise FormatError(f"{path}: expected columns of different names, found {', '.join(names)}")
    return dict(zip(names, table.T, strict=True))


def _delimiter(line: str) -> str | None:
    return next((mark for mark in (",", ";", "\t") if mark in line), None)


def _split(line: str) -> list[str]:
    delimiter = _delimiter(line)
    # Without a delimiter, the space before a unit in brackets is not one.
    parts = line.split(delimiter) if delimiter else re.split(r"\s+(?![(\[])", line)
    return [part.strip().strip("\"'") for part in parts]


def _column(name: str) -> tuple[str, str]:
    """A column's own name, and its unit."""
    plain = _plain(name)
    match = _ANGLE.fullmatch(plain)
    if match:
        unit = match[3] or "rad"
        return f"{match[1]}_{match[2]}", "deg" if unit[0] in "d°" else "rad"
    return NAMES.get(plain, plain), ""


def _samples(columns: dict[str, NDArray[Any]]) -> Samples:
    """Raises FormatError if a column is missing, or holds what cannot be."""
    found: dict[str, NDArray[np.float64]] = {}
    for name, values in columns.items():
        column, unit = _column(name)
        if column not in COLUMNS:
            continue
        if column in found:
            raise FormatError(f"{column}: expected one column, found two")
        if values.ndim != 1 or values.dtype.kind not in "fiu":
            raise FormatError(f"{name}: expected a column of numbers, found {values.dtype} of shape {values.shape}")
        numbers = values.astype(np.float64)
        if not np.isfinite(numbers).all():
            row = int(np.argmax(~np.isfinite(numbers))) + 1
            raise FormatError(f"{name}: expected finite numbers, found {numbers[row - 1]} in row {row} of the data")
        if column in ANGLES:
            _check_range(name, numbers, column, unit)
        found[column] = np.radians(numbers) if unit == "deg" else numbers
    matches = [_ANGLE.fullmatch(_plain(name)) for name in columns]
    stated = {bool(match[3]) for match in matches if match}
    if len(stated) > 1:
        raise FormatError("expected a unit in the names of all columns of angles or of none, found some with one")
    missing = [column for column in COLUMNS if column not in found]
    if missing:
        wanted = "theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg (or _rad), r, g, b"
        raise FormatError(f"expected columns {wanted}, found none named {', '.join(missing)} in {', '.join(columns)}")
    steepest = max(found["theta_i"].max(), found["theta_o"].max())
    if stated == {True} and steepest <= np.radians(1.6):
        largest = np.degrees(steepest)
        raise FormatError(f"theta_i, theta_o: expected degrees, found nothing above {largest:.3g} (radians?)")
    if len({len(values) for values in found.values()}) > 1:
        raise FormatError("expected columns of one length, found different ones")
    angles, f_r = (np.stack([found[column] for column in names], axis=-1) for names in (ANGLES, COLUMNS[4:]))
    return Samples.at_angles(angles, f_r)


def _plain(name: str) -> str:
    return name.strip().lower().translate(GREEK)


def _check_range(name: str, numbers: NDArray[np.float64], column: str, unit: str) -> None:
    """Raises FormatError for angles that cannot be, as those in degrees that are taken for radians."""
    quarter = 90.0 if unit == "deg" else np.pi / 2
    low, high = (0.0, quarter) if column.startswith("theta") else (-4 * quarter, 4 * quarter)
    wrong = (numbers < low - 1e-3 * quarter) | (numbers > high + 1e-3 * quarter)
    if wrong.any():
        row = int(np.argmax(wrong)) + 1
        hint = "" if unit == "deg" else f" (a column in degrees is named {column}_deg)"
        wanted = f"angles from {low:.6g} to {high:.6g} {unit}{hint}"
        raise FormatError(f"{name}: expected {wanted}, found {numbers[row - 1]:g} in row {row} of the data")


FORMAT = Format(
    "samples",
    (".csv",),
    "columns theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, r, g, b",
    needs="formats",
    sniff=looks_like,
    read=parse,
    meant=True,
    largest=LARGEST_FILE,
)
