import struct

import numpy as np
import pytest
from helpers import check_sentence, complaint, must_fail, random_directions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rgl_files import content, fields

from sommerl import MERL, load
from sommerl.formats import rgl, tensor
from sommerl.formats.spectra import srgb_weights
from sommerl.reflectance.table import BrdfTable
from sommerl.render.llvm import drjit, mitsuba
from sommerl.system.errors import FormatError

ALL = (random_directions(12_000, seed) for seed in (1, 2))
A, B = (w[w[:, 2] >= 0.05][:10_000].astype(np.float32).astype(float) for w in ALL)


def written(path, data):
    path.write_bytes(data)
    return path


def by_mitsuba(path):
    """f_r cos θ of Mitsuba's `measured`, whose wi is the viewer, for lights A and viewers B."""
    mi, dr = mitsuba(), drjit()
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    si = dr.zeros(mi.SurfaceInteraction3f, len(B))
    si.wi = mi.Vector3f(*B.T.astype(np.float32))
    return np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*A.T.astype(np.float32)))).T


def check_like_mitsuba(path, brdf):
    """Within a thousandth; Mitsuba calculates in single precision, which is felt below 1e-4."""
    theirs, ours = by_mitsuba(path), brdf.eval(A, B) * A[:, 2:]
    assert np.all(np.abs(ours - theirs) <= 1e-3 * np.abs(theirs) + 1e-7)


@pytest.mark.parametrize("jacobian", [0, 1])
def test_it_is_evaluated_as_mitsuba_does(tmp_path, jacobian):
    path = written(tmp_path / "x.bsdf", content(jacobian=np.array([jacobian], np.uint8)))
    brdf = rgl.read(path, reciprocal=False)
    check_like_mitsuba(path, brdf)
    brdf._jacobian = not jacobian
    must_fail(check_like_mitsuba, path, brdf)


def test_raw_data_keep_their_negative_values(tmp_path):
    path = written(tmp_path / "x.bsdf", content(rgb=fields()["rgb"] - 0.5))
    check_like_mitsuba(path, rgl.read(path, reciprocal=False))
    assert (rgl.read(path, reciprocal=False).eval(A, B) < 0).any()
    assert (rgl.read(path).eval(A, B) >= 0).all()


def check_reciprocal(brdf):
    assert np.allclose(brdf.eval(A, B), brdf.eval(B, A), rtol=1e-9)


def test_the_default_is_the_mean_of_both_orders(tmp_path):
    path = written(tmp_path / "x.bsdf", content())
    brdf, raw = load(path), rgl.read(path, reciprocal=False)
    assert np.allclose(brdf.eval(A, B), (raw.eval(A, B) + raw.eval(B, A)) / 2, rtol=1e-12)
    check_reciprocal(brdf)
    must_fail(check_reciprocal, raw)
    assert 0.05 < brdf.facts["asymmetry"] < 1


def test_asymmetry(tmp_path):
    """If f_r cos θ_o is 1, the integrals are of |cos θ_i − cos θ_o| and (cos θ_i + cos θ_o) / 2: their ratio is 2/3."""
    constant = content(rgb=np.ones((1, 4, 3, 5, 5), np.float32), jacobian=np.zeros(1, np.uint8))
    brdf = rgl.read(written(tmp_path / "x.bsdf", constant), reciprocal=False)
    assert np.allclose(brdf.eval(A, B), 1 / A[:, 2:])
    assert brdf.facts["asymmetry"] == pytest.approx(2 / 3, rel=0.02)


def test_near_grazing_it_stays_finite(tmp_path):
    brdf = load(written(tmp_path / "x.bsdf", content()))
    grazing = np.array([np.sqrt(1 - 1e-12), 0, 1e-6])
    assert np.isfinite(brdf.eval(grazing, grazing * [-1, 1, 1])).all()
    assert brdf.facts["cells_near_grazing"] > 10_000
    assert rgl.read(tmp_path / "x.bsdf", reciprocal=False).facts["cells_near_grazing"] < 10_000
    assert BrdfTable.sampled(brdf).cells_clamped == 0


