"""ASAM OpenMATERIAL 3D's BRDF tables, .xompt (version 1.0): JSON with `brdf.lookupTable`, rows of wavelength [m], θ_i,
θ_o, φ [rad], from the light's azimuth, and f_r [1/sr].

The table is read a part at a time, and never as Python's objects: files hold millions of rows.
"""

from __future__ import annotations

import hashlib
import json
import re
import uuid
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.grid import GridBrdf
from ..reflectance.samples import Samples
from ..reflectance.table import representable
from ..system import door
from ..system.errors import FormatError, MaterialError
from ..system.files import atomic_write
from ..system.visible import visible
from .format import Format
from .grids import Axes, axes_of, on_grid, regular
from .meant import as_f_r
from .reading import asked
from .scattered import from_samples
from .spectra import PRIMARIES, WRITTEN, to_rgb

LARGEST_FILE = 2**29  # bytes
AT_ONCE = 2**24  # bytes
MOST_AROUND = 2**22  # bytes of all but the table
MOST_ROWS, MOST_WAVELENGTHS = 2**24, 4096
HORIZON = np.pi / 2 + 1e-3
COLUMNS = 5
_TABLE = re.compile(rb'"lookupTable"\s*:\s*\[')
_END, _EMPTY = re.compile(rb"\]\s*\]"), re.compile(rb"\s*\]")
_SPACED = bytes.maketrans(b"[],", b"   ")
_SCHEMA = "https://raw.githubusercontent.com/asam-ev/OpenMATERIAL-3D/refs/tags/v1.0.0/schemas/material_brdf_schema.json"
_MARK = "Written by Sommerl"

