"""The command `render`: materials in a scene, or a sheet of them, as they are or against references."""

from __future__ import annotations

import math
import textwrap
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..formats.load import load
from ..formats.registry import by_extension, readable
from ..models.builtin import NAMES
from ..plots.contact_sheet import captioned, tiled
from ..reflectance.brdf import Brdf
from ..reflectance.lattice import INTERPOLATIONS
from ..render.checkpoint import Checkpoint, checkpoint_of, content, content_of
from ..render.compare import Comparison
from ..render.frame import Image, Scene
from ..render.images import DIFFERENCE_GAIN, signed_difference, write_image
from ..render.llvm import mitsuba
from ..render.meshes import Mesh, load_mesh
from ..render.metrics import exposure, flip_map, to_srgb8
from ..render.passes import DEFAULT_SIZE, DEFAULT_SPP, render_all
from ..render.scene_registry import SCENES, make_scene
from ..sampling import named
from ..sampling.named import OURS, SAMPLERS
from ..sampling.sampler import Sampler
from ..system.errors import MaterialError, OptionError, SommerlError
from . import console, render_own
from .checks import (
    check_apart,
    check_output,
    check_rendering,
    environment_of,
    goes_on_from,
    stem,
)
from .compare import alike, table_distance
from .console import Warnings
from .parser import command, rendering_options
from .rows import image_rows, label, table_rows

DEFAULTS = {"scene": "sphere", "spp": DEFAULT_SPP, "size": DEFAULT_SIZE, "sampler": named.OURS.name}
MOST_PIXELS = 2**26  # of a sheet
MOST_COMPARED = 2**23  # of one that is compared: the metrics take some 260 bytes for each
WIDEST = 2048  # pixels that the four pictures of a comparison may take in one row

FILES = """Files:
  --size is that of the frame; of each sphere in a grid. A render of more than ten seconds keeps what it has reached in
  OUTPUT.sommerl-part: killed and started again, the same command goes on, and the result is the same. With --against,
  beside OUTPUT.png: OUTPUT.reference.png, and OUTPUT.against.png with reference, result, signed difference, FLIP and
  the figures; beside OUTPUT.exr: OUTPUT.reference.exr and OUTPUT.difference.exr, result minus reference, linear. In a
  grid, figures are of the spheres that have a reference."""


@dataclass(frozen=True)
class Pair:
    """A material, by its name, and the reference that it is held against, if there is one.

    given: whether the user named it, and it is not the scene's own.
    """

    source: str
    against: str | None = None
    given: bool = True


class Materials:
    """Materials of pairs, looked up as asked. The last few are kept, so that few are read twice and many fit."""

    def __init__(self, lookup: Any) -> None:
        self._lookup = lookup
        self._load: Callable[[str], Brdf] = lru_cache(maxsize=8)(load)

    def both(self, pair: Pair) -> tuple[Brdf, Brdf]:
        """The reference and the material itself; the same twice if there is no reference."""
        brdf = self._load(pair.source)
        lookup = self._lookup if pair.given else None
        if pair.against is not None:
            reference = self._load(pair.against)
            if self._lookup and not pair.given:
                return reference.with_interpolation(self._lookup), brdf
            return alike(reference, brdf, lookup)
        brdf = brdf.with_interpolation(lookup) if lookup else brdf
        return brdf, brdf


@dataclass(frozen=True)
class Setting:
    """What a scene is made of besides its materials; None for what is its own."""

    environment: NDArray[np.float32] | None
    mesh: Mesh | None


def render(options: Namespace) -> dict[str, Any]:
    scene = render_own.scene_of(options)
    if scene:
        return render_own.render(scene, options)
    chosen = {name: value for name, value in vars(options).items() if value is not None}
    return _render(Namespace(**(vars(options) | DEFAULTS | chosen)))


