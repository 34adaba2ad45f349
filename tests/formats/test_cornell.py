import warnings

import numpy as np
import pytest
from helpers import check_sentence, complaint, must_fail, nearest_held, random_directions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sommerl import BrdfTable, load
from sommerl.formats import cornell
from sommerl.formats.spectra import srgb_weights
from sommerl.system.errors import FormatError

A, B = (w[w[:, 2] > 0.2][:40] for w in (random_directions(80, s) for s in (1, 2)))
WAVELENGTHS = [400, 450, 500, 550, 600, 650, 700]


def content(values=None):
    values = np.full((40, 7), 0.2) if values is None else values
    lines = ["# somebody's paint", "", "# num wls", "7", "400 450 500 550", "600 650 700 # the rest", ""]
    for a, b, row in zip(A, B, values, strict=True):
        angles = np.arccos(a[2]), np.arctan2(a[1], a[0]), np.arccos(b[2]), np.arctan2(b[1], b[0])
        lines.append(" ".join(f"{x:.9g}" for x in (*angles, *row)))
    return "\n".join(lines) + "\n"


def written(path, text):
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_a_white_lambertian(tmp_path):
    table = load(written(tmp_path / "x.brdf", content()))
    assert np.allclose(table.eval(A, B), 0.2, rtol=0.01)
    assert table.facts["samples"] == 40
    assert len(table.source.sha256) == 64


def test_colours(tmp_path):
    """A band of red light alone, which is outside sRGB."""
    spectrum = np.tile([0, 0, 0, 0, 0, 1.0, 1.0], (40, 1))
    table = load(written(tmp_path / "paint.txt", content(spectrum)))
    outside = srgb_weights(np.array(WAVELENGTHS))[5:].sum(axis=0)
    assert outside.min() < 0
    assert np.allclose(table.eval(A, B), outside, atol=0.01 * outside.max())
    held = nearest_held(outside)
    assert np.allclose(BrdfTable.of(table).eval(A, B), held, atol=0.01 * held.max())
    assert held[0] > 5 * held[1]


def check_like_colour_science(weights, wavelengths):
    """colour-science, at a nanometre, and with the same rule between and beyond the samples."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour

        observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
        light = colour.SDS_ILLUMINANTS["D65"].copy().align(observer.shape).values
    to_rgb = np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB)
    response = (observer.values * light[:, None]) @ to_rgb.T
    parts = np.array([np.interp(observer.wavelengths, wavelengths, part) for part in np.eye(len(wavelengths))])
    assert np.allclose(weights, parts @ response / response.sum(axis=0), atol=1.5e-3)


@pytest.mark.parametrize(
    "wavelengths", [np.arange(400, 701, 10.0), np.linspace(360, 1000, 195), np.arange(380, 781, 20.0)]
)
def test_spectra_to_srgb(wavelengths):
    weights = srgb_weights(wavelengths)
    check_like_colour_science(weights, wavelengths)
    must_fail(check_like_colour_science, srgb_weights(wavelengths + 1), wavelengths)
    assert np.allclose(weights.sum(axis=0), 1)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("\n7\n", "\n1\n", "number of wavelengths: expected 2 to 1000, found '1'"),
        ("\n7\n", "\n999999999\n", "number of wavelengths: expected 2 to 1000"),
        ("\n7\n", "\n8\n", "wavelengths: expected 8 that increase"),
        ("\n7\n", "\n6\n", "wavelengths: expected 6 that increase"),
        ("450", "390", "wavelengths: expected 7 that increase"),
        ("450", "x", "wavelengths: expected 7 numbers, found others"),
        ("0.2 0.2\n", "0.2\n", "expected rows of 11 columns, found 10"),
        ("0.2 0.2\n", "0.2 nan\n", "expected finite numbers"),
    ],
)
def test_bad_files(tmp_path, old, new, sentence):
    with pytest.raises(FormatError, match=f"x.brdf: .*{sentence}|x.brdf: {sentence}"):
        load(written(tmp_path / "x.brdf", content().replace(old, new, 1)))


def test_every_truncated_length(tmp_path, monkeypatch):
    """Cut at the end of a row, or within its last number, a text cannot be told from a shorter one."""
    monkeypatch.setattr(cornell, "from_samples", lambda samples, **_: samples)
    whole, accepted = content(), 0
    for length in range(len(whole)):
        path = written(tmp_path / "x.brdf", whole[:length])
        message = complaint(load, path)
        check_sentence(message, "x.brdf: ")
        if message is None:
            accepted += 1
            assert whole[:length].splitlines()[-1].count(" ") == 10
    assert accepted > 0


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_bytes_never_end_in_anything_but_a_sentence(tmp_path, data):
    whole = bytearray(content().encode())
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, 300))] = data.draw(st.integers(0, 255))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cornell, "from_samples", lambda samples, **_: samples)
        check_sentence(complaint(load, written(tmp_path / "x.brdf", bytes(whole))), "x.brdf")
