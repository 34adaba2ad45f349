"""Small arrays from safetensors files (Hugging Face, format 0.3 and later): 8 bytes, the length of a JSON header, which
gives each tensor's type, shape and place; then the bytes of all.

No package is needed, and nothing is executed.
"""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..system.errors import FormatError

LENGTH = struct.Struct("<Q")
LONGEST_HEADER = 2**20  # bytes
MOST_TENSORS, MOST_AXES = 512, 8
TYPES = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2"}


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes has the header of a safetensors file."""
    if len(head) < 10 or head[8:9] != b"{":
        return False
    (length,) = LENGTH.unpack_from(head)
    return 2 <= length <= LONGEST_HEADER and (b'"dtype"' in head or b'"__metadata__"' in head)


def arrays(path: Path, data: bytes, most: int) -> dict[str, NDArray[Any]]:
    """The tensors of floating-point numbers in a file's bytes, by name, at most `most` numbers each.

    Raises FormatError for what is damaged or larger.
    """
    (length,) = LENGTH.unpack_from(data)
    start = LENGTH.size + length
    try:
        found = json.loads(data[LENGTH.size : start])
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected a header in JSON, found something else ({error})") from error
    header = cast("dict[str, Any]", found) if isinstance(found, dict) else {}
    tensors = {name: about for name, about in header.items() if name != "__metadata__"}
    if len(data) < start or not 1 <= len(tensors) <= MOST_TENSORS:
        raise FormatError(f"{path}: expected 1 to {MOST_TENSORS} tensors, found {len(tensors)}")
    return {name: _tensor(path, name, about, data, start, most) for name, about in tensors.items()}


def _tensor(path: Path, name: str, about: Any, data: bytes, start: int, most: int) -> NDArray[Any]:
    fields = cast("dict[str, Any]", about) if isinstance(about, dict) else {}
    kind, shape, offsets = (fields.get(key) for key in ("dtype", "shape", "data_offsets"))
    whole = _whole(shape, MOST_AXES) and _whole(offsets, 2) and len(cast("list[int]", offsets)) == 2
    if not whole or not isinstance(kind, str):
        raise FormatError(f"{path}: {name}: expected dtype, shape and data_offsets, found others")
    size = math.prod(cast("list[int]", shape))
    if kind not in TYPES or not 1 <= size <= most:
        raise FormatError(
            f"{path}: {name}: expected at most {most} weights of {', '.join(TYPES)}, found {shape} of {kind}"
        )
    first, last = cast("list[int]", offsets)
    dtype = np.dtype(TYPES[kind])
    if last - first != size * dtype.itemsize or start + last > len(data):
        raise FormatError(f"{path}: {name}: expected {size * dtype.itemsize} bytes of data, found others")
    numbers = np.frombuffer(data, dtype, size, start + first)
    if kind == "BF16":  # the upper half of single precision
        numbers = (numbers.astype(np.uint32) << 16).view(np.float32)
    return numbers.reshape(cast("list[int]", shape))


def _whole(value: Any, most: int) -> bool:
    """Whether it is a list of at most so many whole numbers from 0 on."""
    numbers = cast("list[Any]", value) if isinstance(value, list) else [None]
    return len(numbers) <= most and all(type(number) is int and 0 <= number < 2**48 for number in numbers)
