"""ALTA's and ASTM's text files of samples, made from one formula."""

import numpy as np
import pytest
from helpers import complaint, must_fail, random_directions

from sommerl import load
from sommerl.formats import alta, samples
from sommerl.formats.spectra import FROM_XYZ
from sommerl.reflectance.half_diff import half_diff

LIGHT, VIEWER = (w[w[:, 2] > 0.1][:60] for w in (random_directions(90, s) for s in (1, 2)))


def formula(wi, wo):
    """One-sided, so that an exchange of light and viewer would be seen."""
    return (0.2 + wi[:, 2] + 0.3 * wo[:, 2] ** 2 + 0.1 * (wi * wo).sum(axis=1))[:, None]


F_R = formula(LIGHT, VIEWER)
T_L, T_V = np.arccos(LIGHT[:, 2]), np.arccos(VIEWER[:, 2])
P_L, P_V = (np.arctan2(w[:, 1], w[:, 0]) for w in (LIGHT, VIEWER))
DPHI = P_V - P_L
# ALTA's difference angles are those of V.
T_H, T_D, P_D = half_diff(VIEWER.T, LIGHT.T, reciprocal=False)
HALF = LIGHT + VIEWER
P_H = np.arctan2(HALF[:, 1], HALF[:, 0])
PARAMETERS = {
    "ISOTROPIC_TL_TV_PROJ_DPHI": [T_L, T_V * np.cos(DPHI), T_V * np.sin(DPHI)],
    "ISOTROPIC_TV_TL_DPHI": [T_V, T_L, DPHI],
    "SPHERICAL_TL_PL_TV_PV": [T_L, P_L, T_V, P_V],
    "RUSIN_TH_TD_PD": [T_H, T_D, P_D],
    "RUSIN_TH_PH_TD_PD": [T_H, P_H, T_D, P_D],
    "CARTESIAN": [*VIEWER.T, *LIGHT.T],
}


def content(name, columns, values, output="INV_STERADIAN", head=""):
    rows = np.column_stack([*columns, values])
    head += f"#DIM {len(columns)} {values.shape[1]}\n#PARAM_IN {name}\n#PARAM_OUT {output}\n"
    return '#SAMPLE "x"\n' + head + "\n".join(" ".join(f"{x:.12g}" for x in row) for row in rows) + "\n"


def put(tmp_path, text, name="x.dat"):
    path = tmp_path / name
    path.write_text(text)
    return path


def check_formula(found, f_r=None):
    wanted = formula(found.wi, found.wo) if f_r is None else f_r
    assert len(found.wi) == len(LIGHT)
    assert np.allclose(found.f_r, np.broadcast_to(wanted, found.f_r.shape), atol=1e-6)


@pytest.mark.parametrize("name", PARAMETERS)
def test_parametrisations(tmp_path, name):
    text = content(name, PARAMETERS[name], F_R)
    found = alta.samples_of(put(tmp_path, text), text.encode()).samples
    check_formula(found)
    must_fail(check_formula, samples.Samples(found.wo, found.wi, found.f_r))


def test_without_azimuth(tmp_path):
    text = content("COS_TH_TD", [np.cos(T_H) ** 0.1, np.cos(T_D) ** 0.1], F_R)
    found = alta.samples_of(put(tmp_path, text), text.encode()).samples
    theta_h, theta_d, phi_d = half_diff(found.wo.T, found.wi.T)
    assert np.allclose(np.cos(theta_h), np.cos(T_H) ** 0.1)
    assert np.allclose(np.cos(theta_d), np.cos(T_D) ** 0.1)
    assert np.allclose(phi_d, np.pi / 2)


def test_what_values_mean(tmp_path):
    name = "SPHERICAL_TL_PL_TV_PV"
    for output, values in (
        ("INV_STERADIAN_COSINE_FACTOR", F_R * VIEWER[:, 2:]),
        ("RGB_COLOR", np.repeat(F_R, 3, 1)),
        ("XYZ_COLOR", np.repeat(F_R, 3, 1) @ np.linalg.inv(FROM_XYZ).T),
    ):
        text = content(name, PARAMETERS[name], values, output, "#VS 0\n")
        check_formula(alta.samples_of(put(tmp_path, text), text.encode()).samples)