def _render(options: Namespace) -> dict[str, Any]:
    """Renders one of the scenes that come along."""
    warn = Warnings()
    check_rendering(options)
    pairs = _pairs(options)
    outputs = _outputs(options, pairs)
    materials = Materials(options.lookup)
    pairs, identity, labels = _looked_at(pairs, materials, options, warn)
    setting = _setting(options, warn)
    identity |= {"scene": options.scene, "size": str(options.size), "sampler": options.sampler}
    if setting.environment is not None:
        identity["environment"] = content(setting.environment)
    if setting.mesh:
        identity["mesh"] = content(setting.mesh.positions, setting.mesh.faces, setting.mesh.normals)
    checkpoint = Checkpoint(checkpoint_of(options.output), identity, (options.size, options.size), warn)
    started = time.perf_counter()
    candidates, references = _rendered(options, pairs, materials, setting, checkpoint)
    seconds = time.perf_counter() - started
    comparison = _compared(options, pairs, references, candidates) if references else None
    exposed_as = comparison.reference if comparison else _sheet(candidates)
    scale = exposure(exposed_as.pixels, exposed_as.mask)
    caption = pairs if SCENES[options.scene].each else []
    _write(options.output, candidates, scale, caption)
    result: dict[str, Any] = {"image": str(options.output), "seconds": seconds, "spp": options.spp}
    result |= {"variant": mitsuba().variant(), "scene": options.scene, "sampler": options.sampler}
    result |= {"material": labels[0][1], "materials": [name for _, name in labels], "resumed": checkpoint.resumed}
    rows: dict[str, str] = {}
    if comparison:
        _write(outputs["reference"], references, scale, caption)
        names = _held_against(pairs, labels)
        _write_against(outputs, comparison, names)
        result |= comparison.metrics | {"reference": names[0], "candidate": names[1]}
        result |= {f"{name}_image": str(path) for name, path in outputs.items()}
        rows = image_rows(comparison.metrics)
        held = [pair for pair in pairs if pair.against is not None]
        if len(held) == 1:  # those of several materials would be no figure of any
            tables = table_distance(*materials.both(held[0]))
            result |= {f"table_{name}": value for name, value in tables.items()}
            rows |= table_rows(tables)
    checkpoint.remove()
    if not options.json:
        shown = ", ".join(result["materials"][:3]) + (f" and {len(labels) - 3} more" if labels[3:] else "")
        console.say(f"{shown} → {options.output} ({seconds:.1f} s)")
        if rows:
            console.print_rows(f"{result['candidate']} against {result['reference']}", rows)
    return result | {"warnings": warn.told}


def _outputs(options: Namespace, pairs: Sequence[Pair]) -> dict[str, Path]:
    """The files of a comparison, by what they show."""
    inputs = [*(pair.source for pair in pairs), *options.against, options.envmap, options.mesh]
    check_output(options.output, (".png", ".exr"), *inputs)
    check_apart(checkpoint_of(options.output), *inputs)
    if not options.against:
        return {}
    second = "against" if options.output.suffix.lower() == ".png" else "difference"
    paths = {
        name: options.output.with_suffix(f".{name}{options.output.suffix.lower()}") for name in ("reference", second)
    }
    for path in paths.values():
        check_output(path, (".png", ".exr"), *inputs)
    return paths


def _pairs(options: Namespace) -> list[Pair]:
    """The materials of the scene, in order, each with its reference."""
    given: list[str] = options.materials
    kind = SCENES[options.scene]
    own = kind.materials
    if kind.each:
        sources = [file for source in given for file in _files(source)] or list(own)
    elif len(given) > len(own):
        raise OptionError(f"materials: expected at most {len(own)} in {options.scene}, found {len(given)}")
    else:
        sources = given + list(own[len(given) :])
    if len(options.against) > len(sources):
        raise OptionError(f"against: expected at most {len(sources)}, found {len(options.against)}")
    against = options.against + [None] * (len(sources) - len(options.against))
    return [
        Pair(source, reference, kind.each or number < len(given))
        for number, (source, reference) in enumerate(zip(sources, against, strict=True))
    ]


def _files(source: str) -> Iterator[str]:
    """What a folder stands for."""
    folder = Path(source)
    if source in NAMES or not folder.is_dir():
        yield source
        return
    files = sorted(str(path) for path in folder.iterdir() if by_extension(readable(), path) and path.is_file())
    if not files:
        raise MaterialError(f"{source}: expected a folder with materials, found none in it")
    yield from files


