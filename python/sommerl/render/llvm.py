"""Loads Mitsuba, with an LLVM that works and a variant set. All other modules get Mitsuba from here."""

from __future__ import annotations

import importlib
import importlib.util
import re
import warnings
from functools import cache
from typing import Any

from ..system import jit
from ..system.errors import MissingDependencyError, OptionError
from ..system.interrupt import hold_interrupts

WANTED = f"a GPU, or a libLLVM {jit.OLDEST_LLVM} or newer"
REMEDY = f"on Linux, pip install 'sommerl[render]', or set {jit.PATH_VARIABLE}"
USABLE = re.compile(r"(scalar|llvm|llvm_ad|cuda|cuda_ad)_(rgb|mono|spectral)(_polarized)?")


def mitsuba(variant: str | None = None) -> Any:
    """The module `mitsuba` with a variant set.

    variant: the variant to set. If None, one that is set already stays; otherwise it is `cuda_ad_rgb` if there is a
    GPU, else `llvm_ad_rgb` if there is an LLVM that works, else `scalar_rgb`, with a warning.

    Raises MissingDependencyError if Mitsuba is not installed, or if the variant that is set already is not among
    `usable_variants`; OptionError if `variant` is not.
    """
    mi = _module()
    if variant is not None and variant not in usable_variants():
        raise OptionError(f"variant: expected {' or '.join(usable_variants())}, found {variant}")
    if mi.variant() is None or variant not in (None, mi.variant()):
        with hold_interrupts():
            mi.set_variant(variant or _fastest(mi))
            dr = jit.drjit()
            dr.set_thread_count(max(jit.LEAST_THREADS, dr.thread_count()))
    _check(mi.variant())
    return mi


def usable_variants() -> list[str]:
    """The names of the variants that are installed, run on this machine, and are supported by this package."""
    dr = jit.drjit()
    runs = {"scalar": True, "llvm": jit.has_llvm(dr), "cuda": dr.has_backend(dr.JitBackend.CUDA)}
    return [name for name in _module().variants() if USABLE.fullmatch(name) and runs[name.split("_")[0]]]


@cache
def _check(variant: str) -> None:
    """Raises MissingDependencyError if a variant cannot be used, since Mitsuba could end the process later."""
    if not USABLE.fullmatch(variant):
        raise MissingDependencyError(f"Mitsuba's variant: expected {' or '.join(usable_variants())}, found {variant}")
    dr = jit.drjit()
    if variant.startswith("llvm") and not jit.has_llvm(dr):
        raise MissingDependencyError(
            f"Mitsuba's variant {variant} needs libLLVM {jit.OLDEST_LLVM} or newer, and Dr.Jit has loaded "
            f"{jit.found_llvm(dr)}: call sommerl.render.llvm.mitsuba() before anything imports Dr.Jit, or set "
            f"{jit.PATH_VARIABLE}"
        )


@cache
def _module() -> Any:
    if importlib.util.find_spec("mitsuba") is None:
        raise MissingDependencyError("rendering needs Mitsuba: pip install 'sommerl[render]'")
    with hold_interrupts():
        jit.choose_llvm()
        return importlib.import_module("mitsuba")


def drjit() -> Any:
    """The module `drjit`, loaded after `mitsuba()` has been called."""
    mitsuba()
    return jit.drjit()


def require_compiler() -> None:
    """Raises MissingDependencyError if only scalar variants can be used, which are hundreds of times slower."""
    mi = _module()
    if (mi.variant() or _fastest(mi, warn=False)).startswith("scalar"):
        raise MissingDependencyError(f"rendering needs {WANTED}, and neither was found: {REMEDY}")


def _fastest(mi: Any, *, warn: bool = True) -> str:
    available = set(mi.variants())
    dr = jit.drjit()
    if "cuda_ad_rgb" in available and dr.has_backend(dr.JitBackend.CUDA):
        return "cuda_ad_rgb"
    if "llvm_ad_rgb" in available and jit.has_llvm(dr):
        return "llvm_ad_rgb"
    if warn:
        warnings.warn(
            f"rendering needs {WANTED}, and falls back to scalar mode, about 300 times slower: {REMEDY}",
            stacklevel=4,
        )
    return "scalar_rgb"
