"""What commands check before they start, so that it is not found after long work."""

from __future__ import annotations

from pathlib import Path

from ..formats.names import split_member
from ..system.errors import OptionError
from ..system.files import check_writable
from .folders import make_folder


def check_output(path: Path, extensions: tuple[str, ...], *sources: str | Path | None) -> None:
    """Raises OptionError or OSError if a file cannot be written; makes the folder that it is to be in.

    extensions: those that its name may have. sources: files that the command reads, which are never written over.
    """
    if path.suffix.lower() not in extensions:
        raise OptionError(f"{path}: expected a name that ends in {' or '.join(extensions)}, found {path.suffix!r}")
    check_apart(path, *sources)
    make_folder(path.parent)
    check_writable(path)


def check_apart(path: Path, *sources: str | Path | None) -> None:
    """Raises OptionError if a file that is to be written is one of those that are read."""
    for source in sources:
        file = split_member(source)[0] if source else None
        if file and path.exists() and file.exists() and path.samefile(file):
            raise OptionError(f"{path}: expected an output other than the input")


def check_range(name: str, value: int, low: int, high: int) -> None:
    """Raises OptionError for a number out of range. name: the option, as it is typed."""
    if not low <= value <= high:
        raise OptionError(f"{name}: expected {low} to {high}, found {value}")
