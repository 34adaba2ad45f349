"""Where the paper's materials come from, and what the paper says of them."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from ..compression.material import SomManBrdf
from ..compression.paper.options import TrainOptions
from ..compression.paper.train import train
from ..formats.load import load_table
from ..formats.registry import extensions, readable
from ..reflectance.table import BrdfTable
from ..system.errors import FormatError


def expected(item: str) -> dict[str, Any]:
    """What the paper prints for a table or a figure: see expected.toml."""
    text = resources.files("sommerl.reproduction").joinpath("expected.toml").read_text("utf-8")
    return tomllib.loads(text)[item]


def material(data: Path | None, name: str) -> BrdfTable:
    """A material as a table, interpolated.

    data: a folder with a file of that name in any known format, an archive of materials, or None for the built-in
    stand-ins. Raises FormatError if there is none.
    """
    if data is None:
        source = name
    elif data.is_file():
        source = f"{data}:{name}"
    else:
        known = extensions(readable())
        found = [path for extension in known if (path := data / f"{name}{extension}").is_file()]
        if not found:
            raise FormatError(f"{data}: expected a file {name} with one of {', '.join(known)}, found none")
        source = str(found[0])
    return load_table(source)


def compressed(table: BrdfTable, clusters: int, epochs: int = 30) -> SomManBrdf:
    """By the paper's method; looked up by the nearest cell."""
    return train(table, TrainOptions(clusters=clusters, epochs=epochs))[0]
