"""From where a scene is seen and lit: directions as an azimuth and an elevation, in degrees, with y up.

Azimuth 0 is +z, where the cameras of our scenes stand, and 90 is +x, to their right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..system.errors import OptionError

HIGHEST = 89.0  # elevation of a camera: at 90, up would be anywhere
LARGEST_TURN = 360.0
LEAST_ZOOM, MOST_ZOOM = 0.1, 10.0

Point = tuple[float, float, float]


@dataclass(frozen=True)
class DirectionalLight:
    """Light from one direction [degrees], which alone gives a surface that faces it the irradiance π.

    Raises OptionError for angles that are out of range.
    """

    azimuth: float
    elevation: float

    def __post_init__(self) -> None:
        _check("azimuth", self.azimuth, -LARGEST_TURN, LARGEST_TURN)
        _check("elevation", self.elevation, -90, 90)

    @property
    def towards(self) -> Point:
        """The unit vector to the light."""
        return towards(self.azimuth, self.elevation)


@dataclass(frozen=True)
class Viewpoint:
    """From which direction [degrees] a scene's target is seen. zoom: 1 at the distance of the scene's own camera, 2 at
    half of it.

    Raises OptionError for what is out of range.
    """

    azimuth: float
    elevation: float
    zoom: float = 1.0

    def __post_init__(self) -> None:
        _check("azimuth", self.azimuth, -LARGEST_TURN, LARGEST_TURN)
        _check("elevation", self.elevation, -HIGHEST, HIGHEST)
        _check("zoom", self.zoom, LEAST_ZOOM, MOST_ZOOM)


@dataclass(frozen=True)
class Camera:
    """A camera at `origin` that looks at `target`. fov: of the square frame [degrees]."""

    origin: Point
    target: Point
    fov: float

    @property
    def distance(self) -> float:
        return math.dist(self.origin, self.target)

    def seen_from(self, view: Viewpoint | None) -> Camera:
        """The camera for a view of the same target; itself for None."""
        if view is None:
            return self
        away = self.distance / view.zoom
        x, y, z = (
            at + away * along for at, along in zip(self.target, towards(view.azimuth, view.elevation), strict=True)
        )
        return replace(self, origin=(x, y, z))


def towards(azimuth: float, elevation: float) -> Point:
    """The unit vector of an azimuth and an elevation [degrees]."""
    turn, rise = math.radians(azimuth), math.radians(elevation)
    return math.sin(turn) * math.cos(rise), math.sin(rise), math.cos(turn) * math.cos(rise)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise OptionError(f"{name}: expected {low:g} to {high:g}, found {value:g}")
