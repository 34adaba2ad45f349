"""The index of a file of many materials (.smrlib): what is known of each without reading it, and where it is.

docs/format.md specifies every byte.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...system.errors import FormatError, SommerlError
from ...system.near import did_you_mean
from ...system.sealed_file import DIGEST_BYTES, deflated, inflated
from . import file, notes

INDEX_HEAD = struct.Struct("<IBIII")  # materials, metrics; bytes of common parts, of names, of sources
SMRL, PART = 0, 1  # kinds of a material: the bytes of a .smrl file; what is its own beside what is shared
LONGEST_TEXT = 2**14  # bytes of a name, or of a source, in UTF-8
LONGEST_COMMON = 2**20  # bytes of options and names of metrics
MOST_INFLATED, MOST_FOLD = 2**28, 64  # bytes of the index, inflated; and in units of the file's length
PARTS = 10_000  # of 1, in which colour, gloss and metalness are stored
LARGEST_PART = 2**16 - 1
DIGITS = 6  # of metrics, which are stored in single precision
# Of each material, column after column; after these come the metrics, in single precision.
COLUMNS: tuple[tuple[str, str, int], ...] = (
    ("name_length", "<u2", 1),
    ("source_length", "<u2", 1),
    ("length", "<u4", 1),
    ("crc", "<u4", 1),
    ("kind", "<u1", 1),
    ("options", "<u2", 1),
    ("source_bytes", "<u8", 1),
    ("source_sha256", "<u1", DIGEST_BYTES),
    ("traits", "<u2", 5),
)
ROW = sum(np.dtype(kind).itemsize * count for _, kind, count in COLUMNS)  # bytes, without metrics


@dataclass(frozen=True)
class Entry:
    """What the index says of a material: see `library.record`. `bytes` is of its part of the file."""

    name: str
    source: str = ""
    source_bytes: int = 0
    source_sha256: str = ""
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    metrics: Mapping[str, float] = field(default_factory=dict[str, float])
    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gloss: float = 0.0
    metalness: float = 0.0
    bytes: int = 0


def written(entries: Sequence[Entry], known: Mapping[str, NDArray[Any]]) -> bytes:
    """The bytes of the index. known: some of its columns."""
    metrics = sorted({name for entry in entries for name in entry.metrics})
    told = [_compact(entry.options) for entry in entries]
    options = sorted(set(told))
    numbers = {text: number for number, text in enumerate(options)}
    names = [_text(entry.name, entry.name) for entry in entries]
    sources = [_text(entry.name, entry.source) for entry in entries]
    rows = [(*entry.colour, entry.gloss, entry.metalness) for entry in entries]
    columns: dict[str, Any] = {
        "name_length": [len(name) for name in names],
        "source_length": [len(source) for source in sources],
        **known,
        "options": [numbers[text] for text in told],
        "source_bytes": [entry.source_bytes for entry in entries],
        "source_sha256": [list(_digest(entry)) for entry in entries],
        "traits": np.rint(np.clip(np.nan_to_num(np.array(rows, np.float64)) * PARTS, 0, LARGEST_PART)),
    }
    values = [[entry.metrics.get(name, np.nan) for entry in entries] for name in metrics]
    common = f'{{"metrics":{_compact(metrics)},"options":[{",".join(options)}]}}'.encode()
    head = INDEX_HEAD.pack(len(entries), len(metrics), len(common), sum(map(len, names)), sum(map(len, sources)))
    try:
        parts = [np.array(columns[name], kind).T.tobytes() for name, kind, _ in COLUMNS]
    except OverflowError as error:
        raise FormatError("expected at most 65,536 sets of options, and sources of at most 2⁶⁴ bytes") from error
    with np.errstate(over="ignore"):
        payload = b"".join((*parts, np.array(values, "<f4").tobytes(), common, *names, *sources))
    return head + deflated(payload)


def _compact(value: Any) -> str:
    try:
        return json.dumps(value, sort_keys=True, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    except (TypeError, ValueError, RecursionError) as error:
        raise FormatError(f"expected options that JSON can hold, found others ({error})") from error


def _text(name: str, text: str) -> bytes:
    try:
        data = text.encode()
    except UnicodeEncodeError:
        raise FormatError(f"{name}: expected a name and a source that UTF-8 can hold, found others") from None
    if len(data) > LONGEST_TEXT:
        raise FormatError(f"{name:.60}: expected names and sources of at most {LONGEST_TEXT} bytes, found {len(data)}")
    return data


def _digest(entry: Entry) -> bytes:
    try:
        data = bytes.fromhex(entry.source_sha256) or bytes(DIGEST_BYTES)
    except ValueError:
        data = b""
    if len(data) != DIGEST_BYTES:
        raise FormatError(f"{entry.name}: expected a SHA-256 in hexadecimal digits, found {entry.source_sha256!r}")
    return data


class Index:
    """The index of such a file: its materials in the order of their names' bytes, by their numbers.

    data: of the section. total: bytes of all materials. length: of the file, which bounds what the index may take.
    shared: whether the file has what materials share.
    """

    def __init__(self, data: bytes, total: int, length: int, shared: bool = False) -> None:
        if len(data) < INDEX_HEAD.size:
            raise FormatError(f"expected an index of at least {INDEX_HEAD.size} bytes, found {len(data)}")
        count, metrics, common, names, sources = INDEX_HEAD.unpack_from(data)
        size = count * (ROW + 4 * metrics) + common + names + sources
        if size > min(MOST_INFLATED, MOST_FOLD * length) or common > LONGEST_COMMON:
            raise FormatError(f"expected an index that fits a file of {length} bytes, found one of {size}")
        payload = inflated(data[INDEX_HEAD.size :], size)
        self._count, at = count, 0
        columns: dict[str, NDArray[Any]] = {}
        for name, kind, width in COLUMNS:
            columns[name] = np.frombuffer(payload, kind, count * width, at).reshape(width, count)
            at += columns[name].nbytes
        self._columns = {name: column[0] if len(column) == 1 else column for name, column in columns.items()}
        self._metrics = np.frombuffer(payload, "<f4", count * metrics, at).reshape(metrics, count)
        at += self._metrics.nbytes
        self._metric_names, self._options = _common(payload[at : at + common], metrics)
        self._texts = payload[at + common :]
        self._names = _ends(self._columns["name_length"], 0, names)
        self._sources = _ends(self._columns["source_length"], names, names + sources)
        self._places = _ends(self._columns["length"], 0, total)
        self._check(PART if shared else SMRL)

    def _check(self, last_kind: int) -> None:
        """Raises FormatError for names that are not UTF-8, empty, or not in order, and for numbers out of range."""
        names = [self._name(number) for number in range(self._count)]
        if any(a >= b for a, b in pairwise(names)) or b"" in names[:1]:
            raise FormatError("expected different names, sorted by their bytes, found others")
        kinds, options = self._columns["kind"], self._columns["options"]
        if (kinds > last_kind).any():
            known = f"{SMRL}" if last_kind == SMRL else f"{SMRL} or {PART}"
            found = f"found kind {kinds.max()}; a newer Sommerl may read it"
            raise FormatError(f"expected materials of kind {known}, {found}")
        if self._count and options.max() >= len(self._options):
            raise FormatError(f"expected numbers of options below {len(self._options)}, found {options.max()}")
        texts = (self._columns[name].max(initial=0) for name in ("name_length", "source_length"))
        if max(texts) > LONGEST_TEXT or self._columns["length"].max(initial=0) > file.LONGEST_FILE:
            raise FormatError(
                f"expected texts of at most {LONGEST_TEXT} bytes, and materials that are read, found longer"
            )
        _decoded(self._texts)

    def __len__(self) -> int:
        return self._count

    def _name(self, number: int) -> bytes:
        return self._texts[self._names[number] : self._names[number + 1]]

    def names(self) -> list[str]:
        """All names, in order."""
        return [_decoded(self._name(number)) for number in range(self._count)]

    def number(self, name: str) -> int | None:
        """The number of a material, found by bisection; None if there is none of that name."""
        wanted, low, high = name.encode("utf-8", "surrogatepass"), 0, self._count
        while low < high:
            middle = (low + high) // 2
            if self._name(middle) < wanted:
                low = middle + 1
            else:
                high = middle
        return low if low < self._count and self._name(low) == wanted else None

    def no_such(self, name: str) -> str:
        """What to say of a name that there is not."""
        names = self.names()
        hint = did_you_mean(name, names) or (f"; it has {', '.join(names[:5])}" if names else "; it is empty")
        more = ", …" if hint.startswith("; it has") and len(names) > 5 else ""
        return f"expected a material in it, found none of the name {name}{hint}{more}"

    def place(self, number: int) -> tuple[int, int, int]:
        """Where a material begins in the section of materials, its length, and its CRC-32."""
        start, end = self._places[number], self._places[number + 1]
        return start, end - start, int(self._columns["crc"][number])

    def kind(self, number: int) -> int:
        """How a material is written: SMRL, or PART."""
        return int(self._columns["kind"][number])

    def entry(self, number: int) -> Entry:
        """All that the index says of a material."""
        columns = self._columns
        traits = [int(part) / PARTS for part in columns["traits"][:, number]]
        digest = columns["source_sha256"][:, number].tobytes()
        measured = zip(self._metric_names, self._metrics[:, number].tolist(), strict=True)
        return Entry(
            name=_decoded(self._name(number)),
            source=_decoded(self._texts[self._sources[number] : self._sources[number + 1]]),
            source_bytes=int(columns["source_bytes"][number]),
            source_sha256=digest.hex() if any(digest) else "",
            options=self._options[int(columns["options"][number])],
            metrics={name: float(f"{value:.{DIGITS}g}") for name, value in measured if not isnan(value)},
            colour=(traits[0], traits[1], traits[2]),
            gloss=traits[3],
            metalness=traits[4],
            bytes=self.place(number)[1],
        )


def _decoded(text: bytes) -> str:
    try:
        found = text.decode()
    except UnicodeDecodeError as error:
        raise FormatError("expected names and sources in UTF-8, found other bytes") from error
    if "\0" in found:
        raise FormatError("expected names and sources without zero bytes, found some")
    return found


def _ends(lengths: NDArray[Any], first: int, last: int) -> list[int]:
    """Where each of several things begins that lie one after the other, and where the last one ends.

    Raises FormatError if they do not fill what lies between `first` and `last`.
    """
    ends = (first + np.concatenate([[0], np.cumsum(lengths, dtype=np.uint64)]).astype(np.int64)).tolist()
    if ends[-1] != last:
        raise FormatError(f"expected parts of {last - first} bytes together, found {ends[-1] - first}")
    return ends


def _common(data: bytes, metrics: int) -> tuple[list[str], list[dict[str, Any]]]:
    """The names of metrics, and the sets of options."""
    try:
        found = json.loads(data)
        names, options = found["metrics"], found["options"]
        for each in options:
            notes.check(each, dict.fromkeys(names, 0.0))
        if len(names) == metrics == len(set(names)):
            return list(names), list(options)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, SommerlError):
        pass
    raise FormatError(f"expected the names of {metrics} metrics and objects of options, found others")
