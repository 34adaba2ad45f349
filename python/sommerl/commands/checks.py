"""What commands check before they start, and what several of them do."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..formats.names import split_member
from ..formats.registry import by_extension, readable
from ..render.checkpoint import Checkpoint
from ..render.environment import default_environment, load_environment
from ..render.passes import LARGEST_SIZE
from ..system.errors import FormatError, OptionError
from ..system.files import check_writable
from . import console

SMALLEST_SIZE = 8  # SSIM looks at windows of 7 pixels
MOST_SPP = 2**20


def stem(source: str) -> str:
    path, member = split_member(source)
    return member or (path.stem if by_extension(readable(), path) else path.name)


def check_output(path: Path, extensions: tuple[str, ...], *sources: str | Path | None) -> None:
    """Says before long work what would go wrong after it. sources: what is read, and so not to be written."""
    if path.suffix.lower() not in extensions:
        raise OptionError(f"{path}: expected a name that ends in {' or '.join(extensions)}, found {path.suffix!r}")
    check_apart(path, *sources)
    check_writable(path)


def check_apart(path: Path, *sources: str | Path | None) -> None:
    """Raises OptionError if a file that is to be written is one of those that are read."""
    for source in sources:
        file = split_member(source)[0] if source else None
        if file and path.exists() and file.exists() and path.samefile(file):
            raise OptionError(f"{path}: expected an output other than the input")


def check_range(name: str, value: int, low: int, high: int) -> None:
    """Raises OptionError for a number out of range."""
    if not low <= value <= high:
        raise OptionError(f"{name}: expected {low} to {high}, found {value}")


def check_rendering(options: Namespace) -> None:
    """Checks the options that all renderings have."""
    for name, low, high in (("spp", 1, MOST_SPP), ("size", SMALLEST_SIZE, LARGEST_SIZE), ("seed", 0, 2**64 - 1)):
        check_range(name, getattr(options, name), low, high)
    if options.envmap and not options.envmap.is_file():
        raise FormatError(f"{options.envmap}: expected an environment image, found no file")


@contextmanager
def goes_on_from(checkpoint: Checkpoint) -> Generator[console.Advance | None]:
    """A progress bar for a render; if that is interrupted, it is said whether it can go on."""
    try:
        with console.progress("rendering") as advance:
            yield advance
    except KeyboardInterrupt:
        if checkpoint.holds:
            console.tell(f"{checkpoint.path}: from here, the same command goes on")
        raise


def environment_of(options: Namespace, warn: Callable[[str], None]) -> Any:
    """The environment asked for, or the built-in one."""
    return load_environment(options.envmap, warn) if options.envmap else default_environment()
