"""NVIDIA's measured BSDFs: read, written, and damaged."""

import struct

import numpy as np
import page_files
import pytest
from helpers import complaint, must_fail, run, run_json

from sommerl import builtin, load
from sommerl.formats import mbsdf
from sommerl.reflectance.half_diff import spherical

VALUES = np.random.default_rng(0).normal(0.2, 0.3, (5, 5, 6, 3))
WHOLE = page_files.mbsdf(VALUES)


def put(tmp_path, data):
    path = tmp_path / "x.mbsdf"
    path.write_bytes(data)
    return path


def check_values(brdf, values):
    assert np.array_equal(brdf.values, values.astype("<f4").astype(float))


def test_read(tmp_path):
    grid = load(put(tmp_path, WHOLE))
    check_values(grid, VALUES)
    must_fail(check_values, grid, VALUES.swapaxes(0, 1))
    assert (grid.name, grid.signed, grid.mirrored) == ("x", True, True)
    centre = np.radians(18 * (np.arange(5) + 0.5))
    light, viewer = (np.stack(spherical(centre[k], phi), -1) for k, phi in ((1, 1.0), (3, 1.0 + np.pi * 2.5 / 6)))
    assert np.allclose(grid.eval(light, viewer), VALUES[1, 3, 2], atol=1e-6)


def test_grey(tmp_path):
    check_values(load(put(tmp_path, page_files.mbsdf(VALUES[..., 0], 0))), np.repeat(VALUES[..., :1], 3, axis=-1))


def test_transmission_is_left_out_and_told(tmp_path):
    head = b"MBSDF_DATA_TRANSMISSION=\n" + struct.pack("<3I", 0, 1, 1) + bytes(4)
    first, rest = WHOLE.split(b"\n", 1)
    for data in (first + b"\n" + head + b"\n" + rest, WHOLE + b"\n" + head):
        grid = load(put(tmp_path, data))
        check_values(grid, VALUES)
        assert grid.facts["transmission_left_out"]
    assert "transmission_left_out" not in load(put(tmp_path, WHOLE)).facts
    assert "found none" in str(complaint(load, put(tmp_path, first + b"\n" + head)))


def test_written_and_read_again(capsys, tmp_path):
    path, again = put(tmp_path, WHOLE), tmp_path / "y.mbsdf"
    run_json(capsys, "convert", path, again)
    check_values(load(again), VALUES)
    assert "--overwrite" in run(capsys, "convert", "nickel", again)[2]  # it may be a measurement
    run_json(capsys, "convert", "nickel", again, "--overwrite")
    grid = load(again)
    assert grid.values.shape == (45, 45, 90, 3)
    nickel, (theta, _, phi) = builtin("nickel"), grid.axes
    light, viewer = (np.stack(spherical(theta[k], p), -1) for k, p in ((10, 0.0), (30, phi[70])))
    assert np.allclose(grid.values[10, 30, 70], nickel.eval(light, viewer), rtol=1e-6)
    assert complaint(mbsdf.write, load(path), tmp_path / "z.mbsdf") is None


def cut(at, *numbers):
    head = WHOLE.index(b"=\n") + 2
    return WHOLE[:head] + struct.pack("<3I", *numbers) + WHOLE[head + 12 :] if numbers else WHOLE[:at]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"something else", "expected a measured BSDF"),
        (cut(40), "MBSDF_DATA_REFLECTION"),
        (cut(50), "cut off"),
        (cut(-4), "expected 1800 bytes of data, found 1796"),
        (cut(0, 7, 5, 6), "found type 7"),
        (cut(0, 1, 0, 6), "expected 1 to"),
        (cut(0, 1, 2**32 - 1, 2**32 - 1), "expected 1 to"),
        (WHOLE[:-4] + b"\xff\xff\xff\x7f", "finite"),
        (page_files.mbsdf(-np.ones((2, 2, 2, 3))), "positive"),
    ],
)
def test_damaged(tmp_path, data, said):
    path = put(tmp_path, data)
    assert str(complaint(load, path)).startswith(f"{path}: ")
    assert said in str(complaint(load, path))
