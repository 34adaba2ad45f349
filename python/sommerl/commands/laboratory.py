"""What commands that make something of samples say about it: how far it is from the samples, and what physics says of
these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..formats import residuals
from ..formats.compared import compared, samples_of
from ..formats.plausible import checked
from ..formats.reading import asked
from ..formats.scattered import REACH_DEGREES, extrapolated
from ..reflectance.brdf import Brdf
from ..system.errors import OptionError
from . import console
from .arguments import Arguments, option
from .checks import check_output
from .inputs import load_written

NOTABLE = 0.1  # the share that is extrapolated from which a warning is due
PARTS = {"held_out": "every tenth sample", "held_out_lines": "lines of incidence"}


@dataclass(frozen=True, kw_only=True)
class ReportArguments(Arguments):
    """What commands that make something of samples can be asked for."""

    residuals: Path | None = option(
        default=None, metavar="FILE.csv", help="samples: write measured values, those of OUT, and their differences"
    )


def check_samples(options: ReportArguments, brdf: Brdf, source: str, output: Path) -> None:
    """Raises OptionError or OSError for residuals of what has no samples, or that cannot be written.

    output: what is made of the material, which residuals are not written over.
    """
    if options.residuals is not None:
        if samples_of(brdf) is None:
            raise OptionError(f"--residuals: expected a material of samples, found another one ({source})")
        if options.residuals.resolve() == output.resolve():
            raise OptionError(f"--residuals: expected another file than the output, found {output}")
        if output.exists() and not output.is_file():
            raise OptionError(f"--residuals: expected an output that can be read again, found {output}")
        check_output(options.residuals, (".csv",), source)


def warn_of_samples(brdf: Brdf, source: str) -> None:
    """Warns of what is extrapolated."""
    share = extrapolated(brdf)
    if "prior" in brdf.facts:
        console.warn(
            f"{source}: what was not measured is estimated from {brdf.facts['prior']} (--prior); the median of the "
            f"standard deviation of log f_r is {brdf.facts['deviation_median']:.2g}"
        )
    elif share is not None and share > NOTABLE:
        console.warn(
            f"{source}: {share:.0%} of all pairs of directions above the horizon, by solid angles and cosines, are "
            f"more than {REACH_DEGREES:.0f}° from every sample: there, this material is extrapolated"
        )


def reported(
    source: str, brdf: Brdf, output: Path, made: Callable[[Brdf], Brdf], options: ReportArguments
) -> dict[str, Any]:
    """What is to be said of a file that was made of samples, for --json; and, unless that is asked for, says it.

    made: makes of a material what was written, in the same way. Nothing if there are no samples, or if the output is a
    pipe.
    """
    samples = samples_of(brdf)
    if samples is None or not output.is_file():
        return {}
    result = load_written(output)
    with console.progress(f"leaving samples out of {brdf.name}"):
        report = compared(brdf, result, made)
    physics = checked(samples, brdf, asked() if "rows" in brdf.facts else None)
    for sentence in physics["mistakes"]:
        console.warn(f"{source}: {sentence}")
    if options.residuals is not None:
        residuals.write(samples, result, options.residuals)
    if not options.json:
        console.print_rows(f"{output} against the samples", rows(report or {}, physics))
    return {"samples_report": report, "physics": physics}


def rows(report: dict[str, Any], physics: dict[str, Any]) -> dict[str, str]:
    """A report and what physics says, for people."""
    found = {f"all {report['all']['samples']} samples": _figures(report["all"])} if "all" in report else {}
    for key, name in PARTS.items():
        for part, figures in report.get(key, {}).items():
            found[f"{name} left out, {part} ({figures['samples']})"] = _figures(figures)
    if physics["swapped_asymmetry"] is not None:
        pairs = f"swapped pairs of directions ({physics['swapped_pairs']}): difference over mean"
        found[pairs] = f"{physics['swapped_asymmetry']:.1%}"
    if physics["reflectance"]:
        theta, most = max(physics["reflectance"], key=lambda each: each[1])
        found["largest hemispherical reflectance"] = f"{most:.3g}, at θ_i = {theta:.3g}°"
    if physics["brightest"]:
        found["brightest direction, on most lines of incidence"] = physics["brightest"]
    return found


def _figures(figures: dict[str, float]) -> str:
    return (
        f"median {figures['median']:.2%}, 95 % below {figures['percentile_95']:.1%}, worst {figures['worst']:.0%}, "
        f"at the peak {figures['at_peak']:+.1%}"
    )
