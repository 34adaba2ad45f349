"""ASAM's BRDF tables: read, written, and damaged."""

import json

import numpy as np
import pytest
from helpers import complaint, must_fail, run_json

from sommerl import builtin, load
from sommerl.formats import xompt
from sommerl.formats.reading import Reading, reading
from sommerl.formats.spectra import PRIMARIES, WRITTEN, srgb_weights, to_rgb
from sommerl.reflectance.grid import GridBrdf
from sommerl.reflectance.half_diff import spherical

THETA_I, THETA_O, PHI = np.array([0.0, 0.5, 1.2]), np.array([0.1, 0.9]), np.array([0.0, 1.0, 2.0, 3.0])
NANOMETRES = np.array([450.0, 550.0, 650.0])
SPECTRA = np.random.default_rng(0).random((3, 2, 4, 3)) + 0.1


def rows(angles=(THETA_I, THETA_O, PHI), spectra=SPECTRA):
    directions = np.stack([angle.reshape(-1) for angle in np.meshgrid(*angles, indexing="ij")], -1)
    blocks = [
        np.column_stack([np.full(len(directions), nm * 1e-9), directions, spectra[..., k].reshape(-1)])
        for k, nm in enumerate(NANOMETRES)
    ]
    return np.concatenate(blocks).tolist()


def content(table, indent=4, **more):
    return json.dumps(
        {"metadata": {"openMaterial3dVersion": "1.0.0"}, "brdf": {"lookupTable": table} | more}, indent=indent
    )


def put(tmp_path, text):
    path = tmp_path / "x.xompt"
    path.write_text(text)
    return path


def check_grid(grid, spectra):
    assert isinstance(grid, GridBrdf)
    assert all(np.allclose(a, b) for a, b in zip(grid.axes, (THETA_I, THETA_O, PHI), strict=True))
    assert np.allclose(grid.values, to_rgb(spectra.reshape(-1, 3), NANOMETRES).reshape(3, 2, 4, 3))


@pytest.mark.parametrize("indent", [None, 4])
@pytest.mark.parametrize("at_once", [7000, 2**24])
def test_read(tmp_path, monkeypatch, indent, at_once):
    monkeypatch.setattr(xompt, "AT_ONCE", at_once)
    table = rows()
    np.random.default_rng(1).shuffle(table)
    grid = load(put(tmp_path, content(table, indent, wavelengths=[1])))
    check_grid(grid, SPECTRA)
    must_fail(check_grid, grid, SPECTRA[::-1])
    assert grid.facts["values"] == "3 wavelengths, 450 to 650 nm"


def test_one_wavelength_is_grey(tmp_path):
    grid = load(put(tmp_path, content([row for row in rows() if row[0] == 550e-9])))
    assert np.allclose(grid.values, SPECTRA[..., 1:2])
    assert grid.facts["values"] == "550 nm alone, as grey"


def test_directions_that_are_no_grid_are_samples(tmp_path):
    angles = np.random.default_rng(2).random((60, 3)) * [1.5, 1.5, 6]
    table = [[550e-9, *each, 0.25] for each in angles.tolist()]
    found = load(put(tmp_path, content(table)))
    assert not isinstance(found, GridBrdf)
    assert found.facts["samples"] == 60
    assert np.allclose(found.eval([0.3, 0, 0.954], [0, 0.2, 0.98]), 0.25, rtol=0.01)


def check_meant(grid, factor, turned=0):
    """Whether a grid has the values of SPECTRA times a factor, with the viewer's azimuth turned by so many points."""
    expected = to_rgb(SPECTRA.reshape(-1, 3), NANOMETRES).reshape(3, 2, 4, 3) * factor
    assert isinstance(grid, GridBrdf)
    assert np.allclose(grid.values, np.roll(expected, turned, axis=2))


QUARTERS = (THETA_I, THETA_O, np.radians([0.0, 90.0, 180.0, 270.0]))


@pytest.mark.parametrize(
    ("how", "factor", "turned"),
    [
        (Reading(), 1.0, 0),
        (Reading(values="f_r-cos"), 1 / np.cos(THETA_O)[:, None, None], 0),
        (Reading(values="reflectance-factor"), 1 / np.pi, 0),
        (Reading(phi_from="specular"), 1.0, 2),
    ],
)
def test_a_grid_is_read_as_it_is_asked_for(tmp_path, how, factor, turned):
    """As samples that lie on no grid are."""
    path = put(tmp_path, content(rows(QUARTERS)))
    with reading(how):
        check_meant(load(path), factor, turned)
    if how != Reading():
        must_fail(check_meant, load(path), factor, turned)


