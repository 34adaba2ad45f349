"""What is rendered, and what comes of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Image:
    """A rendered frame: linear RGB (height, width, 3), and which pixels' centres show an object (height, width)."""

    pixels: NDArray[np.float32]
    mask: NDArray[np.bool_]


@dataclass(frozen=True)
class Scene:
    """A Mitsuba scene, and the names of those of its shapes that carry the materials: its objects."""

    mitsuba: Any
    objects: tuple[str, ...]
