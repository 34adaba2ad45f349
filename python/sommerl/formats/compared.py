"""What was written, compared with the samples that it was made from: at all of them, and at some that were left out of
another one, which was made in the same way for that."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..reflectance.arrays import split
from ..reflectance.brdf import Brdf
from ..reflectance.grid import GridBrdf
from ..reflectance.samples import Samples
from ..system.errors import FormatError, MaterialError
from . import held_out
from .gridded import grid_of
from .scattered import ScatteredBrdf, fewest, fitted_to, near

Floats = NDArray[np.float64]
Figures = dict[str, float]
MOST_COMPARED = 200_000  # samples, evenly chosen of more
HORIZON = 1e-6  # a grid's points with a cosine below are no samples


def samples_of(brdf: Brdf) -> Samples | None:
    """The samples that a material was made from: those that it was fitted to, or the points of a grid; else None."""
    if isinstance(brdf, GridBrdf):
        return None if brdf.about_mirror else _points(brdf)
    return brdf.samples


def _points(grid: GridBrdf) -> Samples:
    theta_i, theta_o, phi = (axis.reshape(-1) for axis in np.meshgrid(*grid.axes, indexing="ij"))
    samples = Samples.at_angles(np.stack([theta_i, 0 * phi, theta_o, phi], axis=-1), grid.values.reshape(-1, 3))
    return samples.some(np.minimum(samples.wi[:, 2], samples.wo[:, 2]) > HORIZON)


def relative_errors(samples: Samples, brdf: Brdf) -> Floats:
    """|f_r − measured| over what was measured (`held_out.sizes`), channels added, of each sample, (n)."""
    found = brdf.eval(samples.wi, samples.wo)
    errors: Floats = np.abs(found - samples.f_r).sum(axis=1) / held_out.sizes(samples.f_r)
    return errors


def figures(samples: Samples, brdf: Brdf) -> Figures:
    """samples: how many; median, percentile_95, worst: of their relative errors; at_peak: of the brightest one, with
    its sign: -0.1 where a tenth of the peak is lost."""
    errors = relative_errors(samples, brdf)
    place = int(samples.f_r.sum(axis=1).argmax())
    brightest = slice(place, place + 1)
    said, measured = brdf.eval(samples.wi[brightest], samples.wo[brightest]).sum(), samples.f_r[place].sum()
    return {
        "samples": len(errors),
        "median": float(np.median(errors)),
        "percentile_95": float(np.percentile(errors, 95)),
        "worst": float(errors.max()),
        "at_peak": float((said - measured) / held_out.sizes(samples.f_r)[place]),
    }


def compared(source: Brdf, written: Brdf, made: Callable[[Brdf], Brdf]) -> dict[str, Any] | None:
    """How far what was written is from the samples of its source; None if the source has none.

    made: makes of a material what is written, in the same way. all: `figures` at all samples. held_out,
    held_out_lines: at every tenth sample, and at whole lines of incidence (`held_out.lines`), of what is made without
    either; interpolated: of those within REACH of another sample, extrapolated: of the others. Of a grid, lines alone
    are left out. A part without samples is left out.
    """
    samples = samples_of(source)
    if samples is None:
        return None
    report: dict[str, Any] = {"all": figures(_some(samples), written)}
    gridded = isinstance(source, GridBrdf)
    lines = held_out.lines(samples)
    points = np.zeros(len(lines), bool) if gridded else held_out.points(samples) & ~lines
    kept = samples.some(~(lines | points))
    prior = isinstance(source, ScatteredBrdf) and source.estimate is not None
    if not (lines | points).any() or len(kept.wi) < fewest(prior):
        return report
    try:
        if isinstance(source, ScatteredBrdf):
            again = made(fitted_to(kept, name=source.name, choice=source.choice, prior=prior))
        else:
            without = grid_of(kept, name=source.name)
            if without is None:
                return report
            again = made(without)
    except (FormatError, MaterialError):  # what is left is black, or too little for what was asked
        return report
    for name, mask in (("held_out", points), ("held_out_lines", lines)):
        if mask.any():
            tested = _some(samples.some(mask))
            close = near(kept, split(tested.wi), split(tested.wo))
            parts = {"interpolated": close, "extrapolated": ~close}
            report[name] = {part: figures(tested.some(those), again) for part, those in parts.items() if those.any()}
    return report


def _some(samples: Samples) -> Samples:
    return samples.some(slice(None, None, -(-len(samples.wi) // MOST_COMPARED)))
