"""The command `render`: materials in a scene, or a sheet of them, as they are or against references."""

from __future__ import annotations

import math
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache, partial
from itertools import compress
from pathlib import Path
from typing import Any

from ..compression.atlas import Atlas, is_compact
from ..formats.load import load
from ..plots.contact_sheet import captioned, tiled
from ..reflectance.brdf import Brdf
from ..render.bsdf import make_atlas_bsdf
from ..render.checkpoint import Checkpoint, checkpoint_of, content, content_of
from ..render.compare import Comparison
from ..render.frame import Image, Scene
from ..render.images import DIFFERENCE_GAIN, signed_difference, write_image
from ..render.llvm import mitsuba
from ..render.meshes import Mesh, load_mesh
from ..render.metrics import exposure, flip_map, to_srgb8
from ..render.passes import render_all
from ..render.scene_registry import SCENES, make_scene
from ..render.scenes import Surroundings
from ..render.sheet import Frames, frame_number, sheets
from ..render.viewpoint import DirectionalLight, Viewpoint
from ..sampling import named
from ..sampling.named import OURS
from ..sampling.sampler import Sampler
from ..system.errors import MaterialError, OptionError, SommerlError
from ..system.first_few import first_few
from . import answers, console, render_own
from .checks import check_apart, check_output
from .compare import distances_of, looked_up_alike
from .inputs import expanded, labels, stem
from .parser import add_command
from .render_arguments import DEFAULT_SCENE, RenderArguments
from .rendering import Sampling, check_environment, environment_of, goes_on_from
from .rows import image_rows

MOST_PIXELS = 2**26  # of a sheet
MOST_COMPARED = 2**23  # of one that is compared: the metrics take some 260 bytes for each
WIDEST = 2048  # pixels that the four pictures of a comparison may take in one row

FILES = """Files:
  --size is that of the frame; of each sphere in a grid. A render of more than ten seconds keeps what it has reached in
  OUTPUT.sommerl-part: killed and started again, the same command goes on, and the result is the same. With --against,
  beside OUTPUT.png: OUTPUT.reference.png, and OUTPUT.against.png with reference, result, signed difference, FLIP and
  the figures; beside OUTPUT.exr: OUTPUT.reference.exr and OUTPUT.difference.exr, result minus reference, linear. In a
  grid, figures are of the spheres that have a reference."""


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Renders materials in a scene, or a scene of your own. PNG is exposed for the objects; EXR is linear."
    example = """sommerl render nickel.smrl -o nickel.exr
  sommerl render kitchen.xml -o kitchen.exr --spp 1024 -D wall=nickel.smrl
  sommerl render --scene statue --mesh buddha.obj blue.smrl --against blue.binary -o blue.png
  sommerl render --scene grid FOLDER --size 128 -o sheet.png"""
    add_command(
        add, "render", render, RenderArguments, summary, example, explained=[_scenes(), FILES, render_own.FILES]
    )


def _scenes() -> str:
    """The scenes that come along, for help."""
    lines: list[str] = []
    for name, kind in SCENES.items():
        own = f" ({', '.join(kind.materials)})" if kind.places > 1 else ""
        lines.append(textwrap.fill(kind.summary + own, 118, initial_indent=f"  {name:12}", subsequent_indent=" " * 14))
    return "Scenes:\n" + "\n".join(lines)


def render(options: RenderArguments) -> dict[str, Any]:
    own = render_own.scene_of(options)
    return render_own.render(own, options) if own else _render(options)


@dataclass(frozen=True)
class Pair:
    """A material, by its name, and the reference that it is held against, if there is one.

    given: whether the user named it, and it is not the scene's own.
    """

    source: str
    against: str | None = None
    given: bool = True

    @property
    def sources(self) -> tuple[str, str]:
        """The reference and the material; the same twice if there is no reference."""
        return self.against or self.source, self.source


class Materials:
    """Reads the materials of pairs, with the lookup that is asked for.

    The last eight are kept in memory: few are read twice, and a sheet may have more materials than fit.
    """

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
            return looked_up_alike(reference, brdf, lookup)
        brdf = brdf.with_interpolation(lookup) if lookup else brdf
        return brdf, brdf


@dataclass(frozen=True)
class Setting:
    """The light, the object and the view of a scene, where the user gave them; None where the scene has its own."""

    environment: Surroundings | None
    mesh: Mesh | None
    view: Viewpoint | None

    @property
    def identity(self) -> dict[str, str]:
        """By name, what the pixels depend on."""
        found: dict[str, str] = {}
        if isinstance(self.environment, DirectionalLight):
            found["light"] = repr(self.environment)
        elif self.environment is not None:
            found["environment"] = content(self.environment)
        if self.mesh:
            found["mesh"] = content(self.mesh.positions, self.mesh.faces, self.mesh.normals)
        return found | ({"view": repr(self.view)} if self.view else {})


