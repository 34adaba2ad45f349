"""NumPy's files as materials: samples or neural BRDFs, whichever their arrays are."""

from __future__ import annotations

from pathlib import Path

from ..reflectance.brdf import Brdf
from ..system.errors import FormatError
from . import nbrdf, numpy_files, sample_files, samples
from .format import Format


def _array(path: Path, data: bytes) -> Brdf:
    if not numpy_files.is_array(data):
        raise FormatError(f"{path}: expected a NumPy array, found another kind of file")
    array = numpy_files.read_npy(path, data)
    return samples.parse(path, data) if samples.are_samples(array) else nbrdf.parse(path, data)


def _archive(path: Path, data: bytes, member: str) -> Brdf:
    weights = nbrdf.in_archive(path, data)
    if weights is not None:
        return nbrdf.parse(path, weights)
    sampled = samples.are_columns(numpy_files.read_npz(path, data))
    return samples.parse(path, data) if sampled else nbrdf.parse(path, data, member)


def _members(path: Path, data: bytes) -> list[str]:
    if nbrdf.in_archive(path, data) is not None:
        return [""]
    arrays = numpy_files.read_npz(path, data)
    return [""] if samples.are_columns(arrays) else nbrdf.members(arrays)


ARRAY = Format(
    "NumPy array",
    (".npy",),
    "samples, or the weights of a neural BRDF",
    sniff=numpy_files.is_array,
    read=_array,
    largest=numpy_files.LARGEST_FILE,
    parts=nbrdf.parts,
    write=sample_files.write_grid,
)
ARCHIVE = Format(
    "NumPy archive",
    (".npz",),
    "samples, or neural BRDFs, of which FILE.npz:NAME is one",
    sniff=numpy_files.is_archive,
    read=_archive,
    largest=numpy_files.LARGEST_FILE,
    members=_members,
)
