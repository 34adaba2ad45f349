"""How a command ends: its answer, or what went wrong in one sentence, and an exit status.

With --json, both are one object on standard output; what went wrong is on standard error in any case.
"""

from __future__ import annotations

import json
import math
import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, TextIO

from ..system.errors import MaterialError, OptionError, SommerlError, unexpected
from ..system.visible import visible
from .console import tell, warn

DEBUG = "SOMMERL_DEBUG"


class PartlyDone(MaterialError):
    """Some of several materials failed. answer: what is known of each."""

    def __init__(self, sentence: str, answer: Mapping[str, Any]) -> None:
        super().__init__(sentence)
        self.answer = answer


def asks_for_json(arguments: Sequence[str]) -> bool:
    """Whether --json, or a beginning of it, is among the options, also if the others make no sense."""
    options = arguments[: arguments.index("--")] if "--" in arguments else arguments
    return any(len(word) > 2 and "--json".startswith(word) for word in options)


def outcome(command: Callable[[], Mapping[str, Any] | None], *, as_json: bool) -> int:
    """Runs a command, and prints its answer if that is asked for as JSON; returns its exit status.

    That is 0, 1 for an error in the input, 2 for one in the options. An error that nobody thought of is 1, too. What
    ends Python, an interruption above all, is let through.
    """
    try:
        answer = command()
        if as_json and answer is not None:
            print_answer(answer)
        sys.stdout.flush()
    except OptionError as error:
        return fail(str(error), 2, as_json=as_json)
    except PartlyDone as error:
        return fail(str(error), 1, error.answer, as_json=as_json)
    except SommerlError as error:
        return fail(str(error), 1, as_json=as_json)
    except OSError as error:
        if isinstance(error, BrokenPipeError) and error.filename is None:
            return 1  # whoever read the output has had enough; nobody is left to be told
        if error.filename is None:
            return fail(f"standard output: {error.strerror or error}", 1)
        return fail(f"{error.filename}: {error.strerror or error}", 1, as_json=as_json)
    except MemoryError:
        return fail("not enough memory", 1, as_json=as_json)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic in Rust is no Exception
        return fail(_unexpected(error), 1, as_json=as_json)
    return 0


def print_answer(answer: Mapping[str, Any]) -> None:
    """Prints an answer as JSON, with all warnings so far. A command that then goes on until it is stopped calls it."""
    _print_json({**answer, "warnings": warn.told})
    sys.stdout.flush()


def fail(message: str, status: int, known: Mapping[str, Any] | None = None, *, as_json: bool = False) -> int:
    """Says what went wrong, and returns the exit status. known: what the object holds besides, if it is JSON."""
    tell(f"error: {message}")
    if as_json:
        with suppress(OSError):  # if standard output takes nothing, the sentence is told all the same
            _print_json({**(known or {}), "error": visible(message), "status": status, "warnings": warn.told})
            sys.stdout.flush()
    return status


def _print_json(answer: Mapping[str, Any]) -> None:
    print(json.dumps(finite(answer), indent=2))


def finite(value: Any) -> Any:
    """The same, with null for the numbers that JSON lacks (the PSNR of identical images)."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list):
        return [finite(item) for item in value]  # pyright: ignore[reportUnknownVariableType]
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
    """A sentence on an error that is none of Sommerl's own. With SOMMERL_DEBUG=1, the traceback is printed before."""
    if os.environ.get(DEBUG) == "1":
        for line in "".join(traceback.format_exception(error)).splitlines():
            tell(visible(line))
    return f"{unexpected(error)}; please report it, with what {DEBUG}=1 adds"