def check_counts(brdf, cells, energy):
    table = BrdfTable.sampled(brdf)
    found = {"cells_clamped": table.cells_clamped, "energy_clamped": table.energy_clamped}
    assert found == {key: brdf.facts[key] for key in found}
    assert (found["cells_clamped"], found["energy_clamped"]) == (cells, pytest.approx(energy, rel=1e-6))


def test_negative_numbers_are_counted_where_the_mean_of_both_orders_drops_them(tmp_path):
    rgb = np.full((1, 4, 3, 5, 5), 0.3, np.float32)
    rgb[:, :, 0] = -0.1
    cells = int(MERL.above_horizon.sum())
    brdf = load(written(tmp_path / "x.bsdf", content(rgb=rgb)))
    check_counts(brdf, cells, 1 / 7)
    must_fail(check_counts, brdf, 0, 0.0)
    assert (brdf.eval(A, B)[:, 0] == 0).all()
    assert np.array_equal(brdf.unclamped().eval(A, B)[:, 1:], brdf.eval(A, B)[:, 1:])
    assert (brdf.unclamped().eval(A, B)[:, 0] < 0).all()
    check_counts(load(written(tmp_path / "y.bsdf", content(rgb=np.abs(rgb)))), 0, 0.0)


def test_a_negative_number_in_one_order_is_not_counted_if_the_mean_is_none(tmp_path):
    """What is dropped is counted, not what is in the file."""
    rgb = np.full((1, 4, 3, 5, 5), 0.3, np.float32)
    rgb[0, 3, 1] = -0.001
    brdf = load(written(tmp_path / "x.bsdf", content(rgb=rgb)))
    table = BrdfTable.sampled(brdf)
    raw = BrdfTable.sampled(rgl.read(tmp_path / "x.bsdf", reciprocal=False))
    assert 0 <= table.cells_clamped == raw.cells_clamped < MERL.above_horizon.sum() / 2


def test_it_renders(tmp_path):
    """The same formula in Dr.Jit."""
    mi = mitsuba()
    brdf = load(written(tmp_path / "x.bsdf", content()))
    from sommerl.render.bsdf import upload

    buffers = {name: upload(buffer) for name, buffer in brdf.buffers().items()}
    wi, wo = (tuple(mi.Float(c.astype(np.float32)) for c in w.T) for w in (A, B))
    found = np.stack([np.array(c) for c in brdf.f_r(wi, wo, buffers)], axis=-1)
    assert np.allclose(found, brdf.eval(A, B), rtol=1e-3, atol=1e-5)


def test_spectra_become_linear_srgb(tmp_path):
    wavelengths = np.linspace(400, 700, 16, dtype=np.float32)
    spectra = np.random.default_rng(5).random((1, 4, 16, 5, 5)).astype(np.float32)
    rgb = np.einsum("pnwij,wc->pncij", spectra, srgb_weights(wavelengths)).astype(np.float32)
    one = rgl.read(written(tmp_path / "a.bsdf", content(rgb=None, spectra=spectra, wavelengths=wavelengths)))
    other = rgl.read(written(tmp_path / "b.bsdf", content(rgb=rgb)))
    assert np.allclose(one.eval(A, B), other.eval(A, B), rtol=1e-4, atol=1e-6)


def test_the_order_of_fields_does_not_matter(tmp_path):
    arrays = fields()
    path = tmp_path / "x.bsdf"
    with path.open("wb") as out:
        tensor.write(out, dict(reversed(arrays.items())))
    assert np.array_equal(load(path).eval(A, B), load(written(tmp_path / "y.bsdf", content())).eval(A, B))


def test_a_second_azimuth_with_the_same_data_is_isotropic(tmp_path):
    arrays = fields()
    twice = {name: np.concatenate([arrays[name]] * 2) for name in ("vndf", "luminance", "rgb")}
    path = written(tmp_path / "x.bsdf", content(phi_i=np.array([-np.pi, np.pi], np.float32), **twice))
    assert np.allclose(load(path).eval(A, B), load(written(tmp_path / "y.bsdf", content())).eval(A, B))


