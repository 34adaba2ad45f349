"""HDF5 files that lead elsewhere, or nowhere."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from helpers import complaint, must_fail
from test_nbrdf import FLAT, arrays, check_network, keras

from sommerl import load
from sommerl.formats import hdf5


@pytest.fixture
def file(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w", libver="latest") as file:
        yield file


def check_is_refused(file, found):
    path = file if isinstance(file, Path) else Path(file.filename)
    if not isinstance(file, Path):
        file.close()
    message = complaint(load, path)
    assert message is not None
    assert message.startswith(f"{path}: ")
    assert found in message


@pytest.mark.parametrize("deep", [9, 500, 20_000])
def test_groups_in_each_other(file, deep):
    group = file.create_group("model_weights")
    for _ in range(deep):
        group = group.create_group("g")
    check_is_refused(file, f"expected groups in each other {hdf5.DEEPEST} deep, found deeper ones")


def test_a_group_in_itself(file):
    file.create_group("a/b")
    file["a/b/c"] = file["a"]
    check_is_refused(file, "found deeper ones")


@pytest.mark.parametrize("many", [hdf5.MOST_ITEMS, 20_000])
def test_many_groups(file, many):
    for number in range(many):
        file.create_group(f"model_weights/{number}")
    if many > hdf5.MOST_ITEMS:
        check_is_refused(file, f"expected at most {hdf5.MOST_ITEMS} groups and arrays, found more")
    else:
        path = Path(file.filename)
        check_is_refused(file, "expected dense layers")
        must_fail(check_is_refused, path, "found more")


def test_a_group_of_itself_by_width(file):
    """A few bytes that are as many paths as 20 to the power of 8."""
    group = file.create_group("a")
    for number in range(20):
        group[str(number)] = group
    check_is_refused(file, "expected")


@pytest.mark.parametrize("link", [h5py.SoftLink("/other"), h5py.ExternalLink("other.h5", "/dense")])
@pytest.mark.parametrize("place", ["model_weights", "model_weights/dense", "dense/kernel:0"])
def test_links(file, tmp_path, link, place):
    keras(tmp_path / "other.h5", prefix="")
    file.create_group("other")
    file[place] = link
    check_is_refused(file, f"{place.split('/')[-1]}: expected what the file itself holds, found a link")


def test_arrays_that_lie_elsewhere(file, tmp_path):
    (tmp_path / "secret").write_bytes(bytes(6 * 21 * 4))
    file.create_dataset("dense/kernel:0", (6, 21), "f4", external=[(str(tmp_path / "secret"), 0, 6 * 21 * 4)])
    check_is_refused(file, "expected weights stored in the file")


def test_arrays_put_together_from_elsewhere(file, tmp_path):
    layout = h5py.VirtualLayout((6, 21), "f4")
    layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "x", (6, 21))
    file.create_virtual_dataset("dense/kernel:0", layout)
    check_is_refused(file, "expected weights stored in the file")


def test_filters_that_would_be_loaded(file):
    """As those for which HDF5 looks for libraries in folders."""
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_chunk((6, 21))
    creation.set_filter(32001, h5py.h5z.FLAG_OPTIONAL)
    space = h5py.h5s.create_simple((6, 21))
    h5py.h5d.create(file.create_group("dense").id, b"kernel:0", h5py.h5t.IEEE_F32LE, space, creation)
    check_is_refused(file, "unknown filters")


def test_compressed_layers_are_read(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        for number in (1, 2, 3):
            for name, part in (("kernel:0", "fc"), ("bias:0", "b")):
                options = {"compression": "gzip", "shuffle": True, "fletcher32": True}
                file.create_dataset(f"d{number}/{name}", data=arrays()[f"{part}{number}"], **options)
    check_network(load(tmp_path / "x.h5"), FLAT)


def test_text_and_other_things_are_passed_over(tmp_path):
    keras(tmp_path / "x.h5")
    with h5py.File(tmp_path / "x.h5", "a") as file:
        file["model_weights/note"] = "text"
        file["model_weights/number"] = np.arange(3)
        file.create_group("optimizer_weights").attrs["a"] = 1
    check_network(load(tmp_path / "x.h5"), FLAT)
