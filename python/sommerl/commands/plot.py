"""The command `plot`: what a material is, drawn."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from .. import plots
from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..system.errors import OptionError
from . import console
from .checks import check_output
from .parser import command


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Draws what a material is: lobes, slices, palette."
    example = """sommerl plot nickel.binary -o nickel.png
  sommerl plot nickel.binary nickel.smrl nickel.json:ggx --kind theta-h -o three.pdf"""
    parser = command(add, "plot", plot, summary, example)
    kinds = "\n".join(f"  {name:10}{kind.shows}" for name, kind in plots.KINDS.items())
    parser.epilog = f"Kinds:\n{kinds}\n\n{parser.epilog}"
    parser.add_argument(
        "materials", nargs="+", metavar="MATERIAL", help=f"up to {plots.MOST_MATERIALS}; curves are drawn together"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help=f"a name that ends in {' '.join(plots.FORMATS)}"
    )
    parser.add_argument(
        "--kind",
        choices=[*plots.KINDS, "all"],
        default="all",
        help="one of those below, or all that apply (%(default)s)",
    )


def plot(options: Namespace) -> dict[str, Any]:
    for source in options.materials:
        check_output(options.output, tuple(plots.FORMATS), source)
    if len(options.materials) > plots.MOST_MATERIALS:
        raise OptionError(f"materials: expected 1 to {plots.MOST_MATERIALS}, found {len(options.materials)}")
    materials = _by_name(options.materials)
    figure, kinds = plots.sheet(materials, options.kind)
    plots.save(figure, options.output)
    if not options.json:
        console.say(f"{', '.join(materials)} → {options.output} ({', '.join(kinds)})")
    return {"image": str(options.output), "kinds": kinds, "materials": list(materials)}


def _by_name(sources: list[str]) -> dict[str, Brdf]:
    """Materials by their names; by name and source where that is the same, as of a table and what was made of it."""
    again = next((source for source in sources if sources.count(source) > 1), None)
    if again:
        raise OptionError(f"materials: expected different ones, found {again} twice")
    found = [(source, load(source)) for source in sources]
    names = [brdf.name for _, brdf in found]
    result: dict[str, Brdf] = {}
    for source, brdf in found:
        alone = names.count(brdf.name) == 1 or brdf.name.startswith(source)  # a built-in one's says where it is from
        name = brdf.name if alone else f"{Path(source).name}: {brdf.name}"
        result[f"{source}: {brdf.name}" if name in result else name] = brdf
    return result
