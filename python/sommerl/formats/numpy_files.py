"""NumPy's .npy and .npz files, without executing what they hold and without allocating what they only claim to hold."""

from __future__ import annotations

import io
import math
import warnings
import zipfile
import zlib
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..system.errors import FormatError

MAGIC, ZIP_MAGIC = b"\x93NUMPY", b"PK\x03\x04"
LARGEST_ARRAY = 2**28  # bytes
MOST_HEADER = 4096  # bytes: many fields take some
MOST_ARRAYS, MOST_AXES = 4096, 8
LARGEST_FILE = LARGEST_ARRAY + 2**20  # bytes: with the names of all arrays


def is_array(head: bytes) -> bool:
    """Whether a file that starts with these bytes says that it is a .npy file."""
    return head.startswith(MAGIC)


def is_archive(head: bytes) -> bool:
    """Whether a file that starts with these bytes says that it is an archive, as .npz files are."""
    return head.startswith(ZIP_MAGIC)


def read_npy(path: Path, data: bytes) -> NDArray[Any]:
    """The array in a .npy file's bytes. Raises FormatError."""
    return _array(path, "array", io.BytesIO(data), len(data))


def read_npz(path: Path, data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays in a .npz file's bytes, by name. Raises FormatError."""
    with _archive(path, data) as archive:
        members = archive.infolist()
        if sum(member.file_size for member in members) > LARGEST_ARRAY:
            raise FormatError(f"{path}: expected at most {MOST_ARRAYS} arrays of {LARGEST_ARRAY} bytes, found more")
        arrays: dict[str, NDArray[Any]] = {}
        for member in members:
            with archive.open(member) as stream:
                arrays[member.filename.removesuffix(".npy")] = _array(path, member.filename, stream, member.file_size)
        return arrays


def names(path: Path, data: bytes) -> list[str]:
    """The names of what is in an archive. Raises FormatError."""
    with _archive(path, data) as archive:
        return archive.namelist()


def member(path: Path, data: bytes, member: str, most: int) -> bytes:
    """The bytes of one of an archive's members. Raises FormatError if there are more than `most`."""
    with _archive(path, data) as archive:
        if archive.getinfo(member).file_size > most:
            raise FormatError(f"{path}: {member}: expected at most {most} bytes, found more")
        with archive.open(member) as stream:
            found = stream.read(most + 1)
        if len(found) > most:
            raise FormatError(f"{path}: {member}: expected at most {most} bytes, found more")
        return found


@contextmanager
def _archive(path: Path, data: bytes) -> Generator[zipfile.ZipFile]:
    """An archive. Raises FormatError if it is damaged, holds too many members, or those that are packed otherwise."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if len(members) > MOST_ARRAYS:
                raise FormatError(f"{path}: expected at most {MOST_ARRAYS} arrays of {LARGEST_ARRAY} bytes, found more")
            if any(member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in members):
                raise FormatError(f"{path}: expected arrays stored or deflated, as NumPy writes them, found others")
            yield archive
    # All of these are what zipfile raises for damaged archives: of the directory, the data, its length, an unknown
    # method, encryption, a name that is no text, and a place outside of the file.
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError) as error:
        raise FormatError(f"{path}: expected an archive of NumPy arrays, found a damaged one ({error})") from error


def _array(path: Path, name: str, stream: IO[bytes], length: int) -> NDArray[Any]:
    try:
        version = npy.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise FormatError(f"{path}: {name}: expected NumPy's format 1.0 or 2.0, found {version[0]}.{version[1]}")
        header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of files that Python 2 wrote: they are read all the same
            shape, fortran, dtype = header(stream, MOST_HEADER)
        size = math.prod(shape) * dtype.itemsize
        plain = dtype.subdtype is None and not dtype.hasobject and len(shape) <= MOST_AXES
        if not plain or any(type(n) is not int or n < 0 for n in shape) or not 0 < size <= min(length, LARGEST_ARRAY):
            raise FormatError(f"{path}: {name}: expected numbers within {length} bytes, found {dtype} of shape {shape}")
        data = stream.read(size + 1)
        if len(data) != size:
            raise FormatError(f"{path}: {name}: expected {size} bytes of data, found another number")
    except (ValueError, SyntaxError, TypeError, TokenError, MemoryError, RecursionError) as error:
        raise FormatError(f"{path}: {name}: expected a NumPy array, found another kind of data ({error})") from error
    return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")
