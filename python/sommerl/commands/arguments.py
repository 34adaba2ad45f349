"""The arguments of a command as a dataclass: each field is one, of the field's type.

`option` and `positional` say the rest of a field: its help, its default. `add_to` adds the fields to a parser, and
`read` makes the dataclass of what argparse found: its `Namespace` goes no further than that.
"""

from __future__ import annotations

import re
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable, Collection, Generator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields
from fractions import Fraction
from typing import Any, Literal, NewType, TypeVar, get_args, get_origin, get_type_hints

from ..formats.prior import FEWEST, MOST
from ..formats.reading import MOST_DROPPED, PhiFrom, Values
from ..system import threads
from ..system.errors import OptionError

T = TypeVar("T")

Material = NewType("Material", str)  #: as it was given: a file, or the name of a built-in one

UNITS = {"": 1, "b": 1, "kb": 1000, "mb": 1000_000}


def option(
    *short: str,
    help: str,
    default: Any = MISSING,
    metavar: str | None = None,
    choices: Collection[str] | None = None,
    read: Callable[[str], Any] | None = None,
    instead_of: str | None = None,
) -> Any:
    """A field that is an option, --like-its-name; one without a default has to be given.

    short: its other names. choices: those of a `Literal` by themselves; a table whose names they are, so that new rows
    are among them. read: what makes a value of the text, where the type does not say it. instead_of: names a group of
    options of which one may be given.
    """
    flags: dict[str, Any] = {"short": short, "help": help, "metavar": metavar, "choices": choices, "read": read}
    return field(default=default, metadata={**flags, "instead_of": instead_of})


def positional(metavar: str, *, help: str, default: Any = MISSING, choices: Collection[str] | None = None) -> Any:
    """A field that is an argument without a name; a tuple takes any number, at least one if there is no default."""
    return field(default=default, metadata={"positional": metavar, "help": help, "choices": choices})


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """What every command can be asked for."""

    json: bool = option(default=False, help="print one JSON object and nothing else (docs/json.md)")
    threads: str | None = option(
        default=None,
        metavar="N",
        help=f"the most that work at once ({threads.VARIABLE}; if not set, as many as there are processors)",
    )


@dataclass(frozen=True, kw_only=True)
class WritingArguments(Arguments):
    """What every command that writes files can be asked for."""

    overwrite: bool = option(default=False, help="replace files that Sommerl did not write, and measurements, too")


@dataclass(frozen=True, kw_only=True)
class ReadingArguments(Arguments):
    """What commands that read tables of samples can be asked for."""

    columns: tuple[str, ...] | None = option(
        default=None,
        metavar="NAME,NAME,…",
        read=lambda text: names(text),
        help="of tables of samples: the names of all columns in their order, in place of those in the file, as "
        "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b",
    )
    max_dropped: float = option(
        default=MOST_DROPPED,
        metavar="SHARE",
        help="of tables of samples: the most rows that are left out, without numbers or below the horizon",
    )
    values: Values = option(
        default="f_r",
        help="of tables of samples: what values are: f_r [1/sr], f_r times cos θ_o, or reflectance factors, π f_r, "
        "also in percent (%(default)s)",
    )
    phi_from: PhiFrom = option(
        default="retro",
        help="of tables of samples: where the viewer's azimuth is 0: on the side of the light, or of the mirror's "
        "direction (%(default)s)",
    )
    prior: bool = option(
        default=False,
        help=f"of tables of {FEWEST} to {MOST} samples: estimate what was not measured from 99 known materials",
    )


def flag(name: str) -> str:
    """An option as it is typed, of the name of its field; a word of Python's, like `from_`, ends in an underscore."""
    return f"--{name.rstrip('_').replace('_', '-')}"


@contextmanager
def named_as_typed() -> Generator[None]:
    """Within the block, errors of the library name an option as it is typed: "--target-size", not "target_size".

    Only for calls whose OptionErrors all begin with the name of a parameter.
    """
    try:
        yield
    except OptionError as error:
        raise OptionError(re.sub(r"^\w+(?=: )", lambda found: flag(found[0]), str(error))) from error


def library_options(kind: Callable[..., T], arguments: Arguments) -> T:
    """The library's options, a dataclass, from the arguments that have the same names. Raises OptionError."""
    with named_as_typed():
        return kind(**{each.name: getattr(arguments, each.name) for each in fields(kind)})  # pyright: ignore


