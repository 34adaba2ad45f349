"""Loads Dr.Jit with an LLVM that works.

Dr.Jit needs libLLVM 17 or newer. With an older one, which is what many systems install, it either does not work at all
or aborts the process at the first minimum or maximum. So Dr.Jit never searches for a libLLVM: we choose one for it.
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
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .errors import MissingDependencyError
from .interrupt import hold_interrupts
from .threads import limit

OLDEST_LLVM = 17
PATH_VARIABLE = "DRJIT_LIBLLVM_PATH"
LEAST_THREADS = 2  # the caller's included; with 1, Mitsuba waits for ever when it reads or writes OpenEXR files


def drjit() -> Any:
    """The module `drjit`. Raises MissingDependencyError if it is not installed."""
    if importlib.util.find_spec("drjit") is None:
        raise MissingDependencyError("fitting needs Dr.Jit: pip install 'sommerl[fit]'")
    with hold_interrupts():
        choose_llvm()
        dr = importlib.import_module("drjit")
    threads = limit()
    if threads is not None and dr.thread_count() > max(LEAST_THREADS, threads):
        dr.set_thread_count(max(LEAST_THREADS, threads))
    return dr


@contextmanager
def limited() -> Generator[None]:
    """Within the block, Dr.Jit uses no more threads than the limit, even if that is 1 (see LEAST_THREADS)."""
    dr, threads = drjit(), limit()
    before = dr.thread_count()
    if threads is None or threads >= before:
        yield
        return
    dr.set_thread_count(threads)
    try:
        yield
    finally:
        dr.set_thread_count(before)


def float64() -> Any:
    """Dr.Jit's type for differentiable arrays of double precision.

    Raises MissingDependencyError if there is no LLVM that compiles for this processor.
    """
    dr = drjit()
    if not has_llvm(dr):
        raise MissingDependencyError(
            f"fitting needs libLLVM {OLDEST_LLVM} or newer, and none was found: on Linux, "
            f"pip install 'sommerl[fit]', or set {PATH_VARIABLE}"
        )
    with hold_interrupts():
        return importlib.import_module("drjit.llvm.ad").Float64


def has_llvm(dr: Any) -> bool:
    """Whether Dr.Jit has loaded an LLVM that is new enough."""
    return dr.has_backend(dr.JitBackend.LLVM) and dr.detail.llvm_version()[0] >= OLDEST_LLVM


def found_llvm(dr: Any) -> str:
    """Which LLVM Dr.Jit has loaded, for error messages."""
    active = dr.has_backend(dr.JitBackend.LLVM)
    return f"libLLVM {dr.detail.llvm_version()[0]}" if active else "none"


def choose_llvm() -> None:
    """Sets which libLLVM Dr.Jit will load, if Dr.Jit is not imported yet. If none is new enough, it will load none."""
    if "drjit" not in sys.modules:
        os.environ[PATH_VARIABLE] = find_llvm() or os.devnull


def find_llvm() -> str | None:
    """The path of a libLLVM that Dr.Jit can use, or None."""
    return next((path for path in _candidates() if llvm_version(path) >= OLDEST_LLVM), None)


def llvm_version(path: str) -> int:
    """The major version that a libLLVM reports; 0 if it cannot be loaded or reports none."""
    try:
        library = ctypes.CDLL(path)
        major, minor, patch = (ctypes.c_uint() for _ in range(3))
        library.LLVMGetVersion(ctypes.byref(major), ctypes.byref(minor), ctypes.byref(patch))
        return major.value
    except (OSError, AttributeError):
        # LLVMGetVersion exists since LLVM 16, so a library without it is older.
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
