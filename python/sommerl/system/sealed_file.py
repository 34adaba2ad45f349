"""The parts that our own file formats share: head, checksum, name and source, and compressed contents.

A file is "sealed" if it begins with this head, whose checksum shows whether the rest is damaged:

    bytes  what
    4      magic
    2      version
    4      CRC-32 of all that follows
    …      the body

All numbers are little-endian.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Protocol, TypeVar

from .errors import FormatError, SommerlError
from .visible import visible

PREFIX = struct.Struct("<4sHI")
BYTE = struct.Struct("<B")
LONGEST_NAME = 2**8 - 1  # bytes in UTF-8: its length is stored in one byte
DIGEST_BYTES = 32  # of a SHA-256


class Named(Protocol):
    """A material that a file can hold: it has a name, and keeps the SHA-256 of the file that it was read from."""

    name: str
    file_sha256: str


Material = TypeVar("Material", bound=Named)


def sealed(magic: bytes, version: int, body: bytes) -> bytes:
    """The bytes of a whole file: the head, then the body."""
    return PREFIX.pack(magic, version, zlib.crc32(body)) + body


def write_sealed(out: BinaryIO, magic: bytes, version: int, parts: Sequence[Any]) -> None:
    """Writes such a file. parts: of the body, in order: bytes or arrays, which are not copied."""
    crc = 0
    for part in parts:
        crc = zlib.crc32(part, crc)
    out.write(PREFIX.pack(magic, version, crc))
    for part in parts:
        out.write(part)


def opened(data: bytes, magic: bytes, newest: int, kind: str) -> tuple[int, Reader]:
    """Checks the head of a file's bytes, and returns its version and a reader of its body.

    newest: the last of the versions that are read, of which 1 is the first. kind: what the file should be, for the
    error message. Raises FormatError if the file is of another kind or version, or damaged.
    """
    version = check(zlib.crc32(memoryview(data)[PREFIX.size :]), data, magic, newest, kind)
    return version, Reader(data, PREFIX.size)


def check(crc: int, data: bytes, magic: bytes, newest: int, kind: str) -> int:
    """The version of a file. Raises FormatError as `opened` does.

    data: begins with the head. crc: checksum of all bytes after the head.
    """
    if len(data) < PREFIX.size:
        raise FormatError(f"expected at least {PREFIX.size} bytes, found {len(data)}")
    found_magic, found_version, expected = PREFIX.unpack_from(data)
    if found_magic != magic:
        raise FormatError(f"expected a {kind}, found another kind")
    if not 1 <= found_version <= newest:
        hint = "a newer Sommerl may read it" if found_version > newest else "make it from its source again"
        versions = " or ".join(map(str, range(1, newest + 1)))
        raise FormatError(f"expected version {versions}, found version {found_version}; {hint}")
    if crc != expected:
        raise FormatError("expected the checksum in the file, found another: the file is damaged or cut off")
    return int(found_version)


def decode_file(path: Path, data: bytes, decode: Callable[[bytes], Material]) -> Material:
    """The material that `decode` reads from the bytes of a file, with the SHA-256 of the file.

    Raises FormatError, with the path of the file, for every error of `decode`.
    """
    try:
        material = decode(data)
    except SommerlError as error:
        raise FormatError(f"{path}: {error}") from error
    material.name = visible(material.name)
    material.file_sha256 = hashlib.sha256(data).hexdigest()
    return material


def origin(name: str, source_sha256: str) -> bytes:
    """The bytes of a name in UTF-8 and of a source's SHA-256, each after its length in one byte.

    A name that is too long is cut off. source_sha256: 64 hexadecimal digits, or "" if there is none. Raises FormatError
    for other text.
    """
    text = name.encode("utf-8", "replace")[:LONGEST_NAME].decode("utf-8", "ignore").encode()
    try:
        digest = bytes.fromhex(source_sha256)
    except ValueError as error:
        raise FormatError(f"{name}: expected a SHA-256 in hexadecimal digits, found {source_sha256!r}") from error
    if len(digest) not in (0, DIGEST_BYTES):
        raise FormatError(f"{name}: expected a digest of {DIGEST_BYTES} bytes, found {len(digest)}")
    return bytes([len(text)]) + text + bytes([len(digest)]) + digest


def deflated(payload: bytes) -> bytes:
    """Compresses to a deflate stream (RFC 1951, without zlib's head)."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS, 9)
    return packer.compress(payload) + packer.flush()


def inflated(compressed: bytes, expected: int) -> bytes:
    """Decompresses a deflate stream to exactly `expected` bytes; never takes more memory than that.

    Raises FormatError if the stream is damaged, gives more or fewer bytes, or has other bytes after it.
    """
    inflater = zlib.decompressobj(-zlib.MAX_WBITS)
    try:
        payload = inflater.decompress(compressed, max(expected, 1))  # 0 would stand for any number
        if len(payload) == expected and not inflater.eof:
            payload += inflater.decompress(inflater.unconsumed_tail, 1)
    except zlib.error:
        payload = b""
    if len(payload) != expected or not inflater.eof or inflater.unused_data:
        raise FormatError(f"expected a stream of {expected} bytes, deflated, that ends with the file, found another")
    return payload


class Reader:
    """Reads bytes one part after the other. Its methods raise FormatError if too few bytes are left."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data, self._at = data, at

    def take(self, count: int) -> bytes:
        part = self._data[self._at : self._at + count]
        if len(part) != count:
            raise FormatError(f"expected {count} more bytes, found {len(part)}")
        self._at += count
        return part

    def unpack(self, layout: struct.Struct) -> tuple[Any, ...]:
        return layout.unpack(self.take(layout.size))

    def origin(self) -> dict[str, str]:
        """The name and the source's SHA-256, as `origin` writes them."""
        try:
            name = self.take(*self.unpack(BYTE)).decode()
        except UnicodeDecodeError as error:
            raise FormatError("expected a name in UTF-8, found other bytes") from error
        (digest,) = self.unpack(BYTE)
        if digest not in (0, DIGEST_BYTES):
            raise FormatError(f"expected a digest of 0 or {DIGEST_BYTES} bytes, found {digest}")
        return {"name": name, "source_sha256": self.take(digest).hex()}

    def rest(self) -> bytes:
        return self._data[self._at :]
