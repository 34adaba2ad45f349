"""The command `fit`: analytic models fitted to a material."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

from .. import plots
from ..fitting.fit import Fit, fit_all
from ..fitting.fit import fit as fit_model
from ..fitting.options import MOST_LOBES, FitOptions, Loss, Sampling, check_model
from ..formats import fits, standard_files
from ..formats.load import load
from ..models.multi_lobe import FAMILIES
from ..models.standard import Surface
from ..models.standards import STANDARDS
from ..reflectance.brdf import Brdf
from ..reflectance.metric import decibels
from ..render.compare import compare_on_sphere
from ..render.compress import compress
from ..render.environment import default_environment
from ..render.judge import Judge
from ..system.errors import OptionError
from . import answers, console
from .arguments import Material, WritingArguments, library_options, named_as_typed, option, positional
from .checks import check_output
from .outcome import finite
from .parser import add_command
from .rows import lobe_text, surface_text

DEFAULTS = FitOptions()
BESIDE = 2700  # bytes of the .smrl that a standard's surface is compared with


@dataclass(frozen=True, kw_only=True)
class FitArguments(WritingArguments):
    """What `fit` is asked for."""

    material: Material = positional("MATERIAL", help="the material to fit to: a file or a built-in name")
    model: str = option(
        default="all", metavar="NAME", help="one of the models below; all: every sum of lobes (%(default)s)"
    )
    lobes: int | None = option(
        default=None,
        metavar="N",
        help=f"of a model, with its Lambertian base: 2 to {MOST_LOBES} (2; 1 of models that are a base themselves)",
    )
    loss: Loss = option(
        default=DEFAULTS.loss,
        help="what the error is of: f_r; f_r cos θ_i; the logarithm of that, or its cube root (%(default)s)",
    )
    sampling: Sampling = option(
        default=DEFAULTS.sampling,
        help="directions that a rendered sphere sees, or the centres of the lattice's cells (%(default)s)",
    )
    samples: int = option(
        default=DEFAULTS.samples, metavar="N", help="pairs of directions, for --sampling sphere (%(default)s)"
    )
    starts: int = option(default=DEFAULTS.starts, metavar="N", help="of the search, of each model (%(default)s)")
    seed: int = option(default=DEFAULTS.seed, metavar="N", help="of directions and starts (%(default)s)")
    conserve_energy: bool = option(
        default=False,
        help="sums of lobes: the albedos of each channel sum to 1 at most (loose for oren-nayar, ward and ward-duer)",
    )
    output: Path | None = option(
        "-o",
        default=None,
        metavar="FILE",
        help="a .json with everything, of which FILE.json:MODEL is a material; .mtlx of openpbr; .gltf of gltf",
    )
    picture: Path | None = option(default=None, metavar="FILE", help="a .png of the material, its fits and differences")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Fits analytic models to a material, and says how far each is from it: would a formula do?"
    example = """sommerl fit nickel.binary --model ward --lobes 3
  sommerl fit nickel.binary -o nickel.json --picture nickel.png
  sommerl render nickel.json:ggx -o ggx.png
  sommerl fit nickel.binary --model openpbr -o nickel.mtlx"""
    explained = [f"Sums of lobes:\n{_families()}", f"Surfaces of standards:\n{_standards()}"]
    add_command(add, "fit", fit, FitArguments, summary, example, explained=explained)


def fit(options: FitArguments) -> dict[str, Any]:
    for path, extensions in ((options.output, (".json", *standard_files.FILES)), (options.picture, (".png",))):
        if path:
            check_output(path, extensions, options.material)
    kind = options.output.suffix.lower() if options.output else ""
    if kind in standard_files.FILES and options.model != standard_files.FILES[kind][0]:
        model = standard_files.FILES[kind][0]
        raise OptionError(f"{options.output}: expected --model {model}, which {kind} holds, found {options.model}")
    files = [path for path in (options.output, options.picture) if path]
    chosen = library_options(FitOptions, options)
    every = options.model == "all"
    if not every:
        with named_as_typed():
            check_model(options.model, chosen)  # an unknown one is better told before reading
    brdf = load(options.material)
    with console.progress(f"fitting {brdf.name}") as advance:
        found = (
            fit_all(brdf, chosen, progress=advance)
            if every
            else [fit_model(brdf, options.model, chosen, progress=advance)]
        )
    result = fits.content(brdf.name, [each.as_json() for each in found])
    for row, each in zip(result["fits"], found, strict=True):
        if isinstance(each.brdf, Surface):
            row |= _beside(brdf, each.brdf)
    if options.picture:
        with console.progress("rendering") as advance:
            comparisons = compare_on_sphere(
                brdf, [each.brdf for each in found], default_environment(), progress=advance
            )
        for row, comparison in zip(result["fits"], comparisons, strict=True):
            row["psnr_object_db"] = comparison.metrics["psnr_object_db"]
        plots.fits(brdf.name, [each.model for each in found], comparisons, options.picture)
    if options.output and kind in standard_files.FILES and isinstance(found[0].brdf, Surface):
        standard_files.write(options.output, found[0].brdf)
    elif options.output:
        fits.write(options.output, brdf.name, finite(result["fits"]))
    if not options.json:
        print_fits(f"{options.material}: {chosen.loss} error of fits", result["fits"], found)
        if files:
            console.wrote(files)
    read = {"input": str(options.material), "name": brdf.name}
    return answers.of_materials([read], **result, output=_text(options.output), image=_text(options.picture))


def print_fits(title: str, rows: Sequence[Mapping[str, Any]], fits: Sequence[Fit]) -> None:
    """A table of fits, and their lobes. rows: of `Fit.as_json`, with "psnr_object_db" if that was measured."""
    rendered = "psnr_object_db" in rows[0]
    columns = ["model", "lobes", "error", "relative", *(["PSNR, object"] if rendered else []), "time"]
    table: list[list[str]] = []
    for row, fit in zip(rows, fits, strict=True):
        psnr = [decibels(row["psnr_object_db"])] if rendered else []
        numbers = [
            str(row["lobes"] or ""),
            f"{fit.error:.4g}",
            f"{fit.relative_error:.4f}",
            *psnr,
            f"{fit.seconds:.1f} s",
        ]
        table.append([fit.model, *numbers])
    console.print_table(title, columns, table)
    for row, fit in zip(rows, fits, strict=True):
        if isinstance(fit.brdf, Surface):
            console.say(fit.model, f"  {surface_text(fit.brdf.as_json())}", *_losses(row))
        else:
            console.say(fit.model, *(f"  {lobe_text(lobe.as_json())}" for lobe in fit.brdf.lobes))


def _beside(brdf: Brdf, surface: Surface) -> dict[str, Any]:
    """How far a standard's surface is from the material, and how far a small file of it is, in soft light."""
    judge = Judge(brdf)
    found: dict[str, Any] = {"psnr_soft_db": judge.metrics(surface)["psnr_soft_db"]}
    if surface.model.name == "openpbr":
        found["blender"] = standard_files.blender(surface)
    if not brdf.compressed:
        small, _ = compress(brdf, target_size=BESIDE, effort=1)
        found["smrl"] = {"target_size": BESIDE, "psnr_soft_db": judge.metrics(small)["psnr_soft_db"]}
    return found


def _losses(row: Mapping[str, Any]) -> list[str]:
    small = row.get("smrl")
    beside = f"; a .smrl of {BESIDE} bytes: {decibels(small['psnr_soft_db'])}" if small else ""
    return [f"  PSNR in soft light: {decibels(row['psnr_soft_db'])}{beside}"]


def _text(path: Path | None) -> str | None:
    return str(path) if path else None


def _families() -> str:
    """All models, with their parameters and bounds."""
    lines: list[str] = []
    for name, family in FAMILIES.items():
        shape = ", ".join(f"{p.name} {p.low:g} to {p.high:g}" for p in family.parameters)
        lines.append(f"  {name:20}{shape}".rstrip())
    return "\n".join(lines)


def _standards() -> str:
    """All standards' models, with what they fit."""
    rows = (f"  {name:20}{', '.join(model.by_key)}" for name, model in STANDARDS.items())
    return "\n".join(fill(row, 80, subsequent_indent=22 * " ") for row in rows)
