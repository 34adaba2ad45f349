"""A scene of the user's own, as Mitsuba's XML describes it, with the plug-in `sommerl` known to it."""

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

LARGEST_FILE = 2**32  # bytes of one that a scene is made of
MOST_PIXELS = 2**24  # of a film: a pass of one sample a pixel then takes some 2.5 GB
LOADERS_OWN = ("optimize", "parallel", "path")  # arguments of mi.load_file, which takes parameters beside them
COLOURS = ("RGB", "RGBA", "Y", "YA", "XYZ", "XYZA")  # formats of pixels that a PNG can be made of
ELEMENT = re.compile(r"""<(\w+)((?:\s+[\w:.-]+\s*=\s*(?:"[^"]*"|'[^']*'))+)""")
ATTRIBUTE = re.compile(r"""([\w:.-]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")


@dataclass(frozen=True)
class OwnScene:
    """A scene that Mitsuba has loaded, and its first sensor, which is the one that is rendered."""

    path: Path
    mitsuba: Any
    sensor: Any

    @property
    def samples(self) -> int:
        """Samples a pixel, as the file has it."""
        return int(self.sensor.sampler().sample_count())

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of what the film keeps [pixels]."""
        width, height = (int(n) for n in self.sensor.film().crop_size())
        return width, height


def load(path: Path, parameters: Mapping[str, str]) -> OwnScene:
    """The scene in an XML file, with values for its parameters ($name).

    Raises FormatError if Mitsuba refuses it, if it has no shapes, sensor or integrator, or too large a film;
    OptionError for a parameter whose name cannot be given to Mitsuba's loader.
    """
    for name in parameters:
        if name in LOADERS_OWN:
            raise OptionError(f"-D: expected a name other than {', '.join(LOADERS_OWN)}, found {name}")
    if not path.is_file():
        raise FormatError(f"{path}: expected a scene of Mitsuba's, found no file")
    mi = mitsuba()
    register()
    with refused(path, "load"), hold_interrupts():
        # One object after the other: made side by side, lights come in any order, and the same seed draws others.
        found = mi.load_file(str(path), parallel=False, **parameters)
    if not isinstance(found, mi.Scene):
        raise FormatError(f"{path}: expected a scene, found something else")
    for what, present in (
        ("shapes to render (a snippet is for inclusion in a scene)", found.shapes()),
        ("a sensor", found.sensors()),
        ("an integrator", found.integrator()),
    ):
        if not present:
            raise FormatError(f"{path}: expected {what}, found none")
    scene = OwnScene(path, found, found.sensors()[0])
    width, height = scene.size
    if width * height > MOST_PIXELS:
        raise FormatError(f"{path}: expected a film of at most {MOST_PIXELS} pixels, found {width} × {height}")
    return scene


def render(
    scene: OwnScene,
    *,
    spp: int,
    seed: int = 0,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
) -> Any:
    """The developed picture, a Mitsuba Bitmap with all channels of the film. See `passes.render_all`.

    What passes are summed up as is what the film holds before it is developed: values times the weights of the
    reconstruction filter, and these weights. So the film develops the sum of all samples, as if they were of one pass.
    Raises FormatError if Mitsuba cannot render it.
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
            # Of particles that are traced from the lights, the film holds no weights: each pass is a mean by itself.
            held = total if weights_of(film, total).any() else total / spp
            film.prepare(integrator.aov_names())
            film.put_block(mi.ImageBlock(mi.TensorXf(held.astype(np.float32)), offset=film.crop_offset()))
            return film.bitmap()


def weights_of(film: Any, held: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weight of each pixel, of what a film holds (height, width, channels)."""
    return held[..., channels_of(film.bitmap(raw=True)).index("W")]


def channels_of(bitmap: Any) -> list[str]:
    return [field.name for field in bitmap.struct_()]


def channels_held(scene: OwnScene) -> int:
    """How many channels the film holds before it is developed, weights among them."""
    film = scene.sensor.film()
    with refused(scene.path, "render"), hold_interrupts():
        film.prepare(scene.mitsuba.integrator().aov_names())
        return len(channels_of(film.bitmap(raw=True)))


def check_colours(scene: OwnScene) -> None:
    """Raises FormatError if the film's channels are no colours, which a PNG needs."""
    film = scene.sensor.film()
    with refused(scene.path, "render"), hold_interrupts():
        film.prepare(scene.mitsuba.integrator().aov_names())
        bitmap = film.bitmap()
    if _colours(bitmap) is None:
        found = ", ".join(channels_of(bitmap)[:4])
        raise FormatError(f"{scene.path}: expected a film of colours for a .png, found {found}; .exr takes it")


def write(path: Path, bitmap: Any) -> None:
    """Writes a picture: .exr, linear, all channels in 32 bits; .png, its colours in sRGB, cut off at 0 and 1."""
    mi = mitsuba()
    if path.suffix.lower() == ".png":
        rgb = _colours(bitmap).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        write_image(path, to_srgb8(np.nan_to_num(np.array(rgb))))
        return
    stream = mi.MemoryStream()
    bitmap.metadata()["Software"] = "Sommerl"  # a mark: see `files`
    bitmap.write(stream, mi.Bitmap.FileFormat.OpenEXR)
    with atomic_write(path) as out:
        out.write(bytes(stream.raw_buffer()))


def _colours(bitmap: Any) -> Any:
    """The channels that are the picture itself, without what an integrator adds; None if they are no colours."""
    mi = mitsuba()
    if bitmap.pixel_format() == mi.Bitmap.PixelFormat.MultiChannel:
        bitmap = dict(bitmap.split()).get("<root>")
    return bitmap if bitmap is not None and bitmap.pixel_format().name in COLOURS else None


def digest_of(path: Path) -> str:
    """The SHA-256 of a file that a scene is made of. Raises FormatError if it cannot be read."""
    return hashlib.sha256(door.read(path, LARGEST_FILE)).hexdigest()


def files_of(path: Path, parameters: Mapping[str, str]) -> dict[str, Path]:
    """The files that a scene is made of, by the names that it gives them: of itself and of all files that it includes,
    every one that an attribute names, as far as it is there.

    They are looked for as Mitsuba does: in the scene's folder, in those that <path> adds, and in the working one.
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
    """A text with the values of its parameters; of two that begin alike, the longer one is meant."""
    for name in sorted(parameters, key=len, reverse=True):
        text = text.replace(f"${name}", parameters[name]) if name else text
    return text


def _found(name: str, folders: list[Path]) -> Path | None:
    """The file of that name; of "FILE:MEMBER", FILE."""
    names = [name] + [name[:at] for at, character in enumerate(name) if character == ":"]
    try:
        return next((place for each in names if each for f in folders if (place := f / each).is_file()), None)
    except (OSError, ValueError):  # names that no file can have
        return None


@contextmanager
def refused(path: Path, what: str) -> Generator[None]:
    """Errors of Mitsuba's become a sentence that gives its reason."""
    try:
        yield
    except (SommerlError, MemoryError):
        raise
    except Exception as error:  # of any class: some are raised as they are
        raise FormatError(
            f"{path}: expected a scene that Mitsuba can {what}, found another ({reason(error)})"
        ) from error


def reason(error: Exception) -> str:
    """What an error of Mitsuba's says, in one line, without the lines of source code that it comes from."""
    text = re.sub(r"Traceback \(most recent call last\):\n(?: .*\n)*", "", str(error))
    text = re.sub(r"\[[\w.]+:\d+\] ", "", text)
    text = re.sub(r":\s*\n\s+- ", ": ", text)
    text = re.sub(r"\s*\n\s+- ", "; ", text)
    return visible(" ".join(text.split())) or type(error).__name__


@contextmanager
def warnings_to(say: Callable[[str], None]) -> Generator[None]:
    """What Mitsuba warns of is said once, and not printed among the results."""
    mi = mitsuba()
    said: set[str] = set()

    class Listener(mi.Appender):
        def append(self, level: Any, text: str) -> None:
            sentence = visible(" ".join(re.sub(r"^[\d\-: ]*\w+\s+(\[\w+\] )?", "", text).split()))
            if sentence not in said:
                said.add(sentence)
                say(sentence)

        def log_progress(self, *_: Any) -> None:
            """Passes are counted elsewhere."""

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
