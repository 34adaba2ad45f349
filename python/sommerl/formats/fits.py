"""Files of fits, as `sommerl fit` writes them: JSON, an object with "sommerl_fits": 1, the name of the "material", and
its "fits": of each the "model", the "parameters" of its lobes ("family", "albedo" and the numbers of its shape) and
how it came about. A fit is a material: FILE.json:MODEL; without a name, the first.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from ..errors import FormatError, MaterialError
from ..files import atomic_write
from ..models.multi_lobe import FAMILIES, Lobe, MultiLobe

KEY, VERSION = "sommerl_fits", 1
LARGEST_FILE = 2**24  # bytes
MOST_LOBES = 100


def looks_like(head: bytes) -> bool:
    return head.lstrip().startswith(b"{") and f'"{KEY}"'.encode() in head


def content(material: str, fits: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What such a file holds. fits: of `Fit.as_json`."""
    return {KEY: VERSION, "material": material, "fits": list(fits)}


def write(path: Path, material: str, fits: Sequence[Mapping[str, Any]]) -> None:
    with atomic_write(path) as out:
        out.write(json.dumps(content(material, fits), indent=1, allow_nan=False).encode() + b"\n")


def read(path: str | Path, member: str = "") -> MultiLobe:
    """One of the fits in a file. member: its model; the first if empty. Raises FormatError."""
    path = Path(path)
    if path.stat().st_size > LARGEST_FILE:
        raise FormatError(f"{path}: expected at most {LARGEST_FILE} bytes, found {path.stat().st_size}")
    try:
        found = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected JSON, found something else ({error})") from error
    top = _mapping(path, "the file", found)
    if top.get(KEY) != VERSION:
        raise FormatError(f"{path}: {KEY}: expected {VERSION}, found {top.get(KEY)!r:.40}")
    fits = [_mapping(path, "fits", fit) for fit in _sequence(path, "fits", top.get("fits"))]
    models = [str(fit.get("model")) for fit in fits]
    if not fits:
        raise FormatError(f"{path}: fits: expected one or more, found none")
    if member and member not in models:
        raise FormatError(f"{path}: expected one of {', '.join(models)}, found {member}")
    at = models.index(member) if member else 0
    try:
        lobes = [_lobe(path, lobe) for lobe in _sequence(path, "parameters", fits[at].get("parameters"))]
        return MultiLobe(f"{top.get('material')} ({models[at]} fit)", lobes)
    except MaterialError as error:
        raise FormatError(f"{path}: {error}") from error


def _lobe(path: Path, found: Any) -> Lobe:
    numbers = _mapping(path, "parameters", found)
    family = FAMILIES.get(str(numbers.pop("family", None)))
    if family is None:
        raise FormatError(f"{path}: parameters: expected a family of {', '.join(FAMILIES)}, found another or none")
    albedo = _sequence(path, "albedo", numbers.pop("albedo", None))
    if not all(type(value) in (int, float) for value in (*albedo, *numbers.values())):
        raise FormatError(f"{path}: {family.name}: expected numbers, found something else")
    return Lobe(family, cast(tuple[float, float, float], tuple(albedo)), numbers)


def _mapping(path: Path, field: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FormatError(f"{path}: {field}: expected a JSON object, found {type(value).__name__}")
    return dict(cast(dict[str, Any], value))


def _sequence(path: Path, field: str, value: Any) -> list[Any]:
    if not isinstance(value, list) or len(cast(list[Any], value)) > MOST_LOBES:
        raise FormatError(f"{path}: {field}: expected a list of at most {MOST_LOBES}, found something else")
    return cast(list[Any], value)
