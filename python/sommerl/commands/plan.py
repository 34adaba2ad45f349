"""The command `plan`: where to measure few samples."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..formats import prior, sample_files
from . import console
from .arguments import WritingArguments, option
from .checks import check_output, check_range
from .parser import add_command


@dataclass(frozen=True, kw_only=True)
class PlanArguments(WritingArguments):
    """What `plan` is asked for."""

    samples: int = option(metavar="N", help=f"how many pairs of directions, {prior.FEWEST} to {prior.MOST}")
    output: Path = option(
        "-o", metavar="OUT.csv", help="angles [deg] and empty columns r, g, b: filled in, a table of samples"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Says where to measure, so that few samples say most of a material (--prior of convert and compress)."
    example = """sommerl plan --samples 16 -o plan.csv
  sommerl convert measured.csv material.smrl --prior"""
    add_command(add, "plan", planned, PlanArguments, summary, example)


def planned(options: PlanArguments) -> dict[str, Any]:
    check_range("--samples", options.samples, prior.FEWEST, prior.MOST)
    check_output(options.output, (".csv",))
    with console.progress("planning"):
        angles = prior.shipped().plan(options.samples)
    sample_files.write_plan(angles, options.output)
    if not options.json:
        console.say(f"{len(angles)} pairs of directions, the most telling first → {options.output}")
    return {"materials": [], "samples": len(angles), "output": str(options.output)}
