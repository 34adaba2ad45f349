import io
import os
import socket
from pathlib import Path

import numpy as np
import pytest
from helpers import complaint, must_fail

from sommerl import load
from sommerl.compression.smrl import file as smrl
from sommerl.formats import cornell, fits, merl, nbrdf, rgl, samples
from sommerl.render.environment import load_environment
from sommerl.render.meshes import load_mesh
from sommerl.system import door
from sommerl.system.errors import FormatError

READERS = {
    "load": load, "merl": merl.read, "rgl": rgl.read, "cornell": cornell.read, "samples": samples.read,
    "nbrdf": nbrdf.read, "fits": fits.read, "smrl": smrl.load, "environment": load_environment, "mesh": load_mesh,
}  # fmt: skip


class Counted(io.FileIO):
    """A file that says how much of it was read."""

    read_so_far = 0

    def read(self, size=-1):
        found = super().read(size)
        Counted.read_so_far += len(found)
        return found


@pytest.fixture
def counted(monkeypatch):
    monkeypatch.setattr(door, "FileIO", Counted)
    Counted.read_so_far = 0
    return Counted


def check_reads_at_most(counted, most, read, path, limit):
    complaint(read, path, limit)
    assert counted.read_so_far <= most


@pytest.mark.parametrize("size", [0, 1, 4095, 4096, 4097, 100_000])
def test_what_is_in_a_file_is_what_comes_in(tmp_path, counted, size):
    path, data = tmp_path / "x", np.random.default_rng(size).bytes(size)
    path.write_bytes(data)
    assert door.read(path, size) == data
    assert counted.read_so_far == size
    with door.opened(path) as file:
        assert (file.head, file.read(10**9)) == (data[:4096], data)
    if size:
        assert complaint(door.read, path, size - 1) == f"{path}: expected at most {size - 1} bytes, found {size}"


def test_a_file_that_says_another_length(tmp_path, counted, monkeypatch):
    """As those of /proc, whose length is said to be 0, and those that grow."""
    path = tmp_path / "x"
    path.write_bytes(bytes(10_000_000))
    real = os.fstat

    class Lie:
        def __init__(self, handle):
            self.st_mode, self.st_size = real(handle).st_mode, 0

    monkeypatch.setattr(door.os, "fstat", Lie)
    assert complaint(door.read, path, 5_000_000) == f"{path}: expected at most 5000000 bytes, found more"
    assert counted.read_so_far == 5_000_001
    assert door.read(path, 10_000_000) == bytes(10_000_000)
    must_fail(check_reads_at_most, counted, 5_000_001, lambda path, most: door.read(path, 10 * most), path, 10**6)


def test_a_file_of_the_system():
    assert b"version" in door.read("/proc/version", 10_000)


def check_is_refused(name, path, found):
    message = complaint(READERS[name], path)
    assert message is not None
    assert message.startswith(f"{path}: ")
    assert message.endswith(found)


@pytest.mark.parametrize("name", READERS)
def test_what_is_no_regular_file_is_refused_at_once(tmp_path, name):
    suffix = {"environment": ".exr", "mesh": ".obj"}.get(name, ".csv")
    os.mkfifo(tmp_path / f"pipe{suffix}")
    (tmp_path / f"zero{suffix}").symlink_to("/dev/zero")
    (tmp_path / f"folder{suffix}").mkdir()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / f"s{suffix}"))
    check_is_refused(name, tmp_path / f"pipe{suffix}", "found a pipe")
    check_is_refused(name, tmp_path / f"zero{suffix}", "found a device")
    check_is_refused(name, tmp_path / f"folder{suffix}", "found a directory")
    check_is_refused(name, tmp_path / f"none{suffix}", "there is no such file")
    assert "cannot be read" in str(complaint(READERS[name], tmp_path / f"s{suffix}"))
    must_fail(check_is_refused, name, tmp_path / f"folder{suffix}", "found a pipe")


@pytest.mark.parametrize("name", ["a" * 5000, "a\0b.csv", "\ud800.csv", "a" * 300 + ".smrl"])
def test_names_that_no_file_can_have(name):
    with pytest.raises(FormatError):
        load(name if "." in name else f"{name}/x.csv")


def test_a_sparse_file_is_not_read(tmp_path, counted):
    with (tmp_path / "x.smrl").open("wb") as stream:
        stream.write(b"SMRL")
        stream.truncate(2**40)
    assert "found 1099511627776" in str(complaint(load, tmp_path / "x.smrl"))
    assert counted.read_so_far <= door.HEAD_BYTES


def test_no_reader_opens_files_by_itself():
    rooms = Path(door.__file__).parents[1]
    readers = [*rooms.glob("formats/*.py"), *rooms.glob("*/file.py"), rooms / "compression" / "smrl" / "file.py"]
    readers += [rooms / name for name in ("system/sealed_file.py", "render/meshes.py", "render/environment.py")]
    for path in readers:
        source = path.read_text()
        for word in (".open(", " open(", "read_bytes", "read_text", ".stat()"):
            assert word not in source.replace("archive.open(member)", ""), path