def _looked_at(
    pairs: list[Pair], materials: Materials, options: Namespace, warn: Callable[[str], None]
) -> tuple[list[Pair], dict[str, str], list[tuple[str, str]]]:
    """Reads every material once, so that bad ones are found before hours are spent on the others.

    Returns the pairs that can be read, what decides their pixels, and how reference and material are called. Raises the
    error of one that was named itself.
    """
    kept: list[Pair] = []
    identity: dict[str, str] = {}
    labels: list[tuple[str, str]] = []
    for pair in pairs:
        try:
            reference, brdf = materials.both(pair)
        except SommerlError as error:
            in_folder = pair.source not in options.materials and pair.against is None
            if not in_folder:
                raise
            warn(f"{error}; it is left out")
            continue
        kept.append(pair)
        labels.append((label(reference), label(brdf)))
        identity[f"material {len(kept)}"] = content_of(brdf)
        if pair.against is not None:
            identity[f"reference {len(kept)}"] = content_of(reference)
    if not kept:
        raise MaterialError(f"{options.materials[0]}: expected a folder with materials, found none that can be read")
    pixels = MOST_COMPARED if options.against else MOST_PIXELS
    if len(kept) * options.size**2 > pixels:
        most = int((pixels / len(kept)) ** 0.5)
        raise OptionError(f"size: expected at most {most} for {len(kept)} materials, found {options.size}")
    return kept, identity, labels


def _setting(options: Namespace, warn: Callable[[str], None]) -> Setting:
    taken = SCENES[options.scene]
    for name, allowed, what in (("mesh", taken.mesh, "objects"), ("envmap", taken.environment, "lights")):
        if getattr(options, name) and not allowed:
            raise OptionError(f"{options.scene}: expected no --{name}, since it has {what} of its own, found one")
    mesh = load_mesh(options.mesh) if options.mesh else None
    if mesh and mesh.found:
        warn(mesh.found)
    return Setting(environment_of(options, warn) if taken.environment else None, mesh)


def _rendered(
    options: Namespace, pairs: list[Pair], materials: Materials, setting: Setting, checkpoint: Checkpoint
) -> tuple[list[Image], list[Image]]:
    """The images of the materials, and those of the references, none if there are none: one of a scene, many of a grid.

    Both are rendered with the references' samplers and the same seed, hence with the same directions.
    """
    frames = [[pair] for pair in pairs] if SCENES[options.scene].each else [pairs]

    @lru_cache(maxsize=len(pairs) if len(frames) == 1 else 1)
    def fitted(pair: Pair) -> Sampler:
        return named.fitted(options.sampler, materials.both(pair)[0])

    def make(frame: Sequence[Pair], which: int) -> Scene:
        samplers = [fitted(pair) for pair in frame]
        brdfs = [materials.both(pair)[which] for pair in frame]
        return make_scene(
            options.scene,
            brdfs,
            samplers=samplers,
            environment=setting.environment,
            mesh=setting.mesh,
            size=options.size,
        )

    compared = [any(pair.against is not None for pair in frame) for frame in frames]
    makers: list[Callable[[], Scene]] = []
    for frame, twice in zip(frames, compared, strict=True):
        makers += [partial(make, frame, which) for which in ((0, 1) if twice else (1,))]
    with goes_on_from(checkpoint) as advance:
        images = render_all(makers, spp=options.spp, seed=options.seed, progress=advance, checkpoint=checkpoint)
    rest = iter(images)
    references: list[Image] = []
    candidates: list[Image] = []
    for twice in compared:
        references.append(next(rest))
        candidates.append(next(rest) if twice else references[-1])
    return candidates, references if any(compared) else []


def _compared(
    options: Namespace, pairs: Sequence[Pair], references: Sequence[Image], candidates: Sequence[Image]
) -> Comparison:
    """The images of a scene, or those spheres of a grid that have a reference, each without empty places."""
    if SCENES[options.scene].each:
        held = [pair.against is not None for pair in pairs]
        references, candidates = (list(compress(images, held)) for images in (references, candidates))
    with console.progress("comparing"):
        measured = Comparison.of(_sheet(references, 1), _sheet(candidates, 1))
    return replace(measured, reference=_sheet(references), candidate=_sheet(candidates))


def _held_against(pairs: Sequence[Pair], labels: Sequence[tuple[str, str]]) -> tuple[str, str]:
    """What the references are called, and what is held against them."""
    found = [names for pair, names in zip(pairs, labels, strict=True) if pair.against is not None]
    return ", ".join(reference for reference, _ in found), ", ".join(name for _, name in found)


def _sheet(images: Sequence[Image], columns: int = 0) -> Image:
    """One image of several, in rows, linear."""
    columns = columns or _columns(len(images))
    return Image(tiled([image.pixels for image in images], columns), tiled([image.mask for image in images], columns))


