"""Errors that a user can cause. Each message is one sentence that names the file or the option and what is wrong."""

from __future__ import annotations

from .visible import visible

LONGEST = 2000  # characters of a message; a longer one is cut off


class SommerlError(Exception):
    """An error that the input causes, not the program. Its message is safe to print: it has gone through `visible`."""

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
