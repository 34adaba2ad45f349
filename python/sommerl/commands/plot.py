"""The command `plot`: what a material is, drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import plots
from ..formats.load import load
from ..system.errors import OptionError
from . import answers, console
from .arguments import Material, WritingArguments, option, positional
from .checks import check_output
from .inputs import labels
from .parser import add_command


@dataclass(frozen=True, kw_only=True)
class PlotArguments(WritingArguments):
    """What `plot` is asked for."""

    materials: tuple[Material, ...] = positional(
        "MATERIAL", help=f"a file or a built-in name; of up to {plots.MOST_MATERIALS}, curves are drawn together"
    )
    output: Path = option("-o", metavar="FILE", help=f"a name that ends in {' '.join(plots.FORMATS)}")
    kind: str = option(
        default="all", choices=[*plots.KINDS, "all"], help="one of those below, or all that apply (%(default)s)"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Draws what a material is: lobes, slices, palette."
    example = """sommerl plot nickel.binary -o nickel.png
  sommerl plot nickel.binary nickel.smrl nickel.json:ggx --kind theta-h -o three.pdf"""
    kinds = "\n".join(f"  {name:10}{kind.shows}" for name, kind in plots.KINDS.items())
    add_command(add, "plot", plot, PlotArguments, summary, example, explained=[f"Kinds:\n{kinds}"])


def plot(options: PlotArguments) -> dict[str, Any]:
    for source in options.materials:
        check_output(options.output, tuple(plots.FORMATS), source)
    if len(options.materials) > plots.MOST_MATERIALS:
        raise OptionError(f"MATERIAL: expected 1 to {plots.MOST_MATERIALS}, found {len(options.materials)}")
    again = next((source for source in options.materials if options.materials.count(source) > 1), None)
    if again:
        raise OptionError(f"MATERIAL: expected different ones, found {again} twice")
    brdfs = [load(source) for source in options.materials]
    names = labels(options.materials, [brdf.name for brdf in brdfs])
    figure, kinds = plots.sheet(dict(zip(names, brdfs, strict=True)), options.kind)
    plots.save(figure, options.output)
    if not options.json:
        console.say(f"{', '.join(names)} → {options.output} ({', '.join(kinds)})")
    drawn = [
        {"input": source, "name": brdf.name, "label": name}
        for source, brdf, name in zip(options.materials, brdfs, names, strict=True)
    ]
    return answers.of_materials(drawn, image=str(options.output), kinds=kinds)