def test_intervals_are_ignored(tmp_path):
    text = content("CARTESIAN", PARAMETERS["CARTESIAN"], F_R, head="#VS 2\n").replace("\n", " 7 8\n")
    text = "".join(
        line.removesuffix(" 7 8") + "\n" if line.startswith("#") else line + "\n" for line in text.splitlines()
    )
    check_formula(alta.samples_of(put(tmp_path, text), text.encode()).samples)


def test_the_whole_way(tmp_path):
    table = load(put(tmp_path, content("ISOTROPIC_TV_TL_DPHI", PARAMETERS["ISOTROPIC_TV_TL_DPHI"], F_R)))
    assert table.facts["values"] == "ISOTROPIC_TV_TL_DPHI, INV_STERADIAN"
    assert table.facts["samples"] == 60


ROW = "CARTESIAN", PARAMETERS["CARTESIAN"], F_R


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (content("COS_TK", [T_L], F_R), "line 3: #PARAM_IN: expected ISOTROPIC_TL"),
        (content(*ROW, output="ENERGY"), "line 4: #PARAM_OUT: expected INV_STERADIAN"),
        (content(*ROW).replace("#DIM 6 1", "#DIM 5 1"), "line 2: #DIM: expected 6 1 or 3"),
        (content(*ROW, output="RGB_COLOR"), "line 2: #DIM: expected 6 3"),
        (content("CARTESIAN", [3 * each for each in ROW[1]], F_R), "--max-dropped"),
        (content(*ROW).replace("\n0", "\nx", 1).replace("\n-0", "\nx", 1), "line 5, column x1: expected a number"),
        ("#PARAM_IN CARTESIAN\n", "expected rows of numbers, found none"),
        ("#PARAM_IN CARTESIAN\n1 2 3\n", "line 2: expected 7 columns, found 3"),
    ],
)
def test_damaged(tmp_path, text, said):
    path = put(tmp_path, text)
    message = str(complaint(load, path))
    assert message.startswith(f"{path}: ")
    assert said in message


def astm(names, rows):
    head = 'LAB_NAME nobody\nSAMPLE_NAME "paint, red"\nMEAS_DATE 2024/01/01\nNUM_POINTS 60\nVARS ' + names + "\n\n"
    return head + "\n".join(",".join(f"{x:.9g}" for x in row) for row in rows) + "\n"


ANGLES = np.stack([T_L, P_L, T_V, P_V], axis=-1)


@pytest.mark.parametrize("values", ["R,G,B", "465nm,525nm,630nm", "X,Y,Z", "brdf"])
def test_astm(tmp_path, monkeypatch, values):
    found = []
    monkeypatch.setattr(samples, "table_of", lambda path, data, taken, facts: found.extend((taken, facts)))
    count = values.count(",") + 1
    f_r = np.repeat(F_R, count, 1)
    path = put(tmp_path, astm(f"theta_i,phi_i,theta_s,phi_s,{values}", np.hstack([ANGLES, f_r])), "x.astm")
    load(path)
    taken, facts = found
    check_formula(taken, f_r @ FROM_XYZ.T if values == "X,Y,Z" else None)
    assert facts["angles"] == "radians, from their range"
    must_fail(check_formula, samples.Samples(taken.wo, taken.wi, taken.f_r), F_R[::-1])


def test_damaged_astm(tmp_path):
    rows = np.hstack([ANGLES, F_R])
    path = put(tmp_path, astm("theta_i,phi_i,theta_s,phi_s,brdf", rows).replace(",", ",x", 6), "x.astm")
    assert "line" in str(complaint(load, path))
    assert "expected 32 to" in str(complaint(load, put(tmp_path, astm("theta_i,phi_i,theta_s,phi_s,f", rows[:5]))))
