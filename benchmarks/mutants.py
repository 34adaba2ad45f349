"""Would the tests notice? Small faults, put into the method's code one at a time, by the operators of cosmic-ray.

    uv run --with cosmic-ray --with coverage python benchmarks/mutants.py [--sample 200] [--seed 0]
    uv run --with cosmic-ray --with coverage python benchmarks/mutants.py --mutants 17 204      some of them again

Draws a sample of all mutants of `ROOMS`, evenly. Each is tried against those of `TESTS` that run the line it is in, the
fastest first, until one fails: it is killed. Nothing is written to the source: a child process imports the changed
module in its place. A mutant that needs more than LIMIT seconds of CPU counts as killed, and one that no test runs as
survived. What annotations hold is never run, and not changed. Prints the share killed with its 95 % interval
(Wilson's), and the survivors. It takes about ten minutes of CPU for 200, with the recording.
"""

from __future__ import annotations

import argparse
import ast
import importlib.abc
import importlib.util
import json
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import accumulate
from math import sqrt
from pathlib import Path
from typing import Any

import coverage
import pytest
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "python"
ROOMS = {
    "reflectance": "sommerl/reflectance/*.py",
    "compression": "sommerl/compression/**/*.py",
    "sampling": "sommerl/sampling/*.py",
    "the reader of samples": "sommerl/formats/samples.py",
    "scattered samples": "sommerl/formats/regression.py",
}
TESTS = (
    *("tests/compression", "tests/sampling", "tests/formats/test_samples.py", "tests/formats/test_scattered.py"),
    *("tests/test_directions.py", "tests/test_facts.py", "tests/test_half_diff.py", "tests/test_lattice.py"),
    *("tests/test_lookup.py", "tests/test_materials.py", "tests/test_node_lookup.py", "tests/test_nodes.py"),
    *("tests/test_origin.py", "tests/test_table.py"),
)
RENDERS = ("test_on_device", "test_javascript", "test_judge")  # need a compiler or another program, and take long
LIMIT = 60  # seconds of CPU, for one mutant
LONGEST = 10  # seconds of CPU that a test may take, measured by coverage, to be among those that are run
CASES = 4  # of a test with many, evenly chosen
BUDGET = 6  # seconds of CPU after which no other test is tried against a mutant; the fastest come first


@dataclass(frozen=True)
class Mutant:
    room: str
    path: Path
    operator: str
    occurrence: int
    line: int

    def code(self) -> str:
        return mutate_code(self.path.read_text(), get_operator(self.operator)(), self.occurrence)

    def __str__(self) -> str:
        before, after = self.path.read_text().splitlines(), self.code().splitlines()
        at = next((k for k, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1]), self.line - 1)
        change = f"`{before[at].strip()}` → `{after[at].strip()}`"
        return f"{self.path.relative_to(SOURCE)}:{at + 1}: {change}"


def all_mutants() -> list[Mutant]:
    found: list[Mutant] = []
    operators = [
        (name, get_operator(name)()) for name in sorted(operator_names()) if not get_operator(name).arguments()
    ]
    for room, pattern in ROOMS.items():
        for path in sorted(SOURCE.glob(pattern)):
            tree, unused = get_ast(path.read_text()), set(annotated(ast.parse(path.read_text())))
            for name, operator in operators:
                places = (place for node in ast_nodes(tree) for place in operator.mutation_positions(node))
                found += [
                    Mutant(room, path, name, k, start[0]) for k, (start, _) in enumerate(places) if start not in unused
                ]
    return found


def annotated(tree: ast.AST) -> Iterator[tuple[int, int]]:
    """The places (line, column) that lie in annotations."""
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):
            for part in ast.walk(getattr(node, name, None) or ast.Pass()):
                if isinstance(part, ast.expr):
                    columns = range(part.col_offset, part.end_col_offset or 0)
                    yield from ((part.lineno, column) for column in columns)


class TooLong(BaseException):
    """A test takes more than LONGEST. No Exception, or hypothesis would look for a shorter example."""


