"""Zemax' tabular BSDFs: read and damaged."""

import numpy as np
import pytest
from helpers import complaint, must_fail

from sommerl import load

INCIDENCE, AZIMUTH, RADIAL = [10, 40], [0, 90, 180], [0, 20, 45, 70]


def lines(values):
    return "\n".join(" ".join(f"{x:.6e}" for x in row) for row in values)


def content(values, azimuth=AZIMUTH, symmetry="PlaneSymmetrical", spectral="Monochrome", rotations="1\n0"):
    """values: (channels, incidence, azimuth, radial)."""
    axes = [f"{name}  {len(axis)}\n" + "\t".join(map(str, axis)) for name, axis in
            (("AngleOfIncidence", INCIDENCE), ("ScatterAzimuth", azimuth), ("ScatterRadial", RADIAL))]  # fmt: skip
    head = f"#made up\nSource  Measured\nSymmetry  {symmetry}\nSpectralContent  {spectral}\nScatterType  BRDF\n"
    blocks = [
        f"{name}\nDataBegin\n" + "".join(f"TIS 0.1\n{lines(part)}\n" for part in block) + "DataEnd\n"
        for name, block in zip(["Monochrome"] if len(values) == 1 else ["TristimulusX", "Y", "Z"], values, strict=True)
    ]
    return head + f"SampleRotation  {rotations}\n" + "\n".join(axes) + "\n\n" + "".join(blocks)


VALUES = np.random.default_rng(0).random((1, 2, 3, 4))
VALUES[:, :, :, 0] = VALUES[:, :, :1, 0]
WHOLE = content(VALUES)


def put(tmp_path, text):
    path = tmp_path / "x.bsdf"
    path.write_text(text)
    return path


def direction(degrees, towards):
    t, p = np.radians((degrees, towards))
    return np.array([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])


def check_planes(brdf, values):
    """In the plane of incidence: azimuth 0 goes from the specular direction to the normal, 180 away from it."""
    light = direction(40, 0)
    assert np.allclose(brdf.eval(light, direction(40, 180)), values[1, 0, 0], atol=1e-6)  # specular
    assert np.allclose(brdf.eval(light, direction(20, 180)), values[1, 0, 1], atol=1e-6)
    assert np.allclose(brdf.eval(light, direction(5, 0)), values[1, 0, 2], atol=1e-6)  # past the normal
    assert np.allclose(brdf.eval(light, direction(60, 180)), values[1, 2, 1], atol=1e-6)


def test_read(tmp_path):
    brdf = load(put(tmp_path, WHOLE))
    assert brdf.axes[0].shape + brdf.axes[1].shape + brdf.axes[2].shape == (2, 4, 3)
    check_planes(brdf, VALUES[0])
    must_fail(check_planes, brdf, VALUES[0][:, ::-1])
    assert brdf.mirrored


@pytest.mark.parametrize("azimuth", [[180, 270, 360], [180, 270, 359.9999], [0, 90, 180, 270, 360]])
def test_the_other_side_of_the_plane(tmp_path, azimuth):
    """A file whose material is symmetric about the plane of incidence may have either side, or both."""
    there = VALUES[:, :, ::-1] if azimuth[0] else np.concatenate([VALUES, VALUES[:, :, -2::-1]], axis=2)
    brdf = load(put(tmp_path, content(there, azimuth)))
    check_planes(brdf, VALUES[0])
    must_fail(check_planes, brdf, VALUES[0][:, ::-1])
    beside = direction(40, 0), np.array([0.1, 0.5, 0.86]) / np.linalg.norm([0.1, 0.5, 0.86])
    assert np.allclose(brdf.eval(*beside), load(put(tmp_path, WHOLE)).eval(*beside), atol=1e-4)


def test_a_full_turn_and_colour(tmp_path):
    turn = np.concatenate([VALUES, VALUES[:, :, 1:2], VALUES[:, :, :1]], axis=2)
    brdf = load(put(tmp_path, content(np.repeat(turn, 3, 0), [0, 90, 180, 270, 360], "ASymmetrical", "XYZ")))
    assert not brdf.mirrored
    grey = brdf.eval(direction(40, 0), direction(20, 180))
    assert np.allclose(grey / grey[0], [1.2048, 0.9484, 0.9087] / np.float64(1.2048), atol=1e-3)  # XYZ of equal parts


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (WHOLE.replace("BRDF", "BTDF"), "ScatterType: expected BRDF, found BTDF"),
        (WHOLE.replace("PlaneSymmetrical", "Odd"), "Symmetry: expected"),
        (WHOLE.replace("Monochrome", "Spectral"), "SpectralContent: expected"),
        (WHOLE.replace("SampleRotation  1\n0", "SampleRotation  2\n0 90"), "expected an isotropic material"),
        (WHOLE.replace("DataEnd", ""), "expected a line DataEnd, found the end"),
        (WHOLE.replace("TIS 0.1\n", "", 1), "line 17: expected TIS"),
        (WHOLE.replace("e-01", "x", 1), "ScatterRadial: expected 4 numbers, found others"),
        (WHOLE.replace("ScatterRadial  4", "ScatterRadial  -4"), "ScatterRadial: expected 1 to"),
        (WHOLE.replace("ScatterRadial  4", "ScatterRadial  3"), "ScatterRadial: expected 3 finite numbers, found 4"),
        (WHOLE.replace("0\t90\t180", "0\t190\t180"), "ScatterAzimuth|expected"),
        (WHOLE.replace("10\t40", "40\t10"), "theta_i: expected angles that increase"),
        (WHOLE[:300], "expected"),
    ],
)
def test_damaged(tmp_path, text, said):
    path = put(tmp_path, text)
    message = str(complaint(load, path))
    assert message.startswith(f"{path}: ")
    assert said.split("|")[0] in message or said.split("|")[-1] in message
