"""What the parsers of all commands share."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NoReturn

from ..render.passes import DEFAULT_SIZE, DEFAULT_SPP
from ..system import threads
from ..system.visible import visible


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"error: {visible(message)} (see {self.prog} --help)\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """As argparse does, but that help which cannot be printed is an error."""
        if file is sys.stdout:
            print(message, end="")
        else:
            super()._print_message(message, file)


def command(add: Any, name: str, run: Any, summary: str, example: str, *, writes: bool = True) -> Any:
    """Adds a command, with the options that all have. run: what it does. writes: whether it writes files."""
    parser = add(
        name,
        help=summary[0].lower() + summary[1:].rstrip("."),
        description=summary,
        epilog=f"Example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    if writes:
        parser.add_argument(
            "--overwrite", action="store_true", help="replace files that Sommerl did not write, and measurements, too"
        )
    parser.add_argument(
        threads.OPTION,
        metavar="N",
        help=f"the most that work at once ({threads.VARIABLE}; if not set, as many as there are processors)",
    )
    parser.set_defaults(run=run)
    return parser


def rendering_options(parser: Any) -> None:
    """Adds the options that all renderings have."""
    for name, default, text in (
        ("spp", DEFAULT_SPP, "samples a pixel"),
        ("size", DEFAULT_SIZE, "width and height in pixels"),
        ("seed", 0, "of the random numbers"),
    ):
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"{text} ({default})")
    parser.add_argument(
        "--envmap", type=Path, metavar="FILE", help="a latitude-longitude image that lights the scene (a built-in one)"
    )