Table = NDArray[np.float64]


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes is JSON that speaks of OpenMATERIAL and of a BRDF."""
    said = b"openMaterial3dVersion" in head or b"material_brdf_schema" in head
    return said and head.lstrip().startswith(b"{")


def read(path: str | Path) -> Brdf:
    """The material in a file. Raises FormatError if it is not one, MissingDependencyError without SciPy if its
    directions are no grid."""
    with door.opened(path) as file:
        return parse(Path(path), file)


def parse(path: Path, file: door.File) -> Brdf:
    """As `read`, from an open file; the path is for names and messages alone."""
    digest = hashlib.sha256()
    rows, around = _parts(path, file, digest)
    _check(path, around)
    directions, spectra, wavelengths, facts = _spectra(path, rows)
    f_r = to_rgb(spectra, wavelengths * 1e9)
    named: dict[str, Any] = {"name": visible(path.stem), "source_sha256": digest.hexdigest()}
    try:
        if found := _grid(directions, f_r):
            axes, values = found
            return GridBrdf(*axes, values, facts=facts, **named)
        return from_samples(_samples(directions, f_r), facts=facts, **named)
    except (FormatError, MaterialError) as error:
        raise FormatError(f"{path}: {error}") from error


def _grid(directions: Table, f_r: Table) -> tuple[Axes, Table] | None:
    """The axes and f_r of values on a whole grid, meant as `reading.asked` says; None if they are not on one, or are to
    be completed by a prior."""
    how = asked()
    if how.prior:
        return None
    theta_i, theta_o, phi = directions.T
    around = phi + np.pi if how.phi_from == "specular" else phi
    meant = f_r if how.values == "f_r" else as_f_r(_samples(directions, f_r), how).f_r
    return regular(theta_i, theta_o, around, meant)


def _samples(directions: Table, f_r: Table) -> Samples:
    return Samples.at_angles(np.insert(directions, 1, 0.0, axis=1), f_r)  # φ_i


def _parts(path: Path, file: door.File, digest: Any) -> tuple[Table, bytes]:
    """The rows of the table, and the file with an empty one."""
    before, after, buffer = b"", b"", b""
    rows: list[Table] = []
    for part in _chunks(path, file):
        digest.update(part)
        buffer += part
        if not before:
            found = _TABLE.search(buffer)
            if found:
                before, buffer = buffer[: found.end()] + b"]", buffer[found.end() :]
        if before and not after:
            end = _END.search(buffer) or (None if rows else _EMPTY.match(buffer))
            cut = end.end() - 1 if end else buffer.rfind(b"]")
            rows.append(_rows(path, buffer[: max(cut, 0)]))
            after, buffer = (buffer[cut + 1 :] or b" ", b"") if end else (b"", buffer[max(cut, 0) :])
        elif after:
            after, buffer = after + buffer, b""
        if len(before) + len(after) > MOST_AROUND or len(buffer) > MOST_AROUND + AT_ONCE:
            raise FormatError(f"{path}: expected at most {MOST_AROUND} bytes beside the table, found more")
        if sum(map(len, rows)) > MOST_ROWS:
            raise FormatError(f"{path}: lookupTable: expected at most {MOST_ROWS} rows, found more")
    if not after:
        what = "a whole lookupTable" if before else "a lookupTable"
        raise FormatError(f"{path}: expected {what}, found none")
    return np.concatenate(rows), before + after


def _chunks(path: Path, file: door.File) -> Iterator[bytes]:
    start = 0
    while part := file.part(start, AT_ONCE):
        start += len(part)
        if start > LARGEST_FILE:
            raise FormatError(f"{path}: expected at most {LARGEST_FILE} bytes, found more")
        yield part


def _rows(path: Path, part: bytes) -> Table:
    """The rows in a part of the table."""
    if re.search(rb"[^0-9eE+\-.,\[\]\snul]", part):
        raise FormatError(f"{path}: lookupTable: expected rows of {COLUMNS} numbers, found others")
    text = part.replace(b"null", b" nan ").translate(_SPACED).decode("ascii")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            numbers = np.fromstring(text, np.float64, sep=" ") if text.strip() else np.empty(0)
    except (ValueError, DeprecationWarning) as error:
        raise FormatError(f"{path}: lookupTable: expected rows of {COLUMNS} numbers, found others") from error
    if len(numbers) != COLUMNS * part.count(b"["):
        raise FormatError(f"{path}: lookupTable: expected rows of {COLUMNS} numbers, found others")
    return numbers.reshape(-1, COLUMNS)


def _check(path: Path, around: bytes) -> None:
    """Raises FormatError if the rest of the file is not what it ought to be."""
    try:
        found = json.loads(around)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected JSON, found something else ({error})") from error
    top = cast("dict[str, Any]", found) if isinstance(found, dict) else {}
    brdf = top.get("brdf")
    if not isinstance(brdf, dict) or "lookupTable" not in cast("dict[str, Any]", brdf):
        raise FormatError(f"{path}: expected an object brdf with a lookupTable, found none")


def _spectra(path: Path, rows: Table) -> tuple[Table, Table, Table, Mapping[str, Any]]:
    """θ_i, θ_o, φ [rad] of directions (n, 3); f_r there (n, m); the m wavelengths [m]; and what is to be told."""
    known = np.isfinite(rows).all(axis=1)
    above = known & (np.maximum(rows[:, 1], rows[:, 2]) <= HORIZON)
    if not len(rows) or 1 - above.mean() > asked().max_dropped:
        found = f"{len(rows) - int(above.sum())} of {len(rows)}"
        raise FormatError(
            f"{path}: lookupTable: expected at most {asked().max_dropped:.0%} of the rows to be left out "
            f"(--max-dropped), found {found} without numbers or below the horizon"
        )
    kept = rows[above]
    wrong = (kept[:, 0] <= 0) | (kept[:, 1:3] < 0).any(axis=1) | (np.abs(kept[:, 3]) > 4 * np.pi + 1e-3)
    if wrong.any():
        raise FormatError(f"{path}: lookupTable: expected wavelengths and angles in range, found {kept[wrong][0, :4]}")
    kept = kept[np.lexsort((kept[:, 3], kept[:, 2], kept[:, 1], kept[:, 0]))]
    wavelengths, counts = np.unique(kept[:, 0], return_counts=True)
    if len(wavelengths) > MOST_WAVELENGTHS or len(set(counts.tolist())) > 1:
        raise FormatError(f"{path}: lookupTable: expected the same directions for each wavelength, found others")
    blocks = kept.reshape(len(wavelengths), -1, COLUMNS)
    if np.abs(blocks[:, :, 1:4] - blocks[0, :, 1:4]).max() > 1e-6:
        raise FormatError(f"{path}: lookupTable: expected the same directions for each wavelength, found others")
    ends = f"{wavelengths[0] * 1e9:g} to {wavelengths[-1] * 1e9:g} nm"
    text = (
        f"{ends[: ends.index(' to')]} nm alone, as grey"
        if len(wavelengths) == 1
        else f"{len(wavelengths)} wavelengths, {ends}"
    )
    facts = {"rows": len(rows), "values": text}
    dropped = {"rows_without_numbers": int((~known).sum()), "rows_below_the_horizon": int((known & ~above).sum())}
    return (
        np.clip(blocks[0, :, 1:4], [0, 0, -np.inf], [np.pi / 2, np.pi / 2, np.inf]),
        blocks[:, :, 4].T.copy(),
        wavelengths,
        facts | {name: count for name, count in dropped.items() if count},
    )


def write(brdf: Brdf, path: str | Path) -> GridBrdf:
    """Writes f_r on a grid (`grids.axes_of`) as spectra that are its colours under D65, and returns what was written.

    The format holds no negative values: colours with a negative channel are moved to where there is none, and counted
    (`table.representable`).
    """
    path = Path(path)
    axes = axes_of(brdf)
    values, changed = representable(on_grid(brdf, axes))
    written = GridBrdf(*axes, values, name=brdf.name, source_sha256=brdf.source.sha256, clamped=int(changed.sum()))
    spectra = np.maximum(values.reshape(-1, 3) @ PRIMARIES.T, 0.0)
    angles = np.stack([angle.reshape(-1) for angle in np.meshgrid(*axes, indexing="ij")], axis=-1)
    texts = [f"{a:.6f}, {b:.6f}, {c:.6f}" for a, b, c in angles.tolist()]
    head = json.dumps(_head(brdf), indent=2)
    with atomic_write(path) as out:
        out.write(head[: head.index('"lookupTable": []')].encode() + b'"lookupTable": [\n')
        for number, nanometres in enumerate(WRITTEN.tolist()):
            column = spectra[:, number].tolist()
            block = ",\n".join(
                f"[{nanometres * 1e-9:.4g}, {text}, {value:.7g}]" for text, value in zip(texts, column, strict=True)
            )
            out.write(block.encode() + (b"\n" if number == len(WRITTEN) - 1 else b",\n"))
        out.write(b"]\n}\n}\n")
    return written


def _head(brdf: Brdf) -> dict[str, Any]:
    """All that the schema asks for, with an empty table. What is not known is, in SPDX's word, NOASSERTION."""
    metadata = {
        "name": brdf.name,
        "description": f"{_MARK}. RGB values as smooth spectra under D65.",
        "uuid": str(uuid.uuid5(uuid.NAMESPACE_URL, f"sommerl:{brdf.name}:{brdf.source.sha256}")),
        "materialVersion": "1.0.0",
        "openMaterial3dVersion": "1.0.0",
        "copyrights": ["NOASSERTION"],
        "license": "NOASSERTION",
        "authors": ["NOASSERTION"],
        "sources": "measurement" if brdf.kind == "measurement" else "simulation",
        "typicalSensorTechnology": "camera",
    }
    wavelengths = [float(f"{nanometres * 1e-9:.4g}") for nanometres in WRITTEN.tolist()]
    return {"$schema": _SCHEMA, "metadata": metadata, "brdf": {"wavelengths": wavelengths, "lookupTable": []}}


def _write(brdf: Brdf, path: Path) -> Brdf:
    return write(brdf, path)


FORMAT = Format(
    "OpenMATERIAL 3D",
    (".xompt",),
    "a BRDF table of ASAM's, spectra on a grid of angles",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
    opened=True,
    write=_write,
)