def test_a_grid_is_samples_for_a_prior(tmp_path, monkeypatch):
    monkeypatch.setattr(xompt, "from_samples", lambda samples, **_: len(samples.wi))  # which takes long
    path = put(tmp_path, content(rows()))
    with reading(Reading(prior=True)):
        assert xompt.read(path) == SPECTRA[..., 0].size
    check_grid(xompt.read(path), SPECTRA)


def test_rows_without_numbers_are_left_out(tmp_path):
    table = [row for row in rows() if row[3] != PHI[1]] + [[550e-9, 0.1, 0.2, None, 1.0]]
    assert load(put(tmp_path, content(table))).facts["rows_without_numbers"] == 1
    with reading(Reading(max_dropped=0.0)):
        assert "--max-dropped" in str(complaint(load, put(tmp_path, content(table))))


def test_primaries_are_spectra_of_their_colours():
    assert np.abs(srgb_weights(WRITTEN).T @ PRIMARIES - np.eye(3)).max() < 1e-6
    assert np.allclose(PRIMARIES.sum(axis=1), 1)
    assert PRIMARIES.min() == 0


def test_written_and_read_again(capsys, tmp_path):
    path = tmp_path / "nickel.xompt"
    result = run_json(capsys, "convert", "nickel", path)
    assert result["cells_clamped"] == 0
    run_json(capsys, "convert", "nickel", path)  # Sommerl may replace its own
    found = json.loads(path.read_text())
    metadata = (
        "name",
        "uuid",
        "materialVersion",
        "openMaterial3dVersion",
        "copyrights",
        "license",
        "authors",
        "sources",
    )
    assert set(metadata) <= found["metadata"].keys()
    table = np.array(found["brdf"]["lookupTable"])
    assert (np.lexsort(table[:, 3::-1].T) == np.arange(len(table))).all()
    assert sorted(set(table[:, 0])) == found["brdf"]["wavelengths"]
    grid, nickel = load(path), builtin("nickel")
    light, viewer = (np.stack(spherical(np.radians(t), np.radians(p)), -1) for t, p in ((30.0, 0.0), (45.0, 160.0)))
    assert np.allclose(grid.eval(light, viewer), nickel.eval(light, viewer), rtol=1e-5)


def test_negative_channels_are_moved_and_counted(capsys, tmp_path):
    values = np.full((2, 2, 2, 3), 0.3)
    values[0, 0, 0] = [-0.1, 0.4, 0.2]
    written = xompt.write(GridBrdf([0.1, 0.2], [0.1, 0.2], [0.0, 1.0], values), tmp_path / "x.xompt")
    assert written.counts.cells_clamped == 1
    assert np.allclose(load(tmp_path / "x.xompt").values, written.values, atol=1e-5)
    assert not written.signed


WHOLE = content(rows())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (WHOLE[:-200], "found none|expected rows|JSON"),
        (WHOLE.replace("lookupTable", "table"), "expected a lookupTable, found none"),
        (WHOLE.replace('"lookupTable"', '"lookupTable": [], "lookupTable"'), "lookupTable|JSON"),
        (content([[1, 2, 3]]), "expected rows of 5 numbers"),
        (content([["a"] * 5]), "expected rows of 5 numbers"),
        (content([]), "lookupTable: expected"),
        (content(rows()[:-1]), "same directions"),
        (content([[-1.0, 0, 0, 0, 1]]), "in range"),
        (content([[550e-9, 0, 0, 0, 1e300]]), "single precision"),
        (content([[550e-9, 0, 0, 0, -1]]), "positive"),
    ],
)
def test_damaged(tmp_path, text, said):
    import re

    path = put(tmp_path, text)
    message = str(complaint(load, path))
    assert message.startswith(f"{path}: ")
    assert re.search(said, message)


@pytest.mark.parametrize("turn", [lambda phi: -phi, lambda phi: 2 * np.pi - phi])
def test_one_side_stands_for_both(tmp_path, turn):
    """Azimuths from −180° to 0, or from 180° to 360°, are those of mirror images."""
    check_grid(load(put(tmp_path, content(rows((THETA_I, THETA_O, turn(PHI)))))), SPECTRA)
    both = turn(np.array([0.0, 1.0, 2.0, -2.0]))
    must_fail(check_grid, load(put(tmp_path, content(rows((THETA_I, THETA_O, both))))), SPECTRA)
