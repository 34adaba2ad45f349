"""The command `eval`: f_r of a material at the directions of a table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..formats import numpy_files, sample_files, samples, text
from ..formats.load import load
from ..system import door
from . import answers, console
from .arguments import Material, ReadingArguments, WritingArguments, option, positional
from .checks import check_output
from .parser import add_command

EXTENSIONS = (".csv", ".npy")


@dataclass(frozen=True, kw_only=True)
class EvalArguments(ReadingArguments, WritingArguments):
    """What `eval` is asked for."""

    material: Material = positional("MATERIAL", help="a file or a built-in name")
    directions: Path = positional(
        "DIRECTIONS",
        help="a table with columns of angles, as theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg; others are ignored",
    )
    output: Path = option(
        "-o",
        metavar="OUT",
        help=".csv: the angles [deg], r, g, b [1/sr], a row for each of DIRECTIONS; .npy: the same, angles in radians",
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Evaluates a material at the directions of a table; 0 below the horizon."
    example = "sommerl eval nickel.smrl directions.csv -o nickel.csv"
    add_command(add, "eval", evaluate, EvalArguments, summary, example)


def evaluate(options: EvalArguments) -> dict[str, Any]:
    check_output(options.output, EXTENSIONS, options.material, options.directions)
    data = door.read(options.directions, max(text.LARGEST_FILE, numpy_files.LARGEST_FILE), "a table of directions")
    angles = samples.directions_of(options.directions, data)
    brdf = load(options.material)
    sample_files.write(sample_files.at_directions(brdf, angles), options.output)
    size = options.output.stat().st_size if options.output.is_file() else None  # of what went through a pipe
    if not options.json:
        console.say(f"{brdf.name} at {len(angles)} pairs of directions → {options.output}")
    row = {"input": options.material, "name": brdf.name, "directions": len(angles)}
    return answers.of_materials([row | {"output": str(options.output), "bytes_disk": size}])
