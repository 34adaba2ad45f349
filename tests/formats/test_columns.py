"""Columns as people write them: each variant is made from one formula, and has to be read as it."""

import numpy as np
import pytest
from helpers import complaint, must_fail, run, run_json

from sommerl import load
from sommerl.formats import samples
from sommerl.formats.columns import Column, column
from sommerl.formats.reading import Reading, reading
from sommerl.formats.spectra import FROM_XYZ

DEG = np.pi / 180
GRID = np.array([(a, 0, b, c) for a in range(0, 81, 20) for b in range(0, 81, 20) for c in range(0, 181, 30)], float)
NAMES = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"


def formula(wi, wo):
    """Reciprocal, isotropic, coloured."""
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    return np.array([0.3, 0.2, 0.1]) / np.pi + 0.5 * h[..., 2:] ** 30


def vector(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def at(degrees):
    t, p, v, q = degrees.T * DEG
    return formula(vector(t, p), vector(v, q))


F_R = at(GRID)
ROWS = np.hstack([GRID, F_R])


def text(header, rows, delimiter=",", decimal="."):
    lines = [delimiter.join(f"{x:.9g}".replace(".", decimal) for x in row) for row in rows]
    return "\n".join([header, *lines] if header else lines) + "\n"


@pytest.fixture
def taken(monkeypatch, tmp_path):
    """What the reader takes from a file's content: samples and facts."""

    def run(content, **how):
        found = []
        path = tmp_path / "x.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with monkeypatch.context() as patch, reading(Reading(**how)):
            patch.setattr(samples, "table_of", lambda path, data, taken, facts: found.extend((taken, facts)))
            load(path)
        return found

    return run


def check_formula(found, channels=slice(None)):
    wanted = formula(found.wi, found.wo)[:, channels]
    assert np.allclose(found.f_r, np.broadcast_to(wanted, found.f_r.shape), atol=1e-6)


WHOLE = text(NAMES, ROWS)
RADIANS = np.hstack([GRID * DEG, F_R])
PLANE = np.array([(a, 0, b, 180) for a in range(0, 81, 10) for b in range(-80, 81, 10)], float)
SIGNED = np.hstack([PLANE[:, :1], PLANE[:, 2:3], at(PLANE)])
AXIS = np.hstack([-PLANE[:, :1], PLANE[:, 2:3], at(PLANE)])
SPECTRUM = ",".join(f"{nm} nm" for nm in range(400, 701, 20))
FOUR = NAMES.removesuffix(",r,g,b")
BACKWARDS = ",".join(SPECTRUM.split(",")[::-1])
SPECTRAL = np.hstack([GRID, np.repeat(F_R[:, :1], 16, axis=1)])
UNITS = "deg,deg,deg,deg,1/sr,1/sr,1/sr"


def renamed(*names):
    return text(",".join([*names, "r", "g", "b"]), ROWS)


VARIANTS = {
    "radians": text("theta_i,phi_i,theta_o,phi_o,r,g,b", RADIANS),
    "degrees by their range": text("theta_i,phi_i,theta_o,phi_o,r,g,b", ROWS),
    "mixed units": text("theta_i_deg,phi_i_rad,theta_o_deg,phi_o_deg,r,g,b", ROWS * [1, DEG, 1, 1, 1, 1, 1]),
    "_r": renamed("theta_i_deg", "phi_i_deg", "theta_r_deg", "phi_r_deg"),
    "_s": renamed("theta_i_deg", "phi_i_deg", "theta_s_deg", "phi_s_deg"),
    "_v": renamed("thetaI", "phiI", "thetaV", "phiV"),
    "out": renamed("theta_in (deg)", "phi_in (deg)", "theta_out (deg)", "phi_out (deg)"),
    "ref": renamed("theta_inc", "phi_inc", "theta_ref", "phi_ref"),
    "scattered": renamed("incident theta", "incident phi", "scattered theta", "scattered phi"),
    "viewing": renamed("Incidence zenith [°]", "Incidence azimuth [°]", "Viewing zenith [°]", "Viewing azimuth [°]"),
    "Greek": renamed("θi (°)", "φi (°)", "θr (°)", "φr (°)"),
    "quoted": text('"theta_i_deg","phi_i_deg","theta_o_deg","phi_o_deg","r","g","b"', ROWS),
    "dphi": renamed("theta_i_deg", "dummy", "theta_o_deg", "dphi_deg"),
    "Δφ": renamed("theta_i_deg", "dummy", "theta_o_deg", "Δφ [deg]"),
    "phi alone": renamed("theta_i_deg", "dummy", "theta_o_deg", "phi_deg"),
    "no phi_i": renamed("theta_i_deg", "dummy", "theta_o_deg", "phi_o_deg"),
    "signed": text("theta_i_deg,theta_o_deg,r,g,b", SIGNED),
    "signed with azimuths": text(NAMES, np.hstack([PLANE, at(PLANE)])),
    "signed from one side": text("theta_i_deg,theta_o_deg,r,g,b", AXIS),
    "semicolons": text(NAMES.replace(",", ";"), ROWS, ";"),
    "decimal commas": text(NAMES.replace(",", ";"), ROWS, ";", ","),
    "decimal commas and tabs": text(NAMES.replace(",", "\t"), ROWS, "\t", ","),
    "spaces": text(NAMES.replace(",", " "), ROWS, "   "),
    "bars": text(NAMES.replace(",", " | "), ROWS, " | "),
    "other separators in rows": text(NAMES, ROWS, "\t"),
    "preamble": "".join(f"note {n}: of the day\n" for n in range(3000)) + "\n" + WHOLE,
    "preamble with commas": "a,b,c,d,e,f,g\nInstrument,X,,,,,\n" + WHOLE,
    "commented": "# GonioRef\n# " + WHOLE,
    "units": WHOLE.replace("\n", f"\n{UNITS}\n", 1).replace("_deg", "", 4),
    "D exponents": "\n".join([NAMES, *(",".join(f"{x:.9e}".replace("e", "D") for x in row) for row in ROWS)]),
    "end": WHOLE + "end of data\n",
    "trailing separators": "\n".join(line + "," for line in WHOLE.splitlines()),
    "CR": WHOLE.replace("\n", "\r"),
    "CRLF": WHOLE.replace("\n", "\r\n"),
    "BOM": b"\xef\xbb\xbf" + WHOLE.encode(),
    "UTF-16": WHOLE.encode("utf-16"),
    "UTF-16, no mark": WHOLE.encode("utf-16-le"),
    "Latin-1": WHOLE.replace("_deg", " [°]").encode("latin-1"),
    "minus sign": text(NAMES, np.hstack([PLANE, at(PLANE)])).replace("-", "−"),
    "BRDF columns": text(NAMES.replace("r,g,b", "BRDF_R [1/sr],BRDF_G [1/sr],BRDF_B [1/sr]"), ROWS),
}  # fmt: skip
GREY = {
    "brdf": text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,brdf", ROWS[:, :5]),
    "f_r": text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,f_r [1/sr]", ROWS[:, :5]),
    "Y alone": text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,Y", ROWS[:, :5]),
    "550": text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,550", ROWS[:, :5]),
    "R550": text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,R550", ROWS[:, :5]),
    "550nm": text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,550nm", ROWS[:, :5]),
    "spectrum": text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg," + SPECTRUM, SPECTRAL),
    "spectrum, backwards": text(f"{FOUR},{BACKWARDS}", SPECTRAL),
    "factor": text(f"{FOUR},reflectance factor [%]", np.hstack([GRID, F_R[:, :1] * 100 * np.pi])),
}  # fmt: skip


@pytest.mark.parametrize("name", VARIANTS)
def test_variants(taken, name):
    found, _ = taken(VARIANTS[name])
    assert len(found.wi) in (len(GRID), len(PLANE))
    check_formula(found)
    must_fail(check_formula, found.some(slice(None)).__class__(found.wi, found.wo, found.f_r[::-1]))


@pytest.mark.parametrize("name", GREY)
def test_grey(taken, name):
    found, facts = taken(GREY[name])
    check_formula(found, slice(0, 1))
    must_fail(check_formula, found)
    assert ("grey" in facts["values"]) == ("spectrum" not in name)


def test_what_was_found_is_told(taken):
    assert taken(WHOLE)[1] == {"rows": 175, "angles": "degrees, as their columns say", "values": "linear RGB"}
    assert taken(VARIANTS["radians"])[1]["angles"] == "radians, from their range"
    assert "positive θ_o is on the mirror's side" in taken(VARIANTS["signed"])[1]["plane"]
    assert taken(GREY["550nm"])[1]["values"] == "550 nm alone, as grey"


def test_xyz(taken):
    found, _ = taken(text(NAMES.replace("r,g,b", "X,Y,Z"), np.hstack([GRID, F_R @ np.linalg.inv(FROM_XYZ).T])))
    check_formula(found)


def left_out(count, below=0):
    """The rows, some of which have no numbers, and more below the horizon."""
    lines = WHOLE.splitlines()
    for row in range(count):
        lines[3 * row + 1] = ",".join(lines[3 * row + 1].split(",")[:4]) + (",,,", ",nan,1,1", ",n/a,1,1")[row % 3]
    return "\n".join(lines + ["10,0,120,180,1,1,1", "95,0,20,180,1,1,1"][:below])


def test_rows_without_numbers_and_below_the_horizon_are_left_out_and_counted(taken, tmp_path):
    found, facts = taken(left_out(20, 2))
    check_formula(found)
    assert (facts["rows"], len(found.wi)) == (177, 155)
    assert (facts["rows_without_numbers"], facts["rows_below_the_horizon"]) == (20, 2)
    path = tmp_path / "x.csv"
    path.write_text(left_out(20))
    with reading(Reading(max_dropped=0.05)):
        said = str(complaint(load, path))
    assert said == (
        f"{path}: expected at most 5% of the rows to be left out (--max-dropped), found 11%: 20 without numbers, "
        "0 below the horizon, the first in line 2 (column r: no finite number)"
    )


def test_names_may_be_given(taken):
    names = tuple(NAMES.split(","))
    check_formula(taken(text("", ROWS), columns=names)[0])
    check_formula(taken(text("a,b,c,d,e,f,g", ROWS), columns=names)[0])
    check_formula(taken(text("one title\n\na b c d e f g", ROWS, " "), columns=names)[0])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (text("", ROWS), "line 1: expected the names of columns, as theta_i_deg"),
        (
            text("theta_i_deg,theta_o_deg,r,g,b", SIGNED * ([-1] + 4 * [1]) + [5, 0, 0, 0, 0]),
            "theta_i: expected one sign",
        ),
        (text("theta_i_deg,phi_deg,theta_o_deg,phi_o_deg,r,g,b", ROWS), "expected one azimuth of the viewer"),
        (text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,brdf,value,c", ROWS), "found two, brdf and value"),
        (text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,a,c,e", ROWS), "expected columns of values"),
        (text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,550,550nm,c", ROWS), "expected different wavelengths"),
        (text("theta_h_deg,theta_d_deg,phi_d_deg,x1,r,g,b", ROWS), "line 1: expected the names|found none for theta_i"),
    ],
)
def test_what_cannot_be_told(tmp_path, content, said):
    import re

    path = tmp_path / "x.csv"
    path.write_text(content)
    assert re.search(said, str(complaint(load, path)))


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("theta_i", Column("theta_i")),
        ("Theta Out [deg]", Column("theta_o", "deg")),
        ("azimuth", Column("dphi")),
        ("SZA", Column("theta_i")),
        ("lambda_550", Column("nm", "", 550.0)),
        ("f_r(632.8nm)", Column("nm", "", 632.8)),
        ("theta_h", None),
        ("remark", None),
        ("12", None),
        ("99999", None),
    ],
)
def test_names(name, wanted):
    assert column(name) == wanted


def test_options_of_commands(capsys, tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(text("", ROWS))
    facts = run_json(capsys, "info", path, "--columns", NAMES)["facts"]
    assert facts["angles"] == "degrees, as their columns say"
    assert "angles are in" in run(capsys, "info", path, "--columns", NAMES)[1]
    assert "--columns: expected names" in run(capsys, "info", path, "--columns", "a,,b")[2]
    assert "--max-dropped: expected a share from 0 to 1" in run(capsys, "info", path, "--max-dropped", "3")[2]
