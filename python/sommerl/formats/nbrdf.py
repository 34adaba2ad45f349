"""Files of neural BRDFs (see `models/nbrdf.py`), as their authors' programs and collections write them:

* NAME_fc1.npy, NAME_b1.npy, …, NAME_b3.npy, a file for each array; any of the six names the material;
* .npz with arrays fc1, b1, …, b3; or with one array of 675 weights for each of many materials: FILE.npz:MATERIAL;
* .npy with 675 weights;
* .h5, a Keras model of three dense layers (needs h5py).
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError, MaterialError
from ..models.nbrdf import SHAPES, WEIGHTS, NeuralBrdf
from ..optional import optional
from .arrays_on_disk import MAGIC, read_npy, read_npz
from .names import printable

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
ARRAYS = ("fc1", "b1", "fc2", "b2", "fc3", "b3")
LARGEST_FILE = 2**24
LARGEST_CHUNK = 2**16  # numbers


def read(path: str | Path, member: str = "") -> NeuralBrdf:
    """The material in a file. member: which of the materials in an .npz file. Raises FormatError."""
    path = Path(path)
    with path.open("rb") as stream:
        head = stream.read(len(HDF5_MAGIC))
    try:
        if head.startswith(HDF5_MAGIC):
            return _layers(_keras(path), printable(path.stem))
        if head.startswith(MAGIC):
            return _npy(path)
        return _npz(path, read_npz(path), member)
    except MaterialError as error:
        raise FormatError(f"{path}: {error}") from error


def _npy(path: Path) -> NeuralBrdf:
    name, mark, part = path.stem.rpartition("_")
    if not mark or part not in ARRAYS:
        return NeuralBrdf.from_flat(_numbers(read_npy(path)).reshape(-1), name=printable(path.stem))
    missing = [other for other in ARRAYS if not (path.parent / f"{name}_{other}.npy").is_file()]
    if missing:
        raise FormatError(f"{path}: expected {name}_{missing[0]}.npy beside it, found none")
    return _layers({other: read_npy(path.parent / f"{name}_{other}.npy") for other in ARRAYS}, printable(name))


def _npz(path: Path, arrays: Mapping[str, NDArray[Any]], member: str) -> NeuralBrdf:
    if set(ARRAYS) <= arrays.keys():
        return _layers(arrays, printable(path.stem))
    names = [name for name, array in arrays.items() if array.size == WEIGHTS]
    if not names:
        raise FormatError(f"{path}: expected arrays {', '.join(ARRAYS)}, or of {WEIGHTS} weights each, found none")
    if not member and len(names) > 1:
        raise FormatError(f"{path}: expected the name of one of its {len(names)} materials, as {path}:{names[0]}")
    if member and member not in names:
        nearest = difflib.get_close_matches(member, names, 1, 0.0)[0]
        raise FormatError(f"{path}: expected a material in it, found {member}; did you mean {nearest}?")
    chosen = member or names[0]
    return NeuralBrdf.from_flat(_numbers(arrays[chosen]).reshape(-1), name=f"{chosen} (NBRDF)")


def _layers(arrays: Mapping[str, NDArray[Any]], name: str) -> NeuralBrdf:
    numbers = [_numbers(arrays[part]) for part in ARRAYS]
    pairs = list(zip(numbers[::2], (bias.reshape(-1) for bias in numbers[1::2]), strict=True))
    return NeuralBrdf(pairs, name=f"{name} (NBRDF)")


def _numbers(array: NDArray[Any]) -> NDArray[np.float64]:
    if array.dtype.kind != "f":
        raise MaterialError(f"expected weights in floating point, found {array.dtype}")
    return array.astype(np.float64)


def _keras(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of the dense layers in a Keras model, in their order."""
    h5py = optional("h5py", "h5py", str(path), "formats")
    if path.stat().st_size > LARGEST_FILE:
        raise FormatError(f"{path}: expected at most {LARGEST_FILE} bytes, found {path.stat().st_size}")
    layers: dict[str, dict[str, NDArray[Any]]] = {}

    def visit(name: str, item: Any) -> None:
        layer, _, part = name.rpartition("/")
        part = part.split(":")[0]
        if isinstance(item, h5py.Dataset) and part in ("kernel", "bias"):
            if item.size > WEIGHTS or item.dtype.kind != "f":
                raise FormatError(f"{path}: {name}: expected at most {WEIGHTS} weights, found {item.shape}")
            if math.prod(item.chunks or ()) > LARGEST_CHUNK or item.is_virtual or item.external:
                raise FormatError(f"{path}: {name}: expected weights stored in the file, found large chunks or links")
            layers.setdefault(layer, {})[part] = np.asarray(item)

    try:
        with h5py.File(path, "r") as file:
            top = file.get("model_weights", file)
            if not isinstance(top, h5py.Group):
                raise FormatError(f"{path}: model_weights: expected a group of layers, found one array")
            top.visititems(visit)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FormatError(f"{path}: expected an HDF5 file, found a damaged one ({error})") from error
    found = {layer["kernel"].shape: layer for layer in layers.values() if len(layer) == 2}
    if len(layers) != len(SHAPES) or set(found) != set(SHAPES):
        raise FormatError(f"{path}: expected dense layers of shapes {SHAPES} with biases, found {list(found)}")
    ordered = [found[shape][part] for shape in SHAPES for part in ("kernel", "bias")]
    return dict(zip(ARRAYS, ordered, strict=True))
