"""How commands react to SIGINT (Ctrl-C) and SIGTERM: KeyboardInterrupt, but only where it is safe to stop.

The command line calls `handle_signals` once. As a library, Sommerl leaves signals to the program that uses it; it only
holds Ctrl-C back for a moment where stopping would do harm (`hold_interrupts`).
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
STATUS = 130  # the exit status of a command that was interrupted
PATIENCE = 0.3  # seconds in which signals count as one: `timeout` and terminals send each twice

temporaries: set[str] = set()  #: paths of temporary files, which are removed if the process has to end at once
_holds: list[list[int]] = []  # while `hold_interrupts` is active: one list, of the signals that have come


class _State:
    first: float | None = None  # when the first signal came


def handle_signals() -> None:
    """From now on, the first SIGINT or SIGTERM raises KeyboardInterrupt in the main thread; a second one, more than
    PATIENCE later, ends the process at once. Signals that are ignored stay ignored, as in a shell's background jobs."""
    for number in SIGNALS:
        if signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, _on_signal)
    sys.unraisablehook = _resend


def ignore_signals() -> None:
    """From now on, signals are ignored: the command is done, and Python is shutting down."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def remove_temporaries() -> None:
    """Removes all files that are not completely written."""
    for path in list(temporaries):
        with suppress(OSError):
            os.unlink(path)
        temporaries.discard(path)


@contextmanager
def hold_interrupts() -> Generator[None]:
    """If SIGINT or SIGTERM comes within the block, KeyboardInterrupt is raised only when the block has ended.

    Use it around imports, renders and calls that start threads. Libraries may turn an interruption there into another
    error, or may return while their threads still write to memory that is then freed. The result of a block that was
    interrupted must not be used, since it may be incomplete.
    """
    command = any(signal.getsignal(number) is _on_signal for number in SIGNALS)
    library = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or _holds or not (command or library):
        yield
        return
    came: list[int] = []
    _holds.append(came)
    try:
        if library:
            signal.signal(signal.SIGINT, lambda number, _: came.append(number))
        yield
    except Exception:
        if not came:
            raise
    finally:
        if library:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        _holds.remove(came)
    if came:
        raise KeyboardInterrupt


def _on_signal(number: int, frame: FrameType | None) -> None:
    """The command line's handler of signals."""
    now = time.monotonic()
    if _State.first is None:
        _State.first = now
        if not _holds:
            raise KeyboardInterrupt
        _holds[0].append(number)
    elif now - _State.first > PATIENCE:
        remove_temporaries()
        os._exit(STATUS)


def _resend(unraisable: sys.UnraisableHookArgs) -> None:
    """Sends a signal again if its KeyboardInterrupt was lost, as happens to one that is raised in a destructor."""
    if unraisable.exc_type is KeyboardInterrupt:
        _State.first = None
        threading.Timer(0.01, os.kill, [os.getpid(), signal.SIGINT]).start()
    else:
        sys.__unraisablehook__(unraisable)
