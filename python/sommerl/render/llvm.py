"""The only door to Mitsuba and Dr.Jit: finds an LLVM that works, then chooses the variant.

Dr.Jit needs libLLVM 17 or newer. Given an older one, which is what many systems install, it either stays inactive or
aborts the process on its first minimum or maximum; so it is never left to find one by itself.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib
import importlib.metadata
import importlib.util
import os
import re
import sys
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from ..errors import MissingDependencyError

OLDEST_LLVM = 17
PATH_VARIABLE = "DRJIT_LIBLLVM_PATH"


def mitsuba() -> Any:
    """The module `mitsuba` with a variant set: the one that is set already, or CUDA if there is a GPU, else LLVM, else
    scalar, with a warning.

    Raises MissingDependencyError if Mitsuba is not installed, or the variant that is set is not one of RGB.
    """
    mi = _module()
    if mi.variant() is None:
        mi.set_variant(_variant(mi))
    if not mi.variant().endswith("rgb"):
        raise MissingDependencyError(f"Mitsuba's variant: expected one of RGB, like llvm_ad_rgb, found {mi.variant()}")
    return mi


@cache
def _module() -> Any:
    if importlib.util.find_spec("mitsuba") is None:
        raise MissingDependencyError("rendering needs Mitsuba: install sommerl[render]")
    if "drjit" not in sys.modules:
        path = find_llvm()
        os.environ[PATH_VARIABLE] = path or os.devnull  # never the one that Dr.Jit would find by itself
    return importlib.import_module("mitsuba")


def drjit() -> Any:
    """The module `drjit`, after `mitsuba()`."""
    mitsuba()
    return importlib.import_module("drjit")


def find_llvm() -> str | None:
    """The path of a libLLVM that Dr.Jit can use, or None."""
    return next((path for path in _candidates() if llvm_version(path) >= OLDEST_LLVM), None)


def llvm_version(path: str) -> int:
    """The major version that a libLLVM reports of itself; 0 if it cannot be loaded or does not say."""
    try:
        library = ctypes.CDLL(path)
        major, minor, patch = (ctypes.c_uint() for _ in range(3))
        library.LLVMGetVersion(ctypes.byref(major), ctypes.byref(minor), ctypes.byref(patch))
        return major.value
    except (OSError, AttributeError):
        # LLVMGetVersion came with LLVM 16: what lacks it is older.
        return 0


def _candidates() -> Iterator[str]:
    if chosen := os.environ.get(PATH_VARIABLE):
        yield chosen
    yield from _in_wheel()
    yield from _in_system()
    if found := ctypes.util.find_library("LLVM"):
        yield found


def _in_wheel() -> Iterator[str]:
    try:
        files = importlib.metadata.files("karellen-llvm-core") or []
    except importlib.metadata.PackageNotFoundError:
        return
    for file in files:
        if re.fullmatch(r"libLLVM\.so|libLLVM\.dylib|LLVM-C\.dll", file.name):
            yield str(Path(str(file.locate())).resolve())


def _in_system() -> Iterator[str]:
    places = [Path(p) for p in ("/usr/lib", "/usr/lib64", "/usr/local/lib", "/opt/homebrew/opt/llvm/lib")]
    patterns = ("libLLVM*.so*", "*/libLLVM*.so*", "llvm-*/lib/libLLVM*.so*", "libLLVM*.dylib")
    found = {str(path) for place in places for pattern in patterns for path in place.glob(pattern)}
    yield from sorted(found, key=lambda path: [int(n) for n in re.findall(r"\d+", Path(path).name)], reverse=True)


def _variant(mi: Any) -> str:
    available = set(mi.variants())
    dr: Any = importlib.import_module("drjit")
    if "cuda_ad_rgb" in available and dr.has_backend(dr.JitBackend.CUDA):
        return "cuda_ad_rgb"
    if "llvm_ad_rgb" in available and dr.has_backend(dr.JitBackend.LLVM) and dr.detail.llvm_version()[0] >= OLDEST_LLVM:
        return "llvm_ad_rgb"
    warnings.warn(
        f"no GPU and no libLLVM {OLDEST_LLVM} or newer: rendering falls back to scalar mode, some 300 times slower; "
        f"on Linux, install sommerl[render], or set {PATH_VARIABLE}",
        stacklevel=3,
    )
    return "scalar_rgb"
