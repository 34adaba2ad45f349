"""Weights of neural BRDFs as Keras 3 and PyTorch write them; and what is not taken for weights."""

import io
import json
import struct
import zipfile

import h5py
import numpy as np
import pytest
from helpers import complaint, must_fail
from test_nbrdf import arrays, check_network

from sommerl import load

PARTS = [(arrays()[f"fc{n}"], arrays()[f"b{n}"]) for n in (1, 2, 3)]


def hdf5(write):
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        write(file)
    return out.getvalue()


def keras3(parts=PARTS, transposed=False):
    """The layout of model.save_weights("x.weights.h5"), with an optimiser's state as a trained model has."""

    def write(file):
        for number, (matrix, bias) in enumerate(parts):
            group = "layers/dense" + (f"_{number}" if number else "")
            file[f"{group}/vars/0"] = (matrix.T if transposed else matrix).astype("f4")
            file[f"{group}/vars/1"] = bias.astype("f4")
        file["optimizer/vars/0"] = np.float32(3)
        file["optimizer/vars/1"] = np.zeros((6, 21), "f4")
        file.create_group("vars")

    return hdf5(write)


def keras3_h5():
    def write(file):
        for number, (matrix, bias) in enumerate(PARTS):
            name = f"dense_{number}"
            file[f"model_weights/{name}/sequential/{name}/kernel"] = matrix.astype("f4")
            file[f"model_weights/{name}/sequential/{name}/bias"] = bias.astype("f4")
        file["optimizer_weights/adam/kernel"] = np.zeros((6, 21), "f4")

    return hdf5(write)


def zipped(**members):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return out.getvalue()


def keras_archive(data=None):
    return zipped(**{"metadata.json": b"{}", "config.json": b"{}", "model.weights.h5": data or keras3()})


def safetensors(tensors, dtype="F32", **metadata):
    header, data = dict(metadata), b""
    for name, array in tensors.items():
        raw = array.astype({"F32": "<f4", "F64": "<f8", "F16": "<f2", "BF16": "<f4"}[dtype])
        part = (raw.view("<u4") >> 16).astype("<u2").tobytes() if dtype == "BF16" else raw.tobytes()
        offsets = [len(data), len(data) + len(part)]
        header[name] = {"dtype": dtype, "shape": list(array.shape), "data_offsets": offsets}
        data += part
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


STATE = {
    f"net.{2 * n}.{part}": array
    for n, (matrix, bias) in enumerate(PARTS)
    for part, array in (("weight", matrix.T), ("bias", bias))
}
FILES = {
    "k3.weights.h5": keras3(),
    "transposed.weights.h5": keras3(transposed=True),
    "k3.h5": keras3_h5(),
    "k3.keras": keras_archive(),
    "torch.safetensors": safetensors(STATE, __metadata__={"format": "pt"}),
    "double.safetensors": safetensors(STATE, "F64"),
    "straight.safetensors": safetensors({name: array.T for name, array in STATE.items()}),
}


def put(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", FILES)
def test_read(tmp_path, name):
    found = load(put(tmp_path, name, FILES[name]))
    check_network(found)
    assert found.name.startswith(name.split(".")[0])
    other = safetensors(STATE | {"net.0.bias": PARTS[0][1] + 1})
    must_fail(check_network, load(put(tmp_path, "other.safetensors", other)))


def test_half_precision(tmp_path):
    for dtype in ("F16", "BF16"):
        found = load(put(tmp_path, "x.safetensors", safetensors(STATE, dtype)))
        assert np.allclose(found._layers[0][0], PARTS[0][0], rtol=1e-2, atol=1e-3)


def test_transposed_arrays_of_numpy(tmp_path):
    np.savez(tmp_path / "x.npz", **{name: array.T for name, array in arrays().items()})
    check_network(load(tmp_path / "x.npz"))


WHOLE = FILES["torch.safetensors"]
HEADER = struct.unpack("<Q", WHOLE[:8])[0]


def headed(**about):
    text = json.dumps({"a": {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]} | about}).encode()
    return struct.pack("<Q", len(text)) + text + bytes(8)


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("x.weights.h5", keras3(PARTS[:2]), r"layers/dense/vars/0 (6, 21)"),
        ("x.safetensors", safetensors({"net.0.weight": np.zeros((7, 21))}), "net.0.weight (7, 21)"),
        ("x.safetensors", WHOLE[:-4], "bytes of data"),
        ("x.safetensors", WHOLE[: HEADER // 2], "expected a header in JSON"),
        ("x.safetensors", headed(), "found a (2,)"),
        ("x.safetensors", headed(dtype="I64"), "found [2] of I64"),
        ("x.safetensors", headed(shape=[2**40]), "expected at most 675 weights"),
        ("x.safetensors", headed(shape=[-2]), "expected dtype, shape and data_offsets"),
        ("x.safetensors", headed(data_offsets=[0, 800]), "expected 8 bytes of data"),
        ("x.pt", zipped(**{"archive/data.pkl": b"cos\nsystem\n.", "archive/data/0": b""}), "found a pickle"),
        ("x.keras", keras_archive(b"no HDF5"), "expected"),
        ("x.npz", zipped(**{"merl.npy": b""}), "NumPy array"),
    ],
)
def test_what_is_refused(tmp_path, name, data, said):
    path = put(tmp_path, name, data)
    message = str(complaint(load, path))
    assert message.startswith(f"{path}: ")
    assert said in message


@pytest.mark.parametrize("shape", [(90, 90, 180, 3), (100, 5), (135, 5), (27, 25), (100, 8)])
def test_tables_are_not_taken_for_weights(tmp_path, shape):
    np.save(tmp_path / "x.npy", np.full(shape, 0.3))
    assert f"found float64 of shape {shape}" in str(complaint(load, tmp_path / "x.npy"))
    np.savez(tmp_path / "x.npz", table=np.full(shape, 0.3))
    assert f"found table {shape}" in str(complaint(load, tmp_path / "x.npz"))
