"""MERL .binary files (Matusik et al. 2003): three int32 dimensions, then the planes R, G, B in float64.

Cell number = φ_d + n_φ (θ_d + 90 θ_h); f_r = stored × (1, 1.15, 1.66) / 1500. Files with 360 bins in φ_d hold
data that is not reciprocal.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.cells import Lattice
from ..reflectance.table import BrdfTable
from ..system import door
from ..system.errors import FormatError, MaterialError
from ..system.files import atomic_write
from ..system.visible import visible
from .format import Format

LATTICES: dict[tuple[int, ...], Lattice] = {
    (90, 90, 180): Lattice(),
    (90, 90, 360): Lattice(phi_d=360, reciprocal=False),
}
SCALE = np.array([1.0, 1.15, 1.66]) / 1500.0
HEADER_BYTES = 12
BELOW_HORIZON = -1.0  # what the stored planes hold where nothing can be measured


class MerlTable(BrdfTable):
    """A table from a MERL file. planes: what the file holds, of shape (3,) + the lattice's.

    Scaling to f_r and back is not exact; with these numbers, what was not changed is written as it was read.
    """

    planes: NDArray[np.float64]


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these 12 bytes says that it is a MERL table."""
    return len(head) >= HEADER_BYTES and _dimensions(head) in LATTICES


def read(path: str | Path) -> MerlTable:
    """The table in a MERL file. Raises FormatError if it is not one, MaterialError if nothing in it is positive."""
    return parse(Path(path), door.read(path, LARGEST_FILE))


def parse(path: Path, data: bytes) -> MerlTable:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    if len(data) < HEADER_BYTES:
        raise FormatError(f"{path}: expected a MERL header of {HEADER_BYTES} bytes, found {len(data)}")
    dimensions = _dimensions(data)
    if dimensions not in LATTICES:
        known = " or ".join("×".join(map(str, known)) for known in LATTICES)
        raise FormatError(f"{path}: expected MERL dimensions {known}, found {'×'.join(map(str, dimensions))}")
    lattice = LATTICES[dimensions]
    expected = bytes_on_disk(lattice)
    if len(data) != expected:
        raise FormatError(f"{path}: expected {expected} bytes for these dimensions, found {len(data)}")
    digest = hashlib.sha256(data).hexdigest()
    planes = np.frombuffer(data, "<f8", offset=HEADER_BYTES).reshape(3, *lattice.shape)
    try:
        table = MerlTable(_scaled(planes), lattice, name=visible(path.stem), source_sha256=digest)
    except MaterialError as error:
        raise MaterialError(f"{path}: {error}") from error
    table.planes = planes
    return table


def bytes_on_disk(lattice: Lattice) -> int:
    """The length of a MERL file with that lattice."""
    return HEADER_BYTES + 3 * 8 * lattice.size


LARGEST_FILE = max(map(bytes_on_disk, LATTICES.values()))


def resampled(brdf: Brdf) -> BrdfTable:
    """The BRDF as a table on a lattice of MERL's: itself if it is one, else its values at the centres of the cells."""
    table = BrdfTable.of(brdf)
    return table if table.lattice in LATTICES.values() else BrdfTable.sampled(brdf)


def write(table: BrdfTable, path: str | Path) -> None:
    """Writes a table in MERL's format. Raises FormatError if it has another lattice."""
    if table.lattice not in LATTICES.values():
        raise FormatError(f"{path}: expected a MERL lattice, found {table.lattice}")
    stored = np.where(_reachable(table.lattice)[..., None], table.values / SCALE, BELOW_HORIZON)
    if isinstance(table, MerlTable):
        original, above = np.moveaxis(table.planes, 0, -1), table.lattice.above_horizon[..., None]
        np.copyto(stored, original, where=~above | (table.values == _scaled(table.planes)))
    with atomic_write(Path(path)) as out:
        out.write(np.array(table.lattice.shape, "<i4").tobytes())
        for channel in range(3):
            out.write(stored[..., channel].astype("<f8").tobytes())


def _scaled(planes: NDArray[np.float64]) -> NDArray[np.float64]:
    """f_r of a file's planes, of the lattice's shape + (3,)."""
    with np.errstate(invalid="ignore"):  # of NaN that signals
        return np.moveaxis(planes, 0, -1) * SCALE


def _reachable(lattice: Lattice) -> NDArray[np.bool_]:
    """Cells of which any part is above the horizon: other readers look these up, too."""
    theta_h = (np.arange(90) / 90) ** 2 * np.pi / 2
    theta_d = np.arange(90) / 90 * np.pi / 2
    edges = np.abs(np.cos(np.arange(lattice.phi_d + 1) / lattice.phi_d * lattice.phi_d_range))
    tilt = np.sin(theta_h)[:, None, None] * np.sin(theta_d)[:, None] * np.minimum(edges[1:], edges[:-1])
    return np.cos(theta_h)[:, None, None] * np.cos(theta_d)[:, None] > tilt


def _dimensions(head: bytes) -> tuple[int, ...]:
    return tuple(np.frombuffer(head[:HEADER_BYTES], "<i4").tolist())


def _write_resampled(brdf: Brdf, path: Path) -> BrdfTable:
    table = resampled(brdf)
    write(table, path)
    return table


FORMAT = Format(
    "MERL",
    (".binary",),
    "a table of 90 × 90 × 180 or 360 cells",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
    write=_write_resampled,
)
