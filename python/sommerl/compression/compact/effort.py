"""How much work goes into a compact material: from 1, the quickest, to 9, the most thorough."""

from __future__ import annotations

from dataclasses import dataclass

from ...system.errors import OptionError


@dataclass(frozen=True)
class Effort:
    """The numbers that time and quality depend on.

    directions: of the source that nodes are fitted to, at least. lines: on which errors are measured, for each axis;
    the core takes 64 at once. turns, last_turns: of the alternation between entries and palettes, with sizes estimated
    and with real streams. spread: the numbers of nodes that are tried for a size, in units of the usual number.
    """

    directions: int
    lines: int
    turns: int
    last_turns: int
    spread: tuple[float, ...]


ONE, THREE = (1.0,), (1.0, 0.8, 1.2)
EFFORTS = (
    Effort(150_000, 128, 6, 4, ONE),
    Effort(200_000, 128, 8, 4, ONE),
    Effort(250_000, 192, 10, 6, ONE),
    Effort(350_000, 192, 12, 8, ONE),
    Effort(500_000, 256, 16, 12, ONE),
    Effort(700_000, 384, 20, 16, ONE),
    Effort(1_000_000, 512, 20, 16, ONE),
    Effort(1_000_000, 512, 20, 16, THREE),
    Effort(2_000_000, 1024, 30, 20, (1.0, 0.7, 0.8, 0.9, 1.1, 1.2, 1.35)),
)
DEFAULT = 5


def of(number: int) -> Effort:
    """Effort `number`, from 1 to 9. Raises OptionError for another."""
    if not 1 <= number <= len(EFFORTS):
        raise OptionError(f"effort: expected 1 to {len(EFFORTS)}, found {number}")
    return EFFORTS[number - 1]


USUAL = of(DEFAULT)
