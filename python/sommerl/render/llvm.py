"""The only door to Mitsuba: gives Dr.Jit an LLVM that works, then chooses the variant."""

from __future__ import annotations

import importlib
import importlib.util
import warnings
from functools import cache
from typing import Any

from .. import jit
from ..errors import MissingDependencyError
from ..interrupt import undisturbed


def mitsuba() -> Any:
    """The module `mitsuba` with a variant set: the one that is set already, or CUDA if there is a GPU, else LLVM, else
    scalar, with a warning.

    Raises MissingDependencyError if Mitsuba is not installed, or the variant that is set is not one of RGB.
    """
    mi = _module()
    if mi.variant() is None:
        with undisturbed():
            mi.set_variant(_variant(mi))
            dr = jit.drjit()
            dr.set_thread_count(max(jit.LEAST_THREADS, dr.thread_count()))
    if not mi.variant().endswith("rgb"):
        raise MissingDependencyError(f"Mitsuba's variant: expected one of RGB, like llvm_ad_rgb, found {mi.variant()}")
    return mi


@cache
def _module() -> Any:
    if importlib.util.find_spec("mitsuba") is None:
        raise MissingDependencyError("rendering needs Mitsuba: install sommerl[render]")
    jit.choose_llvm()
    with undisturbed():
        return importlib.import_module("mitsuba")


def drjit() -> Any:
    """The module `drjit`, after `mitsuba()`."""
    mitsuba()
    return jit.drjit()


def _variant(mi: Any) -> str:
    available = set(mi.variants())
    dr = jit.drjit()
    if "cuda_ad_rgb" in available and dr.has_backend(dr.JitBackend.CUDA):
        return "cuda_ad_rgb"
    if "llvm_ad_rgb" in available and jit.has_llvm(dr):
        return "llvm_ad_rgb"
    warnings.warn(
        f"no GPU and no libLLVM {jit.OLDEST_LLVM} or newer: rendering falls back to scalar mode, some 300 times "
        f"slower; on Linux, install sommerl[render], or set {jit.PATH_VARIABLE}",
        stacklevel=3,
    )
    return "scalar_rgb"
