"""How the documentation is built: `uv run --group docs sphinx-build -W docs docs/_build`."""

import argparse
import os
from pathlib import Path
from typing import Any

from sommerl import __version__
from sommerl.commands.cli import parser

HERE = Path(__file__).parent
COLUMNS = "90"  # of what `--help` prints

project = author = "Sommerl"
copyright = "2026 The Sommerl developers; MIT licence"
release = version = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "notebooks", "results"]
html_theme = "furo"
html_title = f"Sommerl {release}"
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_copy_source = False
autodoc_member_order = "bysource"
default_role = "literal"
autodoc_preserve_defaults = True  # as they are written, not as they print
autodoc_typehints = "none"  # signatures say them in the code; here they would be longer than what they explain


def helps(commands: argparse.ArgumentParser, name: str = "") -> list[tuple[str, str]]:
    """The commands below a parser, each with what its `--help` prints."""
    below = [action for action in commands._actions if isinstance(action, argparse._SubParsersAction)]
    found = [(name, commands.format_help())] if name else []
    for action in below:
        for word, command in action.choices.items():
            found += helps(command, f"{name} {word}".strip())
    return found


def write_commands(app: Any) -> None:
    """The page of the commands, from the parser itself. It is not kept: it is what this version says."""
    os.environ["COLUMNS"] = COLUMNS
    parts = [
        "# Every command and option",
        "What `sommerl COMMAND --help` prints. How commands behave is in [commands](commands.md).",
    ]
    parts += [f"## {name}\n\n```text\n{text.rstrip()}\n```" for name, text in helps(parser())]
    (HERE / "cli.md").write_text("\n\n".join(parts) + "\n", "utf-8")


def plain(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text: their lines are indented for people, and bars and asterisks are bars and asterisks."""
    lines[:] = [line.strip().translate({ord("|"): r"\|", ord("*"): r"\*"}) for line in lines]


def setup(app: Any) -> None:
    app.connect("builder-inited", write_commands)
    app.connect("autodoc-process-docstring", plain)
