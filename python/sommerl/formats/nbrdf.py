"""Files of neural BRDFs (see `models/nbrdf.py`), as their authors' programs and collections write them:

* NAME_fc1.npy, NAME_b1.npy, …, NAME_b3.npy, a file for each array; any of the six names the material;
* .npz with arrays fc1, b1, …, b3; or with one array of 675 weights for each of many materials: FILE.npz:MATERIAL;
* .npy with 675 weights;
* .h5, a Keras model of three dense layers (needs h5py).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models.nbrdf import SHAPES, WEIGHTS, NeuralBrdf
from ..system import door
from ..system.errors import FormatError, MaterialError
from ..system.near import did_you_mean
from ..system.visible import visible
from . import hdf5
from .format import Format
from .numpy_files import MAGIC, read_npy, read_npz

ARRAYS = ("fc1", "b1", "fc2", "b2", "fc3", "b3")
LARGEST_FILE = 2**24  # bytes
LONGEST_NAME = 200


def read(path: str | Path, member: str = "") -> NeuralBrdf:
    """The material in a file. member: which of the materials in an .npz file. Raises FormatError."""
    return parse(Path(path), door.read(path, LARGEST_FILE), member)


def parse(path: Path, data: bytes, member: str = "") -> NeuralBrdf:
    """As `read`, from the file's bytes. Of NAME_fc1.npy and the like, the other five arrays are read from files beside
    it."""
    try:
        if hdf5.looks_like(data):
            return _layers(_keras(path, data), visible(path.stem))
        if data.startswith(MAGIC):
            return _npy(path, data)
        return _npz(path, read_npz(path, data), member)
    except MaterialError as error:
        raise FormatError(f"{path}: {error}") from error


def members(arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    """The names of the materials in an .npz file's arrays; "" alone where the arrays are those of one."""
    if set(ARRAYS) <= arrays.keys():
        return [""]
    return [name for name, array in arrays.items() if array.size == WEIGHTS] or [""]


def parts(path: Path) -> list[Path]:
    """All files of the material that a .npy file is of: six, or that one."""
    beside = _beside(path)
    return list(beside.values()) if beside and all(map(os.path.isfile, beside.values())) else [path]


def _beside(path: Path) -> dict[str, Path]:
    """The six files of which NAME_fc1.npy and the like is one, by their arrays; empty for other names."""
    name, mark, part = path.stem.rpartition("_")
    return {each: path.with_name(f"{name}_{each}.npy") for each in ARRAYS} if mark and part in ARRAYS else {}


def _npy(path: Path, data: bytes) -> NeuralBrdf:
    beside = _beside(path)
    if not beside:
        return NeuralBrdf.from_flat(_numbers(read_npy(path, data)).reshape(-1), name=visible(path.stem))
    name, _, part = path.stem.rpartition("_")
    del beside[part]
    missing = [file.name for file in beside.values() if not os.path.isfile(file)]
    if missing:
        raise FormatError(f"{path}: expected {missing[0]} beside it, found none")
    found = {other: read_npy(file, door.read(file, LARGEST_FILE)) for other, file in beside.items()}
    return _layers(found | {part: read_npy(path, data)}, visible(name))


def _npz(path: Path, arrays: Mapping[str, NDArray[Any]], member: str) -> NeuralBrdf:
    if set(ARRAYS) <= arrays.keys():
        return _layers(arrays, visible(path.stem))
    names = members(arrays)
    if names == [""]:
        raise FormatError(f"{path}: expected arrays {', '.join(ARRAYS)}, or of {WEIGHTS} weights each, found none")
    if not member and len(names) > 1:
        raise FormatError(f"{path}: expected the name of one of its {len(names)} materials, as {path}:{names[0]}")
    if member and member not in names:
        hint = did_you_mean(member, names) or f"; it has {', '.join(names[:20])}"
        raise FormatError(f"{path}: expected a material in it, found {member}{hint}")
    chosen = member or names[0]
    return NeuralBrdf.from_flat(_numbers(arrays[chosen]).reshape(-1), name=f"{visible(chosen, LONGEST_NAME)} (NBRDF)")


def _layers(arrays: Mapping[str, NDArray[Any]], name: str) -> NeuralBrdf:
    numbers = [_numbers(arrays[part]) for part in ARRAYS]
    pairs = list(zip(numbers[::2], (bias.reshape(-1) for bias in numbers[1::2]), strict=True))
    return NeuralBrdf(pairs, name=f"{name} (NBRDF)")


def _numbers(array: NDArray[Any]) -> NDArray[np.float64]:
    if array.dtype.kind != "f":
        raise MaterialError(f"expected weights in floating point, found {array.dtype}")
    with np.errstate(invalid="ignore"):  # of NaN that signals; NeuralBrdf refuses all NaN
        return array.astype(np.float64)


def _keras(path: Path, data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of the dense layers in a Keras model, in their order."""
    layers: dict[str, dict[str, NDArray[Any]]] = {}
    for place, array in hdf5.arrays(path, data, "model_weights", ("kernel", "bias"), WEIGHTS).items():
        layer, _, part = place.rpartition("/")
        layers.setdefault(layer, {})[part.split(":")[0]] = array
    found = {layer["kernel"].shape: layer for layer in layers.values() if len(layer) == 2}
    if len(layers) != len(SHAPES) or set(found) != set(SHAPES):
        raise FormatError(f"{path}: expected dense layers of shapes {SHAPES} with biases, found {list(found)}")
    ordered = [found[shape][part] for shape in SHAPES for part in ("kernel", "bias")]
    return dict(zip(ARRAYS, ordered, strict=True))


def _hdf5(path: Path, data: bytes) -> NeuralBrdf:
    if not hdf5.looks_like(data):
        raise FormatError(f"{path}: expected an HDF5 file, found another kind of file")
    return parse(path, data)


FORMAT = Format(
    "neural BRDF",
    (".h5", ".hdf5"),
    "a Keras model of three dense layers",
    needs="formats",
    sniff=hdf5.looks_like,
    read=_hdf5,
    largest=LARGEST_FILE,
)
