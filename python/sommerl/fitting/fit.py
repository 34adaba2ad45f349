"""Fits analytic models to a material, as `sommerl fit` does."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..models.multi_lobe import MultiLobe
from ..models.standard import Surface
from ..models.standards import STANDARDS
from ..reflectance.brdf import Brdf
from ..reflectance.samples import Samples
from ..system import jit
from .data import samples_of
from .options import FitOptions, all_models, check_model, families_of, family
from .search import REFINED, Search
from .surface import SurfaceSearch

Progress = Callable[[int, int], None]  #: steps done, steps in all


@dataclass(frozen=True)
class Start:
    """One starting point of a search.

    shapes: the parameters of each lobe, or all inputs of a standard's surface. error: over all samples, of what was
    found from there with a part of the samples, before the best results were refined.
    """

    shapes: list[dict[str, Any]]
    error: float


@dataclass(frozen=True)
class Fit:
    """The best fit of a model to a material.

    error: as the options' loss measures it. relative_error: the error divided by the root mean square of the samples.
    starts: all starting points. samples: the number of pairs of directions. seconds: the time of the search.
    """

    model: str
    brdf: MultiLobe | Surface
    options: FitOptions
    error: float
    relative_error: float
    starts: list[Start]
    samples: int
    seconds: float

    def as_json(self) -> dict[str, Any]:
        """Everything as plain values, for a file or for --json."""
        if isinstance(self.brdf, Surface):
            lobes, source, parameters = None, self.brdf.model.source, self.brdf.as_json()
        else:
            lobes, source = len(self.brdf.lobes), family(self.model).source
            parameters = [lobe.as_json() for lobe in self.brdf.lobes]
        return {
            "model": self.model,
            "lobes": lobes,
            "source": source,
            "loss": self.options.loss,
            "error": self.error,
            "relative_error": self.relative_error,
            "parameters": parameters,
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
    """Fits all sums of lobes that can have the number asked for, and the diffuse ones; sorted, the best first."""
    models = all_models((options or FitOptions()).lobes)
    return sorted(fit_models(brdf, models, options, progress=progress), key=lambda found: found.error)


def fit_models(
    brdf: Brdf, models: Sequence[str], options: FitOptions | None = None, *, progress: Progress | None = None
) -> list[Fit]:
    """Fits several models to the same samples; returns the fits in the same order. See `families_of` for lobes.

    Raises the same errors as `fit`.
    """
    options = options or FitOptions()
    for model in models:
        check_model(model, options, alone=len(models) == 1)
    samples = samples_of(brdf, options)
    steps = options.starts + REFINED
    found: list[Fit] = []
    for model in models:

        def advance(done: int) -> None:
            if progress:
                progress(len(found) * steps + done, len(models) * steps)

        started = time.perf_counter()
        with jit.limited():
            search = _search(model, samples, options, alone=len(models) == 1)
            best, ends = search.run(advance)
        found.append(
            Fit(
                model,
                search.material(f"{brdf.name} ({model} fit)", best),
                options,
                best.error,
                best.error / search.whole.scale,
                [Start(search.start(end), end.error) for end in ends],
                len(samples.wi),
                time.perf_counter() - started,
            )
        )
    if progress:
        progress(1, 1)
    return found


def _search(model: str, samples: Samples, options: FitOptions, *, alone: bool) -> Search | SurfaceSearch:
    if model in STANDARDS:
        return SurfaceSearch(STANDARDS[model], samples, options)
    return Search(families_of(model, options.lobes, alone=alone), samples, options)
