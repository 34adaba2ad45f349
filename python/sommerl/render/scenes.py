"""Scenes with a fixed camera, into which materials are put."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..brdf import Brdf
from ..sampling.sampler import Sampler
from .bsdf import make_bsdf
from .llvm import drjit, mitsuba

LARGEST_SIZE = 2048  # a pass of one sample a pixel then still fits into 1 GB
SAMPLES_A_PASS = 2**22  # or one a pixel: bounds memory, and Mitsuba crashes beyond 2^32
FILL = 0.9  # of the frame's height, by the sphere
DISTANCE = 5.0  # of the camera, in radii of the sphere
DEFAULT_SIZE, DEFAULT_SPP = 256, 256

Progress = Callable[[int, int], None]  #: passes done, passes in all


@dataclass(frozen=True)
class Image:
    """A rendered frame: linear RGB (height, width, 3), and which pixels' centres show an object (height, width)."""

    pixels: NDArray[np.float32]
    mask: NDArray[np.bool_]


def sphere(
    brdf: Brdf, environment: NDArray[np.float32], *, sampler: Sampler | None = None, size: int = DEFAULT_SIZE
) -> Any:
    """A Mitsuba scene: one sphere of the material in an environment that is visible behind it.

    environment: radiance (height, width, 3), see `environment.py`. sampler: see `make_bsdf`. size: of the square
    frame, in pixels.
    """
    mi = mitsuba()
    half_angle = math.asin(1 / DISTANCE)
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},  # a sphere alone sees the environment and nothing else
            "sensor": {
                "type": "perspective",
                "fov": 2 * math.degrees(math.atan(math.tan(half_angle) / FILL)),
                "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, DISTANCE], target=[0, 0, 0], up=[0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": size,
                    "height": size,
                    "rfilter": {"type": "box"},  # the one filter whose result is the same, bit for bit, every time
                    "pixel_format": "rgb",
                },
                "sampler": {"type": "independent"},
            },
            "environment": {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(environment))},
            "object": {"type": "sphere", "bsdf": make_bsdf(brdf, sampler)},
        }
    )


def render(scene: Any, *, spp: int = DEFAULT_SPP, seed: int = 0, progress: Progress | None = None) -> Image:
    """Renders a scene in passes of bounded size. The same scene, spp and seed give the same pixels on one machine."""
    mi = mitsuba()
    width, height = (int(n) for n in scene.sensors()[0].film().size())
    chunk = max(1, min(spp, SAMPLES_A_PASS // (width * height)))
    passes = -(-spp // chunk)
    total = np.zeros((height, width, 3))
    for number in range(passes):
        samples = min(chunk, spp - number * chunk)
        pixels = np.array(mi.render(scene, spp=samples, seed=_seed(seed, number)))
        total += samples * pixels.astype(np.float64)
        if progress:
            progress(number + 1, passes)
    return Image((total / spp).astype(np.float32), _mask(scene, width, height))


def _seed(seed: int, number: int) -> int:
    """A seed of 32 bits for one pass: different for every pass of every seed, as far as 32 bits go."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0])


def _mask(scene: Any, width: int, height: int) -> NDArray[np.bool_]:
    """Which pixels show an object at their centre."""
    mi, dr = mitsuba(), drjit()
    sensor = scene.sensors()[0]
    if mi.variant().startswith("scalar"):
        centres = [((x + 0.5) / width, (y + 0.5) / height) for y in range(height) for x in range(width)]
        rays = (sensor.sample_ray(0, 0.5, centre, (0.5, 0.5))[0] for centre in centres)
        return np.array([scene.ray_test(ray) for ray in rays]).reshape(height, width)
    i = dr.arange(mi.UInt32, width * height)
    centres = mi.Point2f((mi.Float(i % width) + 0.5) / width, (mi.Float(i // width) + 0.5) / height)
    rays, _ = sensor.sample_ray(0.0, 0.5, centres, mi.Point2f(0.5))
    return np.array(scene.ray_test(rays)).reshape(height, width)
