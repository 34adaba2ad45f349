"""The limit on threads: SOMMERL_THREADS, or --threads of the command line. Everything that starts threads asks here.

The core, SciPy and Dr.Jit are told when they are called. The pools of BLAS and OpenMP, which NumPy and others bring,
read variables of their own when they are loaded: so these are set before this package imports NumPy. Where a program
has imported it before, they are as they were.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from .errors import OptionError

VARIABLE = "SOMMERL_THREADS"
OPTION = "--threads"
MOST = 256
POOLS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def limit() -> int | None:
    """The most threads that are to work at once; None if there is no limit. Raises OptionError for a wrong one."""
    value = os.environ.get(VARIABLE, "")
    return checked(value, VARIABLE) if value else None


def checked(value: str, name: str) -> int:
    """A limit as it was typed. Raises OptionError, which names where it comes from."""
    if not (value.isascii() and value.isdigit() and len(value) < 9 and 1 <= int(value) <= MOST):
        raise OptionError(f"{name}: expected 1 to {MOST}, found {value}")
    return int(value)


def use(threads: int) -> None:
    """Sets the limit for this process and for those that it starts."""
    os.environ[VARIABLE] = str(threads)


def _prepare() -> None:
    """Gives the pools that NumPy is about to start the limit, if there is one. A wrong one is told later."""
    try:
        threads = checked(_typed(sys.orig_argv) or os.environ.get(VARIABLE, ""), VARIABLE)
    except OptionError:
        return
    os.environ.update(dict.fromkeys(POOLS, str(threads)))


def _typed(line: Sequence[str]) -> str:
    """The value of the option in a command line of ours; "" in others, and where it is not given."""
    program = [Path(word).stem for word in line[:4]]
    if "sommerl" not in program:
        return ""
    words = [word for text in line[program.index("sommerl") + 1 :] for word in text.partition("=")[::2] if word]
    return words[-1 - words[::-1].index(OPTION) + 1] if OPTION in words[:-1] else ""


_prepare()
