"""The command `eval`, and what `convert` writes as samples."""

import numpy as np
import pytest
from helpers import must_fail, run, run_json

from sommerl import builtin, load
from sommerl.formats import mbsdf, samples
from sommerl.formats.grids import regular
from sommerl.reflectance.grid import GridBrdf

DIRECTIONS = "theta_i_deg,theta_o_deg,dphi_deg,remark\n10,20,30,a\n0,0,0,b\n60,75,180,c\n100,20,0,d\n"


def vector(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def check_values(rows, brdf):
    """rows: θ_i, φ_i, θ_o, φ_o [rad], f_r."""
    wanted = brdf.eval(vector(rows[:, 0], rows[:, 1]), vector(rows[:, 2], rows[:, 3]))
    assert np.allclose(rows[:, 4:], wanted, rtol=1e-6)


def from_text(path):
    rows = np.loadtxt(path, delimiter=",", skiprows=2)
    rows[:, :4] = np.radians(rows[:, :4])
    return rows


def test_eval(capsys, tmp_path):
    given, out = tmp_path / "directions.csv", tmp_path / "out.csv"
    given.write_text(DIRECTIONS)
    result = run_json(capsys, "eval", "nickel", given, "-o", out)
    assert (result["directions"], result["output"], result["bytes_disk"]) == (4, str(out), out.stat().st_size)
    rows = from_text(out)
    assert np.allclose(rows[:, 3], np.radians([30, 0, 180, 0]))
    assert not rows[3, 4:].any()
    check_values(rows, builtin("nickel"))
    must_fail(check_values, rows, builtin("chrome"))
    run_json(capsys, "eval", "nickel", given, "-o", tmp_path / "out.npy")
    check_values(np.load(tmp_path / "out.npy"), builtin("nickel"))
    assert "4 pairs of directions → " in run(capsys, "eval", "nickel", given, "-o", out)[1]  # which it may replace


@pytest.mark.parametrize(
    ("text", "arguments", "said"),
    [
        (DIRECTIONS, ["-o", "{}/x.txt"], "expected a name that ends in .csv or .npy"),
        (DIRECTIONS, ["-o", "{}/directions.csv"], "expected an output other than the input"),
        ("theta_i_deg,theta_o_deg,dphi_deg\n10,,30\n", ["-o", "{}/x.csv"], "found none in line 2"),
        ("theta_i_deg,phi_deg,x\n10,1,30\n", ["-o", "{}/x.csv"], "found none for theta_o"),
        ("10,20,30\n", ["-o", "{}/x.csv"], "line 1: expected the names of columns"),
        (DIRECTIONS, [], "-o"),
    ],
)
def test_what_eval_refuses(capsys, tmp_path, text, arguments, said):
    given = tmp_path / "directions.csv"
    given.write_text(text)
    status, _, err = run(capsys, "eval", "nickel", given, *(each.format(tmp_path) for each in arguments))
    assert status in (1, 2)
    assert said in err


@pytest.mark.parametrize("extension", [".csv", ".npy"])
def test_a_material_is_written_as_samples(capsys, tmp_path, extension):
    path = tmp_path / f"x{extension}"
    run_json(capsys, "convert", "nickel", path)
    rows = np.load(path) if extension == ".npy" else from_text(path)
    assert len(rows) == 18 * 18 * 37
    check_values(rows, builtin("nickel"))
    found = samples.samples_of(path, path.read_bytes()).samples
    assert np.allclose(found.f_r, builtin("nickel").eval(found.wi, found.wo), rtol=1e-5)


def test_tabs(capsys, tmp_path):
    run_json(capsys, "convert", "nickel", tmp_path / "x.tsv")
    first = (tmp_path / "x.tsv").read_text().splitlines()[1]
    assert first.count("\t") == 6


def test_a_grid_is_written_at_its_own_angles(capsys, tmp_path):
    values = np.random.default_rng(0).normal(size=(3, 3, 4, 3)) / 10  # no more than there is
    theta = (np.arange(3) + 0.5) / 3 * np.pi / 2
    mbsdf.write(GridBrdf(theta, theta, (np.arange(4) + 0.5) / 4 * np.pi, np.ones((3, 3, 4, 3))), tmp_path / "one.mbsdf")
    path = tmp_path / "x.mbsdf"
    data = (tmp_path / "one.mbsdf").read_bytes()
    path.write_bytes(data[: -4 * values.size] + values.astype("<f4").tobytes())
    run_json(capsys, "convert", path, tmp_path / "x.npy")
    rows = np.load(tmp_path / "x.npy")
    grid = regular(rows[:, 0], rows[:, 2], rows[:, 3], rows[:, 4:])
    assert grid
    axes, again = grid
    assert np.allclose(axes[2], load(path).axes[2])
    assert np.allclose(again, values, atol=1e-6)


def test_what_is_no_whole_grid():
    theta, phi = np.meshgrid([0.1, 0.2, 0.3], [0.0, 1.0, 2 * np.pi], indexing="ij")
    theta, phi = theta.reshape(-1), phi.reshape(-1)
    values = np.arange(9.0)[:, None]
    (axes, found) = regular(theta, theta * 0, phi, values) or ((), None)
    assert [len(axis) for axis in axes] == [3, 1, 2]  # without the second end of the turn
    assert np.array_equal(found[:, 0, :, 0], values.reshape(3, 3)[:, :2])
    assert regular(theta[1:], theta[1:] * 0, phi[1:], values[1:]) is None
    assert regular(np.append(theta, 0.1), np.zeros(10), np.append(phi, 0.0), np.arange(10.0)[:, None]) is None
