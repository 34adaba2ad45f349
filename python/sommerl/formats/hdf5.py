"""Reads small arrays from HDF5 files, which may be hostile.

Only arrays that a file itself holds are read: links to other places, data in other files, and filters that the library
would have to load are refused. The depth of groups and the number of items are bounded.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system.errors import FormatError
from ..system.optional import optional

MAGIC = b"\x89HDF\r\n\x1a\n"
DEEPEST, MOST_ITEMS = 8, 512
LARGEST_CHUNK = 2**16  # numbers
FILTERS = frozenset(range(1, 7))  # deflate, shuffle, checksum, szip, n-bit, scale-offset: what the library itself has


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes says that it is an HDF5 file."""
    return head.startswith(MAGIC)


def arrays(path: Path, data: bytes, top: str, wanted: Callable[[str], bool], most: int) -> dict[str, NDArray[Any]]:
    """The arrays of floating-point numbers in a file's bytes whose paths are wanted, by these, at most `most` numbers
    each. top: the group to look in; if there is none, everywhere.

    Raises FormatError for what is damaged, larger or deeper, MissingDependencyError without h5py.
    """
    h5py = optional("h5py", "h5py", str(path), "lab")
    found: dict[str, NDArray[Any]] = {}
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            start = _own(h5py, path, file, top) if top in file.id else file
            if not isinstance(start, h5py.Group):
                raise FormatError(f"{path}: {top}: expected a group of layers, found one array")
            for place, item in _items(h5py, path, start):
                if isinstance(item, h5py.Dataset) and wanted(place):
                    found[place] = _array(path, place, item, most)
    except FormatError:
        raise
    except Exception as error:  # whatever the library makes of damage: there is no list of it
        raise FormatError(f"{path}: expected an HDF5 file, found a damaged one ({error})") from error
    return found


def _items(h5py: Any, path: Path, start: Any) -> Iterator[tuple[str, Any]]:
    """The items in a group and in those in it, each with its path."""
    groups: list[tuple[str, Any]] = [("", start)]
    left = MOST_ITEMS
    while groups:
        place, group = groups.pop()
        left -= len(group)
        if left < 0:
            raise FormatError(f"{path}: expected at most {MOST_ITEMS} groups and arrays, found more")
        for name in group:
            inside = f"{place}/{name}".removeprefix("/")
            item = _own(h5py, path, group, name)
            if isinstance(item, h5py.Group):
                groups.append((inside, item))
                if inside.count("/") >= DEEPEST:
                    raise FormatError(f"{path}: expected groups in each other {DEEPEST} deep, found deeper ones")
            yield inside, item


def _own(h5py: Any, path: Path, group: Any, name: str) -> Any:
    """An item of a group. Raises FormatError if it is a link to something by its name, here or in another file."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise FormatError(f"{path}: {name}: expected what the file itself holds, found a link")
    return group[name]


def _array(path: Path, place: str, item: Any, most: int) -> NDArray[Any]:
    if item.size is None or item.size > most or item.dtype.kind != "f":
        raise FormatError(f"{path}: {place}: expected at most {most} weights, found {item.shape} of {item.dtype}")
    creation = item.id.get_create_plist()
    filters = {creation.get_filter(number)[0] for number in range(creation.get_nfilters())}
    if math.prod(item.chunks or ()) > LARGEST_CHUNK or item.is_virtual or item.external or not filters <= FILTERS:
        found = "large chunks, links or unknown filters"
        raise FormatError(f"{path}: {place}: expected weights stored in the file, found {found}")
    return np.asarray(item)
