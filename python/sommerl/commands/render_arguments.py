"""What the command `render` can be asked for."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TypeVar

from ..reflectance.lattice import Interpolation
from ..render.scene_registry import SCENES
from ..render.viewpoint import DirectionalLight, Viewpoint
from ..sampling.named import OURS, SAMPLERS
from ..system.errors import OptionError
from .arguments import Material, option, positional
from .rendering import RenderingArguments

DEFAULT_SCENE = "sphere"

T = TypeVar("T")


def _view(text: str) -> Viewpoint:
    return _angles(Viewpoint, text, "AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,ZOOM", (2, 3))


def _light(text: str) -> DirectionalLight:
    return _angles(DirectionalLight, text, "AZIMUTH,ELEVATION", (2,))


def _angles(kind: Callable[..., T], text: str, expected: str, counts: tuple[int, ...]) -> T:
    """What numbers between commas say."""
    words = text.split(",")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(isfinite, numbers)):
        raise ArgumentTypeError(f"expected {expected}, found {text}")
    try:
        return kind(*numbers)
    except OptionError as error:
        raise ArgumentTypeError(str(error)) from None


@dataclass(frozen=True, kw_only=True)
class RenderArguments(RenderingArguments):
    """What `render` is asked for; what is None was not given."""

    materials: tuple[Material, ...] = positional(
        "MATERIAL",
        default=(),
        help="as many as the scene takes, the rest are the scene's own; or SCENE.xml, a scene of your own",
    )
    scene: str | None = option(default=None, choices=SCENES, help=f"({DEFAULT_SCENE})")
    output: Path = option("-o", metavar="FILE", help="a .png or .exr file")
    against: tuple[Material, ...] = option(
        default=(),
        metavar="REFERENCE",
        help="render the scene with this material in place of the first MATERIAL, too, and say how far the two are "
        "apart; given again: in place of the second one, and so on",
    )
    from_: Viewpoint | None = option(
        default=None,
        metavar="AZIMUTH,ELEVATION[,ZOOM]",
        read=_view,
        help="look at the scene from there [degrees; 0,0: level, from the front; 90,0: from the right]; ZOOM 2: from "
        "half the distance (the scene's own view)",
    )
    light: DirectionalLight | None = option(
        default=None,
        metavar="AZIMUTH,ELEVATION",
        read=_light,
        help="one directional light from there [degrees] and nothing else, of irradiance π",
    )
    mesh: Path | None = option(
        default=None, metavar="FILE", help="statue: a mesh of triangles, .obj or .ply, y up (a built-in one)"
    )
    lookup: Interpolation | None = option(
        default=None, help="how materials are looked up (tables: trilinear; with --against: as `compare` does)"
    )
    sampler: str | None = option(
        default=None,
        choices=SAMPLERS,
        help=f"how directions to the light are drawn; all give the same image, with more or less noise ({OURS.name})",
    )
    variant: str | None = option(
        default=None, metavar="NAME", help="SCENE.xml: of Mitsuba, like scalar_rgb (the fastest there is)"
    )
    define: tuple[str, ...] = option(
        "-D",
        default=(),
        metavar="NAME=VALUE",
        help="SCENE.xml: a value for its parameter $NAME; given again: for another one",
    )
