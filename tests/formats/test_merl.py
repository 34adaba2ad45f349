import os

import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl import MERL, BrdfTable, Lattice, load
from sommerl.formats import merl
from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import half_diff
from sommerl.system.errors import FormatError, MaterialError

RNG = np.random.default_rng(0)


def raw(dimensions=(90, 90, 180), planes=None):
    header = np.array(dimensions, "<i4").tobytes()
    return header + (np.ones((3, *dimensions)) if planes is None else planes).astype("<f8").tobytes()


def test_scale_and_order_of_the_planes(tmp_path):
    """Three values placed by hand, where the published reader looks for them."""
    planes = np.ones(3 * MERL.size)
    cell = 7 + 180 * (20 + 90 * 3)
    planes[cell], planes[MERL.size + cell], planes[2 * MERL.size + cell] = 1500, 3000, 4500
    path = tmp_path / "x.binary"
    path.write_bytes(raw(planes=planes))
    table = merl.read(str(path))
    assert np.allclose(table.values[3, 20, 7], [1, 2 * 1.15, 3 * 1.66], rtol=1e-15)
    assert np.allclose(table.values[3, 20, 8], np.array([1, 1.15, 1.66]) / 1500, rtol=1e-15)


@pytest.mark.parametrize("lattice", [MERL, Lattice(phi_d=360, reciprocal=False)])
def test_round_trip(tmp_path, lattice):
    table = BrdfTable(RNG.random((*lattice.shape, 3)), lattice)
    path = tmp_path / "table.binary"
    merl.write(table, path)
    assert path.stat().st_size == merl.bytes_on_disk(lattice)
    again = load(path)
    assert isinstance(again, BrdfTable)
    assert again.lattice == lattice
    assert np.allclose(again.values, table.values, rtol=1e-15, atol=0)
    assert again.counts.cells_clamped == 0
    assert again.name == "table"


def test_360_bins_are_not_reciprocal(tmp_path):
    lattice = Lattice(phi_d=360, reciprocal=False)
    values = np.broadcast_to(np.where(np.arange(360) < 180, 1.0, 2.0)[:, None], (*lattice.shape, 3))
    path = tmp_path / "table.binary"
    merl.write(BrdfTable(values, lattice), path)
    table = load(path)
    wi, wo = [0.6, 0.0, 0.8], [0.0, 0.28, 0.96]
    assert sorted([table.eval(wi, wo)[0], table.eval(wo, wi)[0]]) == pytest.approx([1, 2])


def check_what_is_written_below(stored):
    """Negative only where no pair of directions above the horizon looks; 76.2 % of the cells are above in part."""
    cells = MERL.cell(*half_diff(split(random_directions(1_000_000, 1)), split(random_directions(1_000_000, 2))))
    assert (stored.reshape(3, -1)[:, cells] > 0).all()
    assert (stored > 0).mean() == pytest.approx(0.766, abs=5e-3)


def test_below_the_horizon_is_written_as_the_database_does(tmp_path):
    path = tmp_path / "table.binary"
    merl.write(BrdfTable(np.ones((*MERL.shape, 3))), path)
    stored = np.fromfile(path, "<f8", offset=12).reshape(3, *MERL.shape)
    assert (stored[:, ~MERL.above_horizon] < 0).mean() > 0.9
    check_what_is_written_below(stored)
    must_fail(check_what_is_written_below, np.where(MERL.above_horizon, stored, -1))


def test_an_oversized_file_is_not_read(tmp_path):
    path = tmp_path / "huge.binary"
    with path.open("wb") as stream:
        stream.write(np.array(MERL.shape, "<i4").tobytes())
        stream.truncate(2**40)
    with pytest.raises(FormatError, match="expected at most 69984012 bytes, found 1099511627776"):
        load(path)


def test_names_that_are_not_text_become_text(tmp_path):
    path = tmp_path / os.fsdecode(b"n\xff.binary")
    merl.write(BrdfTable(np.ones((*MERL.shape, 3))), path)
    assert load(path).name == "n\ufffd"


def test_another_lattice_is_not_written(tmp_path, small_table):
    with pytest.raises(FormatError, match="expected a MERL lattice"):
        merl.write(small_table, tmp_path / "x.binary")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "found an empty one"),
        (b"abc", "expected a MERL header of 12 bytes, found 3"),
        (b"This is a text about reflectance.", "expected MERL dimensions 90×90×180 or 90×90×360, found"),
        (raw((90, 90, 90)), "found 90×90×90"),
        (raw((90, 90, 180))[:-1], "expected 34992012 bytes for these dimensions, found 34992011"),
        (raw((90, 90, 180))[:12], "found 12"),
        (raw((90, 90, 180)) + b"\0", "found 34992013"),
        (np.array([-90, -90, 180], "<i4").tobytes(), "found -90×-90×180"),
        (np.array([2**31 - 1] * 3, "<i4").tobytes(), "found 2147483647×"),
    ],
)
def test_damaged_files(tmp_path, data, message):
    path = tmp_path / "bad.binary"
    path.write_bytes(data)
    with pytest.raises(FormatError, match=message) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: expected")


def test_all_negative(tmp_path):
    path = tmp_path / "dark.binary"
    path.write_bytes(raw(planes=np.full((3, MERL.size), -1.0)))
    with pytest.raises(MaterialError, match=r"dark\.binary: expected a positive, finite reflectance"):
        load(path)


def test_nan_and_infinities_are_clamped_and_counted(tmp_path):
    planes = np.ones((3, MERL.size))
    planes[0, 0], planes[1, 1], planes[:, 2] = np.nan, -np.inf, np.inf
    path = tmp_path / "holes.binary"
    path.write_bytes(raw(planes=planes))
    assert load(path).counts.cells_clamped == 3


def test_nan_that_signals_is_as_any_other(tmp_path):
    """Also below the horizon, where nobody reads it: no warning comes."""
    planes = np.ones((3, *MERL.shape))
    signals = np.array(0x7FF0000000000001, np.uint64).view(np.float64)
    planes[0][~MERL.above_horizon] = signals
    with pytest.raises(FloatingPointError), np.errstate(invalid="raise"):
        planes * 2.0  # so it does signal
    (tmp_path / "x.binary").write_bytes(raw(planes=planes))
    table = load(tmp_path / "x.binary")
    assert table.counts.cells_clamped == 0
    merl.write(table, tmp_path / "y.binary")
    assert (tmp_path / "y.binary").read_bytes() == (tmp_path / "x.binary").read_bytes()
