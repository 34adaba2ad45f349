"""Many pictures of one scene in one film, one below the other: a sheet.

Each picture, a frame, is taken by the same camera, but at its own time: the number of the frame. A material that takes
its number from the time, of an atlas, is another one in each frame. So a sheet of any number of materials has one
shape, one BSDF and one kernel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from .bsdf import upload
from .frame import Image
from .llvm import drjit, mitsuba

MOST_FRAMES = 256  # of a sheet: places in a frame keep 16 bits of the 24 that single precision has
MOST_PIXELS = 2**22  # of a sheet: bounds memory


@dataclass(frozen=True)
class Frames:
    """So many frames of a sheet, one below the other; the numbers of the first one and of all that follow."""

    first: int
    count: int

    def sensor(self, camera: Any, film: Any) -> Any:
        """What takes them with a Mitsuba sensor. film: as wide as the camera's, and `count` times as high."""
        props = mitsuba().Properties()
        props["film"] = film
        return _sensor(mitsuba().variant())(props, camera, self)

    def cut(self, sheet: Image) -> list[Image]:
        """The frames of a sheet that was rendered."""
        parts = (np.split(array, self.count) for array in (sheet.pixels, sheet.mask))
        return [Image(pixels, mask) for pixels, mask in zip(*parts, strict=True)]


def sheets(count: int, size: int) -> list[Frames]:
    """Sheets, as few as can be and equally long, for `count` frames in all; the last one may have frames too many.

    size: of a frame, in pixels.
    """
    most = max(1, min(MOST_FRAMES, MOST_PIXELS // size**2))
    length = math.ceil(count / math.ceil(count / most))
    return [Frames(first, length) for first in range(0, count, length)]


def frame_number() -> Any:
    """A texture whose value is the number of the frame."""
    return _frame_number(mitsuba().variant())(mitsuba().Properties())


@cache
def _sensor(variant: str) -> Any:
    """The sensor's class for a variant of Mitsuba."""
    mi, dr = mitsuba(), drjit()

    class FramesSensor(mi.Sensor):
        def __init__(self, props: Any, camera: Any, frames: Frames) -> None:
            mi.Sensor.__init__(self, props)
            self._camera, self._count = camera, frames.count
            self._first = upload(np.array(frames.first))  # so that all sheets share one kernel

        def sample_ray(self, time: Any, wavelength: Any, position: Any, aperture: Any, active: Any = True) -> Any:
            place = mi.Point2f(position)
            down = place.y * self._count
            number = dr.clip(dr.floor(down), 0.0, self._count - 1.0)
            inside = mi.Point2f(place.x, down - number)
            ray, weight = self._camera.sample_ray(time, wavelength, inside, aperture, active)
            ray.time = self._first + number
            return ray, weight

        def sample_ray_differential(
            self, time: Any, wavelength: Any, position: Any, aperture: Any, active: Any = True
        ) -> Any:
            ray, weight = self.sample_ray(time, wavelength, position, aperture, active)
            return mi.RayDifferential3f(ray), weight

        def to_string(self) -> str:
            return f"FramesSensor[{self._count}]"

    return FramesSensor


@cache
def _frame_number(variant: str) -> Any:
    """The texture's class for a variant of Mitsuba."""
    mi = mitsuba()

    class FrameNumber(mi.Texture):
        def __init__(self, props: Any) -> None:
            mi.Texture.__init__(self, props)

        def eval_1(self, si: Any, active: Any = True) -> Any:
            return si.time

        def is_spatially_varying(self) -> bool:
            return True

        def to_string(self) -> str:
            return "FrameNumber[]"

    return FrameNumber
