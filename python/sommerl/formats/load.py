"""Materials by name: a file in any known format, told by its content, or a built-in material."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ..compression.smrl import file as smrl
from ..factored import file as fbrdf
from ..models.builtin import NAMES, builtin
from ..reflectance.brdf import Brdf
from ..reflectance.table import BrdfTable
from ..system import door
from ..system.errors import FormatError
from . import cornell, fits, hdf5, merl, nbrdf, numpy_files, rgl, samples, tensor, text
from .names import split_member

Parse = Callable[[Path, bytes], Brdf]
# What `load` reads.
EXTENSIONS = (".smrl", ".fbrdf", ".binary", ".bsdf", ".brdf", ".csv", ".npy", ".npz", ".h5", ".hdf5", ".json")


def load(source: str | Path) -> Brdf:
    """The material in a file of any known format, told by its content, or the built-in one of that name.

    Of an archive of neural BRDFs, "FILE.npz:NAME" is one; of a file of fits, "FILE.json:MODEL". Raises FormatError for
    a file in no known format, MaterialError for a name that is neither file nor built-in.
    """
    path, member = split_member(source)
    if not os.path.isfile(path) and str(source) in NAMES:
        return builtin(str(source))
    if not os.path.exists(path) and not path.suffix and len(path.parts) == 1:
        return builtin(str(source))  # says which name is nearest
    with door.opened(path) as file:
        if not file.head:
            raise FormatError(f"{path}: expected a material file, found an empty one")
        most, parse = _reader(path, file.head, member)
        data = file.read(most)
    return parse(path, data)


def _reader(path: Path, head: bytes, member: str) -> tuple[int, Parse]:
    """The longest file, and the reader, of the format that a file that starts with `head` is in."""
    if fits.looks_like(head):
        return fits.LARGEST_FILE, partial(fits.parse, member=member)
    if member and not head.startswith(numpy_files.ZIP_MAGIC):
        raise FormatError(f"{path}: expected an archive of materials, to take {member} from it, found one material")
    for looks_like, most, parse in FORMATS:
        if looks_like(head):
            return most, partial(_numpy, member=member) if parse is _numpy else parse
    # Its content says nothing: its reader, by its name, says what is wrong with it.
    if path.suffix.lower() in BY_NAME:
        return BY_NAME[path.suffix.lower()]
    raise FormatError(
        f"{path}: expected a material (.smrl, .fbrdf, MERL .binary, RGL .bsdf, Cornell .brdf, samples .csv .npy .npz, "
        "neural BRDF .npy .npz .h5, fits .json), found none of these"
    )


def _numpy(path: Path, data: bytes, member: str = "") -> Brdf:
    """Samples or a neural BRDF, whichever the arrays are."""
    if data.startswith(numpy_files.ZIP_MAGIC):
        sampled = samples.are_columns(numpy_files.read_npz(path, data))
    else:
        array = numpy_files.read_npy(path, data)
        sampled = bool(array.dtype.names) or (array.ndim == 2 and array.shape[1] == len(samples.COLUMNS))
    return samples.parse(path, data) if sampled else nbrdf.parse(path, data, member)


# What tells a format by a file's first bytes, the longest file, and its reader.
FORMATS: tuple[tuple[Callable[[bytes], bool], int, Parse], ...] = (
    (smrl.looks_like, smrl.LONGEST_FILE, smrl.parse),
    (fbrdf.looks_like, fbrdf.LONGEST_FILE, fbrdf.parse),
    (rgl.looks_like, tensor.LARGEST_FILE, rgl.parse),
    (hdf5.looks_like, nbrdf.LARGEST_FILE, nbrdf.parse),
    (numpy_files.looks_like, numpy_files.LARGEST_FILE, _numpy),
    (merl.looks_like, merl.LARGEST_FILE, merl.parse),
    (cornell.looks_like, text.LARGEST_FILE, cornell.parse),
    (samples.looks_like, text.LARGEST_FILE, samples.parse),
)
BY_NAME: dict[str, tuple[int, Parse]] = {
    ".binary": (merl.LARGEST_FILE, merl.parse),
    ".bsdf": (tensor.LARGEST_FILE, rgl.parse),
    ".brdf": (text.LARGEST_FILE, cornell.parse),
    ".csv": (text.LARGEST_FILE, samples.parse),
    ".json": (fits.LARGEST_FILE, fits.parse),
    **dict.fromkeys((".npy", ".npz", ".h5", ".hdf5"), (nbrdf.LARGEST_FILE, nbrdf.parse)),
}


def load_table(source: str | Path) -> BrdfTable:
    """The material as a table on its own lattice; a formula is evaluated at the cell centres of MERL's."""
    return BrdfTable.of(load(source))
