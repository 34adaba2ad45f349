"""Errors that a user can cause. Each message is one sentence that names the file or the option and what is wrong."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from .visible import visible

LONGEST = 2000  # characters of a message; a longer one is cut off
LONGEST_UNEXPECTED = 300  # characters of what an error that nobody thought of says


class SommerlError(Exception):
    """An error that the input causes, not the program. Its message is safe to print: it has gone through `visible`.

    >>> try:
    ...     sommerl.load("nikel")
    ... except sommerl.SommerlError as error:
    ...     print("nickel" in str(error))
    True
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(visible(sentence, LONGEST))


class FormatError(SommerlError):
    """A file is missing, cannot be read, or breaks the rules of its format."""


class MaterialError(SommerlError):
    """A material, or a table of measurements, cannot be used as asked."""


class OptionError(SommerlError):
    """An option has a value that is not allowed."""


class MissingDependencyError(SommerlError):
    """An optional package, or a library like LLVM, is needed and not installed."""


def unexpected(error: BaseException) -> str:
    """What an error is that is none of Sommerl's own, for a sentence."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # it may be anybody's
        text = ""
    text = visible(text if len(text) <= LONGEST_UNEXPECTED else f"{text[:LONGEST_UNEXPECTED]}…")
    found = type(error).__name__ + (f" ({text})" if text else "")
    return f"something went wrong that Sommerl did not expect: {found}"


@contextmanager
def told_of(name: object) -> Generator[None]:
    """Within the block, errors of a format that do not name the file get its name before them."""
    try:
        yield
    except FormatError as error:
        text = str(error)
        raise error if text.startswith(visible(f"{name}: ")) else FormatError(f"{name}: {text}") from error
