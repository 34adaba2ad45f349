"""The retro-reflective lobe, fitted to measured tapes."""

from pathlib import Path

import pytest
from helpers import must_fail

from sommerl import load
from sommerl.fitting import FitOptions, fit

TAPES = sorted((Path(__file__).resolve().parents[3] / "shared" / "data" / "alta").glob("*.dat"))
FEW = FitOptions(samples=20_000, starts=5)


def check_closer(tape, model):
    """By a tenth or more than GGX."""
    assert fit(tape, model, FEW).error < 0.9 * fit(tape, "ggx", FEW).error


@pytest.mark.parametrize("path", TAPES, ids=lambda path: path.stem)
def test_a_retro_reflective_lobe_fits_tapes_more_closely(path):
    tape = load(path)
    check_closer(tape, "retro-ggx")
    must_fail(check_closer, tape, "cook-torrance")