@dataclass(frozen=True)
class Job:
    """What is to be rendered of the scenes that come along: what was asked for, and defaults for the rest."""

    asked: RenderArguments
    scene: str
    sampler: str
    sampling: Sampling

    @classmethod
    def of(cls, options: RenderArguments) -> Job:
        """Raises OptionError for what is out of range, FormatError for an environment that there is not."""
        sampling = Sampling.of(options)
        check_environment(options.envmap)
        return cls(options, options.scene or DEFAULT_SCENE, options.sampler or OURS.name, sampling)


def _render(options: RenderArguments) -> dict[str, Any]:
    """Renders one of the scenes that come along."""
    job = Job.of(options)
    pairs = _pairs(job)
    outputs = _outputs(options, pairs)
    materials = Materials(options.lookup)
    pairs, identity, shown = _read_all(pairs, materials, job)
    setting = _setting(job)
    identity |= {"scene": job.scene, "size": str(job.sampling.size), "sampler": job.sampler} | setting.identity
    size, together = job.sampling.size, _together(job, pairs, materials)
    length = sheets(len(pairs), size)[0].count if together else 1
    identity |= {"frames of a sheet": str(length)} if together else {}
    checkpoint = Checkpoint(checkpoint_of(options.output), identity, (length * size, size), console.warn)
    started = time.perf_counter()
    if together:
        candidates, references = _rendered_together(job, together, setting, checkpoint), []
    else:
        candidates, references = _rendered(job, pairs, materials, setting, checkpoint)
    seconds = time.perf_counter() - started
    comparison = _compared(job, pairs, references, candidates) if references else None
    exposed_as = comparison.reference if comparison else _sheet(candidates)
    scale = exposure(exposed_as.pixels, exposed_as.mask)
    caption = pairs if SCENES[job.scene].each else []
    _write(options.output, candidates, scale, caption)
    result: dict[str, Any] = {"image": str(options.output), "seconds": seconds, "spp": job.sampling.spp}
    result |= {"variant": mitsuba().variant(), "scene": job.scene, "sampler": job.sampler}
    result |= {"material": shown[0]["label"], "resumed": checkpoint.resumed}
    result |= {"from": asdict(setting.view) if setting.view else None}
    result |= {"light": asdict(options.light) if options.light else None}
    rows: dict[str, str] = {}
    if comparison:
        _write(outputs["reference"], references, scale, caption)
        names = _held_against(shown)
        _write_against(outputs, comparison, names)
        result |= comparison.metrics | {"reference": names[0], "candidate": names[1]}
        result |= {f"{name}_image": str(path) for name, path in outputs.items()}
        rows = image_rows(comparison.metrics)
        held = [pair for pair in pairs if pair.against is not None]
        if len(held) == 1:  # those of several materials would be no figure of any
            distances, distance_rows = distances_of(*materials.both(held[0]))
            result |= distances
            rows |= distance_rows
    checkpoint.remove()
    if not options.json:
        rendered = first_few([one["label"] for one in shown])
        console.say(f"{rendered} → {options.output} ({seconds:.1f} s)")
        if rows:
            console.print_rows(f"{result['candidate']} against {result['reference']}", rows)
            console.wrote([options.output, *outputs.values()])
    return answers.of_materials(shown, **result)


def _outputs(options: RenderArguments, pairs: Sequence[Pair]) -> dict[str, Path]:
    """The files that --against writes beside the render, by what they show. Raises OptionError or OSError."""
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


def _pairs(job: Job) -> list[Pair]:
    """The materials of the scene, in order, each with its reference."""
    given, against = job.asked.materials, job.asked.against
    kind = SCENES[job.scene]
    own = kind.materials
    if kind.each:
        sources = expanded(given) or list(own)
    elif len(given) > len(own):
        raise OptionError(f"MATERIAL: expected at most {len(own)} in {job.scene}, found {len(given)}")
    else:
        sources = [*given, *own[len(given) :]]
    if len(against) > len(sources):
        raise OptionError(f"--against: expected at most {len(sources)}, found {len(against)}")
    references = [*against, *[None] * (len(sources) - len(against))]
    return [
        Pair(source, reference, kind.each or number < len(given))
        for number, (source, reference) in enumerate(zip(sources, references, strict=True))
    ]


