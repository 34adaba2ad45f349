"""The only door to Mitsuba: gives Dr.Jit an LLVM that works, then chooses the variant."""

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
REMEDY = f"on Linux, install sommerl[render], or set {jit.PATH_VARIABLE}"
USABLE = re.compile(r"(scalar|llvm|llvm_ad|cuda|cuda_ad)_(rgb|mono|spectral)(_polarized)?")


def mitsuba(variant: str | None = None) -> Any:
    """The module `mitsuba` with a variant set: the one that is set already, or CUDA if there is a GPU, else LLVM, else
    scalar, with a warning. variant: the one that is to be set.

    Raises MissingDependencyError if Mitsuba is not installed, or the variant that is set cannot be used: for a kind of
    colour that is not known here, or for want of an LLVM that works. OptionError for a variant that cannot be chosen.
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
    """The variants that this package works in, of those that are installed and this machine can run."""
    dr = jit.drjit()
    runs = {"scalar": True, "llvm": jit.has_llvm(dr), "cuda": dr.has_backend(dr.JitBackend.CUDA)}
    return [name for name in _module().variants() if USABLE.fullmatch(name) and runs[name.split("_")[0]]]


@cache
def _check(variant: str) -> None:
    """Raises MissingDependencyError if the variant is none that can be used: Mitsuba would end the process later."""
    if not USABLE.fullmatch(variant):
        raise MissingDependencyError(f"Mitsuba's variant: expected {' or '.join(usable_variants())}, found {variant}")
    dr = jit.drjit()
    if variant.startswith("llvm") and not jit.has_llvm(dr):
        raise MissingDependencyError(
            f"Mitsuba's variant {variant}: expected a libLLVM {jit.OLDEST_LLVM} or newer, found {jit.found_llvm(dr)}; "
            f"call sommerl.render.llvm.mitsuba() before anything imports Dr.Jit, or set {jit.PATH_VARIABLE}"
        )


@cache
def _module() -> Any:
    if importlib.util.find_spec("mitsuba") is None:
        raise MissingDependencyError("rendering needs Mitsuba: install sommerl[render]")
    with hold_interrupts():
        jit.choose_llvm()
        return importlib.import_module("mitsuba")


def drjit() -> Any:
    """The module `drjit`, after `mitsuba()`."""
    mitsuba()
    return jit.drjit()


def require_compiler() -> None:
    """Raises MissingDependencyError if renders would be in scalar mode, hundreds of times slower."""
    mi = _module()
    if (mi.variant() or _fastest(mi, warn=False)).startswith("scalar"):
        raise MissingDependencyError(f"rendering: expected {WANTED}, found neither; {REMEDY}")


def _fastest(mi: Any, *, warn: bool = True) -> str:
    available = set(mi.variants())
    dr = jit.drjit()
    if "cuda_ad_rgb" in available and dr.has_backend(dr.JitBackend.CUDA):
        return "cuda_ad_rgb"
    if "llvm_ad_rgb" in available and jit.has_llvm(dr):
        return "llvm_ad_rgb"
    if warn:
        warnings.warn(
            f"expected {WANTED}, found neither: rendering falls back to scalar mode, some 300 times slower; {REMEDY}",
            stacklevel=4,
        )
    return "scalar_rgb"
