"""Measurements on grids, and ALTA's samples, as they come."""

from pathlib import Path

import numpy as np
import pytest
from helpers import must_fail

from sommerl import load
from sommerl.formats import alta
from sommerl.formats.grids import on_grid
from sommerl.formats.mbsdf import write

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
PAINTS = sorted((DATA / "mdl").glob("*.mbsdf"))


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def check_grid(grid, values):
    assert np.allclose(on_grid(grid, grid.axes), values, atol=1e-6)


@pytest.mark.parametrize("path", PAINTS, ids=lambda path: path.stem)
def test_car_paints(path, tmp_path):
    grid = load(path)
    values = np.frombuffer(path.read_bytes()[-4 * grid.values.size :], "<f4").reshape(45, 45, 90, 3)
    check_grid(grid, values)
    must_fail(check_grid, grid, values.swapaxes(0, 1))
    assert 0.1 < (grid.values < 0).mean() < 0.15
    assert grid.signed
    write(grid, tmp_path / "again.mbsdf")
    assert (tmp_path / "again.mbsdf").read_bytes() == path.read_bytes()


def test_asphalt():
    """One direction of the viewer, whatever the light's: 59 angles, 32 wavelengths."""
    grid = load(DATA / "asam" / "example_material_camera_brdf.xompt")
    assert grid.values.shape == (59, 1, 1, 3)
    assert grid.facts["values"] == "32 wavelengths, 390 to 700 nm"
    assert 1e-5 < grid.values.min() < grid.values.max() < 5e-5


@pytest.mark.parametrize("light", [22.5, 45.0, 67.5])
def test_zemax_is_brightest_about_the_specular_direction(light):
    grid = load(DATA / "optics" / "test_13_brdf_one_wavelength_BRDF_zemax_reference.bsdf")
    theta = np.radians(np.arange(0, 88, 0.5))
    found = grid.eval(direction(np.radians(light), 0.0), direction(theta, np.pi))[:, 1]
    at = np.degrees(theta[np.argmax(found)])
    assert abs(at - light) < 15
    assert found.max() > 2 * grid.eval(direction(np.radians(light), 0.0), direction(np.radians(light), 0.5))[1]


def test_retro_reflective_tape():
    path = DATA / "alta" / "retro-3M-jaune.dat"
    found = alta.samples_of(path, path.read_bytes())
    rows = np.loadtxt(path)
    assert found.facts["rows"] == len(rows) == 7397
    at_30 = found.samples.some(np.abs(found.samples.wi[:, 2] - np.cos(np.radians(30))) < 1e-6)
    angle = np.arccos(np.clip((at_30.wi * at_30.wo).sum(axis=1), -1, 1))
    assert np.degrees(angle[np.argmax(at_30.f_r[:, 0])]) < 3  # towards the light
    assert np.allclose(found.samples.f_r[:, 0] * np.maximum(found.samples.wo[:, 2], 0.01), rows[:, 3], rtol=1e-6)
