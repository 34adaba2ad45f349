import io

import h5py
import numpy as np
import pytest
from helpers import check_sentence, complaint, must_fail, random_directions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sommerl import load
from sommerl.models.nbrdf import SHAPES, WEIGHTS, NeuralBrdf
from sommerl.reflectance.half_diff import half_diff
from sommerl.render.bsdf import upload
from sommerl.render.llvm import mitsuba
from sommerl.system.errors import FormatError

A, B = random_directions(500, 1), random_directions(500, 2)
FLAT = np.random.default_rng(0).normal(scale=0.4, size=WEIGHTS)
OTHER = np.random.default_rng(1).normal(scale=0.4, size=WEIGHTS)


def arrays(flat=FLAT):
    """As their program saves them."""
    found, at = {}, 0
    for number, (rows, columns) in enumerate(SHAPES, 1):
        found[f"fc{number}"] = flat[at : at + rows * columns].reshape(rows, columns).astype(np.float32)
        at += rows * columns
        found[f"b{number}"] = flat[at : at + columns].astype(np.float32)
        at += columns
    return found


def by_hand(wi, wo, flat=FLAT):
    """One pair after the other, from vectors and not from angles."""
    parts = arrays(flat)
    theta_h, theta_d, phi_d = half_diff(tuple(wi), tuple(wo))
    half = [np.sin(theta_h), 0, np.cos(theta_h)]
    diff = [np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)]
    x = np.array(half + diff)
    for number in (1, 2):
        x = np.maximum(parts[f"fc{number}"].T @ x + parts[f"b{number}"], 0)
    return np.maximum(np.exp(parts["fc3"].T @ x + parts["b3"]) - 1, 0)


def check_network(brdf, flat=FLAT):
    assert np.allclose(brdf.eval(A, B), [by_hand(a, b, flat) for a, b in zip(A, B, strict=True)], rtol=1e-5, atol=1e-6)


def keras(path, names=("dense_9", "dense_10", "dense_11"), prefix="model_weights"):
    """A file as Keras 2 writes it; the layers' names do not sort in their order."""
    with h5py.File(path, "w") as file:
        group = file.create_group(prefix) if prefix else file
        for number, name in enumerate(names, 1):
            layer = group.create_group(f"{name}/{name}")
            layer["kernel:0"], layer["bias:0"] = arrays()[f"fc{number}"], arrays()[f"b{number}"]


def test_every_kind_of_file(tmp_path):
    for part, array in arrays().items():
        np.save(tmp_path / f"nickel_{part}.npy", array)
    np.save(tmp_path / "flat.npy", FLAT)
    np.savez(tmp_path / "one.npz", **arrays())
    np.savez(tmp_path / "many.npz", nickel=FLAT.astype(np.float32), chrome=OTHER)
    keras(tmp_path / "k.h5")
    keras(tmp_path / "weights.h5", prefix="")
    names = ("nickel_fc1.npy", "nickel_b3.npy", "flat.npy", "one.npz", "many.npz:nickel", "k.h5", "weights.h5")
    for name in names:
        brdf = load(tmp_path / name)
        assert isinstance(brdf, NeuralBrdf)
        check_network(brdf)
    assert load(tmp_path / "nickel_fc1.npy").name == "nickel (NBRDF)"
    must_fail(check_network, load(tmp_path / "many.npz:chrome"))
    check_network(load(tmp_path / "many.npz:chrome"), OTHER)


def test_arrays_that_python_2_wrote(tmp_path):
    np.save(tmp_path / "x.npy", FLAT)
    whole = (tmp_path / "x.npy").read_bytes()
    assert b"(675,), } " in whole
    (tmp_path / "x.npy").write_bytes(whole.replace(b"(675,), } ", b"(675L,), }"))
    check_network(load(tmp_path / "x.npy"))


def test_it_renders():
    mi = mitsuba()
    brdf = NeuralBrdf.from_flat(FLAT, name="x")
    wi, wo = (tuple(mi.Float(c.astype(np.float32)) for c in w.T) for w in (A, B))
    found = brdf.f_r(wi, wo, {name: upload(buffer) for name, buffer in brdf.buffers().items()})
    assert np.allclose(np.stack([np.array(c) for c in found], -1), brdf.eval(A, B), rtol=1e-3, atol=1e-4)


