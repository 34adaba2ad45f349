"""Writes and reads files of factored BRDFs (.fbrdf), format 1. docs/format.md specifies every byte.

The body, which follows the head that `sealed_file` writes:

    bytes  what
    1, …   length of the name, and the name in UTF-8
    1, …   32 and the SHA-256 of the source, or 0
    1, 1   J, K
    …      a deflate stream: F, u and v in half precision, first the low bytes of all numbers and then their high
           bytes; the scales in single precision
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from ..system import door, sealed_file
from ..system.errors import FormatError, SommerlError
from ..system.files import atomic_write
from ..system.sealed_file import Reader
from .material import COLUMNS, ELEVATIONS, MOST, ROWS, FactoredBrdf

MAGIC = b"FBRD"
VERSION = 1
TERMS = struct.Struct("<BB")
LONGEST_FILE = 2**20  # bytes


def looks_like(head: bytes) -> bool:
    """Whether a file that begins with these bytes is a factored BRDF, by its magic number."""
    return head.startswith(MAGIC)


def save(material: FactoredBrdf, path: str | Path) -> int:
    """Writes a file; returns its length [bytes]."""
    data = encode(material)
    with atomic_write(Path(path)) as out:
        out.write(data)
    return len(data)


def load(path: str | Path) -> FactoredBrdf:
    """The factored BRDF in a file. Raises FormatError if it is not one, or is damaged, or is of another version."""
    return parse(Path(path), door.read(path, LONGEST_FILE))


def parse(path: Path, data: bytes) -> FactoredBrdf:
    """The same of a file's bytes."""
    return sealed_file.decode_file(path, data, decode)


def encode(material: FactoredBrdf) -> bytes:
    """The bytes of a material's file; always the same for the same material."""
    halves = np.concatenate([part.reshape(-1) for part in (material.lobes, material.rows, material.columns)])
    planes = halves.astype("<f2").view(np.uint8).reshape(-1, 2).T
    stream = sealed_file.deflated(planes.tobytes() + material.scale.astype("<f4").tobytes())
    head = sealed_file.origin(material.name, material.source.sha256) + TERMS.pack(*material.terms)
    return sealed_file.sealed(MAGIC, VERSION, head + stream)


def decode(data: bytes) -> FactoredBrdf:
    """Reads a factored BRDF from the bytes of a file. Raises FormatError if they are not a valid file."""
    _, reader = sealed_file.opened(data, MAGIC, VERSION, "factored BRDF (.fbrdf)")
    try:
        return _material(reader)
    except FormatError:
        raise
    except (ValueError, zlib.error, SommerlError) as error:
        raise FormatError(f"expected a factored BRDF's header and contents, found others ({error})") from error


def _material(reader: Reader) -> FactoredBrdf:
    origin = reader.origin()
    lobes, terms = map(int, reader.unpack(TERMS))
    if not (1 <= lobes <= MOST and 1 <= terms <= MOST):
        raise FormatError(f"expected 1 to {MOST} lobes and terms, found {lobes} and {terms}")
    shapes = (ELEVATIONS, lobes, 3), (ROWS, lobes, terms), (COLUMNS, lobes, terms)
    sizes = [int(np.prod(shape)) for shape in shapes]
    payload = sealed_file.inflated(reader.rest(), 2 * sum(sizes) + 4 * lobes * terms)
    planes = np.frombuffer(payload, np.uint8, 2 * sum(sizes)).reshape(2, -1)
    halves = np.ascontiguousarray(planes.T).view("<f2").reshape(-1)
    f, u, v = (part.reshape(shape) for part, shape in zip(np.split(halves, np.cumsum(sizes)[:-1]), shapes, strict=True))
    scale = np.frombuffer(payload, "<f4", offset=2 * sum(sizes)).reshape(lobes, terms)
    return FactoredBrdf(f, u, v, scale, **origin)
