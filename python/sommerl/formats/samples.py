"""Tables of samples: what a gonioreflectometer gives. CSV and other text, and NumPy arrays with the same columns.

Columns, in any order, by names of many kinds (`columns`): the polar angle θ of light and viewer, their azimuths φ or
the one between them, and f_r [1/sr]: linear RGB, CIE XYZ, a spectrum, or one grey value. Others are ignored. Angles say
their unit, or it is found from their range. Rows without numbers and below the horizon are left out and counted. A
.npy file holds an array with these names as fields, or one of shape (n, 7), θ_i, φ_i, θ_o, φ_o, r, g, b; an .npz file
an array for each name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.samples import Samples
from ..system import door
from ..system.errors import FormatError
from ..system.visible import visible
from . import angles as angles_of
from . import columns, numpy_files, sample_files, sample_text
from .columns import FACTOR, GREY, RGB, WAVELENGTH, XYZ, Column
from .format import Format
from .reading import asked
from .scattered import from_samples
from .spectra import from_xyz, to_rgb
from .text import LARGEST_FILE, decoded

PLAIN = ("theta_i", "phi_i", "theta_o", "phi_o", "r", "g", "b")
WANTED = "theta_i, phi_i, theta_o, phi_o, and r, g, b"
VALUES = ("r, g, b", "X, Y, Z", "wavelengths as 550nm", "brdf")
Columns = list[tuple[str, Column, NDArray[np.float64]]]  #: of a file: the name, what it says, and the numbers

HORIZON = np.pi / 2 * angles_of.LITTLE  # [rad]
BELOW = 2e-3  # cosines down to minus that count as at the horizon


@dataclass(frozen=True)
class Found:
    """Samples, and what is to be told of how they were read, as `facts` of the material."""

    samples: Samples
    facts: Mapping[str, Any]


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes is a text that names columns of angles, and nobody else's."""
    text = decoded(head)
    start = text.lstrip()
    others = start.startswith(("{", "[")) or "\0" in text or "\nVARS" in text or start.startswith("VARS")
    return not others and "#PARAM_IN" not in text and sample_text.has_names(text)


def are_columns(names: Any) -> bool:
    """Whether arrays of these names hold samples."""
    return any(map(columns.is_angle, names))


def read(path: str | Path) -> Brdf:
    """The material of a file of samples. Raises FormatError if it is not one, MissingDependencyError without SciPy."""
    return parse(Path(path), door.read(path, max(LARGEST_FILE, numpy_files.LARGEST_FILE)))


def parse(path: Path, data: bytes) -> Brdf:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    sha256 = hashlib.sha256(data).hexdigest()
    found = samples_of(path, data)
    del data  # long files take as much memory as what is made of them
    return material_of(path, sha256, found.samples, found.facts)


def material_of(path: Path, source_sha256: str, samples: Samples, facts: Mapping[str, Any]) -> Brdf:
    """The material of samples from a file, whose SHA-256 is given."""
    try:
        return from_samples(samples, name=visible(path.stem), source_sha256=source_sha256, facts=facts)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error


def samples_of(path: Path, data: bytes) -> Found:
    """The samples in a file's bytes. Raises FormatError."""
    found = _columns(path, data)
    try:
        return assembled(*found)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error


def _columns(path: Path, data: bytes) -> tuple[Columns, list[str], Callable[[int], str], str]:
    """The columns in a file's bytes, as `assembled` takes them. Raises FormatError."""
    if data.startswith(numpy_files.MAGIC):
        return of_arrays(path, _fields(path, numpy_files.read_npy(path, data)))
    if data.startswith(numpy_files.ZIP_MAGIC):
        return of_arrays(path, numpy_files.read_npz(path, data))
    given = asked().columns
    table = sample_text.table(path, data, _known, given)
    known = [
        (name, _with_unit(each, unit), numbers)
        for name, unit, numbers in zip(table.names, table.units, table.numbers.T, strict=True)
        if (each := columns.column(name))
    ]
    header = f" (line {table.header})" if table.header and not given else ""
    return known, table.names, lambda row: f"line {table.lines[row]}", header


def _known(names: Sequence[str]) -> list[int]:
    """The places of the columns that say something."""
    return [place for place, name in enumerate(names) if columns.column(name)]


