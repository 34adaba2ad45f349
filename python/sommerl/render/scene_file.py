"""Loads and renders the user's own scenes: Mitsuba's XML files, in which the plug-in `sommerl` can be used."""

from __future__ import annotations

import hashlib
import html
import re
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system import door
from ..system.errors import FormatError, OptionError, SommerlError
from ..system.files import atomic_write
from ..system.interrupt import hold_interrupts
from ..system.visible import visible
from .bsdf import register
from .checkpoint import Checkpoint
from .images import write_image
from .llvm import mitsuba
from .metrics import to_srgb8
from .passes import Progress, sum_of_passes

LARGEST_FILE = 2**32  # bytes of any file that a scene refers to
MOST_PIXELS = 2**24  # of a film: one pass with one sample a pixel then takes about 2.5 GB of memory
# Arguments of mi.load_file itself, so a scene's parameters cannot have these names.
LOADERS_OWN = ("optimize", "parallel", "path")
COLOURS = ("RGB", "RGBA", "Y", "YA", "XYZ", "XYZA")  # pixel formats of Mitsuba that can be written as PNG
ELEMENT = re.compile(r"""<(\w+)((?:\s+[\w:.-]+\s*=\s*(?:"[^"]*"|'[^']*'))+)""")
ATTRIBUTE = re.compile(r"""([\w:.-]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")


@dataclass(frozen=True)
class OwnScene:
    """A scene that Mitsuba has loaded. sensor: its first sensor, which is the one that is rendered."""

    path: Path
    mitsuba: Any
    sensor: Any

    @property
    def samples(self) -> int:
        """The number of samples a pixel that the file asks for."""
        return int(self.sensor.sampler().sample_count())

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the film's crop window [pixels]."""
        width, height = (int(n) for n in self.sensor.film().crop_size())
        return width, height


def load(path: Path, parameters: Mapping[str, str]) -> OwnScene:
    """Loads a scene from an XML file. parameters: values for its parameters ($name).

    Raises FormatError if Mitsuba cannot load it, if it has no shapes, sensor or integrator, or if its film is too
    large; OptionError for a parameter that has the name of an argument of Mitsuba's loader.
    """
    for name in parameters:
        if name in LOADERS_OWN:
            raise OptionError(f"-D: expected a name other than {', '.join(LOADERS_OWN)}, found {name}")
    if not path.is_file():
        raise FormatError(f"{path}: it is not a file" if path.exists() else f"{path}: there is no such file")
    mi = mitsuba()
    register()
    with refused(path, "load"), hold_interrupts():
        # Not in parallel: the order of lights would then vary, and with it what the same seed draws.
        found = mi.load_file(str(path), parallel=False, **parameters)
    if not isinstance(found, mi.Scene):
        raise FormatError(f"{path}: the file describes no scene")
    for what, present in (
        ("shapes (a snippet has to be included in a scene)", found.shapes()),
        ("sensor", found.sensors()),
        ("integrator", found.integrator()),
    ):
        if not present:
            raise FormatError(f"{path}: the scene has no {what}")
    scene = OwnScene(path, found, found.sensors()[0])
    width, height = scene.size
    if width * height > MOST_PIXELS:
        raise FormatError(f"{path}: the film has {width} × {height} pixels, more than {MOST_PIXELS}")
    return scene


def render(
    scene: OwnScene,
    *,
    spp: int,
    seed: int = 0,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
) -> Any:
    """Renders a scene in passes; returns a Mitsuba Bitmap with all channels of the film. See `passes.render_all`.

    Passes are added up before the film is developed, as sums of values times weights of the reconstruction filter, and
    sums of these weights. The developed picture is then that of all samples together, as if there were one pass.
    Raises FormatError if Mitsuba cannot render the scene.
    """
    mi = mitsuba()
    film, integrator = scene.sensor.film(), scene.mitsuba.integrator()

    def one(samples: int, number: int) -> NDArray[np.float64]:
        integrator.render(scene.mitsuba, sensor=scene.sensor, seed=number, spp=samples)
        held = np.array(film.develop(raw=True), np.float64)
        return held if weights_of(film, held).any() else samples * held

    with refused(scene.path, "render"):
        total = sum_of_passes(
            one, spp=spp, seed=seed, pixels=scene.size[0] * scene.size[1], progress=progress, checkpoint=checkpoint
        )
        with hold_interrupts():
            # If particles are traced from the lights, there are no weights, and each pass is a mean.
            held = total if weights_of(film, total).any() else total / spp
            film.prepare(integrator.aov_names())
            film.put_block(mi.ImageBlock(mi.TensorXf(held.astype(np.float32)), offset=film.crop_offset()))
            return film.bitmap()


def weights_of(film: Any, held: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weights (height, width) in the contents of a film that is not developed, (height, width, channels)."""
    return held[..., channels_of(film.bitmap(raw=True)).index("W")]


def channels_of(bitmap: Any) -> list[str]:
    """The names of a bitmap's channels."""
    return [field.name for field in bitmap.struct_()]


def channels_held(scene: OwnScene) -> int:
    """The number of channels of the film before it is developed, weights included."""
    film = scene.sensor.film()
    with refused(scene.path, "render"), hold_interrupts():
        film.prepare(scene.mitsuba.integrator().aov_names())
        return len(channels_of(film.bitmap(raw=True)))


def check_colours(scene: OwnScene) -> None:
    """Raises FormatError if the film has no colours, and so cannot be written as PNG."""
    film = scene.sensor.film()
    with refused(scene.path, "render"), hold_interrupts():
        film.prepare(scene.mitsuba.integrator().aov_names())
        bitmap = film.bitmap()
    if _colours(bitmap) is None:
        found = ", ".join(channels_of(bitmap)[:4])
        raise FormatError(f"{scene.path}: the film has no colours, which .png needs, but {found}; write it as .exr")


def write(path: Path, bitmap: Any) -> None:
    """Writes a picture: as .exr all channels, linear, in 32 bits; as .png its colours, in sRGB, clipped to [0, 1]."""
    mi = mitsuba()
    if path.suffix.lower() == ".png":
        rgb = _colours(bitmap).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        write_image(path, to_srgb8(np.nan_to_num(np.array(rgb))))
        return
    stream = mi.MemoryStream()
    bitmap.metadata()["Software"] = "Sommerl"  # the mark that lets commands replace it: see `system.files`
    bitmap.write(stream, mi.Bitmap.FileFormat.OpenEXR)
    with atomic_write(path) as out:
        out.write(bytes(stream.raw_buffer()))


def _colours(bitmap: Any) -> Any:
    """The picture without the channels that integrators like `aov` add; None if its channels are no colours."""
    mi = mitsuba()
    if bitmap.pixel_format() == mi.Bitmap.PixelFormat.MultiChannel:
        bitmap = dict(bitmap.split()).get("<root>")
    return bitmap if bitmap is not None and bitmap.pixel_format().name in COLOURS else None


def digest_of(path: Path) -> str:
    """The SHA-256 of a file that a scene refers to. Raises FormatError if it cannot be read."""
    return hashlib.sha256(door.read(path, LARGEST_FILE)).hexdigest()


def files_of(path: Path, parameters: Mapping[str, str]) -> dict[str, Path]:
    """The existing files that attributes of a scene, or of a file that it includes, refer to, by the names used there.

    They are searched as Mitsuba does: in the scene's folder, in folders that <path> adds, and in the working folder.
    """
    known, folders, found = dict(parameters), [path.parent, Path()], dict[str, Path]()

    def add(file: Path) -> None:
        for element, attributes in ELEMENT.findall(door.read(file, LARGEST_FILE).decode("utf-8", "replace")):
            values = {name: _filled(html.unescape(a or b), known) for name, a, b in ATTRIBUTE.findall(attributes)}
            if element == "default":
                known.setdefault(values.get("name", ""), values.get("value", ""))
            if element == "path" and "value" in values:
                folders.insert(0, path.parent / values["value"])
            for value in values.values():
                place = _found(value, folders)
                if place and value not in found:
                    found[value] = place
                    if place.suffix.lower() == ".xml":
                        add(place)

    add(path)
    return found


def _filled(text: str, parameters: Mapping[str, str]) -> str:
    """A text with $NAME replaced by values. Longer names go first, since a shorter one may be the beginning of one."""
    for name in sorted(parameters, key=len, reverse=True):
        text = text.replace(f"${name}", parameters[name]) if name else text
    return text


def _found(name: str, folders: list[Path]) -> Path | None:
    """The path of the file that a name refers to; for "FILE:MEMBER", of FILE. None if there is none."""
    names = [name] + [name[:at] for at, character in enumerate(name) if character == ":"]
    try:
        return next((place for each in names if each for f in folders if (place := f / each).is_file()), None)
    except (OSError, ValueError):  # a name that no file can have
        return None


@contextmanager
def refused(path: Path, what: str) -> Generator[None]:
    """Turns errors of Mitsuba into a FormatError that gives its reason. what: what Mitsuba does, as a verb."""
    try:
        yield
    except (SommerlError, MemoryError):
        raise
    except Exception as error:  # of any class: plug-ins raise their own
        raise FormatError(f"{path}: Mitsuba cannot {what} the scene ({reason(error)})") from error


def reason(error: Exception) -> str:
    """The message of an error of Mitsuba in one line, without tracebacks and places in its source code."""
    text = re.sub(r"Traceback \(most recent call last\):\n(?: .*\n)*", "", str(error))
    text = re.sub(r"\[[\w.]+:\d+\] ", "", text)
    text = re.sub(r":\s*\n\s+- ", ": ", text)
    text = re.sub(r"\s*\n\s+- ", "; ", text)
    return visible(" ".join(text.split())) or type(error).__name__


@contextmanager
def warnings_to(say: Callable[[str], None]) -> Generator[None]:
    """Within the block, Mitsuba's warnings are not printed but given to `say`, each once."""
    mi = mitsuba()
    said: set[str] = set()

    class Listener(mi.Appender):
        def append(self, level: Any, text: str) -> None:
            sentence = visible(" ".join(re.sub(r"^[\d\-: ]*\w+\s+(\[\w+\] )?", "", text).split()))
            if sentence not in said:
                said.add(sentence)
                say(sentence)

        def log_progress(self, *_: Any) -> None:
            """Ignores Mitsuba's progress: ours counts passes."""

    logger = mi.logger()
    before = [logger.appender(number) for number in range(logger.appender_count())]
    logger.clear_appenders()
    logger.add_appender(Listener())
    try:
        yield
    finally:
        logger.clear_appenders()
        for appender in before:
            logger.add_appender(appender)
