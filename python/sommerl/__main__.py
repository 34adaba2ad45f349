"""`python -m sommerl` and the command `sommerl`.

Nothing but Python's own modules is imported before signals are held back: NumPy comes with the command line.
"""

import os
import sys
from collections.abc import Callable

from .system.interrupt import STATUS, handle_signals, hold_interrupts, ignore_signals, remove_temporaries


def main() -> int:
    """Runs the command line; returns the exit status.

    An interruption counts from the first moment. It ends the process here, with 130: Python itself would wait for
    threads first, and take modules apart that were left in the middle of their work.
    """
    outputs = _open_streams()
    try:
        handle_signals()
        with hold_interrupts():
            from .commands.cli import main as run
            from .commands.outcome import fail, settled
        status = _status(run) if outputs else fail("standard output: expected it open, found it closed", 1)
    except KeyboardInterrupt:
        ignore_signals()
        _interrupted()
        os._exit(STATUS)
    ignore_signals()
    if not settled() and status == 0:
        status = fail("standard output: cannot be written", 1)
        settled()
    return status


def _status(run: Callable[[], int]) -> int:
    try:
        return run()
    except SystemExit as stop:  # of --help, and of wrong options
        return int(stop.code or 0)


def _interrupted() -> None:
    from .commands.outcome import fail, settled

    remove_temporaries()
    fail("interrupted; nothing was left half-written", STATUS)
    settled()


def _open_streams() -> bool:
    """Opens those standard streams that are closed, so that no file takes their numbers, and what is printed with it;
    returns whether there is an output."""
    while (null := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(null)
    closed = [name for name in ("stdout", "stderr") if getattr(sys, name) is None]
    for name in closed:
        setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    return "stdout" not in closed


if __name__ == "__main__":
    sys.exit(main())
