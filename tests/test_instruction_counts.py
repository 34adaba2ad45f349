"""The guard on instructions lets nothing grow unseen."""

import importlib.util
import tomllib
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "instruction_counts.py"
spec = importlib.util.spec_from_file_location("instruction_counts", SCRIPT)
guard = importlib.util.module_from_spec(spec)
spec.loader.exec_module(guard)
KEPT = tomllib.loads(guard.KEPT.read_text())["instructions"]


@pytest.mark.parametrize(
    ("growth", "noticed"), [(0.0, []), (-0.5, []), (0.025, []), (0.035, ["train"]), (3.0, ["train"])]
)
def test_growth_is_noticed(growth, noticed):
    found = KEPT | {"train": round(KEPT["train"] * (1 + growth))}
    assert guard.grown(found, KEPT) == noticed


def test_all_are_kept():
    assert sorted(KEPT) == sorted(guard.WORKS)
