"""Materials by name: a file in any known format, recognised by its content, or a built-in material."""

from __future__ import annotations

import os
from pathlib import Path

from ..models.builtin import NAMES, builtin
from ..reflectance.brdf import Brdf
from ..reflectance.table import BrdfTable
from ..system import door
from ..system.errors import FormatError
from .names import split_member
from .registry import recognised


def load(source: str | Path) -> Brdf:
    """The material in a file of any known format, recognised by its content, or the built-in one of that name.

    Of a library of materials, "FILE.smrlib:NAME" is one; of an archive of neural BRDFs, "FILE.npz:NAME"; of a file of
    fits, "FILE.json:MODEL". Raises FormatError for a file in no known format, MaterialError for a name that is neither
    file nor built-in.

    >>> load("nickel").name
    'nickel (SGD stand-in)'
    """
    path, member = split_member(source)
    if not os.path.isfile(path) and str(source) in NAMES:
        return builtin(str(source))
    if not os.path.exists(path) and not path.suffix and len(path.parts) == 1:
        return builtin(str(source))  # says which name is nearest
    with door.opened(path) as file:
        if not file.head:
            raise FormatError(f"{path}: expected a material file, found an empty one")
        kind = recognised(path, file.head)
        if member and not kind.members:
            raise FormatError(f"{path}: expected an archive of materials, to take {member} from it, found one material")
        assert kind.read
        content = kind.content(file)
        return kind.read(path, content, member) if kind.members else kind.read(path, content)


def load_table(source: str | Path) -> BrdfTable:
    """The material as a table on its own lattice; a formula is evaluated at the cell centres of MERL's.

    >>> load_table("nickel").values.shape
    (90, 90, 180, 3)
    """
    return BrdfTable.of(load(source))