def add_to(parser: Any, kind: type[Arguments]) -> None:
    """Adds the fields of a dataclass to a parser."""
    types = get_type_hints(kind)
    groups: dict[str, Any] = {}
    for each in fields(kind):
        names, settings = _argument(each, types[each.name])
        group = each.metadata.get("instead_of")
        if group and group not in groups:
            groups[group] = parser.add_mutually_exclusive_group()
        (groups[group] if group else parser).add_argument(*names, **settings)


def read(kind: type[T], found: Namespace) -> T:
    """The dataclass of what argparse found."""
    values = {each.name: getattr(found, each.name) for each in fields(kind)}  # pyright: ignore
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})  # pyright: ignore


def _argument(each: Field[Any], hint: Any) -> tuple[tuple[str, ...], dict[str, Any]]:
    """What argparse is told of a field: names, and settings."""
    about: Mapping[str, Any] = each.metadata
    settings: dict[str, Any] = {"help": about["help"]}
    if each.default is not MISSING:
        settings["default"] = each.default
    several = get_origin(hint) is tuple
    if hint is bool:
        return (*about["short"], flag(each.name)), settings | {"action": "store_true", "dest": each.name}
    kind = get_args(hint)[0] if several else _without_none(hint)
    choices = about["choices"] or (get_args(kind) if get_origin(kind) is Literal else None)
    if choices:
        settings["choices"] = choices
    elif kind is not str:
        settings["type"] = about.get("read") or READERS.get(kind, kind)
    if "positional" in about:
        if several:
            settings |= {"nargs": "+" if each.default is MISSING else "*"}
        elif each.default is not MISSING:
            settings |= {"nargs": "?"}
        return (each.name,), settings | {"metavar": about["positional"]}
    if several:
        settings |= {"action": "append", "default": []}
    if about["metavar"]:
        settings["metavar"] = about["metavar"]
    return (*about["short"], flag(each.name)), settings | {
        "required": each.default is MISSING,
        "dest": each.name,
    }


def _without_none(hint: Any) -> Any:
    """X, of X | None."""
    kinds = [kind for kind in get_args(hint) if kind is not type(None)]
    return kinds[0] if get_origin(hint) is not Literal and kinds and type(None) in get_args(hint) else hint


def whole_number(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ArgumentTypeError(f"expected a whole number, found {text}") from None


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ArgumentTypeError(f"expected a number, found {text}") from None


def names(text: str) -> tuple[str, ...]:
    """Names between commas."""
    found = tuple(word.strip() for word in text.split(","))
    if not all(found):
        raise ArgumentTypeError(f"expected names between commas, found {text}")
    return found


def byte_count(text: str) -> int:
    """A size, like 8000, 8kB or 2.7 kB; kB = 1000 bytes."""
    found = re.fullmatch(r"(\d{1,12}(?:\.\d{1,12})?) ?([kM]?B)?", text, re.ASCII | re.IGNORECASE)
    count = Fraction(found[1]) * UNITS[(found[2] or "").lower()] if found else Fraction(1, 2)
    if count.denominator != 1:
        raise ArgumentTypeError(f"expected a number of bytes, like 8000 or 8kB, found {text}")
    return int(count)


def ranged(text: str) -> tuple[float, float]:
    """LOW..HIGH, or one of the two, from 0 to 1."""
    low, _, high = text.partition("..")
    try:
        found = float(low or 0), float(high or 1)
    except ValueError:
        found = 1.0, 0.0
    if ".." not in text or not 0 <= found[0] <= found[1] <= 1:
        raise ArgumentTypeError(f"expected LOW..HIGH from 0 to 1, like 0.5..1 or ..0.2, found {text}")
    return found


def several(read: Callable[[str], int]) -> Callable[[str], tuple[int, ...]]:
    """What reads numbers between commas, of each of which `read` makes one."""

    def all_of(text: str) -> tuple[int, ...]:
        words = [word.strip() for word in text.split(",")]
        if not all(words):
            raise ArgumentTypeError(f"expected numbers between commas, found {text}")
        return tuple(map(read, words))

    return all_of


READERS: dict[Any, Callable[[str], Any]] = {int: whole_number, float: number}
