"""The parser of a command line, and what is said of one that cannot be read."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NoReturn

from ..system.errors import OptionError
from ..system.near import did_you_mean
from .arguments import Arguments, add_to


class Parser(argparse.ArgumentParser):
    """Raises OptionError, one sentence, for what cannot be read."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        # By this pattern argparse tells a negative number from an option. Its own one knows no numbers between commas,
        # as in `--light -30,50`, and there is no public way to another.
        self._negative_number_matcher = re.compile(r"-\.?\d[^a-z]*$")

    def error(self, message: str) -> NoReturn:
        sentence = message.removeprefix("argument ").replace("not allowed with argument", "not allowed beside")
        raise OptionError(f"{sentence} (see {self.prog} --help)")

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # pyright: ignore
        """As argparse does, but an option that there is not is told first, before those that are missing for it."""
        for word in args or ():
            if word == "--":
                break
            name = word.partition("=")[0]
            if name.startswith("--") and " " not in name and self._is_unknown(name):
                self.unknown(word)
        return super().parse_known_args(args, namespace)

    def unknown(self, word: str) -> NoReturn:
        """Raises OptionError for an argument that has no meaning."""
        if not word.startswith("-"):
            self.error(f"{word}: expected no further argument, found one")
        hint = did_you_mean(word.partition("=")[0], self._flags())
        self.error(f"{word}: expected an option of {self.prog}, found none of that name{hint}")

    def commands(self) -> list[Parser]:
        """The parsers of the commands, if this is the one of all, or of the sub-commands."""
        found = [action for action in self._actions if isinstance(action, argparse._SubParsersAction)]  # pyright: ignore
        return [command for action in found for command in action.choices.values()]  # pyright: ignore

    def leaves(self) -> list[Parser]:
        """The parsers of all commands and sub-commands that do something."""
        below = self.commands()
        return [leaf for each in below for leaf in each.leaves()] if below else [self]

    def actions(self) -> list[argparse.Action]:
        """All arguments that this one takes."""
        return list(self._actions)

    def _is_unknown(self, name: str) -> bool:
        """Whether there is no such option; what comes after a command's name is left to its own parser."""
        return not self.commands() and not any(known.startswith(name) for known in self._flags())

    def _flags(self) -> list[str]:
        return [name for action in self._actions for name in action.option_strings]

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        choices: Iterable[str] = action.choices
        if isinstance(action, argparse._SubParsersAction):  # pyright: ignore
            self.error(f"{value}: expected a command, found none of that name{did_you_mean(value, choices)}")
        name = "/".join(action.option_strings) or action.metavar
        self.error(f"{name}: expected {' or '.join(choices)}, found {value}{did_you_mean(value, choices)}")

    def _print_message(self, message: str, file: Any = None) -> None:
        """As argparse does, but that help which cannot be printed is an error."""
        if file is sys.stdout:
            print(message, end="", flush=True)
        else:
            super()._print_message(message, file)


def add_command(
    add: Any,
    name: str,
    run: Callable[[Any], Any],
    arguments: type[Arguments],
    summary: str,
    example: str,
    *,
    explained: Sequence[str] = (),
) -> None:
    """Adds a command to the command line.

    run: what it does, given its `arguments`. summary: one sentence. example: command lines. explained: paragraphs that
    its help has before the example.
    """
    parser = add(
        name,
        help=summary[0].lower() + summary[1:].rstrip("."),
        description=summary,
        epilog="\n\n".join((*explained, f"Example:\n  {example}")),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_to(parser, arguments)
    parser.set_defaults(run=run, arguments=arguments, parser=parser)
