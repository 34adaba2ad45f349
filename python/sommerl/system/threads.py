"""The limit on threads: SOMMERL_THREADS, or --threads of the command line. Everything that starts threads asks here.

The core, SciPy and Dr.Jit get the limit when they are called. The thread pools of BLAS and OpenMP, which come with
NumPy and others, read environment variables of their own when they are loaded, so these variables are set before this
package imports NumPy. If a program has imported NumPy earlier, its pools keep the number of threads that they have.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from .errors import OptionError

VARIABLE = "SOMMERL_THREADS"
OPTION = "--threads"
MOST = 256  # threads
POOLS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def limit() -> int | None:
    """The largest number of threads to use at once; None for no limit. Raises OptionError if the variable is wrong."""
    value = os.environ.get(VARIABLE, "")
    return checked(value, VARIABLE) if value else None


def checked(value: str, name: str) -> int:
    """The limit as a number. value: as typed. name: of the option or variable, for the error message.

    Raises OptionError if it is not a whole number from 1 to MOST.
    """
    if not (value.isascii() and value.isdigit() and len(value) < 9 and 1 <= int(value) <= MOST):
        raise OptionError(f"{name}: expected 1 to {MOST}, found {value}")
    return int(value)


def use(threads: int) -> None:
    """Sets the limit for this process and for processes that it starts."""
    os.environ[VARIABLE] = str(threads)


def _prepare() -> None:
    """Sets the variables of the thread pools, before NumPy is imported. Ignores a wrong limit: `limit` raises later."""
    try:
        threads = checked(_typed(sys.orig_argv) or os.environ.get(VARIABLE, ""), VARIABLE)
    except OptionError:
        return
    os.environ.update(dict.fromkeys(POOLS, str(threads)))


def _typed(line: Sequence[str]) -> str:
    """The value of --threads in the command line of `sommerl`; "" if it is not given or another program is running."""
    program = [Path(word).stem for word in line[:4]]
    if "sommerl" not in program:
        return ""
    words = [word for text in line[program.index("sommerl") + 1 :] for word in text.partition("=")[::2] if word]
    return words[-1 - words[::-1].index(OPTION) + 1] if OPTION in words[:-1] else ""


_prepare()
