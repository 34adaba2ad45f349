import io
import zipfile

import numpy as np
import pytest
from helpers import check_sentence, complaint, must_fail, random_directions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sommerl import builtin, load
from sommerl.formats import samples
from sommerl.system.errors import FormatError

A, B = (w[w[:, 2] > 0.1][:60] for w in (random_directions(100, s) for s in (1, 2)))
ANGLES = np.stack(
    [np.arccos(A[:, 2]), np.arctan2(A[:, 1], A[:, 0]), np.arccos(B[:, 2]), np.arctan2(B[:, 1], B[:, 0])], 1
)
F_R = builtin("red-fabric").eval(A, B)
RADIANS, DEGREES = np.hstack([ANGLES, F_R]), np.hstack([np.degrees(ANGLES), F_R])
NAMES = ["theta_i", "phi_i", "theta_o", "phi_o", "r", "g", "b"]


@pytest.fixture
def parsed(monkeypatch, tmp_path):
    """What the reader takes from a file, without the table made of it."""

    def run(content, name="x.csv"):
        found = []
        with monkeypatch.context() as patch:
            patch.setattr(samples, "material_of", lambda path, sha256, taken, facts: found.append(taken))
            (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
            load(tmp_path / name)
        return found[0]

    return run


def text(rows, header, delimiter=","):
    lines = [header] + [delimiter.join(f"{value:.17g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"


def check_same(found):
    assert np.allclose(found.wi, A, atol=1e-12)
    assert np.allclose(found.wo, B, atol=1e-12)
    assert np.allclose(found.f_r, F_R)


@pytest.mark.parametrize(
    ("header", "rows", "delimiter"),
    [
        ("theta_i,phi_i,theta_o,phi_o,r,g,b", RADIANS, ","),
        ("# a comment\n\ntheta_i_rad;phi_i_rad;theta_o_rad;phi_o_rad;R;G;B", RADIANS, ";"),
        ("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b", DEGREES, ","),
        ("theta_i [deg], phi_i [deg], theta_o [deg], phi_o [deg], red, green, blue", DEGREES, ","),
        ("Theta I (deg), Phi I (deg), Theta O (deg), Phi O (deg), R, G, B", DEGREES, ","),
        ("theta_i [deg] phi_i [deg] theta_o [deg] phi_o [deg] r g b", DEGREES, " "),
        ("theta_i (degrees)\tphi_i (degrees)\ttheta_o (degrees)\tphi_o (degrees)\tr\tg\tb", DEGREES, "\t"),
        ("θ_i [°],φ_i [°],θ_o [°],φ_o [°],r,g,b", DEGREES, ","),
        ("# theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b", DEGREES, ","),  # np.savetxt's way
        ('"ThetaIn_deg","PhiIn_deg","ThetaOut_deg","PhiOut_deg","r","g","b"', DEGREES, ","),
        ("theta_i_deg,phi_i_rad,theta_o_deg,phi_o_rad,r,g,b",
         np.hstack([np.degrees(ANGLES[:, :1]), ANGLES[:, 1:2], np.degrees(ANGLES[:, 2:3]), ANGLES[:, 3:], F_R]), ","),
        ("b,g,r,phi_o,theta_o,phi_i,theta_i,remark", np.hstack([RADIANS[:, ::-1], np.ones((60, 1))]), ","),
    ],
)  # fmt: skip
def test_text(parsed, header, rows, delimiter):
    check_same(parsed(text(rows, header, delimiter)))


def test_other_angles_would_be_noticed(parsed):
    found = parsed(text(RADIANS / [10, 1, 10, 1, 1, 1, 1], "theta_i,phi_i,theta_o,phi_o,r,g,b"))
    must_fail(check_same, found)


def saved(array, **options):
    out = io.BytesIO()
    np.save(out, array, **options)
    return out.getvalue()


def zipped(**arrays):
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


def test_numpy(parsed):
    check_same(parsed(saved(RADIANS), "x.npy"))
    check_same(parsed(saved(np.asfortranarray(RADIANS)), "x.npy"))
    fields = np.array(list(map(tuple, DEGREES)), [(f"{n}_deg", "f8") if "_" in n else (n, "f8") for n in NAMES])
    check_same(parsed(saved(fields), "x.npy"))
    check_same(parsed(zipped(**dict(zip(NAMES, RADIANS.T, strict=True))), "x.npz"))


def test_content_and_not_the_extension_tells(parsed):
    check_same(parsed(text(RADIANS, ",".join(NAMES)), "x.txt"))
    check_same(parsed(saved(RADIANS), "x.binary"))


def test_the_whole_way(tmp_path):
    path = tmp_path / "fabric.csv"
    path.write_text(text(DEGREES, "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"))
    table = load(path)
    assert table.name == "fabric"
    assert table.facts["samples"] == 60
    assert np.allclose(table.eval(A, B), F_R, rtol=0.5)


HEADER = ",".join(NAMES)


FEW = np.repeat(RADIANS[:1], 40, axis=0)


def damaged(row, column, cell, rows=RADIANS, header=HEADER):
    """The text of some rows with another cell; counted from 0, without the header."""
    lines = [line.split(",") for line in text(rows, header).splitlines()]
    lines[row + 1][column] = cell
    return "\n".join(",".join(line) for line in lines) + "\n"


def many_nan(count):
    rows = RADIANS.copy()
    rows[2 : 2 + count, 5] = np.nan
    return text(rows, HEADER)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (text(RADIANS[:, :6], ",".join(NAMES[:6])), r"found r, g alone in theta_i, .*, r, g \(line 1\)"),
        (text(DEGREES * 3, HEADER), r"theta_i: expected angles from -180 to 180 deg, found .* in line \d+"),
        (text(RADIANS * [1, 800, 1, 1, 1, 1, 1], HEADER), "phi_i: expected angles from -"),
        (
            text(RADIANS, "# x\n" + HEADER.replace("_i", "_i_deg").replace("_o", "_o_deg")),
            r"theta_i_deg, theta_o_deg: expected degrees, found nothing above 1.4\d* \(line 2\) \(radians\?\)",
        ),
        (text(RADIANS, "1,2,3,4,5,6,7"), "line 1: expected the names of columns, .*--columns"),
        (
            text(RADIANS, HEADER.replace("g", "r")),
            r"r: expected one column, found two \(line 1\)|g: expected|r, b alone",
        ),
        (
            text(RADIANS, HEADER.replace("phi_i", "theta_in")),
            "theta_i: expected one column, found two, theta_i and theta_in",
        ),
        (
            text(RADIANS, HEADER.replace("theta_i", "incident")),
            r"found none for theta_i in incident, phi_i, .*\(line 1\)",
        ),
        (damaged(3, 5, "x"), "line 5, column g: expected a number, found 'x'"),
        (damaged(3, 5, "1,2"), "line 5: expected 7 columns, found 8"),
        (text(RADIANS, HEADER)[:-30], "line 61: expected 7 columns"),
        (text(RADIANS, HEADER + ",c"), "line 2: expected 8 columns, found 7"),
        (damaged(0, 2, "1,2"), "line 2: expected 7 columns, found 8"),
        (text(RADIANS, HEADER).replace("\n", "\n1,0,1,0,1\n", 1), "line 2: expected 7 columns, found 5"),
        (HEADER + "\n", "line 1: expected rows of numbers below the names"),
        (many_nan(20), r"at most 25% of the rows .*found 33%: 20 without numbers, .* in line 4 \(column g"),
        (text(RADIANS[:20], HEADER), "expected 32 to 2000000 samples, found 20"),
        (b"theta_i,theta_o,\x00", "expected text, found another character at 16"),
    ],
)
def test_bad_text(tmp_path, content, sentence):
    path = tmp_path / "x.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(FormatError, match=rf"x\.csv: .*({sentence})"):
        load(path)


def test_how_many_rows_there_are_is_no_row(parsed):
    check_same(parsed(text(RADIANS, HEADER).replace("\n", "\n60\n", 1)))


def test_a_column_of_words_is_ignored(parsed):
    lines = text(RADIANS, "sample," + HEADER).splitlines()
    named = "\n".join([lines[0]] + [f'"nickel",{line}' for line in lines[1:]])
    check_same(parsed(named))


def npy_header(shape, dtype="'<f8'"):
    header = f"{{'descr': {dtype}, 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + np.uint16(len(header)).tobytes() + header.encode()


def packed(method, damage=0):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        archive.writestr("theta_i.npy", saved(RADIANS[:, 0]))
    data = bytearray(out.getvalue())
    data[60 : 60 + damage] = bytes(damage)
    return bytes(data)


def bomb():
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("theta_i.npy", bytes(2**29))
    return out.getvalue()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (npy_header("(1000000000000, 7)"), "expected numbers within"),
        (npy_header("(-3, 7)"), "expected (numbers within|a NumPy array)"),
        (npy_header("(60, 7)") + bytes(60 * 56 - 200), "expected numbers within|expected 3360 bytes"),
        (npy_header("(60, 7)") + bytes(60 * 56 + 1), "expected 3360 bytes of data, found another number"),
        (npy_header("(-1, -1)") + bytes(8), "expected numbers within"),
        (npy_header("(5,)", "('<f8', (2,))") + bytes(80), "expected numbers within|expected a NumPy array"),
        (npy_header("(" + 20 * "1, " + ")") + bytes(8), "expected numbers within"),
        (npy_header("(True,)") + bytes(8), "expected (numbers within|a NumPy array)"),
        (npy_header("-" * 3000 + "1", "1"), "expected a NumPy array"),
        (npy_header("(60, 7)", "'|O'") + bytes(60 * 56), "expected numbers within|expected a NumPy array"),
        (saved(RADIANS.astype(complex)), "expected a column of numbers, found complex"),
        (saved(RADIANS.astype(">f8").view("<f8")), "theta_|phi_|r:|expected"),  # the other byte order
        (b"\x93NUMPY\x09\x00" + bytes(100), "expected NumPy's format 1.0 or 2.0, found 9.0"),
        (zipped(theta_i=RADIANS[:, 0]), "found none for theta_o"),
        (zipped(**dict(zip(NAMES, RADIANS.T, strict=True)) | {"r": np.ones(3)}), "expected columns of one length"),
        (zipped(**dict(zip(NAMES, RADIANS.T, strict=True)))[:-100], "damaged|found none of these|expected"),
        (packed(zipfile.ZIP_LZMA), "expected arrays stored or deflated"),
        (packed(zipfile.ZIP_DEFLATED, 30), "damaged"),
        (bomb(), "expected at most 4096 arrays of 268435456 bytes"),
    ],
)
def test_bad_arrays(tmp_path, content, sentence):
    path = tmp_path / "x.npy"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=f"x.npy: .*({sentence})"):
        load(path)


@pytest.mark.parametrize("whole", [saved(RADIANS), zipped(**dict(zip(NAMES, RADIANS.T, strict=True)))])
def test_every_truncated_length(tmp_path, whole):
    path = tmp_path / "x.npz"
    for length in range(0, len(whole), 3):
        path.write_bytes(whole[:length])
        with pytest.raises(FormatError, match=r"x\.npz: "):
            load(path)


WHOLE = (text(RADIANS, HEADER).encode(), saved(RADIANS), zipped(**dict(zip(NAMES, RADIANS.T, strict=True))))


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_bytes_never_end_in_anything_but_a_sentence(tmp_path, data):
    whole = bytearray(data.draw(st.sampled_from(WHOLE)))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, min(len(whole), 600) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "x.csv"
    path.write_bytes(bytes(whole))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(samples, "material_of", lambda path, sha256, taken, facts: taken)
        check_sentence(complaint(load, path), "x.csv")
