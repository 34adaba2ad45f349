"""The comparison of benchmarks/real_plane.py with planes made by hand."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from helpers import must_fail

from sommerl import BrdfTable

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "real_plane.py"


def _script():
    spec = importlib.util.spec_from_file_location("real_plane", SCRIPT)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


real_plane = _script()
SEEN = (3, 5)  # (θ_h, θ_d) of a cell above the horizon
GRAZING = (0, 87)  # of one where both cosines are 0.04
HIDDEN = (89, 89)  # and of one that is not above it


def linear(byte):
    """What is `byte` on sRGB's curve (IEC 61966-2-1), as a fraction of 255."""
    x = byte / 255
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4


def table(f_r, phi_d=90):
    """One that is black but for a cell in bin `phi_d`."""
    values = np.zeros((90, 90, 180, 3))
    values[(*SEEN, phi_d)] = f_r
    return BrdfTable(values)


def by_hand(rgb, at=SEEN):
    plane = np.zeros((90, 90, 3), np.uint8)
    plane[at] = rgb
    return plane


def check_plane(brdf, rgb):
    np.testing.assert_array_equal(real_plane.plane(brdf), by_hand(rgb))


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
def test_it_is_rounded_down_and_clipped_at_1(interpolation):
    shown = table([linear(127.9), linear(5.9), 7.0]).with_interpolation(interpolation)
    check_plane(shown, [127, 5, 255])
    must_fail(check_plane, shown, [128, 6, 255])  # rounded to the nearest


def test_it_is_of_one_bin_of_phi_d():
    for beside in (89, 91):
        must_fail(check_plane, table([1.0, 1.0, 1.0], beside), [255, 255, 255])


def check_distance(found, real, all_, away):
    assert real_plane.distance(found, real) == pytest.approx((all_, away))


def test_the_distance_is_over_the_cells_above_the_horizon_and_away_from_grazing():
    cells = [int(each.sum()) for each in (real_plane.ABOVE, real_plane.AWAY)]
    assert cells == [8023, 6984]
    one_off = [10 * np.log10(255**2 * 3 * count) for count in cells]  # a difference of 1 in one channel of one cell
    check_distance(by_hand([127, 5, 255]), by_hand([126, 5, 255]), *one_off)
    farthest = [10 * np.log10(3 * count) for count in cells]  # not 8 bits wrapped around
    check_distance(by_hand([255, 0, 0]), by_hand([0, 0, 0]), *farthest)
    check_distance(by_hand([255] * 3, HIDDEN), by_hand([0] * 3), np.inf, np.inf)
    check_distance(by_hand([1, 0, 0], GRAZING), by_hand([0, 0, 0]), one_off[0], np.inf)
    must_fail(check_distance, by_hand([1, 0, 0]), by_hand([0, 0, 0]), one_off[0], np.inf)


def test_names_are_the_databases(tmp_path):
    archive = tmp_path / "many.npz"
    np.savez(archive, nickel=np.zeros(1), other=np.zeros(1))
    known = ["brass", "nickel"]
    found = list(real_plane.named([str(archive), f"{archive}:nickel", "tables/brass.binary"], known))
    assert found == [(f"{archive}:nickel", "nickel")] * 2 + [("tables/brass.binary", "brass")]
    with pytest.raises(SystemExit, match="expected a material of the planes, found other"):
        list(real_plane.named([f"{archive}:other"], known))
