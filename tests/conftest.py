"""Fixtures for all tests."""

import numpy as np
import pytest
from helpers import SMALL

from sommerl import BrdfTable


@pytest.fixture
def small_table() -> BrdfTable:
    """Random reflectances, most of them dark, as measured ones are."""
    values = np.random.default_rng(0).random((*SMALL.shape, 3)) ** 6
    return BrdfTable(values, SMALL, name="small")