def _read_all(
    pairs: Sequence[Pair], materials: Materials, job: Job
) -> tuple[list[Pair], dict[str, str], list[dict[str, Any]]]:
    """Reads every material once, so that a bad one is found before hours are spent on the others.

    Returns the pairs that can be read; by name, hashes of all that decides their pixels; and what is said of each
    material, see `_described`. A material of a folder or a pattern that cannot be read is left out with a warning; the
    error of one that was named is raised.
    """
    kept: list[Pair] = []
    identity: dict[str, str] = {}
    named: list[tuple[str, str, str]] = []
    for pair in pairs:
        try:
            both = materials.both(pair)
        except SommerlError as error:
            if pair.against is not None or not pair.given or pair.source in job.asked.materials:
                raise
            console.warn(f"{error}; it is left out")
            continue
        kept.append(pair)
        named += [(source, brdf.name, brdf.lookup) for source, brdf in zip(pair.sources, both, strict=True)]
        identity[f"material {len(kept)}"] = content_of(both[1])
        if pair.against is not None:
            identity[f"reference {len(kept)}"] = content_of(both[0])
    if not kept:
        raise MaterialError(f"{job.asked.materials[0]}: expected a folder with materials, found none that can be read")
    _check_pixels(job, len(kept))
    return kept, identity, _described(kept, named)


def _described(pairs: Sequence[Pair], named: Sequence[tuple[str, str, str]]) -> list[dict[str, Any]]:
    """What is said of each material: input, name, lookup, label, and the label of its reference, or None.

    named: input, name and lookup of the reference and of the material of each pair, one after the other.
    """
    made = labels([source for source, _, _ in named], [name for _, name, _ in named])
    shown = [f"{label} ({looked_up})" for label, (_, _, looked_up) in zip(made, named, strict=True)]
    return [
        dict(zip(("input", "name", "lookup"), one, strict=True))
        | {"label": label, "reference": reference if pair.against is not None else None}
        for pair, one, reference, label in zip(pairs, named[1::2], shown[::2], shown[1::2], strict=True)
    ]


def _check_pixels(job: Job, count: int) -> None:
    """Raises OptionError for a sheet of so many materials that is too large."""
    pixels = MOST_COMPARED if job.asked.against else MOST_PIXELS
    if count * job.sampling.size**2 > pixels:
        most = int((pixels / count) ** 0.5)
        raise OptionError(f"--size: expected at most {most} for {count} materials, found {job.sampling.size}")


def _setting(job: Job) -> Setting:
    taken = SCENES[job.scene]
    mesh, envmap, light, view = job.asked.mesh, job.asked.envmap, job.asked.light, job.asked.from_
    for option, value, allowed, what in (
        ("--mesh", mesh, taken.mesh, "objects"),
        ("--envmap", envmap, taken.environment, "lights"),
        ("--light", light, taken.environment, "lights"),
        ("--from", view, taken.view, "a view"),
    ):
        if value and not allowed:
            raise OptionError(f"{job.scene}: expected no {option}, since it has {what} of its own, found one")
    if light and envmap:
        raise OptionError("--light: expected no --envmap beside it, found one")
    loaded = load_mesh(mesh) if mesh else None
    if loaded and loaded.found:
        console.warn(loaded.found)
    environment = light or (environment_of(envmap) if taken.environment else None)
    return Setting(environment, loaded, view)


def _rendered(
    job: Job, pairs: list[Pair], materials: Materials, setting: Setting, checkpoint: Checkpoint
) -> tuple[list[Image], list[Image]]:
    """The images of the materials, and those of the references, or none if there is no reference.

    A scene is one image; a grid has an image for each material.

    Both are rendered with the references' samplers and the same seed, hence with the same directions.
    """
    frames = [[pair] for pair in pairs] if SCENES[job.scene].each else [pairs]

    @lru_cache(maxsize=len(pairs) if len(frames) == 1 else 1)
    def fitted(pair: Pair) -> Sampler:
        return named.fitted(job.sampler, materials.both(pair)[0])

    def make(frame: Sequence[Pair], which: int) -> Scene:
        samplers = [fitted(pair) for pair in frame]
        brdfs = [materials.both(pair)[which] for pair in frame]
        return make_scene(
            job.scene,
            brdfs,
            samplers=samplers,
            environment=setting.environment,
            mesh=setting.mesh,
            view=setting.view,
            size=job.sampling.size,
        )

    compared = [any(pair.against is not None for pair in frame) for frame in frames]
    makers: list[Callable[[], Scene]] = []
    for frame, twice in zip(frames, compared, strict=True):
        makers += [partial(make, frame, which) for which in ((0, 1) if twice else (1,))]
    with goes_on_from(checkpoint) as advance:
        spp, seed = job.sampling.spp, job.sampling.seed
        images = render_all(makers, spp=spp, seed=seed, progress=advance, checkpoint=checkpoint)
    rest = iter(images)
    references: list[Image] = []
    candidates: list[Image] = []
    for twice in compared:
        references.append(next(rest))
        candidates.append(next(rest) if twice else references[-1])
    return candidates, references if any(compared) else []


