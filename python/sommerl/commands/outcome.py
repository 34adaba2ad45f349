"""How a command ends: what went wrong in one sentence on standard error, and an exit status."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable
from typing import TextIO

from ..system.errors import OptionError, SommerlError
from ..system.visible import visible
from .console import tell

DEBUG = "SOMMERL_DEBUG"
LONGEST = 300  # characters of what an error that nobody thought of says


def outcome(command: Callable[[], None]) -> int:
    """Runs a command; returns its exit status: 0, 1 for an error in the input, 2 for one in the options.

    An error that nobody thought of is 1, too. What ends Python, an interruption above all, is let through.
    """
    try:
        command()
        sys.stdout.flush()
    except OptionError as error:
        return fail(str(error), 2)
    except SommerlError as error:
        return fail(str(error), 1)
    except OSError as error:
        if isinstance(error, BrokenPipeError) and error.filename is None:
            return 1  # whoever read the output has had enough; nobody is left to be told
        return fail(f"{error.filename or 'standard output'}: {error.strerror or error}", 1)
    except MemoryError:
        return fail("not enough memory", 1)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic in Rust is no Exception
        return fail(_unexpected(error), 1)
    return 0


def fail(message: str, status: int) -> int:
    """Says what went wrong, and hands on the exit status."""
    tell(f"error: {message}")
    return status


def settled() -> bool:
    """Whether standard output took all that was printed.

    What a stream did not take is forgotten: Python would try once more when it ends, and make a noise about it.
    """
    written = _flushed(sys.stdout, 1)
    _flushed(sys.stderr, 2)
    return written


def _flushed(stream: TextIO, number: int) -> bool:
    try:
        stream.flush()
    except (OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, number)
        os.close(null)
        return False
    return True


def _unexpected(error: BaseException) -> str:
    """One sentence on an error that nobody thought of; where it came from is told before, if one asks for it."""
    if os.environ.get(DEBUG) == "1":
        for line in "".join(traceback.format_exception(error)).splitlines():
            tell(visible(line))
    try:
        text = " ".join(str(error).split())
    except Exception:  # it may be anybody's
        text = ""
    text = visible(text if len(text) <= LONGEST else f"{text[:LONGEST]}…")
    found = type(error).__name__ + (f" ({text})" if text else "")
    return f"expected none that Sommerl does not know, found {found}; please report it, with what {DEBUG}=1 adds"