def _columns(count: int) -> int:
    """Of a sheet: at least as many as rows, and with the fewest empty places among those less than twice the root."""
    least = math.ceil(math.sqrt(count))
    return min(range(least, 2 * least), key=lambda columns: (-count % columns, columns))


def _write(path: Path, images: Sequence[Image], scale: float, pairs: Sequence[Pair]) -> None:
    """Writes a render: of several images a sheet, with labels in a PNG. scale: its exposure."""
    if path.suffix.lower() == ".exr":
        write_image(path, _sheet(images).pixels)
        return
    pictures = [to_srgb8(image.pixels * scale) for image in images]
    if len(pairs) == len(images):
        captions = [stem(pair.source) for pair in pairs]
        pictures = [captioned(list(zip(captions, pictures, strict=True)), _columns(len(pictures)))]
    write_image(path, pictures[0])


def _write_against(outputs: dict[str, Path], comparison: Comparison, names: tuple[str, str]) -> None:
    """Writes what shows a comparison, but for the render itself and the reference."""
    if "difference" in outputs:
        write_image(outputs["difference"], comparison.candidate.pixels - comparison.reference.pixels)
        return
    a, b = comparison.exposed()
    pictures = {
        f"reference: {names[0]}": a,
        names[1]: b,
        f"difference × {DIFFERENCE_GAIN}, red: brighter": signed_difference(a, b),
        "FLIP, black for none": flip_map(a, b),
    }
    notes = [f"{name} {value}" for name, value in image_rows(comparison.metrics).items()]
    columns = len(pictures) if len(pictures) * a.shape[1] <= WIDEST else 2
    write_image(outputs["against"], captioned(list(pictures.items()), columns, notes))


def _scenes() -> str:
    """All scenes, what they show, and their own materials where there are several."""
    lines: list[str] = []
    for name, kind in SCENES.items():
        own = f" ({', '.join(kind.materials)})" if kind.places > 1 else ""
        lines.append(textwrap.fill(kind.summary + own, 118, initial_indent=f"  {name:12}", subsequent_indent=" " * 14))
    return "\n".join(lines)


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Renders materials in a scene, or a scene of your own. PNG is exposed for the objects; EXR is linear."
    example = """sommerl render nickel.smrl -o nickel.exr
  sommerl render kitchen.xml -o kitchen.exr --spp 1024 -D wall=nickel.smrl
  sommerl render --scene statue --mesh buddha.obj blue.smrl --against blue.binary -o blue.png
  sommerl render --scene grid FOLDER --size 128 -o sheet.png"""
    parser = command(add, "render", render, summary, example)
    parser.epilog = f"Scenes:\n{_scenes()}\n\n{FILES}\n\n{render_own.FILES}\n\n{parser.epilog}"
    parser.add_argument(
        "materials",
        nargs="*",
        metavar="MATERIAL",
        help="as many as the scene takes, the rest are the scene's own; or SCENE.xml, a scene of your own",
    )
    default = DEFAULTS["scene"]
    parser.add_argument("--scene", choices=[*SCENES], help=f"({default})")
    parser.add_argument("-o", "--output", type=Path, required=True, help="a .png or .exr file")
    parser.add_argument(
        "--against",
        action="append",
        default=[],
        metavar="REFERENCE",
        help="render the scene with this material in place of the first MATERIAL, too, and say how far the two are "
        "apart; given again: in place of the second one, and so on",
    )
    parser.add_argument(
        "--mesh", type=Path, metavar="FILE", help="statue: a mesh of triangles, .obj or .ply, y up (a built-in one)"
    )
    parser.add_argument(
        "--lookup",
        choices=INTERPOLATIONS,
        help="how materials are looked up (tables: trilinear; with --against: as `compare` does)",
    )
    parser.add_argument(
        "--sampler",
        choices=[*SAMPLERS],
        help=f"how directions to the light are drawn; all give the same image, with more or less noise ({OURS.name})",
    )
    parser.add_argument(
        "--variant", metavar="NAME", help="SCENE.xml: of Mitsuba, like scalar_rgb (the fastest there is)"
    )
    parser.add_argument(
        "-D", dest="define", action="append", default=[], metavar="NAME=VALUE",
        help="SCENE.xml: a value for its parameter $NAME; given again: for another one",
    )  # fmt: skip
    rendering_options(parser)
    parser.set_defaults(spp=None, size=None)  # so that it is known which are given
