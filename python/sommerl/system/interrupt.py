"""What ends a command from outside, SIGINT (Ctrl-C) and SIGTERM: KeyboardInterrupt, but not in mid-air.

As a library, Sommerl leaves signals to the program that it is in. The command line calls `heed` once.
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
STATUS = 130  # of a command that was interrupted
PATIENCE = 0.3  # seconds in which signals count as one: `timeout` and terminals send each twice

temporaries: set[str] = set()  #: paths of files that go if the process has to end at once
_holds: list[list[int]] = []  # the signals that came in the block that is not to be disturbed, if there is one


class _State:
    first: float | None = None  # when the command was first told to end


def heed() -> None:
    """From now on, SIGINT and SIGTERM raise KeyboardInterrupt in the main thread, once; another one later ends the
    process at once. Signals that are ignored stay so, as in a shell's background jobs."""
    for number in SIGNALS:
        if signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, _told)
    sys.unraisablehook = _again


def unheeded() -> None:
    """From now on, signals change nothing: the command is at its end, and Python takes itself apart."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def remove_temporaries() -> None:
    """Removes what is half-written."""
    for path in list(temporaries):
        with suppress(OSError):
            os.unlink(path)
        temporaries.discard(path)


@contextmanager
def undisturbed() -> Generator[None]:
    """Holds an interruption back until the block has ended, and raises KeyboardInterrupt then: what was under way is
    not to be used. Within imports, renders and calls that start threads, others make another error of it, or leave
    their threads to write to memory that is gone."""
    command = any(signal.getsignal(number) is _told for number in SIGNALS)
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


def _told(number: int, frame: FrameType | None) -> None:
    """The command line's handler."""
    now = time.monotonic()
    if _State.first is None:
        _State.first = now
        if not _holds:
            raise KeyboardInterrupt
        _holds[0].append(number)
    elif now - _State.first > PATIENCE:
        remove_temporaries()
        os._exit(STATUS)


def _again(unraisable: sys.UnraisableHookArgs) -> None:
    """An interruption that came where nobody could be told of it, as while Python collects garbage, comes again."""
    if unraisable.exc_type is KeyboardInterrupt:
        _State.first = None
        threading.Timer(0.01, os.kill, [os.getpid(), signal.SIGINT]).start()
    else:
        sys.__unraisablehook__(unraisable)
