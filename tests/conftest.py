"""Fixtures for all tests."""

import gc
import math
import os
import sys
from pathlib import Path

# Workers use all cores. If each had as many threads for linear algebra, these would mostly wait for each other.
os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
# In CI, pytest would write all differences of two long lists, which takes minutes; and many checks have to fail.
os.environ |= {"CI": "", "BUILD_NUMBER": ""}

import numpy as np
import pytest
from browser import browse, browse_for_all, chromium, chromium_with_webgpu, playwright  # noqa: F401 - fixtures
from helpers import SMALL

from sommerl import BrdfTable
from sommerl.commands import console

SLOW = frozenset((Path(__file__).parent / "slow.txt").read_text().split())  # by benchmarks/slow_tests.py

console.INTERVAL = math.inf  # or what is on standard error would depend on how fast a machine is


def pytest_collection_modifyitems(items):
    for item in items:
        if item.nodeid.partition("[")[0] in SLOW:
            item.add_marker("slow")
            # To count lines costs time in Python 3.11: decoders in plain Python take four times as long.
            if item.nodeid.startswith("tests/compression/"):
                item.add_marker("no_cover")


@pytest.fixture(autouse=True, scope="module")
def settle(request):
    """Frees Mitsuba's scenes, which are cycles of references, while its threads are at rest, and not at whatever moment
    of another module's tests: a run of all tests once stood still in one that never touches Mitsuba. What a module
    keeps goes, too: each render compiles all BSDFs that there are in the process."""
    yield
    if "drjit" in sys.modules:
        for kept in vars(request.module).values():
            if hasattr(kept, "cache_clear") and kept.__module__ == request.module.__name__:
                kept.cache_clear()
        sys.modules["drjit"].sync_thread()
        gc.collect()


@pytest.fixture
def small_table() -> BrdfTable:
    """Random reflectances, most of them dark, as measured ones are."""
    values = np.random.default_rng(0).random((*SMALL.shape, 3)) ** 6
    return BrdfTable(values, SMALL, name="small")
