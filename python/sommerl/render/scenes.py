"""Scenes with a fixed camera, into which materials are put."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..sampling.sampler import Sampler
from ..system.errors import OptionError
from .bsdf import make_bsdf
from .frame import Scene
from .llvm import mitsuba
from .meshes import Mesh, knot, lathe
from .passes import DEFAULT_SIZE
from .sheet import Frames
from .viewpoint import Camera, DirectionalLight, Point, Viewpoint

FILL = 0.9  # of the frame's height, by the sphere
DISTANCE = 5.0  # of the camera, in radii of the sphere
BOUNCES = 8  # of light, where there is more than one object

Surroundings = NDArray[np.float32] | DirectionalLight  #: an environment, radiance (height, width, 3), or one light

SPHERE = Camera(
    (0.0, 0.0, DISTANCE), (0.0, 0.0, 0.0), 2 * math.degrees(math.atan(math.tan(math.asin(1 / DISTANCE)) / FILL))
)
STANDING = Camera((0.0, 0.95, 3.4), (0.0, 0.49, 0.0), 19.5)  # before things of unit height on the plane
LYING = Camera((0.0, 2.2, 2.2), (0.0, 0.0, 0.0), 24.0)  # at 45 degrees


def sphere(
    brdf: Brdf,
    environment: Surroundings,
    *,
    sampler: Sampler | None = None,
    view: Viewpoint | None = None,
    size: int = DEFAULT_SIZE,
) -> Scene:
    """One sphere of the material in an environment that is visible behind it.

    environment: radiance (height, width, 3), see `environment.py`; or a directional light, before black. sampler: see
    `make_bsdf`. view: None for the scene's own. size: of the square frame, in pixels.
    """
    things = {"environment": _light_of(environment), "object": {"type": "sphere", "bsdf": make_bsdf(brdf, sampler)}}
    # A sphere alone sees the environment and nothing else.
    return _scene(things, ("object",), SPHERE.seen_from(view), size=size, bounces=1)


def spheres(
    bsdf: Any,
    first: int,
    frames: int,
    environment: Surroundings,
    *,
    view: Viewpoint | None = None,
    size: int = DEFAULT_SIZE,
) -> Scene:
    """The pictures that `sphere` has of so many materials of an atlas from the number `first` on, as a sheet.

    bsdf: from `make_atlas_bsdf`, which asks for the material that `sheet.frame_number` says. size: of a frame.
    """
    things = {"environment": _light_of(environment), "object": {"type": "sphere", "bsdf": bsdf}}
    return _scene(things, ("object",), SPHERE.seen_from(view), size=size, bounces=1, frames=Frames(first, frames))


def statue(
    brdf: Brdf,
    environment: Surroundings,
    *,
    mesh: Mesh | None = None,
    sampler: Sampler | None = None,
    view: Viewpoint | None = None,
    size: int = DEFAULT_SIZE,
) -> Scene:
    """A mesh of the material, scaled to unit size, on a grey plane in an environment: global illumination.

    mesh: see `meshes.load_mesh`; a carved finial if None. The others: see `sphere`. Raises OptionError for a view from
    below the plane.
    """
    figure = (mesh or finial()).standing()
    return _standing("statue", figure, brdf, environment, sampler, view, size)


def ball(
    brdf: Brdf,
    environment: Surroundings,
    *,
    sampler: Sampler | None = None,
    view: Viewpoint | None = None,
    size: int = DEFAULT_SIZE,
) -> Scene:
    """A ball of the material on a turned foot, with a groove in which it reflects itself, as `statue` has its mesh.

    The arguments: see `statue`.
    """
    return _standing("ball", material_ball(), brdf, environment, sampler, view, size)


def sample(
    brdf: Brdf,
    environment: Surroundings,
    *,
    sampler: Sampler | None = None,
    view: Viewpoint | None = None,
    size: int = DEFAULT_SIZE,
) -> Scene:
    """A flat square of the material, 1 wide, that lies in the environment and faces up, seen at 45 degrees.

    The arguments: see `sphere`.
    """
    lying = mitsuba().ScalarTransform4f().rotate([1, 0, 0], -90).scale(0.5)
    square = {"type": "rectangle", "to_world": lying, "bsdf": make_bsdf(brdf, sampler)}
    things = {"environment": _light_of(environment), "sample": square}
    return _scene(things, ("sample",), LYING.seen_from(view), size=size, bounces=1)


def still_life(brdfs: Sequence[Brdf], *, samplers: Sequence[Sampler] | None = None, size: int = DEFAULT_SIZE) -> Scene:
    """Three materials on a table under area lights, whose objects reflect each other: a bowl with two balls, a knot, a
    vase, and a third ball.

    In the spirit of the paper's Fig. 7. brdfs: of the bowl and the ball beside it; of the knot and a ball in the bowl;
    of the vase and the other ball in the bowl. samplers: one for each, see `make_bsdf`.
    """
    one, two, three = (make_bsdf(brdf, samplers[k] if samplers else None) for k, brdf in enumerate(brdfs))
    objects: dict[str, Any] = {
        "bowl": bowl().moved(-0.42, 0, 0.42).shape(one),
        "ball": _ball(0.17, (0.4, 0.17, 0.72), one),
        "knot": knot("knot").standing(1.0).turned(-20).moved(0.62, 0, -0.08).shape(two),
        "ball in the bowl": _ball(0.17, (-0.27, 0.242, 0.37), two),
        "vase": vase().moved(-0.38, 0, -0.72).shape(three),
        "other ball in the bowl": _ball(0.15, (-0.58, 0.222, 0.45), three),
    }
    things = objects | {
        "table": _plane(0.08),
        "fill": {"type": "constant", "radiance": {"type": "rgb", "value": 0.1}},
        "key": _light((-2.4, 2.8, 1.6), (0, 0.3, 0), (0.8, 0.8), (9.0, 8.6, 8.0)),
        "rim": _light((2.9, 1.7, -1.0), (0, 0.5, 0), (0.4, 1.3), (6.0, 6.6, 7.5)),
        "front": _light((1.6, 2.4, 3.6), (0, 0.4, 0), (0.5, 0.5), (5.0, 5.0, 5.0)),
    }
    camera = Camera((0.0, 1.75, 4.6), (0.04, 0.4, 0.0), 25.5)
    return _scene(things, tuple(objects), camera, size=size, bounces=BOUNCES)


@cache
def finial() -> Mesh:
    """A pine cone on a turned foot, with a ball on top: carved, smooth, hollow and sharp in turn."""
    foot = [(0, 0), (0.27, 0), (0.27, 0), (0.27, 0.06), (0.27, 0.06), (0.235, 0.075), (0.25, 0.11), (0.2, 0.125)]
    stem = [(0.115, 0.15), (0.085, 0.21), (0.085, 0.21), (0.15, 0.235), (0.15, 0.26), (0.1, 0.275), (0.1, 0.29)]
    body = [(0.27, 0.31), (0.3, 0.5), (0.2, 0.71), (0.08, 0.79), (0.05, 0.81), (0.05, 0.81)]
    ball = [(0.1 * math.sin(a), 0.9 - 0.1 * math.cos(a)) for a in np.radians(range(30, 181, 10))]

    def scales(y: NDArray[np.float64], phi: NDArray[np.float64]) -> NDArray[np.float64]:
        v = np.clip((y - 0.3) / 0.47, 0, 1)
        window = np.clip(8 * v, 0, 1) * np.clip(5 * (1 - v), 0, 1)
        one, other = (np.cos(n * phi / 2 + sign * 15 * v) ** 2 + 0.01 for n, sign in ((8, 1), (13, -1)))
        return 0.035 * window * (one * other) ** 0.3

    return lathe("statue", [*foot, *stem, *body, *ball], rows=240, columns=200, relief=scales)


@cache
def material_ball() -> Mesh:
    """A ball of radius 0.42 on a turned foot, 1 high, with a groove below its equator."""
    foot = [(0, 0), (0.3, 0), (0.3, 0), (0.3, 0.035), (0.3, 0.035), (0.2, 0.06), (0.12, 0.1), (0.12, 0.14)]

    def around(*degrees: float, depth: float = 0.0) -> list[tuple[float, float]]:
        """Points of the ball, or below its surface, at angles from its lowest point."""
        radius = 0.42 - depth
        return [(radius * math.sin(a), 0.58 - radius * math.cos(a)) for a in np.radians(degrees)]

    below, above = around(*range(20, 61, 10), 68, 68), around(78, 78, *range(90, 181, 10))
    outline = [*foot, *below, *around(69, 73, 77, depth=0.06), *above]
    return lathe("ball", outline, rows=200, columns=160)


def bowl() -> Mesh:
    """A bowl with a rim, 1 wide."""
    outside = [(0, 0), (0.2, 0), (0.2, 0), (0.2, 0.03), (0.42, 0.1), (0.5, 0.33), (0.5, 0.33)]
    inside = [(0.47, 0.33), (0.47, 0.33), (0.4, 0.12), (0.2, 0.06), (0, 0.06)]
    return lathe("bowl", outside + inside, rows=200, columns=160)


def vase() -> Mesh:
    """A vase with a neck."""
    outside = [(0, 0), (0.22, 0), (0.22, 0), (0.22, 0.03), (0.4, 0.25), (0.42, 0.6), (0.16, 0.85), (0.13, 1.0)]
    inside = [(0.24, 1.12), (0.24, 1.12), (0.22, 1.12), (0.11, 1.0), (0.11, 0.8), (0, 0.8)]
    return lathe("vase", outside + inside, rows=260, columns=160)


def _standing(
    name: str,
    mesh: Mesh,
    brdf: Brdf,
    environment: Surroundings,
    sampler: Sampler | None,
    view: Viewpoint | None,
    size: int,
) -> Scene:
    """A mesh of unit height on the grey plane."""
    camera = STANDING.seen_from(view)
    if camera.origin[1] <= 0:
        raise OptionError(
            f"{name}: expected a view from above the plane, found one from {-camera.origin[1]:.2g} below it"
        )
    things = {
        "environment": _light_of(environment),
        "plane": _plane(0.06),
        name: mesh.shape(make_bsdf(brdf, sampler)),
    }
    return _scene(things, (name,), camera, size=size, bounces=BOUNCES)


def _scene(
    things: Mapping[str, Any],
    objects: tuple[str, ...],
    camera: Camera,
    *,
    size: int,
    bounces: int,
    frames: Frames | None = None,
) -> Scene:
    """things: everything but camera and integrator. frames: of a sheet; None for one picture."""
    mi = mitsuba()
    film = {
        "type": "hdrfilm",
        "width": size,
        "height": size,
        "rfilter": {"type": "box"},  # the one filter whose result is the same, bit for bit, every time
        "pixel_format": "rgb",
    }
    look = mi.ScalarTransform4f().look_at(origin=list(camera.origin), target=list(camera.target), up=[0, 1, 0])
    sensor = {
        "type": "perspective",
        "fov": camera.fov,
        "to_world": look,
        "film": film,
        "sampler": {"type": "independent"},
    }
    if frames:
        whole = mi.load_dict(film | {"height": frames.count * size})
        sensor = frames.sensor(mi.load_dict(sensor), whole)
    # Russian roulette would end paths by how dark the material is: the same seed would give other directions to each.
    integrator = {"type": "path", "max_depth": bounces + 1, "rr_depth": bounces + 2}
    # Each thing is made first: from one description, Mitsuba makes lamps in an order that varies from run to run, and
    # in another order the same seed draws other lamps.
    made = {name: mi.load_dict(thing) if isinstance(thing, dict) else thing for name, thing in things.items()}
    description = {"type": "scene", "integrator": integrator, "sensor": sensor, **made}
    return Scene(mi.load_dict(description), objects)


def _light_of(environment: Surroundings) -> dict[str, Any]:
    if isinstance(environment, DirectionalLight):
        direction, irradiance = [-x for x in environment.towards], {"type": "rgb", "value": math.pi}
        return {"type": "directional", "direction": direction, "irradiance": irradiance}
    return {"type": "envmap", "bitmap": mitsuba().Bitmap(np.ascontiguousarray(environment))}


def _plane(albedo: float) -> dict[str, Any]:
    """The plane y = 0, grey, as far as one can see."""
    transform = mitsuba().ScalarTransform4f
    return {
        "type": "disk",
        "to_world": transform().rotate([1, 0, 0], -90).scale(60),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}},
    }


def _ball(radius: float, at: Point, bsdf: Any) -> dict[str, Any]:
    return {"type": "sphere", "radius": radius, "center": list(at), "bsdf": bsdf}


def _light(at: Point, towards: Point, half: tuple[float, float], radiance: Point) -> dict[str, Any]:
    """A rectangle that shines on one side; half: of its width and height."""
    transform = mitsuba().ScalarTransform4f
    return {
        "type": "rectangle",
        "to_world": transform().look_at(origin=list(at), target=list(towards), up=[0, 1, 0]).scale([*half, 1]),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}},
    }
