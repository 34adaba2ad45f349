"""The command `render` with a scene file of the user's own."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..render import scene_file
from ..render.checkpoint import Checkpoint, checkpoint_of
from ..render.llvm import mitsuba
from ..system.errors import OptionError
from . import answers
from .arguments import flag, named_as_typed
from .checks import check_apart, check_output, check_range
from .console import say, warn
from .render_arguments import RenderArguments
from .rendering import LARGEST_SEED, MOST_SPP, goes_on_from

EXTENSION = ".xml"
WITHOUT = (
    "scene",
    "against",
    "mesh",
    "envmap",
    "from_",
    "light",
    "size",
    "lookup",
    "sampler",
)  # options that a scene file decides
ONLY = {"variant": "--variant", "define": "-D"}  # options that nothing else takes

FILES = """Scene files:
  SCENE.xml is a scene of your own in Mitsuba's format, where <bsdf type="sommerl"> with a string `filename` is a
  material; `convert` writes such snippets. It is rendered as it says: its first sensor, film, integrator and sampler.
  EXR has all channels of the film; PNG has its colours as they are, without exposure."""


def scene_of(options: RenderArguments) -> Path | None:
    """The scene file that is to be rendered, if it is one. Raises OptionError for options that do not go with it."""
    given = [Path(source) for source in options.materials if Path(source).suffix.lower() == EXTENSION]
    if not given:
        for name, option in ONLY.items():
            if getattr(options, name):
                raise OptionError(f"{option}: expected a scene file, SCENE.xml, found none")
        return None
    if len(options.materials) > 1:
        raise OptionError(
            f"{given[0]}: expected one scene file and no materials, found {len(options.materials)} inputs"
        )
    usual = {field.name: field.default for field in fields(options)}
    for name in WITHOUT:
        if getattr(options, name) != usual[name]:
            raise OptionError(
                f"{flag(name)}: expected no such option beside a scene file, which decides that, found one"
            )
    return given[0]


def render(path: Path, options: RenderArguments) -> dict[str, Any]:
    """Renders a scene file."""
    parameters = _parameters(options.define)
    check_range("--seed", options.seed, 0, LARGEST_SEED)
    if options.spp is not None:
        check_range("--spp", options.spp, 1, MOST_SPP)
    check_output(options.output, (".png", ".exr"), path)
    with named_as_typed():
        variant = mitsuba(options.variant).variant()
    with scene_file.warnings_to(warn):
        scene = scene_file.load(path, parameters)
        spp = scene.samples if options.spp is None else options.spp
        check_range(f"{path}: sample_count", spp, 1, MOST_SPP)
        if options.output.suffix.lower() == ".png":
            scene_file.check_colours(scene)
        files = scene_file.files_of(path, parameters)
        for written in (options.output, checkpoint_of(options.output)):
            check_apart(written, path, *files.values())
        identity = {"scene": scene_file.digest_of(path)} | {f"-D {name}": value for name, value in parameters.items()}
        identity |= {f"file {name}": scene_file.digest_of(file) for name, file in files.items()}
        width, height = scene.size
        checkpoint = Checkpoint(
            checkpoint_of(options.output),
            identity,
            (height, width),
            warn,
            channels=scene_file.channels_held(scene),
        )
        started = time.perf_counter()
        with goes_on_from(checkpoint) as advance:
            bitmap = scene_file.render(scene, spp=spp, seed=options.seed, progress=advance, checkpoint=checkpoint)
        seconds = time.perf_counter() - started
        scene_file.write(options.output, bitmap)
    checkpoint.remove()
    if not options.json:
        say(f"{path} → {options.output} ({seconds:.1f} s)")
    result = {"image": str(options.output), "seconds": seconds, "spp": spp, "variant": variant, "scene": str(path)}
    result |= {"size": list(scene.size), "channels": scene_file.channels_of(bitmap), "files": list(files)}
    return answers.of_materials([], input=str(path), resumed=checkpoint.resumed, **result)


def _parameters(definitions: Sequence[str]) -> dict[str, str]:
    """Values by names. Raises OptionError for what is not name=value."""
    found: dict[str, str] = {}
    for definition in definitions:
        name, equals, value = definition.partition("=")
        if not equals or not re.fullmatch(r"\w+", name):
            raise OptionError(f"-D: expected name=value, found {definition}")
        if name in found:
            raise OptionError(f"-D: expected each name once, found {name} again")
        found[name] = value
    return found
