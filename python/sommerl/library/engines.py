"""What does the work of a build: processes of this machine, or a cluster. Each is a `concurrent.futures.Executor`."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from ..system import threads
from ..system.errors import OptionError
from ..system.interrupt import hold_interrupts
from ..system.optional import optional

# Python has a process that clears up after others; it would complain of a build that was killed.
QUIET = "ignore::UserWarning:multiprocessing.resource_tracker"
CONNECTING = 10.0  # seconds in which a cluster has to answer


@dataclass(frozen=True)
class Engine:
    """open: begins, and ends after its block, at once if that fails. at_once: how many jobs it is given at a time, None
    for all: if a process of this machine dies, any of these may be why."""

    open: Callable[[], AbstractContextManager[Executor]]
    at_once: int | None


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processes(count: int) -> Engine:
    """So many processes of this machine, each with one thread."""
    return Engine(lambda: _processes(count), 2 * count)


def cluster(address: str, warn: Callable[[str], None]) -> Engine:
    """Dask's distributed scheduler at an address. warn: is told if it has no workers."""
    return Engine(lambda: _cluster(address, warn), None)


@contextmanager
def _processes(count: int) -> Generator[Executor]:
    # Not by fork: a copy of this process would hold the library's lock after its death.
    context = multiprocessing.get_context("spawn")
    life, ours = context.Pipe(duplex=False)
    quiet = ",".join(filter(None, (os.environ.get("PYTHONWARNINGS"), QUIET)))
    with life, ours, _inherited({threads.VARIABLE: "1", "PYTHONWARNINGS": quiet}):
        pool = ProcessPoolExecutor(count, context, initializer=_begin, initargs=(life,))
        try:
            yield pool
            pool.shutdown()
        except BaseException:
            with hold_interrupts():
                ours.close()  # ends them all, in the middle of their work
                pool.shutdown(cancel_futures=True)
            raise


@contextmanager
def _inherited(variables: Mapping[str, str]) -> Generator[None]:
    """Within the block, new processes have these variables in their environment."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _begin(life: Connection) -> None:
    """In a new process: it ends with the one that began it, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # which a terminal sends to both

    def wait() -> None:
        try:
            life.poll(None)
        finally:
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


@contextmanager
def _cluster(address: str, warn: Callable[[str], None]) -> Generator[Executor]:
    distributed = optional("distributed", "Dask's distributed scheduler", "--cluster", "cluster")
    for handler in logging.getLogger("distributed").handlers:
        handler.addFilter(lambda _: False)  # what fails is told in a sentence of ours
    try:
        with hold_interrupts(), warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            client: Any = distributed.Client(address, timeout=CONNECTING, set_as_default=False)
    except (OSError, ValueError, TypeError, TimeoutError) as error:
        raise OptionError(f"cluster: expected Dask's scheduler at {address}, found none ({error})") from error
    executor = client.get_executor(pure=False)
    try:
        if not client.scheduler_info()["workers"]:
            warn(f"{address}: expected workers of Dask's scheduler, found none yet; the build waits for them")
        yield executor
        executor.shutdown()
    except BaseException:
        with hold_interrupts():
            executor.shutdown(wait=False)  # takes back what has not begun
        raise
    finally:
        with hold_interrupts():
            client.close()
