"""Errors that a user can cause. Each message is one sentence: file, field, expected, found."""

from __future__ import annotations

from .visible import visible

LONGEST = 2000  # characters of a sentence


class SommerlError(Exception):
    """Any error that is the input's fault and not the program's. Its sentence can be shown: see `visible`."""

    def __init__(self, sentence: str) -> None:
        super().__init__(visible(sentence, LONGEST))


class FormatError(SommerlError):
    """A file is not what its format says it should be."""


class MaterialError(SommerlError):
    """A material, or a table of measurements, cannot be used as asked."""


class OptionError(SommerlError):
    """An option has a value that makes no sense."""


class MissingDependencyError(SommerlError):
    """An optional package is needed and not there."""
