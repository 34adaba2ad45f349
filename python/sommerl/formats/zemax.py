"""Zemax' tabular .bsdf files (Radiant Imaging's "BSDF Data Interchange file format", 2008): text.

Lines in this order, "#" starts a comment: Source, Symmetry, SpectralContent, ScatterType; SampleRotation,
AngleOfIncidence, ScatterAzimuth and ScatterRadial, each with a count and, on the next line, that many angles [deg]; the
name of what is measured; DataBegin; for each rotation and incidence, TIS and its value, and a row for each azimuth with
a value [1/sr] for each radial angle; DataEnd. Of XYZ, three such blocks, TristimulusX, …Y, …Z. Radial angle and
azimuth are polar coordinates about the specular direction, with azimuth 0 towards the normal.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..reflectance.grid import GridBrdf
from ..system import door
from ..system.errors import FormatError, MaterialError
from ..system.visible import visible
from .format import Format
from .spectra import from_xyz
from .text import LARGEST_FILE, decoded, text_of

AXES = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
SYMMETRIES = ("PlaneSymmetrical", "ASymmetrical", "ASymmetrical4D", "Isotropic")
MOST_ANGLES, MOST_VALUES = 4096, 2**24

Line = tuple[int, str]


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes has the lines of Zemax' format."""
    text = decoded(head)
    return re.search(r"^\s*ScatterType\s+B[RT]DF", text, re.MULTILINE) is not None and "AngleOfIncidence" in text


def read(path: str | Path) -> GridBrdf:
    """The material in a file. Raises FormatError if it is not one, or is transparent or anisotropic."""
    return parse(Path(path), door.read(path, LARGEST_FILE))


def parse(path: Path, data: bytes) -> GridBrdf:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    lines = _lines(text_of(path, data))
    head, axes = _head(path, lines)
    counts = [len(axes[name]) for name in AXES]
    if counts[0] != 1:
        raise FormatError(f"{path}: SampleRotation: expected an isotropic material with one, found {counts[0]}")
    tristimulus = head["SpectralContent"].upper() == "XYZ"
    blocks = [_block(path, lines, counts[1:]) for _ in range(3 if tristimulus else 1)]
    values = np.stack(blocks * (1 if tristimulus else 3), axis=-1)
    if tristimulus:
        values = from_xyz(values)
    incidence, azimuth, radial = (axes[name] for name in AXES[1:])
    values, azimuth = _one_turn(path, values, azimuth, head["Symmetry"])
    try:
        return GridBrdf(
            np.radians(incidence),
            np.radians(radial),
            np.radians(azimuth),
            values.swapaxes(1, 2),
            about_mirror=True,
            name=visible(path.stem),
            source_sha256=hashlib.sha256(data).hexdigest(),
            facts={"values": "CIE XYZ, to linear sRGB" if tristimulus else "one channel, as grey"},
        )
    except MaterialError as error:
        raise FormatError(f"{path}: {error}") from error


def _lines(text: str) -> Iterator[Line]:
    for number, line in enumerate(re.split(r"\r\n|\r|\n", text), 1):
        plain = line.split("#")[0].strip()
        if plain:
            yield number, plain


def _next(path: Path, lines: Iterator[Line], wanted: str) -> Line:
    found = next(lines, None)
    if found is None:
        raise FormatError(f"{path}: expected {wanted}, found the end of the file")
    return found


def _head(path: Path, lines: Iterator[Line]) -> tuple[dict[str, str], dict[str, NDArray[np.float64]]]:
    """The keywords, and the angles [deg] by their keyword."""
    head: dict[str, str] = {}
    axes: dict[str, NDArray[np.float64]] = {}
    while len(axes) < len(AXES):
        number, line = _next(path, lines, f"a line {AXES[len(axes)]}")
        name, *rest = line.split()
        if name not in AXES:
            head[name] = " ".join(rest)
            continue
        if not rest or not re.fullmatch(r"[0-9]{1,5}", rest[0]) or not 1 <= int(rest[0]) <= MOST_ANGLES:
            raise FormatError(
                f"{path}: line {number}: {name}: expected 1 to {MOST_ANGLES}, found {' '.join(rest)[:40]!r}"
            )
        axes[name] = _numbers(path, lines, int(rest[0]), name)
    if head.get("ScatterType", "") != "BRDF":
        raise FormatError(f"{path}: ScatterType: expected BRDF, found {head.get('ScatterType', 'none')}")
    if head.get("Symmetry", "").lower() not in map(str.lower, SYMMETRIES):
        raise FormatError(f"{path}: Symmetry: expected {', '.join(SYMMETRIES)}, found {head.get('Symmetry', 'none')}")
    if head.get("SpectralContent", "").upper() not in ("MONOCHROME", "XYZ"):
        found = head.get("SpectralContent", "none")
        raise FormatError(f"{path}: SpectralContent: expected Monochrome or XYZ, found {found}")
    if np.prod([len(axis) for axis in axes.values()], dtype=np.float64) > MOST_VALUES:
        raise FormatError(f"{path}: expected at most {MOST_VALUES} values, found more")
    return head, axes


def _numbers(path: Path, lines: Iterator[Line], count: int, what: str) -> NDArray[np.float64]:
    """So many numbers, on one line or on several."""
    found: list[str] = []
    number = 0
    while len(found) < count:
        number, line = _next(path, lines, f"{count} numbers for {what}")
        found += line.split()
    try:
        numbers = np.array(found, np.float64)
    except ValueError as error:
        raise FormatError(f"{path}: line {number}: {what}: expected {count} numbers, found others ({error})") from error
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise FormatError(f"{path}: line {number}: {what}: expected {count} finite numbers, found {len(numbers)}")
    return numbers


def _block(path: Path, lines: Iterator[Line], counts: list[int]) -> NDArray[np.float64]:
    """The values between DataBegin and DataEnd, (incidence, azimuth, radial)."""
    number, line = 0, ""
    while line != "DataBegin":
        number, line = _next(path, lines, "a line DataBegin")
    parts: list[NDArray[np.float64]] = []
    for _ in range(counts[0]):
        number, line = _next(path, lines, "a line TIS")
        if not line.startswith("TIS"):
            raise FormatError(f"{path}: line {number}: expected TIS and its value, found {line[:40]!r}")
        parts.append(np.stack([_numbers(path, lines, counts[2], "ScatterRadial") for _ in range(counts[1])]))
    number, line = _next(path, lines, "a line DataEnd")
    if line != "DataEnd":
        raise FormatError(f"{path}: line {number}: expected DataEnd, found {line[:40]!r}")
    return np.stack(parts)


def _one_turn(
    path: Path, values: NDArray[np.float64], azimuth: NDArray[np.float64], symmetry: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values and azimuths without a second end of a full turn, and without what plane symmetry says again."""
    if (np.diff(azimuth) <= 0).any() or azimuth[0] < 0:
        raise FormatError(f"{path}: ScatterAzimuth: expected angles that increase from 0, found others")
    if len(azimuth) > 1 and azimuth[-1] - azimuth[0] > 360 - 1e-3:
        values, azimuth = values[:, :-1], azimuth[:-1]
    if symmetry.lower() == "planesymmetrical":
        folded = np.where(azimuth > 180 + 1e-3, 360 - azimuth, azimuth)
        _, kept = np.unique(folded.round(3), return_index=True)  # of those that say the same, the first
        values, azimuth = values[:, kept], folded[kept]
    return values, azimuth


FORMAT = Format(
    "Zemax",
    (".bsdf",),
    "f_r on a grid about the specular direction, isotropic or symmetric about the plane of incidence",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
)
