"""NVIDIA MDL's measured BSDFs, .mbsdf: f_r on a grid of θ_in, θ_out and the azimuth between the two.

A line "NVIDIA ARC MBSDF V1"; then, for reflection and for transmission, a line MBSDF_DATA_REFLECTION= or
MBSDF_DATA_TRANSMISSION= (MBSDF_DATA= is reflection, too); uint32 type (0 grey, 1 RGB), uint32 n, uint32 m, and float32
[θ_in][θ_out][φ], of type 1 with r, g, b. Angles are the centres of n equal bins from 0 to π/2, and of m from 0 (light
and viewer on one side) to π (the mirror's side).
"""

from __future__ import annotations

import hashlib
import re
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.grid import GridBrdf
from ..reflectance.half_diff import TWO_PI
from ..system import door
from ..system.errors import FormatError, MaterialError
from ..system.files import atomic_write
from ..system.visible import visible
from .format import Format
from .grids import on_grid

MAGIC = b"NVIDIA ARC MBSDF"
FIRST_LINE = MAGIC + b" V1\n"
SECTION = re.compile(rb"\nMBSDF_DATA(_REFLECTION|_TRANSMISSION)?=\n")
HEAD = struct.Struct("<3I")
CHANNELS = {0: 1, 1: 3}  # by type
MOST_VALUES = 2**26
LARGEST_FILE = 2**29  # bytes
LONGEST_TEXT = 2**16  # bytes before the data
WRITTEN = (45, 90)  # bins in θ and in φ, as in the examples of MDL's SDK


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes says that it is a measured BSDF of MDL's."""
    return head.startswith(MAGIC)


def read(path: str | Path) -> GridBrdf:
    """The reflection in a file. Raises FormatError if it is not one, MaterialError if nothing in it is positive."""
    return parse(Path(path), door.read(path, LARGEST_FILE))


def parse(path: Path, data: bytes) -> GridBrdf:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    if not looks_like(data):
        raise FormatError(f"{path}: expected a measured BSDF (.mbsdf), found another kind of file")
    at, transmission = 0, False
    # A section begins in text, or right after the data of the one before.
    while found := SECTION.search(data, at, at + LONGEST_TEXT):
        kind, start = found[1], found.end()
        if kind == b"_TRANSMISSION":
            transmission = True
            at = start + HEAD.size + 4 * _shape(path, data, start)[0]
            continue
        return _grid(path, data, start, transmission=transmission)
    raise FormatError(f"{path}: expected a line MBSDF_DATA_REFLECTION=, found none")


def _shape(path: Path, data: bytes, start: int) -> tuple[int, tuple[int, ...]]:
    """How many numbers a section has, and their shape."""
    if len(data) < start + HEAD.size:
        raise FormatError(f"{path}: expected the size of the data, found a file that is cut off")
    kind, thetas, phis = HEAD.unpack_from(data, start)
    if kind not in CHANNELS:
        raise FormatError(f"{path}: expected data of type 0 (grey) or 1 (RGB), found type {kind}")
    count = thetas * thetas * phis * CHANNELS[kind]
    if not 1 <= count <= MOST_VALUES:
        raise FormatError(f"{path}: expected 1 to {MOST_VALUES} values, found {thetas} × {thetas} × {phis} directions")
    left = len(data) - start - HEAD.size
    if left < 4 * count:
        raise FormatError(f"{path}: expected {4 * count} bytes of data, found {left}")
    return count, (thetas, thetas, phis, CHANNELS[kind])


def _grid(path: Path, data: bytes, start: int, *, transmission: bool) -> GridBrdf:
    count, shape = _shape(path, data, start)
    with np.errstate(invalid="ignore"):  # of NaN that signals
        values = np.frombuffer(data, "<f4", count, start + HEAD.size).astype(np.float64).reshape(shape)
    if not np.isfinite(values).all():
        raise FormatError(f"{path}: expected finite numbers, found NaN or infinity")
    thetas, phis = shape[0], shape[2]
    after = start + HEAD.size + 4 * count
    more = SECTION.search(data, after - 1, after + LONGEST_TEXT)
    left_out = transmission or (more is not None and more[1] == b"_TRANSMISSION")
    try:
        return GridBrdf(
            *_axes(thetas, phis),
            np.broadcast_to(values, (*shape[:3], 3)),
            name=visible(path.stem),
            source_sha256=hashlib.sha256(data).hexdigest(),
            facts={"transmission_left_out": True} if left_out else {},
        )
    except MaterialError as error:
        raise MaterialError(f"{path}: {error}") from error


def _axes(thetas: int, phis: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """θ_in, θ_out and φ [rad] at the centres of the bins."""
    theta = (np.arange(thetas) + 0.5) / thetas * (TWO_PI / 4)
    return theta, theta, (np.arange(phis) + 0.5) / phis * (TWO_PI / 2)


def write(brdf: Brdf, path: str | Path) -> None:
    """Writes f_r at the centres of 45 × 45 × 90 bins; of a material that was read from such a file, those of that file.

    The mean of both sides of the plane of incidence, where they differ. Negative channels are kept.
    """
    thetas, phis = WRITTEN
    if isinstance(brdf, GridBrdf) and brdf.mirrored and not brdf.about_mirror:
        n, m = len(brdf.axes[0]), len(brdf.axes[2])
        own = zip(brdf.axes, _axes(n, m), strict=True)
        if all(len(a) == len(b) and np.allclose(a, b, rtol=0, atol=1e-12) for a, b in own):
            return _save(brdf.values, path)
    _save(on_grid(brdf, _axes(thetas, phis), both_sides=not brdf.mirrored), path)


def _save(values: NDArray[np.float64], path: str | Path) -> None:
    head = HEAD.pack(1, len(values), values.shape[2])
    with atomic_write(Path(path)) as out:
        out.write(FIRST_LINE + b"MBSDF_DATA_REFLECTION=\n" + head + values.astype("<f4").tobytes())


def _write(brdf: Brdf, path: Path) -> Brdf:
    write(brdf, path)
    return brdf


FORMAT = Format(
    "MDL measured BSDF",
    (".mbsdf",),
    "f_r on a grid of the angles of light and viewer, of NVIDIA's MDL",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
    write=_write,
)
