"""Finds the paper's materials, and the numbers that the paper prints for them."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any, TypedDict, Unpack

from ..compression.material import SomManBrdf
from ..compression.paper.options import Rule, TrainOptions
from ..compression.paper.train import train
from ..formats.load import load_table
from ..formats.registry import extensions, readable
from ..reflectance.table import BrdfTable
from ..system.errors import FormatError


class Learnt(TypedDict, total=False):
    """The options of `train` by which the two ways of learning differ."""

    rule: Rule
    alpha: float


#: By what they are called. The paper prints no rate for its equation; docs/method.md has the experiment.
RULES: dict[str, Learnt] = {"default": {}, "Eq. 2 as printed": {"rule": "paper", "alpha": 0.5}}


def expected(item: str) -> dict[str, Any]:
    """The numbers that the paper prints, from expected.toml. item: "table1", "fig5" or "fig6"."""
    text = resources.files("sommerl.reproduction").joinpath("expected.toml").read_text("utf-8")
    return tomllib.loads(text)[item]


def material(data: Path | None, name: str) -> BrdfTable:
    """A material as a table with trilinear lookup.

    data: a folder that holds a file of that name in any known format, or an archive of materials (.npz); None for the
    built-in stand-ins. Raises FormatError if there is no such file.
    """
    if data is None:
        source = name
    elif data.is_file():
        source = f"{data}:{name}"
    else:
        known = extensions(readable())
        found = [path for extension in known if (path := data / f"{name}{extension}").is_file()]
        if not found:
            raise FormatError(f"{data}: there is no file {name} in it that ends in one of {', '.join(known)}")
        source = str(found[0])
    return load_table(source)


def described(data: Path | None) -> str:
    """What the materials in `data` are, as captions say it."""
    if data is None:
        return "built-in SGD stand-ins"
    return f"NBRDF stand-ins of {data.name}" if data.is_file() else f"the files in {data.absolute().name}"


def compressed(table: BrdfTable, clusters: int, epochs: int = 30, **rule: Unpack[Learnt]) -> SomManBrdf:
    """The table, compressed with the preset `paper` and nearest lookup. rule: one of RULES."""
    return train(table, TrainOptions(clusters=clusters, epochs=epochs, **rule))[0]
