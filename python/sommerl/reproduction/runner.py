"""Makes cells by several processes, keeps what comes of each, and goes on where it was stopped."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, replace
from typing import Any

from ..library.engines import processes, processors, results
from ..system import threads
from ..system.errors import MaterialError
from .cells import Cell, Outcome, Setting, Store, plain

Progress = Callable[[int, int], None]  #: work done, and in all, in parts of a second


@dataclass(frozen=True)
class Job:
    """A cell that is to be made."""

    cell: Cell
    setting: Setting


def run(
    cells: Sequence[Cell],
    setting: Setting,
    store: Store,
    progress: Callable[[str], AbstractContextManager[Progress | None]] = lambda _: nullcontext(),
) -> dict[str, Outcome]:
    """The outcomes of cells, by their names. Those that the store has already are not made again; the others are made
    by as many processes as there are processors, and kept one by one. Cells that have to be alone come last.

    progress: with what takes long; in its block, what it gives is called with how far that is. Raises what a cell
    raises, MaterialError if a process dies; what is done by then is kept.
    """
    keys = {cell.name: cell.key(setting) for cell in cells}
    found = {cell.name: store.load(cell, keys[cell.name]) for cell in cells}
    wanted = [cell for cell in cells if found[cell.name] is None]
    done, total = 0.0, sum(cell.cost for cell in wanted)
    with progress("measuring") as advance:
        for alone, count in ((False, threads.limit() or processors()), (True, 1)):
            # The longest first, so that no process is left with one when the others have ended.
            jobs = [Job(cell, setting) for cell in sorted(wanted, key=lambda cell: -cell.cost) if cell.alone == alone]
            if not jobs:
                continue
            with closing(results(perform, jobs, processes(min(count, len(jobs))))) as made:
                for job, outcome in made:
                    if isinstance(outcome, BaseException):
                        raise _told(job.cell, outcome)
                    store.save(job.cell, keys[job.cell.name], outcome)
                    found[job.cell.name] = outcome
                    done += job.cell.cost
                    if advance:
                        advance(round(10 * done), round(10 * total))
    return {name: outcome for name, outcome in found.items() if outcome is not None}


def perform(job: Job) -> Outcome:
    """Makes a cell, in a process of its own."""
    started = time.perf_counter()
    outcome = job.cell.work(job.setting, **job.cell.arguments)
    return replace(outcome, values=plain(outcome.values), seconds=round(time.perf_counter() - started, 2))


def values(outcomes: Mapping[str, Outcome], prefix: str) -> dict[str, Mapping[str, Any]]:
    """The values of the cells whose names begin so, by what follows."""
    return {name[len(prefix) :]: each.values for name, each in outcomes.items() if name.startswith(prefix)}


def _told(cell: Cell, error: BaseException) -> BaseException:
    if type(error).__name__ == "BrokenProcessPool":
        return MaterialError(f"{cell.name}: expected a process to measure it, found it killed; is there enough memory?")
    return error
