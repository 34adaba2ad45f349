"""Fits analytic models to a material, as `sommerl fit` does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..models.multi_lobe import MultiLobe
from ..reflectance.brdf import Brdf
from ..system import jit
from .data import samples_of
from .options import FitOptions, all_models, families_of, family
from .search import REFINED, Search

Progress = Callable[[int, int], None]  #: steps done, steps in all


@dataclass(frozen=True)
class Start:
    """One starting point of a search. shapes: the parameters of each lobe. error: over all samples, of what was found
    from there with a part of the samples, before the best results were refined."""

    shapes: list[dict[str, float]]
    error: float


@dataclass(frozen=True)
class Fit:
    """The best fit of a model to a material.

    error: as the options' loss measures it. relative_error: the error divided by the root mean square of the samples.
    starts: all starting points. samples: the number of pairs of directions. seconds: the time of the search.
    """

    model: str
    brdf: MultiLobe
    options: FitOptions
    error: float
    relative_error: float
    starts: list[Start]
    samples: int
    seconds: float

    def as_json(self) -> dict[str, Any]:
        """Everything as plain values, for a file or for --json."""
        return {
            "model": self.model,
            "lobes": len(self.brdf.lobes),
            "source": family(self.model).source,
            "loss": self.options.loss,
            "error": self.error,
            "relative_error": self.relative_error,
            "parameters": [lobe.as_json() for lobe in self.brdf.lobes],
            "sampling": self.options.sampling,
            "samples": self.samples,
            "seed": self.options.seed,
            "conserve_energy": self.options.conserve_energy,
            "starts": [{"parameters": s.shapes, "error": s.error} for s in self.starts],
            "seconds": self.seconds,
        }


def fit(brdf: Brdf, model: str, options: FitOptions | None = None, *, progress: Progress | None = None) -> Fit:
    """Fits one model to a material.

    progress: called with the steps done and the steps in all. Raises OptionError for an unknown model, or one that
    cannot have the number of lobes asked for; MaterialError for a material that cannot be fitted, like a black one.
    """
    return fit_models(brdf, [model], options, progress=progress)[0]


def fit_all(brdf: Brdf, options: FitOptions | None = None, *, progress: Progress | None = None) -> list[Fit]:
    """Fits all models that can have the number of lobes asked for, and the diffuse ones; sorted, the best first."""
    models = all_models((options or FitOptions()).lobes)
    return sorted(fit_models(brdf, models, options, progress=progress), key=lambda found: found.error)


def fit_models(
    brdf: Brdf, models: Sequence[str], options: FitOptions | None = None, *, progress: Progress | None = None
) -> list[Fit]:
    """Fits several models to the same samples; returns the fits in the same order. See `families_of` for lobes.

    Raises the same errors as `fit`.
    """
    options = options or FitOptions()
    sums = [families_of(model, options.lobes, alone=len(models) == 1) for model in models]
    samples = samples_of(brdf, options)
    steps = options.starts + REFINED
    found: list[Fit] = []
    for model, families in zip(models, sums, strict=True):

        def advance(done: int) -> None:
            if progress:
                progress(len(found) * steps + done, len(models) * steps)

        started = time.perf_counter()
        with jit.limited():
            search = Search(families, samples, options)
            best, ends = search.run(advance)
        found.append(
            Fit(
                model,
                MultiLobe(f"{brdf.name} ({model} fit)", search.lobes(best.places, best.albedos)),
                options,
                best.error,
                best.error / search.whole.scale,
                [Start([dict(o.shape) for o in search.lobes(end.start, end.albedos)], end.error) for end in ends],
                len(samples.wi),
                time.perf_counter() - started,
            )
        )
    if progress:
        progress(1, 1)
    return found
