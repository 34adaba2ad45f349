"""What can be chosen about fits, and the defaults: those of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from ..models.family import Family
from ..models.lambertian import LAMBERTIAN
from ..models.multi_lobe import FAMILIES
from ..system.errors import OptionError
from ..system.near import did_you_mean

Loss = Literal["l2", "cosine-l2", "log", "cube-root"]
Sampling = Literal["sphere", "lattice"]

MOST_LOBES = 4
LEAST_SAMPLES, MOST_SAMPLES = 1000, 10_000_000
MOST_STARTS = 1000


@dataclass(frozen=True)
class FitOptions:
    """What is minimised, over which directions, and how thoroughly.

    lobes: of a model, its Lambertian base among them; None for the least: 2, or 1 of a model that is a base itself.
    loss: the root of the mean square, over samples and channels, of differences of "l2": f_r; "cosine-l2": f_r cos θ_i
        (Ngan et al. 2005, and with them the paper); "log": ln(1 + f_r cos θ_i / ε), ε = 0.001; "cube-root":
        ∛(f_r cos θ_i).
    sampling: "sphere", the directions that a rendered sphere sees, `samples` of them; "lattice", the centres of all
        cells, MERL's if the material has none.
    starts: how many places a search begins at; the first is the one of `Parameter.start`, all others are random.
    seed: of directions and starts.
    conserve_energy: lets the albedos of a channel sum to 1 at most: what comes back is then no more than what comes in,
        for families that promise as much (`Family.conserves_energy`).

    Raises OptionError for values outside these.
    """

    lobes: int | None = None
    loss: Loss = "cosine-l2"
    sampling: Sampling = "sphere"
    samples: int = 1_500_000
    starts: int = 20
    seed: int = 0
    conserve_energy: bool = False

    def __post_init__(self) -> None:
        for field, allowed in (("loss", Loss), ("sampling", Sampling)):
            if getattr(self, field) not in get_args(allowed):
                expected = " or ".join(get_args(allowed))
                raise OptionError(f"{field}: expected {expected}, found {getattr(self, field)}")
        ranges = [("samples", LEAST_SAMPLES, MOST_SAMPLES), ("starts", 1, MOST_STARTS), ("seed", 0, 2**64 - 1)]
        if self.lobes is not None:
            ranges.append(("lobes", 1, MOST_LOBES))
        for field, low, high in ranges:
            if not low <= getattr(self, field) <= high:
                raise OptionError(f"{field}: expected {low} to {high}, found {getattr(self, field)}")


def family(model: str) -> Family:
    """The family of that name. Raises OptionError, with all names, if there is none."""
    if model not in FAMILIES:
        hint = did_you_mean(model, FAMILIES)
        raise OptionError(f"model: expected {', '.join(FAMILIES)} or all, found {model}{hint}")
    return FAMILIES[model]


def families_of(model: str, lobes: int | None, *, alone: bool = True) -> tuple[Family, ...]:
    """The families of a model's lobes. Raises OptionError if it cannot have so many, or so few.

    alone: whether it is the only model asked for; if not, a number of lobes is not meant for those that have one.
    """
    chosen = family(model)
    if chosen.diffuse:
        if alone and lobes not in (None, 1):
            raise OptionError(f"lobes: expected 1 of {model}, which is a base itself, found {lobes}")
        return (chosen,)
    if lobes == 1:
        raise OptionError(f"lobes: expected 2 to {MOST_LOBES} of {model}, its Lambertian base among them, found 1")
    return (LAMBERTIAN, *[chosen] * ((lobes or 2) - 1))


def all_models(lobes: int | None) -> list[str]:
    """All models that can have so many lobes, after those that are a base alone."""
    return [name for name, chosen in FAMILIES.items() if chosen.diffuse or lobes != 1]
