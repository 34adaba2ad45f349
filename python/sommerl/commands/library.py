"""The command `library`: materials by the thousand. Each of its sub-commands is in a module of its own."""

from __future__ import annotations

from typing import Any

from . import library_build, library_find, library_list, library_pack, library_sheet, library_verify

SUMMARY = "Materials by the thousand: built by many processes, checked, packed into one file, listed and found."
# In the order in which help lists them.
SUBCOMMANDS = (library_build, library_verify, library_pack, library_list, library_find, library_sheet)


def arguments(add: Any) -> None:
    """Adds the command, with its sub-commands, to the command line."""
    parser = add("library", help=SUMMARY[0].lower() + SUMMARY[1:].rstrip("."), description=SUMMARY)
    add_to = parser.add_subparsers(metavar="COMMAND", dest="subcommand", required=True).add_parser
    for module in SUBCOMMANDS:
        module.arguments(add_to)
