"""The options of fits. The defaults are those of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from ..models.family import Family
from ..models.lambertian import LAMBERTIAN
from ..models.multi_lobe import FAMILIES
from ..models.standards import STANDARDS
from ..system.errors import OptionError
from ..system.near import did_you_mean
from ..system.whole import make_whole

Loss = Literal["l2", "cosine-l2", "log", "cube-root"]
Sampling = Literal["sphere", "lattice"]

MOST_LOBES = 4
LEAST_SAMPLES, MOST_SAMPLES = 1000, 10_000_000
MOST_STARTS = 1000


@dataclass(frozen=True)
class FitOptions:
    """What is minimised, over which directions, and how thoroughly.

    lobes: the number of lobes, the Lambertian base included. None: 2, or 1 for a model that is a base itself.
    loss: the root mean square, over samples and channels, of the differences of one of: "l2", f_r; "cosine-l2",
        f_r cos θ_i (Ngan et al. 2005, and the paper); "log", ln(1 + f_r cos θ_i / ε) with ε = 0.001; "cube-root",
        ∛(f_r cos θ_i).
    sampling: "sphere", the directions that occur on a rendered sphere, `samples` of them; "lattice", the centres of all
        cells of the material's lattice, or of MERL's if it has none.
    starts: the number of starting points of the search. The first is from `Parameter.start`, the others are random.
    seed: of directions and starts.
    conserve_energy: whether the albedos of a channel may add up to at most 1. No more light is then reflected than
        arrives, for families that guarantee this of one lobe (`Family.conserves_energy`).

    Raises OptionError for values that are not allowed.
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
        make_whole(self, "lobes", "samples", "starts", "seed")
        ranges = [("samples", LEAST_SAMPLES, MOST_SAMPLES), ("starts", 1, MOST_STARTS), ("seed", 0, 2**64 - 1)]
        if self.lobes is not None:
            ranges.append(("lobes", 1, MOST_LOBES))
        for field, low, high in ranges:
            if not low <= getattr(self, field) <= high:
                raise OptionError(f"{field}: expected {low} to {high}, found {getattr(self, field)}")


def family(model: str) -> Family:
    """The family of a name. Raises OptionError, which lists all names, if there is none of that name."""
    if model not in FAMILIES:
        names = (*FAMILIES, *STANDARDS)
        raise OptionError(f"model: expected {', '.join(names)} or all, found {model}{did_you_mean(model, names)}")
    return FAMILIES[model]


def check_model(model: str, options: FitOptions, *, alone: bool = True) -> None:
    """Raises OptionError for an unknown model, and for options that it cannot have. alone: as in `families_of`."""
    if model not in STANDARDS:
        families_of(model, options.lobes, alone=alone)
    elif not alone:
        return
    elif options.lobes is not None:
        raise OptionError(f"lobes: {model} has layers of its own and no number of lobes, found {options.lobes}")
    elif options.conserve_energy:
        raise OptionError(f"conserve_energy: expected a sum of lobes, found {model}, whose inputs its standard bounds")


def families_of(model: str, lobes: int | None, *, alone: bool = True) -> tuple[Family, ...]:
    """The families of a model's lobes. Raises OptionError if the model cannot have that number of lobes.

    alone: whether this is the only model asked for. If not, models that always have one lobe ignore `lobes`.
    """
    chosen = family(model)
    if chosen.diffuse:
        if alone and lobes not in (None, 1):
            raise OptionError(f"lobes: {model} is a base itself and has 1 lobe, found {lobes}")
        return (chosen,)
    if lobes == 1:
        raise OptionError(f"lobes: expected 2 to {MOST_LOBES} of {model}, its Lambertian base included, found 1")
    return (LAMBERTIAN, *[chosen] * ((lobes or 2) - 1))


def all_models(lobes: int | None) -> list[str]:
    """The names of all models that can have this number of lobes, and of those that always have one."""
    return [name for name, chosen in FAMILIES.items() if chosen.diffuse or lobes != 1]
