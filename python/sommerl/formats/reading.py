"""How tables of samples are read where the file does not say it: what commands are asked for by options."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from ..system.errors import OptionError

MOST_DROPPED = 0.25


@dataclass(frozen=True)
class Reading:
    """columns: the names of all columns in their order, in place of those in the file; empty to take these.
    max_dropped: the largest share of the rows that may be left out, since they hold no numbers or lie below the
    horizon.

    Raises OptionError for a share that is none.
    """

    columns: tuple[str, ...] = ()
    max_dropped: float = MOST_DROPPED

    def __post_init__(self) -> None:
        if not 0 <= self.max_dropped <= 1:
            raise OptionError(f"max_dropped: expected a share from 0 to 1, found {self.max_dropped:g}")


AS_IT_IS = Reading()
_asked: ContextVar[Reading] = ContextVar("reading", default=AS_IT_IS)


def asked() -> Reading:
    """How tables of samples are read now."""
    return _asked.get()


@contextmanager
def reading(how: Reading) -> Generator[None]:
    """Within the block, tables of samples are read so."""
    before = _asked.set(how)
    try:
        yield
    finally:
        _asked.reset(before)
