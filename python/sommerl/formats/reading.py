"""How tables of samples are read where the file does not say it: what commands are asked for by options."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Literal

from ..system.errors import OptionError

MOST_DROPPED = 0.25

Values = Literal["f_r", "f_r-cos", "reflectance-factor"]
PhiFrom = Literal["retro", "specular"]


@dataclass(frozen=True)
class Reading:
    """columns: the names of all columns in their order, in place of those in the file; empty to take these.
    max_dropped: the largest share of the rows that may be left out, since they hold no numbers or lie below the
    horizon. values: what these are: f_r [1/sr]; f_r-cos, f_r times the cosine of the viewer's angle; or
    reflectance-factor, π f_r, also in percent, which its size tells. phi_from: where the viewer's azimuth is 0: on the
    side of the light (retro), or of the mirror's direction (specular). prior: whether what was not measured is
    estimated from what is known of other materials (`prior`), for few samples.

    Raises OptionError for a share that is none.
    """

    columns: tuple[str, ...] = ()
    max_dropped: float = MOST_DROPPED
    values: Values = "f_r"
    phi_from: PhiFrom = "retro"
    prior: bool = False

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