NAN = fields()["vndf"].copy()
NAN[0, 1, 2, 3] = np.nan


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"vndf": None}, "expected a field vndf"),
        ({"theta_i": np.array([0, 1, 0.5, 1.5], np.float32)}, "theta_i: expected angles that increase"),
        ({"vndf": NAN}, "vndf: expected finite numbers"),
        ({"vndf": -fields()["vndf"]}, "vndf: expected no negative values"),
        ({"ndf": 0 * fields()["ndf"]}, "ndf: expected no negative values, and some above 0"),
        ({"rgb": fields()["rgb"][:, :3]}, "rgb: expected float32 of shape 1 × 4 × 3"),
        ({"rgb": fields()["rgb"].astype(np.float64)}, "rgb: expected float32 of shape .*float64"),
        ({"rgb": fields()["vndf"], "vndf": fields()["rgb"]}, "vndf: expected float32 of shape"),
        ({"jacobian": np.ones(2, np.uint8)}, "jacobian: expected one byte"),
        ({"sigma": np.ones((2, 1), np.float32)}, "sigma: expected float32"),
        (
            {"phi_i": np.zeros(8, np.float32), "vndf": np.ones((8, 4, 8, 9), np.float32),
             "rgb": np.ones((8, 4, 3, 5, 5), np.float32)}, "phi_i: expected an isotropic material.*8 angles"),
        (
            {"phi_i": np.zeros(2, np.float32), "vndf": np.random.default_rng(0).random((2, 4, 8, 9)).astype("<f4"),
             "rgb": np.ones((2, 4, 3, 5, 5), np.float32)}, "phi_i: expected an isotropic material.*2 angles"),
    ],
)  # fmt: skip
def test_bad_fields(tmp_path, changes, sentence):
    path = written(tmp_path / "x.bsdf", content(**changes))
    with pytest.raises(FormatError, match=f"x.bsdf: {sentence}"):
        load(path)


def test_every_truncated_length(tmp_path):
    data, path = content(), tmp_path / "x.bsdf"
    for length in range(len(data)):
        with pytest.raises(FormatError, match=r"x.bsdf: .*expected"):
            load(written(path, data[:length]))


@pytest.mark.parametrize(
    ("where", "what", "sentence"),
    [
        (12, b"\x02\x00", "version: expected 1.0, found 2.0"),
        (14, struct.pack("<I", 2**32 - 1), "number of fields: expected 1 to 64"),
        (14, struct.pack(">I", 10), "number of fields: expected 1 to 64"),  # the other byte order
        (18, struct.pack("<H", 2**16 - 1), "expected field names of 1 to 256 bytes"),
        (31, struct.pack("<H", 2**16 - 1), "description: expected at most 8 axes"),
        (33, b"\x63", "description: expected a type of 1 to 11, found 99"),
        (34, struct.pack("<Q", 2**63), "description: expected data within"),
        (42, struct.pack("<Q", 2**62), "description: expected data within"),
    ],
)
def test_hostile_headers(tmp_path, where, what, sentence):
    data = content()
    path = written(tmp_path / "x.bsdf", data[:where] + what + data[where + len(what) :])
    with pytest.raises(FormatError, match=sentence):
        load(path)


def test_a_file_that_is_too_large(tmp_path):
    """It takes no room on the disk, and must not take any in memory."""
    path = written(tmp_path / "x.bsdf", content())
    with path.open("r+b") as stream:
        stream.truncate(2**33)
    with pytest.raises(FormatError, match="expected at most 67108864 bytes, found 8589934592"):
        load(path)


def test_a_name_twice(tmp_path):
    arrays, path = fields(), tmp_path / "x.bsdf"
    with path.open("wb") as out:
        tensor.write(out, arrays | {"vndg": arrays["vndf"]})
    path.write_bytes(path.read_bytes().replace(b"vndg", b"vndf"))
    with pytest.raises(FormatError, match="vndf: expected one field of that name, found two"):
        load(path)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_bytes_never_end_in_anything_but_a_sentence(tmp_path, data):
    whole = bytearray(content())
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, 450))] = data.draw(st.integers(0, 255))
    check_sentence(complaint(load, written(tmp_path / "x.bsdf", bytes(whole))), "x.bsdf")
