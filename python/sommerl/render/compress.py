"""The preset `compact` as users call it: candidates are judged against the source."""

from __future__ import annotations

from dataclasses import replace

from ..compression.compact import effort as efforts
from ..compression.compact import search
from ..compression.compact.search import CompactOptions, CompactReport, Progress
from ..compression.material import SomManBrdf
from ..reflectance.brdf import Brdf
from ..reflectance.reciprocal import reciprocal as averaged
from .judge import Judge, score


def compress(
    brdf: Brdf,
    *,
    target_size: int | None = None,
    target_psnr: float | None = None,
    effort: int = efforts.DEFAULT,
    reciprocal: bool = False,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[SomManBrdf, CompactReport]:
    """Compresses any BRDF by the preset `compact`: a palette and an index on a lattice of nodes fitted to it.

    target_size: the most bytes that its file may take; the material of that size with the best `judge.score` is
    returned. target_psnr: the least PSNR [dB] of a sphere in soft light (`judge`); the smallest material that reaches
    it is returned. `search.DEFAULT_PSNR` if neither is given. effort: how much work goes into it, from 1 to 9
    (`compact.effort`). reciprocal: compress the mean of both orders of the directions (`reflectance.reciprocal`), which
    the targets then refer to. seed: of directions, first weights and order; the same input, options and seed give the
    same bytes. progress: called with steps done and steps in all.

    The report's metrics say how far the material is from `brdf`, as it is given. Nothing is rendered.

    Raises OptionError for a size, a PSNR or an effort out of range, or if both targets are given; and MaterialError if
    the target cannot be met.

    >>> small, report = compress(sommerl.load("nickel"), target_size=600, effort=1)
    >>> sommerl.save(small, "nickel.smrl") <= 600
    True
    """
    options = CompactOptions(target_size, target_psnr, effort, seed)
    fitted = averaged(brdf) if reciprocal else brdf
    judge = Judge(fitted)
    judged: list[tuple[SomManBrdf, dict[str, float]]] = []

    def quality(material: SomManBrdf) -> float:
        metrics = judge.metrics(material)
        judged.append((material, metrics))
        return score(metrics) if options.target_size is not None else metrics["psnr_soft_db"]

    material, report = search.compress(fitted, options, quality=quality, progress=progress)
    known = [metrics for candidate, metrics in judged if candidate is material and fitted is brdf]
    return material, replace(report, metrics=known[0] if known else Judge(brdf).metrics(material))
