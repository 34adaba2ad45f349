"""Renders in passes, which bounds memory, shows progress, and lets a long render be stopped and resumed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..system import jit
from ..system.interrupt import hold_interrupts
from .checkpoint import Checkpoint, State
from .frame import Image, Scene
from .llvm import drjit, mitsuba

LARGEST_SIZE = 2048  # pixels: one pass with one sample a pixel then fits into 1 GB of memory
SAMPLES_A_PASS = 2**22  # at most, if that is at least one a pixel: bounds memory; Mitsuba crashes beyond 2^32
MOST_A_PIXEL = 2**12  # samples in a pass; from 2^16 on, threads share pixels, and sums depend on the threads' order
DEFAULT_SIZE, DEFAULT_SPP = 256, 256

Progress = Callable[[int, int], None]  #: passes done, passes in all


def render(scene: Scene, *, spp: int = DEFAULT_SPP, seed: int = 0, progress: Progress | None = None) -> Image:
    """Renders a scene. The same scene, spp (samples a pixel) and seed give the same pixels on one machine."""
    return render_all([lambda: scene], spp=spp, seed=seed, progress=progress)[0]


def render_all(
    scenes: Sequence[Callable[[], Scene]],
    *,
    spp: int = DEFAULT_SPP,
    seed: int = 0,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
) -> list[Image]:
    """Renders several scenes as `render` does, all with the same seed, so that similar scenes get the same directions.

    scenes: functions that make them. Each is called just before its scene is rendered, so that only one scene is in
        memory at a time.
    checkpoint: if it holds a state of this render, the render is resumed, and gives the same pixels as if it had never
        been stopped. It is written every few seconds, and on KeyboardInterrupt. The caller removes it.
    """
    mi = mitsuba()
    count = len(_passes(spp, checkpoint.pixels)) if checkpoint else 0
    state = checkpoint.load(_identity(spp, seed), len(scenes), count) if checkpoint else State()
    try:
        for make in scenes[len(state.images) :]:
            with hold_interrupts():
                scene = make()
            width, height = (int(n) for n in scene.mitsuba.sensors()[0].film().size())
            passes = _passes(spp, width * height)
            before, of_all = len(state.images) * len(passes), len(scenes) * len(passes)

            def one(samples: int, number: int, scene: Scene = scene) -> NDArray[np.float64]:
                return samples * np.array(mi.render(scene.mitsuba, spp=samples, seed=number), np.float64)

            reached = _after_each(state, passes, seed, one, checkpoint)
            for state in reached:
                if progress:
                    progress(before + state.passes, of_all)
            assert state.total is not None
            with hold_interrupts():
                image = Image((state.total / spp).astype(np.float32), _mask(scene, width, height))
                state = State((*state.images, image))
    except KeyboardInterrupt:
        if checkpoint and (state.images or state.passes):
            checkpoint.save(state, now=True)
        raise
    return list(state.images)


def sum_of_passes(
    one: Callable[[int, int], NDArray[np.float64]],
    *,
    spp: int,
    seed: int,
    pixels: int,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
) -> NDArray[np.float64]:
    """The sum of the results of `one(samples a pixel, seed)` over all passes of an image.

    pixels: their number, which decides how many passes there are. checkpoint: as in `render_all`.
    """
    passes = _passes(spp, pixels)
    state = checkpoint.load(_identity(spp, seed), 1, len(passes)) if checkpoint else State()
    try:
        reached = _after_each(state, passes, seed, one, checkpoint)
        for state in reached:
            if progress:
                progress(state.passes, len(passes))
    except KeyboardInterrupt:
        if checkpoint and state.passes:
            checkpoint.save(state, now=True)
        raise
    assert state.total is not None
    return state.total


def _identity(spp: int, seed: int) -> dict[str, str]:
    """What the pixels of every render depend on, for the identity of its checkpoint."""
    mi = mitsuba()
    identity = {"spp": str(spp), "seed": str(seed), "variant": mi.variant(), "size of passes": str(SAMPLES_A_PASS)}
    return identity | {"version of Sommerl": __version__, "version of Mitsuba": mi.__version__}


def _after_each(
    state: State,
    passes: Sequence[int],
    seed: int,
    one: Callable[[int, int], NDArray[np.float64]],
    checkpoint: Checkpoint | None,
) -> Iterator[State]:
    """Yields the state of a render after each pass; first the state that it is resumed from, if it is."""
    if state.passes:
        yield state
    for number in range(state.passes, len(passes)):
        with hold_interrupts(), jit.limited():
            total = one(passes[number], _seed(seed, number))
        # After an interruption, this line is not reached: Mitsuba may not have finished the pass.
        state = State(state.images, total if state.total is None else state.total + total, number + 1)
        if checkpoint:
            checkpoint.save(state)
        yield state


def _passes(spp: int, pixels: int) -> list[int]:
    """The samples a pixel of each pass: powers of two, so that no two threads share a pixel.

    Dr.Jit gives each thread a block of samples whose length is a power of two. If a block ended within the samples of a
    pixel, two threads would add to that pixel, and the rounding of its sum would depend on which comes first.
    """
    most = max(1, min(MOST_A_PIXEL, SAMPLES_A_PASS // pixels))
    most = 1 << most.bit_length() - 1
    return [most] * (spp // most) + [1 << bit for bit in reversed(range(most.bit_length())) if spp % most & 1 << bit]


def _seed(seed: int, number: int) -> int:
    """A 32-bit seed for one pass, different (as far as 32 bits allow) for each pass of each seed."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0])


def _mask(scene: Scene, width: int, height: int) -> NDArray[np.bool_]:
    """The pixels that show an object at their centre, (height, width)."""
    mi, dr = mitsuba(), drjit()
    sensor = scene.mitsuba.sensors()[0]
    objects = [shape for shape in scene.mitsuba.shapes() if shape.id() in scene.objects]
    if mi.variant().startswith("scalar"):
        centres = [((x + 0.5) / width, (y + 0.5) / height) for y in range(height) for x in range(width)]
        rays = (sensor.sample_ray(0, 0.5, centre, (0.5, 0.5))[0] for centre in centres)
        found = [scene.mitsuba.ray_intersect(ray) for ray in rays]
        return np.array([si.is_valid() and si.shape in objects for si in found]).reshape(height, width)
    i = dr.arange(mi.UInt32, width * height)
    centres = mi.Point2f((mi.Float(i % width) + 0.5) / width, (mi.Float(i // width) + 0.5) / height)
    rays, _ = sensor.sample_ray(0.0, 0.5, centres, mi.Point2f(0.5))
    hit = scene.mitsuba.ray_intersect_preliminary(rays)
    seen = dr.zeros(mi.Bool, width * height)
    for shape in objects:
        seen |= hit.is_valid() & (hit.shape == mi.ShapePtr(shape))
    return np.array(seen).reshape(height, width)
