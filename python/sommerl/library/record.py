"""What a library knows of one of its materials, and how that is written: an object of JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from math import inf, isfinite
from typing import Any, cast

from ..system.errors import FormatError
from ..system.visible import visible

LONGEST_TEXT = 4096  # characters of a name or a path
MOST = 64  # options, or metrics
LARGEST = 2**53  # bytes: JSON's numbers are exact up to there
PLAIN = (str, int, float, bool, type(None))


@dataclass(frozen=True)
class Record:
    """One material of a library.

    name: unique in the library: the source's path below the folder that was compressed, without its extension, parts
        joined by "/"; of a file that holds many, with ":" and the material's name in it, as the loader takes them.
    file: the material's .smrl, relative to the library's folder, parts joined by "/". bytes, sha256: of that file.
    source: what it was compressed from, relative to the folder of sources, as the loader takes it. source_bytes,
        source_sha256: of its file; of all of them in turn where a material is read from several.
    options: that it was compressed with. metrics: how far it is from its source, by the keys of `render.judge.JUDGED`.
    colour, gloss, metalness: see `traits`.
    """

    name: str
    file: str
    bytes: int
    sha256: str
    source: str
    source_bytes: int
    source_sha256: str
    options: Mapping[str, Any]
    metrics: Mapping[str, float]
    colour: tuple[float, float, float]
    gloss: float
    metalness: float


def as_json(record: Record) -> dict[str, Any]:
    """The record as an object of JSON. A PSNR of identical pictures, which is infinite, is null."""
    metrics = {key: None if value == inf else value for key, value in record.metrics.items()}
    return asdict(record) | {"metrics": metrics, "colour": list(record.colour)}


def from_json(found: Any) -> Record:
    """The record of such an object. Raises FormatError for anything else."""
    said = _mapping("a record", found)
    names = [each.name for each in fields(Record)]
    if said.keys() != set(names):
        raise FormatError(f"expected a record with {', '.join(names)}, found {_listed(said)}")
    return Record(
        name=_text("name", said["name"]),
        file=_file(said["file"]),
        bytes=_count("bytes", said["bytes"]),
        sha256=_digest("sha256", said["sha256"]),
        source=_text("source", said["source"]),
        source_bytes=_count("source_bytes", said["source_bytes"]),
        source_sha256=_digest("source_sha256", said["source_sha256"]),
        options=_options(said["options"]),
        metrics=_metrics(said["metrics"]),
        colour=_colour(said["colour"]),
        gloss=_number("gloss", said["gloss"]),
        metalness=_number("metalness", said["metalness"]),
    )


def written(value: Any) -> bytes:
    """The bytes of an object of JSON, always the same for the same object."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def parsed(data: bytes) -> Any:
    """What JSON says. Raises FormatError for what is none, and for numbers that are not finite."""
    try:
        return json.loads(data, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"expected JSON, found something else ({error})") from error


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _mapping(what: str, found: Any) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise FormatError(f"{what}: expected a JSON object, found {type(found).__name__}")
    return cast(dict[str, Any], found)


def _listed(names: Mapping[str, Any]) -> str:
    return ", ".join(visible(name, 40) for name in list(names)[:20]) or "nothing"


def _text(field: str, found: Any) -> str:
    if not (isinstance(found, str) and 0 < len(found) <= LONGEST_TEXT and not re.search("[\0\ud800-\udfff]", found)):
        raise FormatError(f"{field}: expected a text of 1 to {LONGEST_TEXT} characters, found {found!r:.60}")
    return found


def _file(found: Any) -> str:
    """The path of a file below a folder, which leads nowhere else."""
    path = _text("file", found)
    parts = path.split("/")
    if not path.endswith(".smrl") or any(part.startswith(".") or not part or "\\" in part for part in parts):
        raise FormatError(f"file: expected a path of a .smrl below the library's folder, found {found!r:.60}")
    return path


def _count(field: str, found: Any) -> int:
    if type(found) is not int or not 0 <= found <= LARGEST:
        raise FormatError(f"{field}: expected a number of bytes, found {found!r:.60}")
    return found


def _digest(field: str, found: Any) -> str:
    if not isinstance(found, str) or not re.fullmatch("[0-9a-f]{64}", found):
        raise FormatError(f"{field}: expected a SHA-256 in hexadecimal digits, found {found!r:.80}")
    return found


def _number(field: str, found: Any) -> float:
    try:
        if type(found) in (int, float) and isfinite(found):
            return float(found)
    except OverflowError:  # Python's whole numbers have no end
        pass
    raise FormatError(f"{field}: expected a finite number, found {found!r:.60}")


def _options(found: Any) -> dict[str, Any]:
    options = _mapping("options", found)
    if len(options) > MOST or any(len(name) > LONGEST_TEXT or type(options[name]) not in PLAIN for name in options):
        raise FormatError(f"options: expected at most {MOST} texts, numbers, true, false or null, found {found!r:.60}")
    return options


def _metrics(found: Any) -> dict[str, float]:
    metrics = _mapping("metrics", found)
    if len(metrics) > MOST or any(len(name) > LONGEST_TEXT for name in metrics):
        raise FormatError(f"metrics: expected at most {MOST} numbers, found {found!r:.60}")
    return {key: inf if value is None else _number(visible(key, 40), value) for key, value in metrics.items()}


def _colour(found: Any) -> tuple[float, float, float]:
    if not isinstance(found, list) or len(cast(list[Any], found)) != 3:
        raise FormatError(f"colour: expected three numbers, found {found!r:.60}")
    red, green, blue = (_number("colour", value) for value in cast(list[Any], found))
    return red, green, blue
