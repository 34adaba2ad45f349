"""The command line: parses, calls, prints. All defaults are the library's."""

from __future__ import annotations

import argparse
import io
import json
import math
import sys
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from .. import __version__
from ..formats.registry import listed, readable
from ..models.builtin import NAMES
from ..system import threads
from ..system.files import keeping
from . import compare, compress, console, convert, demo, factor, fit, info, paper, plot, render
from .outcome import outcome
from .parser import Parser

DESCRIPTION = """\
Turns measured reflectance into small material files that render fast and look like the measurement.

A MATERIAL is a file in one of the formats below, told by its content, or the name of a built-in one."""

BUILT_IN = "Built-in materials (SGD stand-ins for measured ones):\n  " + "\n  ".join(
    ", ".join(NAMES[i : i + 5]) for i in range(0, len(NAMES), 5)
)

EXAMPLES = """\
Examples:
  sommerl demo
  sommerl compress blue-metallic-paint.binary -o blue.smrl --clusters 256
  sommerl info blue.smrl
  sommerl compare blue-metallic-paint.binary blue.smrl
  sommerl render --scene sphere blue.smrl -o blue.png
"""


# In the order in which help lists them.
COMMANDS = (demo, compress, info, convert, compare, fit, factor, render, plot, paper)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status: 0, 1 for an error in the input, 2 for one in the options."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # not every terminal has a multiplication sign

    def command() -> None:
        options = _parser().parse_args(arguments)
        if options.threads is not None:
            threads.use(threads.checked(options.threads, threads.OPTION))
        threads.limit()
        with warnings.catch_warnings(), keeping(overwrite=getattr(options, "overwrite", False)):
            warnings.showwarning = _warned
            result = options.run(options)
        if options.json:
            print(json.dumps(_finite(result), indent=2))

    return outcome(command)


def _warned(message: Warning | str, *_: Any, **__: Any) -> None:
    """Tells a warning of Python's without the line of code that it comes from."""
    console.tell(f"warning: {message}")


def _finite(value: Any) -> Any:
    """The same, with null for the numbers that JSON lacks (the PSNR of identical images)."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list):
        return [_finite(item) for item in value]  # pyright: ignore[reportUnknownVariableType]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _parser() -> Parser:
    parser = Parser(
        prog="sommerl",
        description=DESCRIPTION,
        epilog=f"Formats:\n{listed(readable())}\n\n{BUILT_IN}\n\n{EXAMPLES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"sommerl {__version__}")
    add = parser.add_subparsers(metavar="COMMAND", required=True, dest="command").add_parser
    for module in COMMANDS:
        module.arguments(add)
    return parser
