"""Cornell's .brdf files: scattered spectral samples (Program of Computer Graphics, as distributed with pbrt).

Text, of which "#" starts a comment: the number of wavelengths; the wavelengths [nm]; then, for each sample, θ_i φ_i
θ_o φ_o [rad] and a reflectance at each wavelength. Spectra become linear sRGB, and samples a material (`scattered`).
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import numpy as np

from ..reflectance.brdf import Brdf
from ..reflectance.samples import Samples
from ..system import door
from ..system.errors import FormatError
from ..system.visible import visible
from .format import Format
from .scattered import from_samples
from .spectra import srgb_weights
from .text import LARGEST_FILE, rows, text_of, uncommented

MOST_WAVELENGTHS = 1000


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes has a whole number alone in its first line that is no comment."""
    lines = uncommented(head.decode("utf-8-sig", "replace"))
    return bool(lines) and re.fullmatch(r"[0-9]{1,9}", lines[0]) is not None


def read(path: str | Path) -> Brdf:
    """The material of a Cornell file. Raises FormatError if it is not one, MissingDependencyError without `lab`."""
    return parse(Path(path), door.read(path, LARGEST_FILE))


def parse(path: Path, data: bytes) -> Brdf:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    lines = uncommented(text_of(path, data))
    if not lines or not re.fullmatch(r"\d{1,9}", lines[0]) or not 2 <= int(lines[0]) <= MOST_WAVELENGTHS:
        if lines and lines[0].split()[0] == "analytic":
            raise FormatError(f"{path}: expected samples, found a formula for BRDF Explorer, which is a program")
        found = repr(lines[0][:20]) if lines else "nothing"
        raise FormatError(f"{path}: number of wavelengths: expected 2 to {MOST_WAVELENGTHS}, found {found}")
    count, start = int(lines[0]), 1
    wavelengths: list[str] = []
    while len(wavelengths) < count and start < len(lines):
        wavelengths += lines[start].split()
        start += 1
    try:
        nanometres = np.array(wavelengths, np.float64)
    except ValueError as error:
        raise FormatError(f"{path}: wavelengths: expected {count} numbers, found others ({error})") from error
    if len(nanometres) != count or not ((np.diff(nanometres) > 0).all() and 200 < nanometres[0] < 1000):
        raise FormatError(f"{path}: wavelengths: expected {count} that increase [nm], found {len(nanometres)} others")
    samples = rows(path, lines[start:], 4 + count)
    try:
        return from_samples(
            Samples.at_angles(samples[:, :4], samples[:, 4:] @ srgb_weights(nanometres)),
            name=visible(path.stem),
            source_sha256=hashlib.sha256(data).hexdigest(),
        )
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error


FORMAT = Format(
    "Cornell",
    (".brdf",),
    "scattered samples of spectra",
    needs="lab",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
)
