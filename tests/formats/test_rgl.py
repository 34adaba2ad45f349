import struct

import numpy as np
import pytest
from helpers import check_sentence, complaint, moved_share, must_fail, random_directions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rgl_files import content, fields

from sommerl import MERL, Lattice, load
from sommerl.formats import rgl, tensor
from sommerl.formats.spectra import srgb_weights
from sommerl.reflectance.reciprocal import reciprocal
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
    brdf = rgl.read(path)
    check_like_mitsuba(path, brdf)
    brdf._jacobian = not jacobian
    must_fail(check_like_mitsuba, path, brdf)


def test_negative_numbers_are_kept(tmp_path):
    path = written(tmp_path / "x.bsdf", content(rgb=fields()["rgb"] - 0.5))
    check_like_mitsuba(path, load(path))
    assert (load(path).eval(A, B) < 0).any()
    assert load(path).signed
    assert not load(written(tmp_path / "y.bsdf", content())).signed


def check_reciprocal(brdf):
    assert np.allclose(brdf.eval(A, B), brdf.eval(B, A), rtol=1e-9)


def test_it_is_one_sided(tmp_path):
    brdf = load(written(tmp_path / "x.bsdf", content()))
    assert not brdf.reciprocal
    must_fail(check_reciprocal, brdf)
    check_reciprocal(reciprocal(brdf))
    assert 0.05 < brdf.facts["asymmetry"] < 1


def around_the_normal(brdf, theta, light=0.5):
    """f_r for viewers at the angle `theta` from the normal, all around it."""
    phi = np.arange(64) * (np.pi / 32)
    viewers = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.full(64, np.cos(theta))], -1)
    return brdf.eval(np.array([np.sin(light), 0, np.cos(light)]), viewers)


def test_a_viewer_at_the_normal_sees_the_mean_over_all_azimuths(tmp_path):
    brdf = load(written(tmp_path / "x.bsdf", content()))
    near = around_the_normal(brdf, 1e-6)
    assert np.ptp(near[:, 0]) > 0.05 * near[:, 0].mean()
    for light in (0.05, 0.5, 1.2, 1.5):
        mean = around_the_normal(brdf, 1e-6, light).mean(axis=0)
        assert np.allclose(around_the_normal(brdf, 0.0, light)[0], mean, rtol=0.01)


def test_asymmetry(tmp_path):
    """If f_r cos θ_o is 1, the integrals are of |cos θ_i − cos θ_o| and (cos θ_i + cos θ_o) / 2: their ratio is 2/3."""
    constant = content(rgb=np.ones((1, 4, 3, 5, 5), np.float32), jacobian=np.zeros(1, np.uint8))
    brdf = rgl.read(written(tmp_path / "x.bsdf", constant))
    assert np.allclose(brdf.eval(A, B), 1 / A[:, 2:])
    assert brdf.facts["asymmetry"] == pytest.approx(2 / 3, rel=0.02)


def test_near_grazing_it_stays_finite(tmp_path):
    brdf = load(written(tmp_path / "x.bsdf", content()))
    grazing = np.array([np.sqrt(1 - 1e-12), 0, 1e-6])
    assert np.isfinite(brdf.eval(grazing, grazing * [-1, 1, 1])).all()
    assert 5_000 < brdf.facts["cells_near_grazing"] < 10_000


def red_is_negative(tmp_path):
    rgb = np.full((1, 4, 3, 5, 5), 0.3, np.float32)
    rgb[:, :, 0] = -0.1
    return load(written(tmp_path / "x.bsdf", content(rgb=rgb)))


def check_counts(table, cells, energy):
    assert (table.counts.cells_clamped, table.counts.energy_clamped) == (cells, pytest.approx(energy, rel=1e-6))


def test_negative_colours_are_counted_where_a_table_cannot_hold_them(tmp_path):
    brdf = red_is_negative(tmp_path)
    assert brdf.facts["energy_negative"] == pytest.approx(1 / 7, rel=1e-6)
    table = BrdfTable.sampled(brdf)
    assert (table.values >= 0).all()
    check_counts(table, int(MERL.above_horizon.sum()), moved_share([-0.1, 0.3, 0.3]))
    must_fail(check_counts, table, 0, 0.0)
    check_counts(BrdfTable.sampled(load(written(tmp_path / "y.bsdf", content()))), 0, 0.0)


def test_what_averaging_moves_is_counted(tmp_path):
    brdf = load(written(tmp_path / "x.bsdf", content()))
    table = BrdfTable.sampled(brdf)
    assert 0 < table.counts.energy_averaged < brdf.facts["asymmetry"]
    assert BrdfTable.sampled(brdf, Lattice(20, 20, 40, reciprocal=False)).counts.energy_averaged == 0


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
