"""What the command line prints: progress, tables of values, sizes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..system.visible import visible

Advance = Callable[[int, int], None]
INTERVAL = 10.0  # seconds between lines about long work, where there is no terminal for a bar


def say(*lines: str) -> None:
    """Lines on standard output, as they can be shown: see `visible`."""
    for line in lines:
        print(visible(line))


def tell(line: str) -> None:
    """A line on standard error, as it can be shown. If that takes nothing, nobody is told: no reason to stop."""
    with suppress(OSError):
        print(visible(line), file=sys.stderr)


class Warnings:
    """Tells on standard error what is not as expected, and keeps it: `told`."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def __call__(self, sentence: str) -> None:
        self.told.append(visible(sentence))
        tell(f"warning: {sentence}")


warn = Warnings()  #: all warnings of the command that runs; the command line empties it before


def wrote(paths: Iterable[Path | str]) -> None:
    """Says which files were written."""
    say("Wrote " + ", ".join(map(str, paths)))


@contextmanager
def progress(what: str) -> Generator[Advance | None]:
    """Says on standard error how far work has come: a function of steps done and steps in all.

    A bar if that is a terminal; else a line every INTERVAL seconds, so that a log says what takes long.
    """
    if not sys.stderr.isatty():
        yield _lines(what)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.percentage:>3.0f} %")
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(visible(what), total=None)

        def advance(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield advance


def _lines(what: str) -> Advance:
    """Tells how far work has come, in a line every INTERVAL seconds."""
    started = last = time.monotonic()

    def advance(done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if done < total and now - last >= INTERVAL:
            last = now
            left = (now - started) * (total - done) / done if done else 0
            more = f", some {left:.0f} s left" if done else ""
            tell(f"{what}: {done / total:.0%} after {now - started:.0f} s{more}")

    return advance


def print_rows(title: str, rows: Mapping[str, str]) -> None:
    """A table of names and values on standard output."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(visible(title)), show_header=False, title_justify="left")
    table.add_column()
    table.add_column(justify="right", overflow="fold")
    for name, value in rows.items():
        table.add_row(Text(visible(name)), Text(visible(value)))
    Console().print(table)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table with a head on standard output; the first column to the left, the others to the right."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(visible(title)), title_justify="left")
    for number, name in enumerate(columns):
        table.add_column(Text(name), justify="right" if number else "left", overflow="fold")
    for row in rows:
        table.add_row(*(Text(visible(cell)) for cell in row))
    Console().print(table)


def size(count: int) -> str:
    """A number of bytes, in the units of 1000 that file sizes are given in."""
    if count < 1000:
        return f"{count} B"
    return f"{count / 1e3:.1f} kB" if count < 1e6 else f"{count / 1e6:.2f} MB"
