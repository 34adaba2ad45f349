"""The table of scenes. The command line, help and docs ask this table; a new scene is one more row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from ..models.builtin import NAMES
from ..reflectance.brdf import Brdf
from ..sampling.sampler import Sampler
from ..system.errors import OptionError
from .environment import default_environment
from .frame import Scene
from .meshes import Mesh
from .passes import DEFAULT_SIZE
from .scenes import Surroundings, ball, sample, sphere, spheres, statue, still_life
from .viewpoint import Viewpoint


@dataclass(frozen=True)
class Contents:
    """What is put into a scene.

    samplers: how directions are drawn, one for each BRDF; for None see `make_bsdf`. environment: radiance
        (height, width, 3), or a directional light in its place, or None where the scene has lights of its own. mesh,
        view: None for the scene's own. size: of the square frame, in pixels.
    """

    brdfs: Sequence[Brdf]
    samplers: Sequence[Sampler] | None
    environment: Surroundings | None
    mesh: Mesh | None
    size: int
    view: Viewpoint | None = None

    @property
    def sampler(self) -> Sampler | None:
        """That of the first material."""
        return self.samplers[0] if self.samplers else None


@dataclass(frozen=True)
class SceneKind:
    """A scene that comes along, and what it takes.

    summary: what it shows, for help. make: makes it from contents that `make_scene` has checked.
    materials: built-in ones that are shown where the user names none; their number is the scene's.
    environment, mesh, view: whether it takes one from the user; with an environment, a directional light, too.
    each: whether it takes any number of materials and shows each in a picture of its own; `make` then makes the picture
        of one material.
    sheet: of such a scene, makes the pictures of many materials of an atlas as a sheet, see `scenes.spheres`.
    """

    summary: str
    make: Callable[[Contents], Scene]
    materials: tuple[str, ...]
    environment: bool = True
    mesh: bool = False
    view: bool = False
    each: bool = False
    sheet: Callable[..., Scene] | None = None

    @property
    def places(self) -> int:
        """How many materials are in a picture."""
        return 1 if self.each else len(self.materials)


def _with(scene: Callable[..., Scene]) -> Callable[[Contents], Scene]:
    """What makes a scene of one material in an environment."""

    def make(contents: Contents) -> Scene:
        brdf, sampler = contents.brdfs[0], contents.sampler
        return scene(brdf, contents.environment, sampler=sampler, view=contents.view, size=contents.size)

    return make


def _statue(contents: Contents) -> Scene:
    return _with(partial(statue, mesh=contents.mesh))(contents)


def _still_life(contents: Contents) -> Scene:
    return still_life(contents.brdfs, samplers=contents.samplers, size=contents.size)


# In the order in which help and docs list them.
SCENES: dict[str, SceneKind] = {
    "sphere": SceneKind(
        "one material on a sphere in the environment", _with(sphere), ("blue-metallic-paint",), view=True
    ),
    "statue": SceneKind(
        "one material on a carved figure, or on --mesh, on a grey plane in the environment; global illumination",
        _statue,
        ("blue-metallic-paint",),
        mesh=True,
        view=True,
    ),
    "ball": SceneKind(
        "one material on a ball with a groove, on a foot, on a grey plane in the environment; global illumination",
        _with(ball),
        ("blue-metallic-paint",),
        view=True,
    ),
    "sample": SceneKind(
        "one material on a flat square, seen at 45 degrees, in the environment",
        _with(sample),
        ("blue-metallic-paint",),
        view=True,
    ),
    "still-life": SceneKind(
        "three: a bowl and a ball, a knot and a ball, a vase and a ball, under area lights of their own, with "
        "interreflection",
        _still_life,
        ("nickel", "yellow-matte-plastic", "blue-metallic-paint"),
        environment=False,
    ),
    "grid": SceneKind(
        "any number on spheres, each as `sphere` has it, at one exposure, with labels in the PNG; a folder stands for "
        "the material files in it, of which those that cannot be read are named and left out; if no material is given, "
        "all built-in ones",
        _with(sphere),
        NAMES,
        view=True,
        each=True,
        sheet=spheres,
    ),
}


def make_scene(
    name: str,
    brdfs: Sequence[Brdf],
    *,
    samplers: Sequence[Sampler] | None = None,
    environment: Surroundings | None = None,
    mesh: Mesh | None = None,
    view: Viewpoint | None = None,
    size: int = DEFAULT_SIZE,
) -> Scene:
    """A scene of SCENES; of one that shows each material by itself, the picture of one material.

    The arguments are those of `Contents`. Raises OptionError for another name, and for what the scene does not take.
    """
    if name not in SCENES:
        raise OptionError(f"scene: expected {', '.join(SCENES)}, found {name}")
    kind = SCENES[name]
    if len(brdfs) != kind.places:
        expected = f"{kind.places} material{'s' if kind.places > 1 else ''}"
        raise OptionError(f"{name}: expected {expected}, found {len(brdfs)}")
    taken = ("environment", environment, kind.environment), ("mesh", mesh, kind.mesh), ("view", view, kind.view)
    for what, given, allowed in taken:
        if given is not None and not allowed:
            raise OptionError(f"{name}: expected no {what}, since it has its own, found one")
    if kind.environment and environment is None:
        environment = default_environment()
    return kind.make(Contents(brdfs, samplers, environment, mesh, size, view))