def of_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> tuple[Columns, list[str], Callable[[int], str], str]:
    """The columns in arrays, by their names. Raises FormatError."""
    known: Columns = []
    for name, values in arrays.items():
        each = columns.column(name)
        if not each:
            continue
        if values.ndim != 1 or values.dtype.kind not in "fiu":
            found = f"{values.dtype} of shape {values.shape}"
            raise FormatError(f"{path}: {name}: expected a column of numbers, found {found}")
        with np.errstate(invalid="ignore"):  # of NaN that signals
            known.append((name, each, values.astype(np.float64)))
    if len({len(values) for _, _, values in known}) > 1:
        raise FormatError(f"{path}: expected columns of one length, found different ones")
    return known, list(arrays), lambda row: f"row {row + 1} of the data", ""


def are_samples(array: NDArray[Any]) -> bool:
    """Whether a .npy file's array holds samples: it has fields, or as many columns as they have."""
    return bool(array.dtype.names) or (array.ndim == 2 and array.shape[1] == len(asked().columns or PLAIN))


def _fields(path: Path, array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    if array.dtype.names:
        return {name: array[name] for name in array.dtype.names}
    names = asked().columns or PLAIN
    if array.ndim != 2 or array.shape[1] != len(names):
        raise FormatError(f"{path}: expected an array of shape (n, {len(names)}), found {array.shape}")
    return dict(zip(names, array.T, strict=True))


def _with_unit(column: Column, unit: str) -> Column:
    """A column whose name says no unit, with that of a row of units."""
    stated = columns.unit_of(unit)
    return column if column.unit or not stated else Column(column.role, stated, column.nanometres)


def assembled(
    known: Columns,
    names: Sequence[str],
    where: Callable[[int], str],
    header: str,
) -> Found:
    """Samples from columns of numbers, each with its name in the file.

    names: of all columns; where: names a row in messages; header: where the names are, for messages. Raises FormatError
    if something is missing or cannot be, and where too many rows have to be left out.
    """
    four, how, plane = _angles(known, names, where, header)
    values, f_r, colours = _values(known, names, header)
    kept, dropped = _kept(four, values, known, where)
    facts: dict[str, Any] = {"rows": len(four), "angles": how, "values": colours}
    facts |= {"plane": plane} if plane else {}
    facts |= {f"rows_{name}": count for name, count in dropped.items() if count}
    return Found(Samples.at_angles(four[kept], f_r[kept]), facts)


def directions_of(path: Path, data: bytes) -> NDArray[np.float64]:
    """θ_i, φ_i, θ_o, φ_o [rad] of all rows of a file with columns of angles, whatever others it has, (n, 4).

    Raises FormatError where there are none, or a row has no number.
    """
    known, names, where, header = _columns(path, data)
    try:
        four, _, _ = _angles(known, names, where, header)
        unknown = ~np.isfinite(four).all(axis=1)
        if unknown.any():
            raise FormatError(f"expected angles in every row, found none in {where(int(np.argmax(unknown)))}")
        return four
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error


def _angles(
    known: Columns, names: Sequence[str], where: Callable[[int], str], header: str
) -> tuple[NDArray[np.float64], str, str]:
    """θ_i, φ_i, θ_o, φ_o [rad], (n, 4); how their unit was found; and what was taken for granted."""
    roles = _roles(known, names, header)
    if not len(known[0][2]):
        raise FormatError("expected rows of numbers, found none")
    given = {role: angles_of.Given(name, unit, numbers) for role, (name, unit, numbers) in roles.items()}
    angles, how = angles_of.in_radians(given, where, header)
    four, plane = angles_of.directions(angles)
    return four, how, plane


def _roles(known: Columns, names: Sequence[str], header: str) -> dict[str, tuple[str, str, NDArray[np.float64]]]:
    """The columns of angles by what they are: name, unit, numbers."""
    found: dict[str, tuple[str, str, NDArray[np.float64]]] = {}
    for name, each, numbers in known:
        if each.role not in columns.ANGLES:
            continue
        if each.role in found:
            raise FormatError(f"{each.role}: expected one column, found two, {found[each.role][0]} and {name}{header}")
        found[each.role] = name, each.unit, numbers
    if "phi_i" in found and "phi_o" not in found and "dphi" in found:
        found["phi_o"] = found.pop("dphi")  # beside an azimuth of the light, `phi` is the viewer's
    if "phi_o" in found and "dphi" in found:
        raise FormatError(
            f"phi: expected one azimuth of the viewer, found {found['phi_o'][0]}, {found['dphi'][0]}{header}"
        )
    missing = [role for role in ("theta_i", "theta_o") if role not in found]
    if missing:
        raise FormatError(
            f"expected columns {WANTED}, found none for {', '.join(missing)} in {', '.join(names)}{header} "
            "(--columns names them)"
        )
    return found


def _values(known: Columns, names: Sequence[str], header: str) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """The columns of values (n, m), f_r in linear RGB (n, 3), and what they were, for people."""
    of_role: dict[str, Columns] = {}
    for each in known:
        of_role.setdefault(each[1].role, []).append(each)
    for trio, text in ((RGB, "linear RGB"), (XYZ, "CIE XYZ, to linear sRGB")):
        if all(role in of_role for role in trio):
            taken = [of_role[role] for role in trio]
            again = next((each for each in taken if len(each) > 1), None)
            if again:
                raise FormatError(f"{again[0][1].role}: expected one column, found two{header}")
            values = _scaled([each[0] for each in taken])
            return values, values if trio is RGB else from_xyz(values), text
    if WAVELENGTH in of_role:
        taken = of_role[WAVELENGTH]
        wavelengths = np.array([each[1].nanometres for each in taken])
        if len(np.unique(wavelengths)) < len(wavelengths):
            raise FormatError(f"expected different wavelengths, found one twice in {', '.join(names)}{header}")
        values = _scaled(taken)
        ends = f"{wavelengths.min():g} to {wavelengths.max():g} nm"
        text = f"{wavelengths[0]:g} nm alone, as grey" if len(taken) == 1 else f"{len(taken)} wavelengths, {ends}"
        return values, to_rgb(values, wavelengths), text
    grey = of_role.get(GREY, []) + of_role.get(FACTOR, [])
    if not grey and len(of_role.get("y", [])) == 1 and "x" not in of_role:
        grey = of_role["y"]  # the luminance alone
    if len(grey) != 1:
        some = ", ".join(role for role in (*RGB, *XYZ) if role in of_role)
        found = f"two, {grey[0][0]} and {grey[1][0]}," if len(grey) > 1 else f"{some} alone" if some else "none"
        raise FormatError(
            f"expected columns of values ({'; '.join(VALUES)}), found {found} in {', '.join(names)}{header} "
            "(--columns names them)"
        )
    values = _scaled(grey)
    factor = grey[0][1].role == FACTOR
    text = f"{grey[0][0]}, as grey" + (", divided by π" if factor else "")
    return values, np.repeat(values / np.pi if factor else values, 3, axis=1), text


def _scaled(taken: Columns) -> NDArray[np.float64]:
    return np.stack([numbers / 100 if each.unit == "percent" else numbers for _, each, numbers in taken], axis=-1)


def _kept(
    angles: NDArray[np.float64],
    values: NDArray[np.float64],
    known: Columns,
    where: Callable[[int], str],
) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Which rows are samples, and how many of the others there are of each kind. Raises FormatError for too many."""
    empty = ~(np.isfinite(angles).all(axis=1) & np.isfinite(values).all(axis=1))
    below = ~empty & (np.maximum(angles[:, 0], angles[:, 2]) > HORIZON)
    dropped = {"without_numbers": int(empty.sum()), "below_the_horizon": int(below.sum())}
    left_out: NDArray[np.bool_] = np.asarray(empty | below)
    share = float(left_out.mean())
    if share > asked().max_dropped:
        first = int(np.argmax(left_out))
        column = next((name for name, _, numbers in known if not np.isfinite(numbers[first])), "")
        what = f"column {column}: no finite number" if column else "below the horizon"
        raise FormatError(
            f"expected at most {asked().max_dropped:.0%} of the rows to be left out (--max-dropped), found "
            f"{share:.0%}: {dropped['without_numbers']} without numbers, {dropped['below_the_horizon']} below the "
            f"horizon, the first in {where(first)} ({what})"
        )
    return ~left_out, dropped


FORMAT = Format(
    "samples",
    (".csv", ".tsv"),
    "columns theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, r, g, b, and others of many names",
    needs="lab",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
    write=sample_files.write_grid,
)
