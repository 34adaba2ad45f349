"""The tensor container of RGL's .bsdf files: named arrays, laid out as Mitsuba and pbrt-v4 read them.

    bytes  what
    12     "tensor_file", 0
    2      version, 1 and 0
    4      number of fields
    …      for each: length of its name (2 bytes), name, number of axes (2), type (1), offset of its data (8),
           length of each axis (8)

All numbers are little-endian; the data of a field lies at its offset, last axis fastest.
"""

from __future__ import annotations

import io
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..system.errors import FormatError

MAGIC = b"tensor_file\0"
VERSION = b"\x01\x00"
TYPES = dict(enumerate(("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8"), start=1))
NUMBERS = {np.dtype(name): number for number, name in TYPES.items()}
LARGEST_FILE = 2**26  # bytes; RGL's isotropic materials take up to 8 MB
MOST_FIELDS, LONGEST_NAME, MOST_AXES = 64, 256, 8


@dataclass(frozen=True)
class Field:
    """Where in the file an array lies."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    offset: int

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


class TensorFile:
    """The fields of a container, from a file's bytes. No array is made before `array` asks for it, and all sizes are
    checked against the file's first. Raises FormatError."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self._data = path, data
        self.fields = self._header(io.BytesIO(data))

    def array(self, name: str) -> NDArray[Any]:
        """The data of a field. Raises FormatError if there is no such field, or a number in it is not finite."""
        field = self.field(name)
        data = np.frombuffer(self._data, field.dtype, math.prod(field.shape), field.offset).reshape(field.shape)
        if data.dtype.kind == "f" and not np.isfinite(data).all():
            raise FormatError(f"{self.path}: {name}: expected finite numbers, found NaN or infinity")
        return data

    def field(self, name: str) -> Field:
        if name not in self.fields:
            raise FormatError(f"{self.path}: expected a field {name}, found {', '.join(self.fields) or 'none'}")
        return self.fields[name]

    def _header(self, stream: BinaryIO) -> dict[str, Field]:
        if _take(self.path, stream, len(MAGIC), "header") != MAGIC:
            raise FormatError(f"{self.path}: expected a tensor file, found another kind")
        version = _take(self.path, stream, len(VERSION), "header")
        if version != VERSION:
            raise FormatError(f"{self.path}: version: expected 1.0, found {version[0]}.{version[1]}")
        (count,) = self._unpack(stream, "<I")
        if not 1 <= count <= MOST_FIELDS:
            raise FormatError(f"{self.path}: number of fields: expected 1 to {MOST_FIELDS}, found {count}")
        fields: dict[str, Field] = {}
        for _ in range(count):
            name, field = self._field(stream)
            if name in fields:
                raise FormatError(f"{self.path}: {name}: expected one field of that name, found two")
            fields[name] = field
        header = stream.tell()
        for name, field in fields.items():
            if not header <= field.offset <= len(self._data) - field.nbytes:
                found = f"{field.nbytes} bytes from byte {field.offset}"
                raise FormatError(f"{self.path}: {name}: expected data within {len(self._data)} bytes, found {found}")
        return fields

    def _field(self, stream: BinaryIO) -> tuple[str, Field]:
        (length,) = self._unpack(stream, "<H")
        if not 1 <= length <= LONGEST_NAME:
            raise FormatError(f"{self.path}: expected field names of 1 to {LONGEST_NAME} bytes, found {length}")
        raw = _take(self.path, stream, length, "header")
        name = raw.decode("ascii", "replace")
        if not (name.isascii() and name.isprintable()):
            raise FormatError(f"{self.path}: expected field names in ASCII, found {raw!r}")
        axes, kind, offset = self._unpack(stream, "<HBQ")
        if kind not in TYPES:
            raise FormatError(f"{self.path}: {name}: expected a type of 1 to {len(TYPES)}, found {kind}")
        if axes > MOST_AXES:
            raise FormatError(f"{self.path}: {name}: expected at most {MOST_AXES} axes, found {axes}")
        return name, Field(np.dtype(TYPES[kind]), self._unpack(stream, f"<{axes}Q"), offset)

    def _unpack(self, stream: BinaryIO, layout: str) -> tuple[int, ...]:
        return struct.unpack(layout, _take(self.path, stream, struct.calcsize(layout), "header"))


def write(out: BinaryIO, fields: Mapping[str, NDArray[Any]]) -> None:
    """Writes a container with the given arrays; their types must be among TYPES."""
    header = 18 + sum(13 + len(name) + 8 * array.ndim for name, array in fields.items())
    offset = header
    out.write(MAGIC + VERSION + struct.pack("<I", len(fields)))
    for name, array in fields.items():
        out.write(struct.pack("<H", len(name)) + name.encode("ascii"))
        out.write(struct.pack("<HBQ", array.ndim, NUMBERS[array.dtype], offset))
        out.write(struct.pack(f"<{array.ndim}Q", *array.shape))
        offset += array.nbytes
    for array in fields.values():
        out.write(np.ascontiguousarray(array).tobytes())


def _take(path: Path, stream: BinaryIO, length: int, what: str) -> bytes:
    data = stream.read(length)
    if len(data) != length:
        raise FormatError(f"{path}: {what}: expected {length} more bytes, found {len(data)}: the file is cut off")
    return data
