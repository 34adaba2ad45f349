"""Columns of numbers in text files, as people and instruments write them.

The first line in which at least two cells name angles has the names; what stands before it is a preamble, with or
without "#". A row of units may follow. Commas, semicolons, tabs, bars or spaces separate columns; decimals may have
commas where columns do not; exponents may have a D. Cells that are empty or say that nothing is known are NaN.
"""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..system.errors import FormatError
from . import columns
from .text import text_of

DELIMITERS = ("\t", ";", ",", "|", None)  # None: spaces
NOTHING = {"", "nan", "na", "n/a", "#n/a", "n.a.", "-", "--", "—", "null", "none", "inf", "-inf", "+inf", "infinity"}
FEWEST_NUMBERS = 3  # of a row, even if some are missing; fewer may be how many rows there are
MOST_TRIED = 200  # lines after the preamble in which the first row of numbers is looked for
END_OF_LINE = re.compile(r"\r\n|\r|\n")
HINT = re.compile("th|ph|θ|ϑ|φ|ϕ|az|zen|polar|incl|angle|aoi|vza", re.IGNORECASE)  # in all names of angles
LONGEST_NAMES = 2**16  # characters of a line with names
D_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")


@dataclass(frozen=True)
class Table:
    """names: of all columns. units: those in a row of their own, "" where there is none. numbers: (rows, columns) of
    those that are wanted, others NaN. lines: the file's own numbers of the rows' lines, from 1; header: of the names'
    line, 0 if there was none."""

    names: list[str]
    units: list[str]
    numbers: NDArray[np.float64]
    lines: NDArray[np.intp]
    header: int


def has_names(text: str) -> bool:
    """Whether a line of a text names columns of angles."""
    return _found(END_OF_LINE.split(text)) is not None


def table(path: Path, data: bytes, wanted: Callable[[Sequence[str]], list[int]], given: Sequence[str] = ()) -> Table:
    """The columns in a file's bytes.

    wanted: which columns are to be numbers, of their names. given: the names, in place of those in the file. Raises
    FormatError where there are no names, no rows, or a row has other columns.
    """
    lines = END_OF_LINE.split(text_of(path, data).translate({0x2212: "-", 0xA0: " "}))
    found = _found(lines)
    if not found and not given:
        raise FormatError(_nameless(path, lines))
    at, names, delimiter = found or (-1, [], None)
    if given:
        names = list(given)
    rows = [(number, line) for number, line in _plain(lines, at + 1)]
    units = [""] * len(names)
    if not rows:
        raise FormatError(f"{path}: line {at + 1}: expected rows of numbers below the names of columns, found none")
    start, delimiter = _first_row(path, rows, len(names), delimiter, named=not given)
    if found and not given and start:
        cells = _split(rows[start - 1][1], delimiter)
        if len(cells) == len(names) and all(map(columns.is_unit, cells)):
            units = cells
    rows = rows[start:]
    used = wanted(names)
    numbers = _numbers(path, rows, names, used, delimiter)
    return Table(names, units, numbers, np.array([number for number, _ in rows], np.intp), at + 1 if found else 0)


def rows_of(path: Path, data: bytes, names: Sequence[str]) -> Table:
    """The rows of numbers in a file's bytes whose columns are known: the first ones of `names`, others ignored.

    Raises FormatError where there are no rows, or a row has fewer columns.
    """
    rows = list(_plain(END_OF_LINE.split(text_of(path, data)), 0))
    if not rows:
        raise FormatError(f"{path}: expected rows of numbers, found none")
    first = rows[0][1]
    delimiter = next((each for each in ("\t", ";", ",") if len(_split(first, each)) >= len(names)), None)
    count = len(_split(first, delimiter))
    if count < len(names):
        raise FormatError(f"{path}: line {rows[0][0]}: expected {len(names)} columns, found {count}")
    every = [*names, *("" for _ in range(count - len(names)))]
    numbers = _numbers(path, rows, every, list(range(len(names))), delimiter)
    return Table(every, [""] * count, numbers, np.array([number for number, _ in rows], np.intp), 0)


def _found(lines: Sequence[str]) -> tuple[int, list[str], str | None] | None:
    """The line with the names of columns: its place, the names, and what separates them."""
    for at, line in enumerate(lines):
        plain = re.sub(r"^\s*(?:#|%|//|;|VARS\b)\s*", "", line).strip()
        if len(plain) > LONGEST_NAMES or not HINT.search(plain):
            continue
        best: tuple[int, list[str], str | None] | None = None
        for delimiter in DELIMITERS:
            names = _split_names(plain, delimiter)
            score = sum(map(columns.is_angle, names)) if len(names) > 2 else 0
            if score >= 2 and (best is None or score > best[0]):
                best = score, names, delimiter
        if best:
            return at, best[1], best[2]
    return None


