"""Cells that measure nothing, for tests of what makes and keeps them: in a module, where other processes find them."""

from pathlib import Path

import numpy as np

from sommerl.reproduction.cells import Cell, Outcome
from sommerl.reproduction.section import webp
from sommerl.system.errors import MaterialError


def counted(setting, folder, name, value):
    """Leaves a line in a file each time that it is made."""
    with (Path(folder) / f"{name}.log").open("a") as out:
        out.write("made\n")
    return Outcome({"value": value, "nothing": float("inf")}, {"grey": webp(np.full((8, 8, 3), 128, np.uint8))})


def refused(setting):
    raise MaterialError("refused: expected another material, found this one")


def cell(folder, name, value=1.0, **about):
    return Cell(name, counted, {"folder": str(folder), "name": name.replace("/", "-"), "value": value}, **about)


def times_made(folder, name):
    path = Path(folder) / f"{name.replace('/', '-')}.log"
    return len(path.read_text().splitlines()) if path.exists() else 0
