"""The command `fit`: analytic models fitted to a material."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import plots
from ..fitting.fit import Fit, fit_all
from ..fitting.fit import fit as fit_model
from ..fitting.options import MOST_LOBES, FitOptions, Loss, Sampling, families_of
from ..formats import fits
from ..formats.load import load
from ..models.multi_lobe import FAMILIES
from ..reflectance.metric import decibels
from ..render.compare import compare_on_sphere
from ..render.environment import default_environment
from . import answers, console
from .arguments import Material, WritingArguments, library_options, named_as_typed, option, positional
from .checks import check_output
from .parser import add_command
from .rows import lobe_text

DEFAULTS = FitOptions()


@dataclass(frozen=True, kw_only=True)
class FitArguments(WritingArguments):
    """What `fit` is asked for."""

    material: Material = positional("MATERIAL", help="the material to fit to: a file or a built-in name")
    model: str = option(default="all", metavar="NAME", help="one of the models below, or all (%(default)s)")
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
        help="let the albedos of each channel sum to 1 at most (which binds oren-nayar, ward and ward-duer loosely)",
    )
    output: Path | None = option(
        "-o", default=None, metavar="FILE", help="a .json with everything; FILE.json:MODEL is a material"
    )
    picture: Path | None = option(default=None, metavar="FILE", help="a .png of the material, its fits and differences")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Fits analytic models to a material, and says how far each is from it: would a formula do?"
    example = """sommerl fit nickel.binary --model ward --lobes 3
  sommerl fit nickel.binary -o nickel.json --picture nickel.png
  sommerl render nickel.json:ggx -o ggx.png"""
    add_command(add, "fit", fit, FitArguments, summary, example, explained=[f"Models:\n{_families()}"])


def fit(options: FitArguments) -> dict[str, Any]:
    for path, extension in ((options.output, ".json"), (options.picture, ".png")):
        if path:
            check_output(path, (extension,), options.material)
    files = [path for path in (options.output, options.picture) if path]
    chosen = library_options(FitOptions, options)
    every = options.model == "all"
    if not every:
        with named_as_typed():
            families_of(options.model, chosen.lobes)  # an unknown one is better told before reading
    brdf = load(options.material)
    with console.progress(f"fitting {brdf.name}") as advance:
        found = (
            fit_all(brdf, chosen, progress=advance)
            if every
            else [fit_model(brdf, options.model, chosen, progress=advance)]
        )
    result = fits.content(brdf.name, [each.as_json() for each in found])
    if options.picture:
        with console.progress("rendering") as advance:
            comparisons = compare_on_sphere(
                brdf, [each.brdf for each in found], default_environment(), progress=advance
            )
        for row, comparison in zip(result["fits"], comparisons, strict=True):
            row["psnr_object_db"] = comparison.metrics["psnr_object_db"]
        plots.fits(brdf.name, [each.model for each in found], comparisons, options.picture)
    if options.output:
        fits.write(options.output, brdf.name, result["fits"])
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
        numbers = [str(row["lobes"]), f"{fit.error:.4g}", f"{fit.relative_error:.4f}", *psnr, f"{fit.seconds:.1f} s"]
        table.append([fit.model, *numbers])
    console.print_table(title, columns, table)
    for fit in fits:
        console.say(fit.model, *(f"  {lobe_text(lobe.as_json())}" for lobe in fit.brdf.lobes))


def _text(path: Path | None) -> str | None:
    return str(path) if path else None


def _families() -> str:
    """All models, with their parameters and bounds."""
    lines: list[str] = []
    for name, family in FAMILIES.items():
        shape = ", ".join(f"{p.name} {p.low:g} to {p.high:g}" for p in family.parameters)
        lines.append(f"  {name:20}{shape}".rstrip())
    return "\n".join(lines)
