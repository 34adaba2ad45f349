"""Fixtures for all tests."""

import gc
import math
import sys

import numpy as np
import pytest
from browser import browse, browse_for_all, chromium, chromium_with_webgpu, playwright  # noqa: F401 - fixtures
from helpers import SMALL

from sommerl import BrdfTable
from sommerl.commands import console

console.INTERVAL = math.inf  # or what is on standard error would depend on how fast a machine is


@pytest.fixture(autouse=True, scope="module")
def settle():
    """Frees Mitsuba's scenes, which are cycles of references, while its threads are at rest, and not at whatever moment
    of another module's tests: a run of all tests once stood still in one that never touches Mitsuba."""
    yield
    if "drjit" in sys.modules:
        sys.modules["drjit"].sync_thread()
        gc.collect()


@pytest.fixture
def small_table() -> BrdfTable:
    """Random reflectances, most of them dark, as measured ones are."""
    values = np.random.default_rng(0).random((*SMALL.shape, 3)) ** 6
    return BrdfTable(values, SMALL, name="small")
