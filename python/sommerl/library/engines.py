"""What does the work of a build: processes of this machine, or a cluster. Each is a `concurrent.futures.Executor`."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from ..system import threads
from ..system.errors import MaterialError, OptionError
from ..system.interrupt import hold_interrupts
from ..system.optional import optional

J = TypeVar("J")  #: a job
R = TypeVar("R")  #: what comes of it

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


def results(work: Callable[[J], R], jobs: Sequence[J], engine: Engine) -> Generator[tuple[J, R | BaseException]]:
    """What comes of each job, in the order in which they end.

    If a process dies, its job is not known: all that were begun are done once more, one by one, so that the one that
    it died of is told from the others. Raises MaterialError if a cluster gives up.
    """
    waiting, suspects = deque(jobs), deque[J]()
    while waiting or suspects:
        alone = not waiting
        queue = deque([suspects.popleft()]) if alone else waiting
        with engine.open() as executor:
            for job, result in _until_broken(executor, work, queue, engine.at_once):
                if isinstance(result, BrokenExecutor) and not alone:
                    suspects.append(job)
                else:
                    yield job, result


def _until_broken(
    executor: Executor, work: Callable[[J], R], queue: deque[J], at_once: int | None
) -> Iterator[tuple[J, R | BaseException]]:
    """Takes jobs from a queue, and gives what comes of them, until the queue is empty or the executor is broken."""
    begun: dict[Future[R], J] = {}
    broken = False
    while begun or (queue and not broken):
        while queue and not broken and (at_once is None or len(begun) < at_once):
            try:
                begun[executor.submit(work, queue[0])] = queue[0]
                queue.popleft()
            except BrokenExecutor as error:
                broken = True
                if not begun:
                    yield queue.popleft(), error
        for future in wait(begun, return_when=FIRST_COMPLETED).done:
            job = begun.pop(future)
            try:
                yield job, future.result()
            except CancelledError as error:
                raise MaterialError("cluster: expected it to go on, found its work cancelled; run again") from error
            except Exception as error:
                broken = broken or isinstance(error, BrokenExecutor)
                yield job, error


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
    distributed = optional("distributed", "Dask's distributed scheduler", "--cluster", "library")
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
