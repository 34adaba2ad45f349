"""Materials by name: a file in any known format, told by its content, or a built-in material."""

from __future__ import annotations

from pathlib import Path

from .brdf import Brdf, OnLattice
from .errors import FormatError, MaterialError
from .formats import merl
from .lattice import Interpolation
from .materials import NAMES, builtin
from .som_man import file as smrl
from .table import BrdfTable

HEAD_BYTES = 12


def load(source: str | Path) -> Brdf:
    """The material in a file (MERL table or .smrl), or the built-in one of that name.

    Raises FormatError for a file in no known format, MaterialError for a name that is neither file nor built-in.
    """
    path = Path(source)
    if str(source) in NAMES and not path.is_file():
        return builtin(str(source))
    if not path.exists():
        if path.suffix or len(path.parts) > 1:
            raise FormatError(f"{path}: expected a file, found none")
        return builtin(str(source))  # says which name is nearest
    if path.is_dir():
        raise FormatError(f"{path}: expected a material file, found a directory")
    try:
        with path.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
        if not head:
            raise FormatError(f"{path}: expected a material file, found an empty one")
        if smrl.looks_like(head):
            return smrl.load(path)
        if merl.looks_like(head) or path.suffix == ".binary":
            return merl.read(path)
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from error
    raise FormatError(f"{path}: expected a MERL table (.binary) or a Sommerl material (.smrl), found neither")


def interpolated(brdf: Brdf, interpolation: Interpolation) -> Brdf:
    """The same material, looked up in another way. Raises MaterialError if it is a formula, or there is no such way."""
    if isinstance(brdf, OnLattice):
        return brdf.with_interpolation(interpolation)
    raise MaterialError(f"{brdf.name}: expected a table or a compressed material to look up, found a formula")


def load_table(source: str | Path) -> BrdfTable:
    """The material as a table on its own lattice; a formula is evaluated at the cell centres of MERL's."""
    return BrdfTable.of(load(source))
