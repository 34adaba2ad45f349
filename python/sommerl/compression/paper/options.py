"""What can be chosen about training, and the defaults: the preset `paper`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import isfinite
from operator import index
from typing import Any, Literal, get_args

from ...system.errors import OptionError

Rule = Literal["paper", "kohonen"]
Order = Literal["seeded", "table"]
Topology = Literal["chain", "sheet"]


@dataclass(frozen=True)
class TrainOptions:
    """Options of the learner. docs/method.md gives the experiments behind the defaults.

    clusters: M, the number of units.
    epochs: how often the table is presented.
    seed: of the first weights and of the order of presentation.
    rule: "paper" keeps the factor x in Eq. 2 and Eq. 6, "kohonen" drops it.
    alpha: the first epoch's learning rate, in (0, 1].
    order: "seeded" presents the cells in one random order, "table" in the file's.
    radius: standard deviation, in units, of the neighbourhood in the first epoch; it shrinks as alpha does. 0: the
        winner learns alone.
    topology: how the units are arranged for that: in a "chain", or in a "sheet" of ⌈√M⌉ columns.
    distinct: whether a unit stores a cell once at most. Eq. 3-5 let a cell that comes back in a later epoch take a
        second place, and a third; with `distinct` it takes the place that it has.

    Raises OptionError for values outside these.

    >>> TrainOptions(clusters=64).alpha
    0.02
    """

    clusters: int = 256
    epochs: int = 30
    seed: int = 0
    rule: Rule = "kohonen"
    alpha: float = 0.02
    order: Order = "seeded"
    radius: float = 0.0
    topology: Topology = "chain"
    distinct: bool = False

    def __post_init__(self) -> None:
        for field, allowed in (("rule", Rule), ("order", Order), ("topology", Topology)):
            if getattr(self, field) not in get_args(allowed):
                expected = " or ".join(get_args(allowed))
                raise OptionError(f"{field}: expected {expected}, found {getattr(self, field)}")
        for field, kind in (
            ("clusters", index),
            ("epochs", index),
            ("seed", index),
            ("alpha", float),
            ("radius", float),
        ):
            try:
                object.__setattr__(self, field, kind(getattr(self, field)))  # NumPy's numbers become Python's
            except (TypeError, ValueError) as error:
                raise OptionError(f"{field}: expected a number, found {getattr(self, field)!r}") from error
        if self.distinct not in (False, True):
            raise OptionError(f"distinct: expected true or false, found {self.distinct!r}")
        object.__setattr__(self, "distinct", bool(self.distinct))
        for field, low, high in (("clusters", 1, 2**16), ("epochs", 1, 10_000), ("seed", 0, 2**64 - 1)):
            if not low <= getattr(self, field) <= high:
                raise OptionError(f"{field}: expected {low} to {high}, found {getattr(self, field)}")
        if not 0 < self.alpha <= 1:
            raise OptionError(f"alpha: expected a number above 0, at most 1, found {self.alpha}")
        if not (isfinite(self.radius) and 0 <= self.radius <= 1000):
            raise OptionError(f"radius: expected 0 to 1000, found {self.radius}")

    def noted(self) -> dict[str, Any]:
        """The options as a material's file notes them. `distinct`, which came later, is noted if it is set: files made
        without it keep their bytes."""
        return {name: value for name, value in asdict(self).items() if name != "distinct" or value}
