"""The command `library find`: materials of a library by name, colour, gloss, metalness, or like another one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..formats.load import load
from ..library.finding import Wanted, colour_distance, colour_named, looks, nearest, unlikeness
from ..library.library import Library
from ..library.record import Record
from . import console
from .arguments import Arguments, Material, option, positional, ranged
from .checks import check_range
from .library_rows import COLUMNS, answer, cells, described
from .parser import add_command

MOST = 20
LARGEST_MOST = 2**20
DISTANCES = """Distances:
  --colour: of the material's colour (its albedo at 45°, sRGB) in Oklab, where lightness counts half: below 0.1 most
  would use the same word. --like: the RMS difference of log(f_r + 0.01) at 320 pairs of directions, for which every
  material that is left by the other options is read; some milliseconds each."""


@dataclass(frozen=True, kw_only=True)
class FindArguments(Arguments):
    """What `library find` is asked for."""

    library: str = positional("LIBRARY", help="a folder, a .smrlib file, or the address of one")
    name: str = option(default="", metavar="TEXT", help="a part of the name, or a pattern in quotes, like 'paint/*-0?'")
    gloss: tuple[float, float] | None = option(
        default=None, metavar="LOW..HIGH", read=ranged, help="0 is matte, 1 a mirror"
    )
    metalness: tuple[float, float] | None = option(
        default=None, metavar="LOW..HIGH", read=ranged, help="0 is a matte or coated body, 1 a metal"
    )
    colour: str | None = option(
        default=None, metavar="COLOUR", instead_of="order", help="nearest first: a CSS colour, or digits like #ffcc00"
    )
    like: Material | None = option(
        default=None, metavar="MATERIAL", instead_of="order", help="most alike first: a file or a built-in name"
    )
    most: int = option(default=MOST, metavar="N", help="how many are shown (%(default)s)")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Finds materials of a library by name, colour, gloss and metalness, or those that look like another one."
    example = """sommerl library find paints.smrlib --colour crimson --gloss 0.4..
  sommerl library find paints.smrlib --like nickel --most 5"""
    add_command(add, "find", found, FindArguments, summary, example, explained=[DISTANCES])


def found(options: FindArguments) -> dict[str, Any]:
    check_range("--most", options.most, 1, LARGEST_MOST)
    colour = colour_named(options.colour, "--colour") if options.colour is not None else None
    wanted = Wanted(options.name, options.gloss or (0.0, 1.0), options.metalness or (0.0, 1.0))
    other = looks(load(options.like)) if options.like is not None else None
    with Library(options.library) as library:
        left = [record for record in library.records if record in wanted]
        if other is not None:
            with console.progress("comparing") as advance:
                far = _counted(lambda record: unlikeness(looks(library[record.name]), other), len(left), advance)
                shown = nearest(left, far, options.most)
        elif colour is not None:
            shown = nearest(left, lambda record: colour_distance(record.colour, colour), options.most)
        else:
            shown = [(record, None) for record in left[: options.most]]
        if not options.json:
            _print(shown, len(left))
        rows = [described(library, record) | {"distance": far} for record, far in shown]
        return answer(rows, library, count=len(left))


def _counted(
    distance: Callable[[Record], float], total: int, advance: console.Advance | None
) -> Callable[[Record], float]:
    """A distance that says how many it has been asked for."""
    done = 0

    def counted(record: Record) -> float:
        nonlocal done
        done += 1
        if advance:
            advance(done, total)
        return distance(record)

    return counted


def _print(shown: Sequence[tuple[Record, float | None]], count: int) -> None:
    if not shown:
        console.say("No material is like that.")
        return
    ranked = shown[0][1] is not None
    rows = [cells(record) + ([] if far is None else [f"{far:.3f}"]) for record, far in shown]
    title = f"{len(shown)} of {count} materials" if len(shown) < count else f"{count} materials"
    console.print_table(title, (*COLUMNS, *(["distance"] if ranked else [])), rows)
