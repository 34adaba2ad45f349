"""Ctrl-C while other libraries are at work."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def undisturbed() -> Generator[None]:
    """Holds an interruption back until the block has ended, and raises KeyboardInterrupt then: what was under way is
    not to be used. Within imports and renders, others make another error of it, in mid-air."""
    interrupt = signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is not interrupt:
        yield
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    except Exception:
        if not came:
            raise
    finally:
        signal.signal(signal.SIGINT, interrupt)
    if came:
        raise KeyboardInterrupt
