"""The command line: puts the commands together, and runs one. All defaults are the library's."""

from __future__ import annotations

import argparse
import io
import sys
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from .. import __version__
from ..formats.reading import Reading, reading
from ..formats.registry import listed, readable
from ..models.builtin import NAMES
from ..system import threads
from ..system.files import replacing_files
from . import (
    blend,
    compare,
    completion,
    compress,
    convert,
    demo,
    eval,
    factor,
    fit,
    info,
    library,
    paper,
    plan,
    plot,
    render,
    view,
)
from .arguments import ReadingArguments, WritingArguments, named_as_typed, read
from .console import warn
from .folders import empty_ones_removed
from .outcome import asks_for_json, outcome
from .parser import Parser

DESCRIPTION = """\
Turns measured reflectance into small material files that render fast and look like the measurement.

A MATERIAL is a file in one of the formats below, recognised by its content, or the name of a built-in one."""

BUILT_IN = "Built-in materials (SGD stand-ins for measured ones):\n  " + "\n  ".join(
    ", ".join(NAMES[i : i + 5]) for i in range(0, len(NAMES), 5)
)

EXAMPLES = """\
Examples:
  sommerl demo
  sommerl compress nickel -o nickel.smrl --target-size 2.7kB
  sommerl info nickel.smrl
  sommerl compare nickel nickel.smrl
  sommerl render --scene sphere nickel.smrl -o nickel.png
  sommerl view nickel nickel.smrl
"""


# In the order in which help lists them.
COMMANDS = (
    demo,
    compress,
    info,
    convert,
    eval,
    plan,
    blend,
    compare,
    fit,
    factor,
    render,
    plot,
    view,
    library,
    paper,
    completion,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status: 0, 1 for an error in the input, 2 for one in the options."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # not every terminal has a multiplication sign
    typed = sys.argv[1:] if arguments is None else list(arguments)
    warn.told.clear()
    return outcome(lambda: _run(typed), as_json=asks_for_json(typed))


def _run(typed: Sequence[str]) -> Mapping[str, Any] | None:
    """What one command answers; None where there was nothing to do but to print help."""
    all_commands = parser()
    found, unknown = all_commands.parse_known_args(typed)
    if found.command is None:
        if unknown:
            all_commands.unknown(unknown[0])
        all_commands.print_help()
        return None
    if unknown:
        found.parser.unknown(unknown[0])
    options = read(found.arguments, found)
    if options.threads is not None:
        threads.use(threads.checked(options.threads, threads.OPTION))
    threads.limit()
    overwrite = isinstance(options, WritingArguments) and options.overwrite
    with (
        warnings.catch_warnings(),
        replacing_files(overwrite=overwrite),
        empty_ones_removed(),
        reading(_reading(options)),
    ):
        warnings.showwarning = _warned
        return found.run(options)


def _reading(options: Any) -> Reading:
    """How tables of samples are to be read."""
    if not isinstance(options, ReadingArguments):
        return Reading()
    with named_as_typed():
        return Reading(options.columns or (), options.max_dropped, options.values, options.phi_from, options.prior)


def _warned(message: Warning | str, *_: Any, **__: Any) -> None:
    """Tells a warning of Python's without the line of code that it comes from."""
    warn(str(message))


def parser() -> Parser:
    """The parser of all commands."""
    made = Parser(
        prog="sommerl",
        description=DESCRIPTION,
        epilog=f"Formats:\n{listed(readable())}\n\n{BUILT_IN}\n\n{EXAMPLES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("--version", action="version", version=f"sommerl {__version__}")
    add = made.add_subparsers(metavar="COMMAND", dest="command").add_parser
    for module in COMMANDS:
        module.arguments(add)
    return made