def _together(job: Job, pairs: Sequence[Pair], materials: Materials) -> list[Brdf]:
    """The materials of a scene that can have them in an atlas; none if one cannot be, or is held against a reference,
    with which it shares its directions."""
    if not SCENES[job.scene].sheet or len(pairs) < 2 or job.sampler != OURS.name or job.asked.against:
        return []
    found: list[Brdf] = []
    for pair in pairs:
        found.append(materials.both(pair)[1])
        if not is_compact(found[-1]):
            return []
    return found


def _rendered_together(job: Job, brdfs: Sequence[Brdf], setting: Setting, checkpoint: Checkpoint) -> list[Image]:
    """The images of materials, which are rendered as one."""
    size, make = job.sampling.size, SCENES[job.scene].sheet
    parts = sheets(len(brdfs), size)

    @cache
    def bsdf() -> Any:
        return make_atlas_bsdf(Atlas(brdfs), frame_number())

    def scene(part: Frames) -> Scene:
        assert make
        return make(bsdf(), part.first, part.count, setting.environment, view=setting.view, size=size)

    with goes_on_from(checkpoint) as advance:
        spp, seed = job.sampling.spp, job.sampling.seed
        makers = [partial(scene, part) for part in parts]
        images = render_all(makers, spp=spp, seed=seed, progress=advance, checkpoint=checkpoint)
    frames = [frame for part, image in zip(parts, images, strict=True) for frame in part.cut(image)]
    return frames[: len(brdfs)]


def _compared(job: Job, pairs: Sequence[Pair], references: Sequence[Image], candidates: Sequence[Image]) -> Comparison:
    """Measures how far the candidates are from the references; of a grid, over the spheres that have a reference."""
    if SCENES[job.scene].each:
        held = [pair.against is not None for pair in pairs]
        references, candidates = (list(compress(images, held)) for images in (references, candidates))
    with console.progress("comparing"):
        measured = Comparison.of(_sheet(references, 1), _sheet(candidates, 1))
    return replace(measured, reference=_sheet(references), candidate=_sheet(candidates))


def _held_against(shown: Sequence[Mapping[str, Any]]) -> tuple[str, str]:
    """The labels of the references, and of the materials that are compared with them. shown: of `_described`."""
    found = [one for one in shown if one["reference"] is not None]
    return ", ".join(one["reference"] for one in found), ", ".join(one["label"] for one in found)


def _sheet(images: Sequence[Image], columns: int = 0) -> Image:
    """One image of several: rows of `columns`, or of as many as `_columns` says; linear."""
    columns = columns or _columns(len(images))
    return Image(tiled([image.pixels for image in images], columns), tiled([image.mask for image in images], columns))


def _columns(count: int) -> int:
    """How many columns a sheet of so many images has: no fewer than rows, fewer than twice the square root of the
    count, and of these the number that leaves the fewest places empty."""
    least = math.ceil(math.sqrt(count))
    return min(range(least, 2 * least), key=lambda columns: (-count % columns, columns))


def _write(path: Path, images: Sequence[Image], scale: float, pairs: Sequence[Pair]) -> None:
    """Writes a render: of several images a sheet, with labels in a PNG. scale: its exposure."""
    if path.suffix.lower() == ".exr":
        write_image(path, _sheet(images).pixels)
        return
    pictures = [to_srgb8(image.pixels * scale) for image in images]
    if len(pairs) == len(images):
        sources = [pair.source for pair in pairs]
        captions = labels(sources, [stem(source) for source in sources])
        pictures = [captioned(list(zip(captions, pictures, strict=True)), _columns(len(pictures)))]
    write_image(path, pictures[0])


def _write_against(outputs: dict[str, Path], comparison: Comparison, names: tuple[str, str]) -> None:
    """Writes the difference as EXR; or, as PNG, reference, render, difference, FLIP and figures on one sheet."""
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
