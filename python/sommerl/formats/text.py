"""Rows of numbers in text files."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..system.errors import FormatError

LARGEST_FILE = 2**28  # bytes
MOST_LINES = 2**23
LINE_ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"  # of str.splitlines


def text_of(path: Path, data: bytes) -> str:
    """The text in a file's bytes: UTF-8, UTF-16, or else Windows' Latin-1. Raises FormatError if it is not text, or has
    more than MOST_LINES lines.
    """
    text = decoded(data)
    odd = re.search(r"[\x00-\x08\x0e-\x1a\x7f]", text)  # an escape may stand in a name, which is shown without it
    if odd:
        raise FormatError(f"{path}: expected text, found another character at {odd.start()}")
    if sum(text.count(mark) for mark in LINE_ENDS) > MOST_LINES:
        raise FormatError(f"{path}: expected at most {MOST_LINES} lines, found more")
    return text


def decoded(data: bytes) -> str:
    """Bytes as text, whatever they hold; those that begin a file may end within a character."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace")
    start = data[:200]
    for odd, coding in ((1, "utf-16-le"), (0, "utf-16-be")):  # without a mark: every other byte is 0
        if len(start) > 7 and not any(start[odd::2]) and all(start[1 - odd :: 2]):
            return data.decode(coding, "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if error.start >= len(data) - 3 and error.reason == "unexpected end of data":
            return data[: error.start].decode("utf-8-sig")
        return data.decode("cp1252", "replace")


def uncommented(text: str) -> list[str]:
    """The lines of a text without what follows "#", and without those in which nothing is left."""
    return [line for line in (line.split("#")[0].strip() for line in text.splitlines()) if line]


def rows(path: Path, lines: list[str], columns: int) -> NDArray[np.float64]:
    """The numbers in lines of text, with spaces between them, shape (lines, columns). Raises FormatError where a line
    has other columns.
    """
    if any(len(line.split()) != columns for line in (*lines[:1], *lines[-1:])):
        found = next(n for line in (lines[0], lines[-1]) if (n := len(line.split())) != columns)
        raise FormatError(f"{path}: expected rows of {columns} columns, found {found}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of no rows at all, which are told below
            numbers = np.loadtxt(lines, np.float64, quotechar='"', ndmin=2)
    except ValueError as error:
        raise FormatError(f"{path}: expected rows of {columns} numbers, found others ({error})") from error
    if not numbers.size or numbers.shape[1] != columns:
        raise FormatError(
            f"{path}: expected rows of {columns} numbers, found {numbers.shape[1] if numbers.size else 0}"
        )
    return numbers
