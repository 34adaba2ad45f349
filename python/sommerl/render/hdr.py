"""Radiance's .hdr images (Ward, "Real Pixels", Graphics Gems II, 1991): three mantissas and a common exponent a pixel.

Mitsuba's own decoder is not used, since it writes beyond its memory if a file has a run that is longer than its line.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

MAGIC = b"#?RADIANCE", b"#?RGBE"
LONGEST_HEAD = 2**16
SHORTEST, LONGEST = 8, 2**15 - 1  # pixels of a line that may be run-length encoded


def size(data: bytes) -> tuple[int, int, int]:
    """Width, height, and the position of the first pixel. Raises ValueError if there is no valid head."""
    found = re.search(rb"\n-Y (\d{1,9}) \+X (\d{1,9})\n", data[:LONGEST_HEAD])
    if not found or not re.search(rb"\nFORMAT=32-bit_rle_rgbe\s*\n", data[: found.start() + 1]):
        raise ValueError("no lines with a format and a size like -Y 512 +X 1024")
    return int(found[2]), int(found[1]), found.end()


def decode(data: bytes) -> NDArray[np.float32]:
    """Linear RGB of shape (height, width, 3). Raises ValueError for damaged data."""
    width, height, at = size(data)
    if SHORTEST <= width <= LONGEST and data[at : at + 2] == b"\2\2":
        lines: list[bytes] = []
        for _ in range(height):
            line, at = _line(data, at, width)
            lines.append(line)
        rgbe = np.frombuffer(b"".join(lines), np.uint8).reshape(height, 4, width).transpose(0, 2, 1)
    else:
        rgbe = np.frombuffer(data, np.uint8, 4 * width * height, at).reshape(height, width, 4)
    exponent = rgbe[..., 3:].astype(np.int32)
    scale = np.ldexp(np.float32(1), np.where(exponent > 0, exponent - 136, -200)).astype(np.float32)
    return np.where(exponent > 0, rgbe[..., :3] * scale, np.float32(0))


def _line(data: bytes, at: int, width: int) -> tuple[bytes, int]:
    """Decodes a run-length encoded line: its bytes, channel after channel, and the position after it."""
    if data[at : at + 4] != bytes((2, 2, width >> 8, width & 255)):
        raise ValueError("a line of another width")
    at += 4
    parts: list[bytes] = []
    for _ in range(4):
        left = width
        while left > 0:
            count = data[at] if at < len(data) else 0
            if count > 128:
                count -= 128
                parts.append(data[at + 1 : at + 2] * count)
                at += 2
            else:
                parts.append(data[at + 1 : at + 1 + count])
                at += 1 + count
            if not 0 < count <= left or at > len(data):
                raise ValueError("runs that do not make up a line")
            left -= count
    return b"".join(parts), at
