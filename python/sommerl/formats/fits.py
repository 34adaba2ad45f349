"""Files of fits, as `sommerl fit` writes them: JSON, an object with "sommerl_fits": 1, the name of the "material", and
its "fits": of each the "model", the "parameters" of its lobes ("family", "albedo" and the numbers of its shape), or of
a standard's surface ("model" and its inputs), and how it came about. A fit is a material: FILE.json:MODEL; without a
name, the first.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from ..models.multi_lobe import FAMILIES, Lobe, MultiLobe
from ..models.standard import Surface
from ..models.standards import STANDARDS
from ..system import door
from ..system.errors import FormatError, MaterialError
from ..system.files import atomic_write
from ..system.visible import visible
from .format import Format

KEY, VERSION = "sommerl_fits", 1
LARGEST_FILE = 2**24  # bytes
MOST_LOBES, LONGEST_NAME = 100, 200


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes is JSON with the key of fits."""
    return head.lstrip().startswith(b"{") and f'"{KEY}"'.encode() in head


def content(material: str, fits: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What such a file holds. fits: of `Fit.as_json`."""
    return {KEY: VERSION, "material": material, "fits": list(fits)}


def write(path: Path, material: str, fits: Sequence[Mapping[str, Any]]) -> None:
    with atomic_write(path) as out:
        out.write(json.dumps(content(material, fits), indent=1, allow_nan=False).encode() + b"\n")


def read(path: str | Path, member: str = "") -> MultiLobe | Surface:
    """One of the fits in a file. member: its model; the first if empty. Raises FormatError."""
    return parse(Path(path), door.read(path, LARGEST_FILE), member)


def parse(path: Path, data: bytes, member: str = "") -> MultiLobe | Surface:
    """As `read`, from the file's bytes; the path is for names and messages alone."""
    top, fits, models = _models(path, data)
    material = _name(path, "material", top.get("material"))
    if member and member not in models:
        raise FormatError(f"{path}: expected one of {', '.join(models[:20])}, found {member}")
    at = models.index(member) if member else 0
    name, parameters = f"{material} ({models[at]} fit)", fits[at].get("parameters")
    try:
        if isinstance(parameters, dict):
            return _surface(path, name, parameters)
        return MultiLobe(name, [_lobe(path, lobe) for lobe in _sequence(path, "parameters", parameters)])
    except MaterialError as error:
        raise FormatError(f"{path}: {error}") from error


def members(path: Path, data: bytes) -> list[str]:
    """The models of the fits in a file. Raises FormatError."""
    return list(dict.fromkeys(_models(path, data)[2]))


def _models(path: Path, data: bytes) -> tuple[dict[str, Any], list[dict[str, Any]], list[str]]:
    """What is in the file, its fits, and the model of each."""
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected JSON, found something else ({error})") from error
    top = _mapping(path, "the file", found)
    if type(top.get(KEY)) is not int or top[KEY] != VERSION:
        what = f"found {top[KEY]!r:.40}" if KEY in top else "found another JSON file"
        raise FormatError(f'{path}: expected fits as `sommerl fit` writes them, with "{KEY}": {VERSION}, {what}')
    fits = [_mapping(path, "fits", fit) for fit in _sequence(path, "fits", top.get("fits"))]
    models = [_name(path, "model", fit.get("model")) for fit in fits]
    if not fits:
        raise FormatError(f"{path}: fits: expected one or more, found none")
    return top, fits, models


def _surface(path: Path, name: str, found: Any) -> Surface:
    inputs = _mapping(path, "parameters", found)
    model = STANDARDS.get(str(inputs.pop("model", None)))
    if model is None:
        raise FormatError(f"{path}: parameters: expected a model of {', '.join(STANDARDS)}, found another or none")
    values = {_name(path, model.name, key): _numbers(path, model.name, value) for key, value in inputs.items()}
    for key, value in values.items():
        if key in model.by_key and model.by_key[key].colour != isinstance(value, tuple):
            what = "three numbers" if model.by_key[key].colour else "a number"
            raise FormatError(f"{path}: {model.name}: {key}: expected {what}, found something else")
    return Surface(name, model, values)


def _numbers(path: Path, field: str, value: Any) -> float | tuple[float, ...]:
    """A number, or a list of them."""
    if isinstance(value, list):
        return tuple(_number(path, field, each) for each in _sequence(path, field, value))
    return _number(path, field, value)


def _lobe(path: Path, found: Any) -> Lobe:
    numbers = _mapping(path, "parameters", found)
    family = FAMILIES.get(str(numbers.pop("family", None)))
    if family is None:
        raise FormatError(f"{path}: parameters: expected a family of {', '.join(FAMILIES)}, found another or none")
    albedo = [_number(path, family.name, value) for value in _sequence(path, "albedo", numbers.pop("albedo", None))]
    shape = {_name(path, family.name, key): _number(path, family.name, value) for key, value in numbers.items()}
    return Lobe(family, cast(tuple[float, float, float], tuple(albedo)), shape)


def _number(path: Path, field: str, value: Any) -> float:
    try:
        if type(value) in (int, float):
            return float(value)
    except OverflowError:  # Python's whole numbers have no end
        pass
    raise FormatError(f"{path}: {field}: expected numbers, found something else")


def _name(path: Path, field: str, value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST_NAME:
        raise FormatError(
            f"{path}: {field}: expected a name of at most {LONGEST_NAME} characters, found something else"
        )
    return visible(value)


def _mapping(path: Path, field: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FormatError(f"{path}: {field}: expected a JSON object, found {type(value).__name__}")
    return dict(cast(dict[str, Any], value))


def _sequence(path: Path, field: str, value: Any) -> list[Any]:
    if not isinstance(value, list) or len(cast(list[Any], value)) > MOST_LOBES:
        raise FormatError(f"{path}: {field}: expected a list of at most {MOST_LOBES}, found something else")
    return cast(list[Any], value)


FORMAT = Format(
    "fits",
    (".json",),
    "analytic models, which `fit` writes; FILE.json:MODEL is one",
    sniff=looks_like,
    read=parse,
    largest=LARGEST_FILE,
    members=members,
)