def _split_names(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:  # the space before a unit in brackets, or one that stands alone, separates nothing
        return [name.strip("\"'") for name in re.split(r"\s+(?![(\[]|nm\b|deg\b|rad\b|°)", line)]
    return [name.strip().strip("\"'") for name in line.split(delimiter)]


def _plain(lines: Sequence[str], start: int) -> Iterator[tuple[int, str]]:
    """The lines from a place on, with their numbers from 1, without comments and empty ones."""
    for number, line in enumerate(islice(lines, start, None), start + 1):
        plain = line.split("#")[0] if "#" in line and "#n/a" not in line.lower() else line
        if plain.strip():
            yield number, plain


def _first_row(
    path: Path, rows: Sequence[tuple[int, str]], count: int, delimiter: str | None, *, named: bool
) -> tuple[int, str | None]:
    """The place of the first row of numbers, and what separates its cells.

    named: whether the file names the columns, and does so above `rows`. Then, numbers that are more or fewer than the
    names are a row with a mistake, and no preamble.
    """
    order = [delimiter, *(each for each in DELIMITERS if each != delimiter)]
    first, mistaken = "", False
    for place, (number, line) in enumerate(rows[:MOST_TRIED] if named else rows):
        for each in order:
            cells = _split(line, each)
            found = [cell for cell in cells if _number(cell, each) is not None]
            if len(found) * 2 <= len(cells) or not any(re.search(r"\d", cell) for cell in cells):
                continue
            if len(cells) == count:
                return place, each
            first = first or f"line {number}: expected {count} columns, found {len(cells)}"
            mistaken = mistaken or (named and len(found) >= FEWEST_NUMBERS)
        if mistaken:
            break
    if not first:
        first = f"line {rows[0][0]}: expected a row of {count} numbers, found {rows[0][1].strip()[:40]!r}"
    raise FormatError(f"{path}: {first}")


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    cells: list[str] = line.split(delimiter)
    if '"' in line:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return [cell.strip() for cell in cells]


def _number(cell: str, delimiter: str | None) -> float | None:
    """The number in a cell: NaN where it says that there is none; None for anything else."""
    cell = cell.strip().strip("\"'")
    if cell.lower() in NOTHING:
        return float("nan")
    if "," in cell and delimiter != "," and cell.count(",") == 1 and "." not in cell:
        cell = cell.replace(",", ".")
    try:
        return float(D_EXPONENT.sub("e", cell)) if "_" not in cell else None
    except ValueError:
        return None


def _numbers(
    path: Path, rows: Sequence[tuple[int, str]], names: Sequence[str], used: Sequence[int], delimiter: str | None
) -> NDArray[np.float64]:
    """The numbers in rows: quickly if NumPy can read them all, else cell by cell."""
    quick = _quickly([line for _, line in rows], len(names), used, delimiter)
    if quick is not None and list(used) == list(range(len(names))):
        return quick  # and no second array, which long files would have to find room for
    numbers = np.full((len(rows), len(names)), np.nan)
    if quick is not None:
        numbers[:, used] = quick
        return numbers
    for at, (number, line) in enumerate(rows):
        cells = _split(line, delimiter)
        if len(cells) == len(names) + 1 and not cells[-1]:  # a separator at the end of the line
            cells.pop()
        if len(cells) != len(names):
            if at == len(rows) - 1 and at and not any(_number(cell, delimiter) is not None for cell in cells if cell):
                return numbers[:at]  # a last line of words
            raise FormatError(f"{path}: line {number}: expected {len(names)} columns, found {len(cells)}")
        for column in used:
            found = _number(cells[column], delimiter)
            if found is None:
                raise FormatError(
                    f"{path}: line {number}, column {names[column]}: expected a number, found {cells[column][:40]!r}"
                )
            numbers[at, column] = found
    return numbers


def _quickly(
    lines: Sequence[str], count: int, used: Sequence[int], delimiter: str | None
) -> NDArray[np.float64] | None:
    """The numbers in the columns that are used; None where a row has other columns, or something that is no number."""
    separators = count - 1
    if delimiter and any(line.count(delimiter) != separators for line in lines):
        return None
    if not delimiter and any(len(line.split()) != count for line in lines):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return np.loadtxt(
                lines, np.float64, delimiter=delimiter, usecols=list(used), quotechar='"', ndmin=2, comments=None
            )
    except ValueError:
        return None


def _nameless(path: Path, lines: Sequence[str]) -> str:
    """What is said of a file in which no line names columns of angles."""
    for number, line in enumerate(lines, 1):
        plain = line.strip()
        if plain and not plain.startswith("#"):
            return (
                f"{path}: line {number}: expected the names of columns, as theta_i_deg, phi_i_deg, theta_o_deg, "
                f"phi_o_deg, r, g, b (or --columns with the names of all), found {plain[:60]!r}"
            )
    return f"{path}: expected the names of columns, as theta_i_deg, found no line"
