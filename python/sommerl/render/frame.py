"""The scene that is rendered, and the image that it gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Image:
    """A rendered image. pixels: linear RGB, (height, width, 3). mask: which pixels show an object at their centre."""

    pixels: NDArray[np.float32]
    mask: NDArray[np.bool_]


@dataclass(frozen=True)
class Scene:
    """A Mitsuba scene. objects: the names of the shapes that have the materials to be shown or compared."""

    mitsuba: Any
    objects: tuple[str, ...]
