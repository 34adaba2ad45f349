"""The preset `compact` as users call it: what it is to keep is measured on a rendered sphere."""

from __future__ import annotations

from ..compression.compact import search
from ..compression.compact.search import CompactOptions, CompactReport, Progress, Quality
from ..compression.material import SomManBrdf
from ..reflectance.brdf import Brdf
from ..system.errors import MissingDependencyError
from .compare import judge_on_sphere
from .environment import default_environment
from .llvm import require_compiler


def compress(
    brdf: Brdf,
    *,
    target_size: int | None = None,
    target_psnr: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[SomManBrdf, CompactReport]:
    """Compresses any BRDF by the preset `compact`: a palette and an index on a lattice of nodes fitted to it.

    target_size: the most bytes that its file may take; the best material of that size is returned. target_psnr: the
    least PSNR [dB], of a sphere rendered in the built-in environment, over the object's pixels; the smallest material
    that reaches it is returned. `search.DEFAULT_PSNR` if neither is given. seed: of directions, first weights and
    order; the same input, options and seed give the same bytes. progress: called with steps done and steps in all.

    It takes half a minute to a minute and a half. Without a compiler for Mitsuba's kernels, a size is met by the fit's
    own error instead of renders, and `psnr_db` of the report is None.

    Raises OptionError for a size or a PSNR out of range, or both; MaterialError if the target cannot be met;
    MissingDependencyError without SciPy, and without Mitsuba if a PSNR is asked for.
    """
    options = CompactOptions(target_size, target_psnr, seed)
    return search.compress(brdf, options, quality=_quality(brdf, options), progress=progress)


def _quality(brdf: Brdf, options: CompactOptions) -> Quality | None:
    """The renderer; without it or a compiler for it, the fit's own error has to do where a size is asked for."""
    try:
        require_compiler()
        return judge_on_sphere(brdf, default_environment())
    except MissingDependencyError:
        if options.target_size is None:
            raise
        return None
