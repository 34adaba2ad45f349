"""The buffers of many materials as few long ones, so that one formula serves them all.

Each buffer holds what the materials have under its name, one behind the other. What a lane reads depends on the number
of its material: a `Section` that begins where that material's part does, so that formulas take it for a buffer.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system.errors import MaterialError
from .arrays import Array, Section, ops

LONGEST = 2**31 - 1  # entries: what indices of 32 bits reach on every device


class Concatenated:
    """The buffers of several materials, which have the same names.

    parts: of each material, as `Brdf.buffers` gives them: flat arrays, and numbers, of shape (). buffers: the long
    arrays, which a renderer uploads; those that say where each material's parts begin are among them.

    Raises MaterialError for what has more entries than a device can address.
    """

    count: int  #: of materials
    buffers: dict[str, NDArray[Any]]

    def __init__(self, parts: Iterable[Mapping[str, NDArray[Any]]]) -> None:
        every = list(parts)
        self.count = len(every)
        self.buffers = {}
        self._numbers: list[str] = []  # of buffers that have one entry a material
        self._strides: dict[str, int] = {}  # of those whose parts are equally long
        self._starts: dict[str, str] = {}  # of all others: the buffer that says where each part begins
        known: dict[bytes, str] = {}
        for name, first in every[0].items():
            arrays = [part[name] for part in every]
            self.buffers[name] = np.stack(arrays) if first.ndim == 0 else np.concatenate(arrays)
            if len(self.buffers[name]) > LONGEST:
                raise MaterialError(f"{self.count} materials: expected at most {LONGEST} entries of {name}, found more")
            if first.ndim == 0:
                self._numbers.append(name)
                continue
            lengths = {len(array) for array in arrays}
            if len(lengths) == 1:
                self._strides[name] = lengths.pop()
                continue
            starts = np.cumsum([0, *(len(array) for array in arrays[:-1])]).astype(np.uint32)
            # Buffers with an entry each for the same things begin at the same places, which are looked up once.
            self._starts[name] = known.setdefault(starts.tobytes(), f"starts of {name}")
            self.buffers[self._starts[name]] = starts

    def of(self, material: Array, buffers: Mapping[str, Any]) -> dict[str, Any]:
        """What each lane reads: the buffers of its material. material: numbers below `count`, as indices.

        buffers: those of this object, as they are or uploaded.
        """
        gather = ops(material).gather
        found: dict[str, Any] = {name: gather(buffers[name], material) for name in self._numbers}
        for name, stride in self._strides.items():
            found[name] = Section(buffers[name], material * stride)
        for name, starts in self._starts.items():
            found[name] = Section(buffers[name], gather(buffers[starts], material))
        return found
