"""Files of neural BRDFs (see `models/nbrdf.py`), as their authors' programs and collections write them:

* NAME_fc1.npy, NAME_b1.npy, …, NAME_b3.npy, a file for each array; any of the six names the material;
* .npz with arrays fc1, b1, …, b3; or with one array of 675 weights for each of many materials: FILE.npz:MATERIAL;
* .npy with 675 weights;
* .h5 and .weights.h5, a Keras model of three dense layers, and .keras, an archive with one (both need h5py);
* .safetensors, a state dict of PyTorch's.

Matrices may be transposed, (outputs, inputs), as PyTorch has them. Nothing is ever unpickled.
"""

from __future__ import annotations

import os
import re
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
from . import hdf5, numpy_files, safetensors
from .format import Format
from .numpy_files import MAGIC, read_npy, read_npz

ARRAYS = ("fc1", "b1", "fc2", "b2", "fc3", "b3")
LARGEST_FILE = 2**24  # bytes
LONGEST_NAME = 200
KERAS = "model.weights.h5"  # in a .keras archive


def read(path: str | Path, member: str = "") -> NeuralBrdf:
    """The material in a file. member: which of the materials in an .npz file. Raises FormatError."""
    return parse(Path(path), door.read(path, LARGEST_FILE), member)


def parse(path: Path, data: bytes, member: str = "") -> NeuralBrdf:
    """As `read`, from the file's bytes. Of NAME_fc1.npy and the like, the other five arrays are read from files beside
    it."""
    try:
        if hdf5.looks_like(data):
            return network(path, _keras(path, data))
        if safetensors.looks_like(data):
            return network(path, safetensors.arrays(path, data, WEIGHTS))
        if data.startswith(MAGIC):
            return _npy(path, data)
        return _npz(path, read_npz(path, data), member)
    except MaterialError as error:
        raise FormatError(f"{path}: {error}") from error


def members(arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    """The names of the materials in an .npz file's arrays; "" alone where the arrays are those of one."""
    if set(ARRAYS) <= arrays.keys():
        return [""]
    return [name for name, array in arrays.items() if is_flat(array)] or [""]


def is_flat(array: NDArray[Any]) -> bool:
    """Whether an array is all weights of a network in a row, and not a table that has as many numbers."""
    return array.size == WEIGHTS == max(array.shape, default=0)


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
        array = read_npy(path, data)
        if not is_flat(array):
            raise FormatError(
                f"{path}: expected samples, an array of shape (n, 7) (or of as many columns as --columns names), or "
                f"{WEIGHTS} weights of a neural BRDF, found {array.dtype} of shape {array.shape}"
            )
        return NeuralBrdf.from_flat(_numbers(array).reshape(-1), name=visible(path.stem))
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
        found = ", ".join(f"{visible(name)} {array.shape}" for name, array in list(arrays.items())[:8])
        raise FormatError(
            f"{path}: expected columns of samples, arrays {', '.join(ARRAYS)}, or of {WEIGHTS} weights each, "
            f"found {found}"
        )
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
    if pairs[0][0].shape == SHAPES[0][::-1] and pairs[2][0].shape == SHAPES[2][::-1]:
        pairs = [(matrix.T, bias) for matrix, bias in pairs]
    return NeuralBrdf(pairs, name=f"{name} (NBRDF)")


def network(path: Path, arrays: Mapping[str, NDArray[Any]]) -> NeuralBrdf:
    """The network of arrays whose names are paths: of each layer a matrix and a bias, in one place.

    Layers are told apart by their shapes. Raises FormatError for others, with the shapes that the file has.
    """
    layers: dict[str, list[NDArray[Any]]] = {}
    for place, array in arrays.items():
        layers.setdefault(re.split(r"[./][^./]*$", place)[0], []).append(array)
    found: dict[tuple[int, ...], list[NDArray[Any]]] = {}
    for pair in layers.values():
        pair.sort(key=lambda array: -array.ndim)
        if [array.ndim for array in pair] == [2, 1]:
            found[pair[0].shape] = pair
    for shapes in (SHAPES, [shape[::-1] for shape in SHAPES]):
        if len(layers) == len(SHAPES) and set(found) == set(shapes):
            ordered = [part for shape in shapes for part in found[shape]]
            return _layers(dict(zip(ARRAYS, ordered, strict=True)), visible(path.name.split(".")[0] or path.stem))
    shown = (
        ", ".join(f"{visible(place, LONGEST_NAME)} {array.shape}" for place, array in list(arrays.items())[:12])
        or "none"
    )
    raise FormatError(
        f"{path}: expected dense layers with matrices {SHAPES}, or transposed, and their biases, found {shown}"
    )


def _numbers(array: NDArray[Any]) -> NDArray[np.float64]:
    if array.dtype.kind != "f":
        raise MaterialError(f"expected weights in floating point, found {array.dtype}")
    with np.errstate(invalid="ignore"):  # of NaN that signals; NeuralBrdf refuses all NaN
        return array.astype(np.float64)


def in_archive(path: Path, data: bytes) -> bytes | None:
    """The weights in a .keras archive, an HDF5 file; None if it is another archive.

    Raises FormatError for a pickle of PyTorch's, and for weights that are damaged or too large.
    """
    names = numpy_files.names(path, data)
    if any(name.rpartition("/")[2].endswith(".pkl") for name in names):
        raise FormatError(
            f"{path}: expected weights or samples, found a pickle as PyTorch writes it, which could run programs "
            "and is never read: save the state dict with safetensors"
        )
    return numpy_files.member(path, data, KERAS, LARGEST_FILE) if KERAS in names else None


def _keras(path: Path, data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of the layers in a Keras model, by path: kernel and bias, or, since Keras 3, vars/0 and vars/1."""
    return hdf5.arrays(path, data, "model_weights", _is_weight, WEIGHTS)


def _is_weight(place: str) -> bool:
    parts = place.split(":")[0].split("/")
    return parts[-1] in ("kernel", "bias") or (parts[0] != "optimizer" and parts[-2:-1] == ["vars"])


def _weights(path: Path, data: bytes) -> NeuralBrdf:
    if not hdf5.looks_like(data) and not safetensors.looks_like(data):
        raise FormatError(f"{path}: expected an HDF5 or safetensors file, found another kind of file")
    return parse(path, data)


def _looks_like(head: bytes) -> bool:
    return hdf5.looks_like(head) or safetensors.looks_like(head)


FORMAT = Format(
    "neural BRDF",
    (".h5", ".hdf5", ".keras", ".safetensors"),
    "three dense layers, as Keras or PyTorch write them",
    needs="lab",
    sniff=_looks_like,
    read=_weights,
    largest=LARGEST_FILE,
)
