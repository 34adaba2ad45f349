"""Checks the headers of OpenEXR, Radiance HDR and PFM images before they are decoded.

The decoders believe the size that a header gives, and a file of a few bytes could make them take any amount of memory
and time.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from itertools import groupby

from . import hdr

MOST_PIXELS = 2**26  # 8192 × 8192
MOST_VALUES = 2**28  # of all channels
MOST_CHANNELS = 64
LONGEST_HEAD = 2**20  # bytes
EXR, PFM = b"v/1\x01", (b"PF", b"Pf")
LDR = b"\x89PNG", b"\xff\xd8\xff", b"BM", b"P3", b"P5", b"P6"
PARTS, DEEP = 0x1000, 0x0800  # flags of OpenEXR: several parts, deep pixels


def kind_of(data: bytes) -> str:
    """Mitsuba's name of an image's format; "LDR" for formats of low dynamic range, "" for unknown ones."""
    if data.startswith(EXR):
        return "OpenEXR"
    if data.startswith(hdr.MAGIC):
        return "RGBE"
    if data[:2] in PFM and data[2:3].isspace():
        return "PFM"
    return "LDR" if data.startswith(LDR) else ""


def check(kind: str, data: bytes) -> None:
    """Raises ValueError if a header is not valid, or gives more than MOST_PIXELS or MOST_VALUES."""
    sizes = {"OpenEXR": _exr, "RGBE": _hdr, "PFM": _pfm}[kind](data)
    for width, height, channels in sizes:
        values = width * height * channels
        if not (width >= 1 and height >= 1 and width * height <= MOST_PIXELS and 1 <= values <= MOST_VALUES):
            raise ValueError(f"{width} × {height} pixels of {channels} channels, of at most {MOST_PIXELS} pixels")


def _hdr(data: bytes) -> Iterator[tuple[int, int, int]]:
    width, height, _ = hdr.size(data)
    yield width, height, 3


def _pfm(data: bytes) -> Iterator[tuple[int, int, int]]:
    found = re.match(rb"P([Ff])\s+(\d{1,9})\s+(\d{1,9})\s+[-+.\deE]{1,20}\s", data)
    if not found:
        raise ValueError("no size and scale in the first lines")
    yield int(found[2]), int(found[3]), 3 if found[1] == b"F" else 1


def _exr(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yields width, height and channels of every window and every tile of all parts. Raises ValueError."""
    version = struct.unpack_from("<I", data, 4)[0]
    if version & DEEP:
        raise ValueError("deep pixels")
    parts = groupby(_attributes(data[:LONGEST_HEAD], bool(version & PARTS)), lambda attribute: attribute[0])
    for _, attributes in parts:
        sizes: list[tuple[int, int]] = []
        channels = 0
        for _, kind, value in attributes:
            if kind == b"box2i":
                x0, y0, x1, y1 = struct.unpack("<4i", value)
                sizes.append((x1 - x0 + 1, y1 - y0 + 1))
            elif kind == b"tiledesc":
                sizes.append(struct.unpack_from("<2I", value))
            elif kind == b"chlist":
                channels = _channels(value)
        if not sizes or not 1 <= channels <= MOST_CHANNELS:
            raise ValueError(f"a head without window, or with {channels} channels, of at most {MOST_CHANNELS}")
        for width, height in sizes:
            yield width, height, channels


def _attributes(data: bytes, parts: bool) -> Iterator[tuple[int, bytes, bytes]]:
    """Yields the part, the type and the value of every attribute. Raises ValueError if the header is cut off."""
    at, part = 8, 0
    while True:
        name, at = _word(data, at)
        if not name:
            part += 1
            if not parts or data[at : at + 1] in (b"\0", b""):
                return
            continue
        kind, at = _word(data, at)
        if at + 4 > len(data):
            raise ValueError("a head that is cut off")
        (size,) = struct.unpack_from("<i", data, at)
        at += 4
        if not 0 <= size <= len(data) - at:
            raise ValueError("a head that is cut off")
        yield part, kind, data[at : at + size]
        at += size


def _word(data: bytes, at: int) -> tuple[bytes, int]:
    """The bytes up to the next zero byte, and the position after it."""
    end = data.find(b"\0", at, at + 256)
    if end < 0:
        raise ValueError("a head that is cut off")
    return data[at:end], end + 1


def _channels(value: bytes) -> int:
    """The number of channels in a list, in which each has a name, a zero byte and 16 bytes."""
    at = count = 0
    while at < len(value) and value[at] and count <= MOST_CHANNELS:
        _, at = _word(value, at)
        at, count = at + 16, count + 1
    return count
