"""What the command `render` can be asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..reflectance.lattice import Interpolation
from ..render.scene_registry import SCENES
from ..sampling.named import OURS, SAMPLERS
from .arguments import Material, option, positional
from .rendering import RenderingArguments

DEFAULT_SCENE = "sphere"


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