class Recorder:
    """A pytest plugin: which tests pass in time, what they take, and, by coverage's contexts, which lines they run."""

    def __init__(self, measured: coverage.Coverage) -> None:
        self._measured = measured
        self.seconds: dict[str, float] = {}
        self._failed: set[str] = set()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        cases: dict[str, list[pytest.Item]] = {}
        for item in items:
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
        items[:] = [item for each in cases.values() for item in each[:: -(-len(each) // CASES)]]

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._measured.switch_context(item.nodeid)
        started = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, LONGEST, LONGEST)
        yield
        signal.setitimer(signal.ITIMER_PROF, 0)
        if item.nodeid not in self._failed:
            self.seconds[item.nodeid] = time.process_time() - started

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self._failed.add(report.nodeid)


def record(output: Path) -> int:
    """Runs all tests, in this process, and writes each one's seconds and the tests of each line."""
    measured = coverage.Coverage(data_file=None, include=[f"{SOURCE}/sommerl/*"], config_file=False)
    recorder = Recorder(measured)
    signal.signal(signal.SIGPROF, too_long)
    measured.start()
    left_out = [f"--ignore-glob=*{name}*" for name in RENDERS]
    pytest.main(["-q", *quiet(), *left_out, *TESTS], plugins=[recorder])
    measured.stop()
    data = measured.get_data()
    lines = {path: data.contexts_by_lineno(path) for path in data.measured_files()}
    output.write_text(json.dumps({"seconds": recorder.seconds, "lines": lines}))
    return 0


def too_long(*_: object) -> None:
    raise TooLong


def quiet() -> list[str]:
    plugins = ("cacheprovider", "xdist", "hypothesispytest")
    return [*(f"-pno:{name}" for name in plugins), "--assert=plain", "-o", "addopts=", "-o", "faulthandler_timeout=0"]


def tests_of(mutant: Mutant, recorded: dict[str, Any]) -> list[str]:
    """Those that run its statement; if it is run when the module is imported, all that run anything of the file."""
    lines = recorded["lines"].get(str(mutant.path), {})
    first, last = statement(mutant)
    found = {test for line in range(first, last + 1) for test in lines.get(str(line), [])}
    if "" in found:
        found = {test for tests in lines.values() for test in tests}
    seconds = {test: recorded["seconds"][test] for test in found if test in recorded["seconds"]}
    fastest = sorted(seconds, key=lambda test: seconds[test])
    spent = accumulate((seconds[test] for test in fastest), initial=0.0)
    return [test for test, before in zip(fastest, spent, strict=False) if before < BUDGET]


def statement(mutant: Mutant) -> tuple[int, int]:
    """First and last line of the innermost statement, or of the head of one that has a body."""
    best = (mutant.line, mutant.line)
    for node in ast.walk(ast.parse(mutant.path.read_text())):
        if isinstance(node, ast.stmt) and node.lineno <= mutant.line <= (node.end_lineno or 0):
            body = getattr(node, "body", None)
            last = max(node.lineno, body[0].lineno - 1) if body else node.end_lineno or node.lineno
            if mutant.line <= last:
                best = (node.lineno, last)
    return best


class Finder(importlib.abc.MetaPathFinder):
    """Imports a mutant in the place of its module."""

    def __init__(self, mutant: Mutant) -> None:
        self._path, self._code = mutant.path, mutant.code()
        self._module = ".".join(mutant.path.relative_to(SOURCE).with_suffix("").parts)

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> Any:
        if fullname != self._module:
            return None
        loader = Loader(fullname, str(self._path))
        loader.code = self._code
        return importlib.util.spec_from_file_location(fullname, self._path, loader=loader)


class Loader(importlib.machinery.SourceFileLoader):
    code: str

    def get_code(self, fullname: str) -> Any:
        return compile(self.code, self.path, "exec")


def in_a_child(work: Callable[[], int]) -> int:
    """What `work` returns in a child process; another number if it dies."""
    child = os.fork()
    if not child:
        os.setsid()
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(null, stream)
        status = 99
        try:
            status = work()
        finally:
            os._exit(status)
    code = os.waitpid(child, 0)[1]
    return os.waitstatus_to_exitcode(code)


def survives(mutant: Mutant, tests: list[str]) -> bool:
    def attempt() -> int:
        resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
        signal.alarm(20 * LIMIT)  # of one that waits
        sys.meta_path.insert(0, Finder(mutant))
        return int(pytest.main(["-x", "-q", *quiet(), *tests]))

    return not tests or in_a_child(attempt) == 0


def interval(killed: int, count: int) -> tuple[float, float]:
    """Wilson's, of 95 %."""
    z, share = 1.96, killed / count
    middle, width = share + z * z / (2 * count), z * sqrt(share * (1 - share) / count + (z / (2 * count)) ** 2)
    return (middle - width) / (1 + z * z / count), (middle + width) / (1 + z * z / count)


def prepare() -> None:
    """Imports what takes long, once for all children; nothing of the package."""
    os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
    os.chdir(ROOT)
    sys.path.insert(0, str(SOURCE))
    for module in (
        "numpy",
        "scipy.optimize",
        "scipy.sparse.linalg",
        "scipy.spatial",
        "scipy.stats",
        "hypothesis",
        "rich.console",
    ):
        importlib.import_module(module)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--mutants", type=int, nargs="+", help="their numbers, as printed, instead of a sample")
    given = parser.parse_args()
    prepare()
    mutants = all_mutants()
    chosen = given.mutants or sorted(random.Random(given.seed).sample(range(len(mutants)), given.sample))
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "recorded.json"
        if in_a_child(lambda: record(output)):
            raise SystemExit("the tests cannot be run")
        recorded = json.loads(output.read_text())
    print(f"{len(mutants)} mutants; {len(chosen)} drawn; {len(recorded['seconds'])} tests\n", flush=True)
    survived: list[int] = []
    for number in chosen:
        tests = tests_of(mutants[number], recorded)
        if survives(mutants[number], tests):
            survived.append(number)
            print(f"* {number}, {len(tests)} tests: {mutants[number]}", flush=True)
    print("\n| room | mutants | drawn | killed |\n|---|---|---|---|")
    for room in ROOMS:
        drawn = [number for number in chosen if mutants[number].room == room]
        killed = len(drawn) - sum(number in survived for number in drawn)
        print(f"| {room} | {sum(mutant.room == room for mutant in mutants)} | {len(drawn)} | {killed} |")
    killed = len(chosen) - len(survived)
    low, high = interval(killed, len(chosen))
    print(f"\nkilled: {killed} of {len(chosen)}, {killed / len(chosen):.1%} ({low:.1%} to {high:.1%})")


if __name__ == "__main__":
    main()
