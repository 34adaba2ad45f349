"""What the commands that render share: options, the environment, and progress that can be resumed."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..render.checkpoint import Checkpoint
from ..render.environment import default_environment, load_environment
from ..render.passes import DEFAULT_SIZE, DEFAULT_SPP, LARGEST_SIZE
from ..system.errors import FormatError
from . import console
from .arguments import WritingArguments, option
from .checks import check_range

SMALLEST_SIZE = 8  # SSIM looks at windows of 7 pixels
MOST_SPP = 2**20
LARGEST_SEED = 2**64 - 1


@dataclass(frozen=True, kw_only=True)
class RenderingArguments(WritingArguments):
    """What every rendering can be asked for; `spp` and `size` are None where they are not given."""

    spp: int | None = option(default=None, metavar="N", help=f"samples a pixel ({DEFAULT_SPP})")
    size: int | None = option(default=None, metavar="N", help=f"width and height in pixels ({DEFAULT_SIZE})")
    seed: int = option(default=0, metavar="N", help="of the random numbers (%(default)s)")
    envmap: Path | None = option(
        default=None, metavar="FILE", help="a latitude-longitude image that lights the scene (a built-in one)"
    )


@dataclass(frozen=True)
class Sampling:
    """How many pixels and samples a rendering has. Raises OptionError for what is out of range."""

    spp: int
    size: int
    seed: int

    def __post_init__(self) -> None:
        check_range("--spp", self.spp, 1, MOST_SPP)
        check_range("--size", self.size, SMALLEST_SIZE, LARGEST_SIZE)
        check_range("--seed", self.seed, 0, LARGEST_SEED)

    @classmethod
    def of(cls, options: RenderingArguments) -> Sampling:
        """What was asked for, and defaults for the rest."""
        spp = DEFAULT_SPP if options.spp is None else options.spp
        return cls(spp, DEFAULT_SIZE if options.size is None else options.size, options.seed)


def check_environment(path: Path | None) -> None:
    """Raises FormatError if there is no such file."""
    if path and not path.is_file():
        raise FormatError(f"{path}: expected an environment image, found no file")


def environment_of(path: Path | None) -> Any:
    """The environment in a file, or the built-in one."""
    return load_environment(path, console.warn) if path else default_environment()


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
