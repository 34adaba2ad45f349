"""Materials by name: a file in any known format, told by its content, or a built-in material."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

from .brdf import Brdf, OnLattice
from .errors import FormatError, MaterialError
from .factored import file as fbrdf
from .factored.material import FactoredBrdf
from .formats import arrays_on_disk, cornell, fits, merl, nbrdf, rgl, samples
from .formats.names import split_member
from .lattice import Interpolation
from .materials import NAMES, builtin
from .som_man import file as smrl
from .table import BrdfTable

HEAD_BYTES = 4096
# What `load` reads.
EXTENSIONS = (".smrl", ".fbrdf", ".binary", ".bsdf", ".brdf", ".csv", ".npy", ".npz", ".h5", ".hdf5", ".json")


def load(source: str | Path) -> Brdf:
    """The material in a file of any known format, told by its content, or the built-in one of that name.

    Of an archive of neural BRDFs, "FILE.npz:NAME" is one; of a file of fits, "FILE.json:MODEL". Raises FormatError for
    a file in no known format, MaterialError for a name that is neither file nor built-in.
    """
    path, member = split_member(source)
    if str(source) in NAMES and not path.is_file():
        return builtin(str(source))
    if not path.exists():
        if path.suffix or len(path.parts) > 1:
            raise FormatError(f"{path}: expected a file, found none")
        return builtin(str(source))  # says which name is nearest
    if path.is_dir():
        raise FormatError(f"{path}: expected a material file, found a directory")
    try:
        with path.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
        if not head:
            raise FormatError(f"{path}: expected a material file, found an empty one")
        return _read(path, head, member)
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror or error})") from error


def _read(path: Path, head: bytes, member: str) -> Brdf:
    """The material in a file that starts with `head`."""
    if fits.looks_like(head):
        return fits.read(path, member)
    if member and not head.startswith(arrays_on_disk.ZIP_MAGIC):
        raise FormatError(f"{path}: expected an archive of materials, to take {member} from it, found one material")
    if smrl.looks_like(head):
        return smrl.load(path)
    if fbrdf.looks_like(head):
        return fbrdf.load(path)
    if rgl.looks_like(head):
        return rgl.read(path)
    if head.startswith(nbrdf.HDF5_MAGIC):
        return nbrdf.read(path)
    if head.startswith((arrays_on_disk.MAGIC, arrays_on_disk.ZIP_MAGIC)):
        return _numpy(path, member)
    if merl.looks_like(head):
        return merl.read(path)
    if cornell.looks_like(head):
        return cornell.read(path)
    if samples.looks_like(head):
        return samples.read(path)
    return _named(path)


def _numpy(path: Path, member: str) -> Brdf:
    """Samples or a neural BRDF, whichever the arrays are."""
    if zipfile.is_zipfile(path):
        sampled = samples.are_columns(arrays_on_disk.read_npz(path))
    else:
        array = arrays_on_disk.read_npy(path)
        sampled = bool(array.dtype.names) or (array.ndim == 2 and array.shape[1] == len(samples.COLUMNS))
    return samples.read(path) if sampled else nbrdf.read(path, member)


def _named(path: Path) -> Brdf:
    """A file whose content says nothing: its reader, by its name, says what is wrong with it."""
    reader: dict[str, Callable[[Path], Brdf]] = {".binary": merl.read, ".bsdf": rgl.read, ".brdf": cornell.read}
    reader |= {".csv": samples.read, ".json": fits.read}
    reader |= dict.fromkeys((".npy", ".npz", ".h5", ".hdf5"), nbrdf.read)
    if path.suffix.lower() in reader:
        return reader[path.suffix.lower()](path)
    raise FormatError(
        f"{path}: expected a material (.smrl, .fbrdf, MERL .binary, RGL .bsdf, Cornell .brdf, samples .csv .npy .npz, "
        "neural BRDF .npy .npz .h5, fits .json), found none of these"
    )


def interpolated(brdf: Brdf, interpolation: Interpolation) -> Brdf:
    """The same material, looked up in another way. Raises MaterialError if it is a formula, or there is no such way."""
    if isinstance(brdf, OnLattice):
        return brdf.with_interpolation(interpolation)
    kind = "a factored one" if isinstance(brdf, FactoredBrdf) else "a formula"
    raise MaterialError(f"{brdf.name}: expected a table or a compressed material to look up, found {kind}")


def load_table(source: str | Path) -> BrdfTable:
    """The material as a table on its own lattice; a formula is evaluated at the cell centres of MERL's."""
    return BrdfTable.of(load(source))