def test_it_is_reciprocal():
    brdf = NeuralBrdf.from_flat(FLAT, name="x")
    assert np.allclose(brdf.eval(A, B), brdf.eval(B, A))


def saved(**named):
    out = io.BytesIO()
    np.savez(out, **named)
    return out.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("x.npz", saved(a=FLAT, b=OTHER), "expected the name of one of its 2 materials, as .*x.npz:a"),
        ("x.npz", saved(a=FLAT[:-1]), "expected columns of samples, arrays fc1, b1, .* found a .674,"),
        ("x.npz", saved(a=FLAT * np.nan), "expected finite weights"),
        ("x.npz", saved(a=FLAT.astype(int)), "expected weights in floating point"),
        ("x.npz", saved(**arrays() | {"fc2": FLAT[:10]}), "expected layers of shapes"),
        ("x.h5", b"\x89HDF\r\n\x1a\n" + bytes(200), "expected an HDF5 file, found a damaged one"),
        ("x.h5", b"not HDF5", "expected an HDF5 or safetensors file, found another kind of file"),
        ("x.npy", b"not NumPy", "expected a NumPy array, found another kind of file"),
    ],
)
def test_bad_files(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError, match=sentence):
        load(tmp_path / name)


def test_a_name_that_is_not_in_the_archive(tmp_path):
    np.savez(tmp_path / "x.npz", nickel=FLAT, chrome=OTHER)
    with pytest.raises(FormatError, match="expected a material in it, found nikel; did you mean nickel"):
        load(tmp_path / "x.npz:nikel")


def test_a_file_is_missing_beside(tmp_path):
    np.save(tmp_path / "nickel_fc1.npy", arrays()["fc1"])
    with pytest.raises(FormatError, match=r"expected nickel_b1.npy beside it, found none"):
        load(tmp_path / "nickel_fc1.npy")


def test_a_keras_model_of_another_kind(tmp_path):
    keras(tmp_path / "x.h5", names=("dense", "dense_1"))
    with pytest.raises(FormatError, match="expected dense layers with matrices"):
        load(tmp_path / "x.h5")


def test_hdf5_that_is_not_layers(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["model_weights"] = 5.0
    with pytest.raises(FormatError, match="model_weights: expected a group of layers"):
        load(tmp_path / "x.h5")
    with h5py.File(tmp_path / "y.h5", "w") as file:
        file.create_dataset(
            "dense/kernel", (6, 21), "f4", maxshape=(None, None), chunks=(4000, 4000), compression="gzip"
        )
    with pytest.raises(FormatError, match="dense/kernel: expected weights stored in the file, found large chunks"):
        load(tmp_path / "y.h5")


def test_a_colon_in_a_name(tmp_path):
    np.savez(tmp_path / "x.npz", **{"a:b": FLAT, "c": OTHER})
    check_network(load(tmp_path / "x.npz:a:b"))
    np.save(tmp_path / "flat.npy", FLAT)
    with pytest.raises(FormatError, match="expected an archive of materials, to take a from it"):
        load(tmp_path / "flat.npy:a")


def test_every_truncated_length(tmp_path):
    keras(tmp_path / "whole.h5")
    np.savez(tmp_path / "whole.npz", **arrays())
    np.save(tmp_path / "whole.npy", FLAT)
    for kind, step in (("h5", 97), ("npz", 7), ("npy", 7)):
        whole, path = (tmp_path / f"whole.{kind}").read_bytes(), tmp_path / f"x.{kind}"
        for length in range(0, len(whole), step):
            path.write_bytes(whole[:length])
            with pytest.raises(FormatError, match=f"x.{kind}: "):
                load(path)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_bytes_never_end_in_anything_but_a_sentence(tmp_path, data):
    kind = data.draw(st.sampled_from(["h5", "npz"]))
    path = tmp_path / f"x.{kind}"
    if kind == "h5":
        keras(path)
    else:
        np.savez(path, **arrays())
    whole = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(whole))
    check_sentence(complaint(load, path), "x.")
