"""The command `fit`: analytic models fitted to a material."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

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
from . import console
from .checks import check_output
from .parser import command
from .rows import lobe_text

DEFAULTS = FitOptions()


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Fits analytic models to a material, and says how far each is from it: would a formula do?"
    example = """sommerl fit nickel.binary --model ward --lobes 3
  sommerl fit nickel.binary -o nickel.json --picture nickel.png
  sommerl render nickel.json:ggx -o ggx.png"""
    parser = command(add, "fit", fit, summary, example)
    parser.epilog = f"Models:\n{_families()}\n\n{parser.epilog}"
    parser.add_argument("material", metavar="MATERIAL")
    parser.add_argument("--model", default="all", metavar="NAME", help="one of the models below, or all (%(default)s)")
    parser.add_argument(
        "--lobes",
        type=int,
        metavar="N",
        help=f"of a model, with its Lambertian base: 2 to {MOST_LOBES} (2; 1 of models that are a base themselves)",
    )
    for name, allowed, text in (
        ("loss", Loss, "what the error is of: f_r; f_r cos θ_i; the logarithm of that, or its cube root"),
        ("sampling", Sampling, "directions that a rendered sphere sees, or the centres of the lattice's cells"),
    ):
        default = getattr(DEFAULTS, name)
        parser.add_argument(f"--{name}", choices=get_args(allowed), default=default, help=f"{text} (%(default)s)")
    for name, text in (
        ("samples", "pairs of directions, for --sampling sphere"),
        ("starts", "of the search, of each model"),
        ("seed", "of directions and starts"),
    ):
        default = getattr(DEFAULTS, name)
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"{text} (%(default)s)")
    parser.add_argument(
        "--conserve-energy",
        action="store_true",
        help="let the albedos of each channel sum to 1 at most (which binds oren-nayar, ward and ward-duer loosely)",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="a .json with everything; FILE.json:MODEL is a material"
    )
    parser.add_argument("--picture", type=Path, metavar="FILE", help="a .png of the material, its fits and differences")


def _families() -> str:
    """All models, with their parameters and bounds."""
    lines: list[str] = []
    for name, family in FAMILIES.items():
        shape = ", ".join(f"{p.name} {p.low:g} to {p.high:g}" for p in family.parameters)
        lines.append(f"  {name:20}{shape}".rstrip())
    return "\n".join(lines)


def fit(options: Namespace) -> dict[str, Any]:
    for path, extension in ((options.output, ".json"), (options.picture, ".png")):
        if path:
            check_output(path, (extension,), options.material)
    chosen = FitOptions(**{field.name: getattr(options, field.name) for field in fields(FitOptions)})
    every = options.model == "all"
    if not every:
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
    return result


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
