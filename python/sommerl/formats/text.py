"""Rows of numbers in text files."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError

LARGEST_FILE = 2**28  # bytes


def text_of(path: Path) -> str:
    """The text in a file. Raises FormatError if it is too long, or not text."""
    length = path.stat().st_size
    if length > LARGEST_FILE:
        raise FormatError(f"{path}: expected at most {LARGEST_FILE} bytes, found {length}")
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: expected text, found another byte at {error.start}") from error


def uncommented(text: str) -> list[str]:
    """The lines of a text without what follows "#", and without those in which nothing is left."""
    return [line for line in (line.split("#")[0].strip() for line in text.splitlines()) if line]


def rows(
    path: Path, lines: list[str], columns: int, delimiter: str | None = None, used: list[int] | None = None
) -> NDArray[np.float64]:
    """The numbers in lines of so many columns, (n, columns), or in some of them. Raises FormatError.

    delimiter: None for spaces. used: the columns that are wanted; all if None.
    """
    if any(len(line.split(delimiter)) != columns for line in (*lines[:1], *lines[-1:])):
        found = next(n for line in (lines[0], lines[-1]) if (n := len(line.split(delimiter))) != columns)
        raise FormatError(f"{path}: expected rows of {columns} columns, found {found}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of no rows at all, which are told below
            numbers = np.loadtxt(lines, np.float64, delimiter=delimiter, usecols=used, quotechar='"', ndmin=2)
    except ValueError as error:
        raise FormatError(f"{path}: expected rows of {columns} numbers, found others ({error})") from error
    wanted = columns if used is None else len(used)
    if not numbers.size or numbers.shape[1] != wanted:
        raise FormatError(
            f"{path}: expected rows of {columns} numbers, found {numbers.shape[1] if numbers.size else 0}"
        )
    return numbers
