"""A library as a mapping, from a folder, from a file, and from an address."""

import functools
import http.server
import re
import threading
import warnings
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers import complaint, must_fail, random_directions
from library_files import GOLDEN, MATERIALS, entry, folder, packed

from sommerl import Library, load
from sommerl.compression.smrl import file
from sommerl.library import remote
from sommerl.library.library import NoSuchMaterial, entry_of
from sommerl.library.pack import pack
from sommerl.system.errors import FormatError, MaterialError, OptionError

NAMES = sorted(MATERIALS)
A, B = random_directions(10, 1), random_directions(10, 2)


class Server(http.server.ThreadingHTTPServer):
    """A server on this machine of one file; `sent` are the bytes of each answer's body."""

    def __init__(self, data, ranges):
        self.data, self.ranges, self.sent = data, ranges, []
        super().__init__(("127.0.0.1", 0), Handler)

    @property
    def address(self):
        return f"http://127.0.0.1:{self.server_port}/x.smrlib"


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        data, found = self.server.data, re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        if self.path != "/x.smrlib":
            return self.send_error(404)
        partly = found and self.server.ranges
        body = data[int(found[1]) : int(found[2]) + 1] if partly else data
        self.server.sent.append(len(body))
        self.send_response(206 if partly else 200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


@pytest.fixture
def served():
    """serve(bytes, ranges=…): a server of them."""
    servers = []

    def serve(data, *, ranges=True):
        server = Server(data, ranges)
        servers.append(server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        return server

    yield serve
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.fixture(params=["folder", "file", "address"])
def library(request, tmp_path, served):
    made = folder(tmp_path / "made")
    if request.param == "folder":
        return Library(made)
    with Library(made) as whole:
        pack(whole, tmp_path / "x.smrlib")
    if request.param == "file":
        return Library(tmp_path / "x.smrlib")
    return Library(served((tmp_path / "x.smrlib").read_bytes()).address)


def check_mapping(library):
    assert isinstance(library, Mapping)
    assert list(library) == library.names == [record.name for record in library.records] == NAMES
    assert len(library) == 3
    assert "cells" in library
    assert "other" not in library
    assert 3 not in library
    assert library.get("other") is None
    for name in NAMES:
        material, other = library[name], file.decode(MATERIALS[name])
        assert np.array_equal(material.eval(A, B), other.eval(A, B))
        assert library.data(name) == MATERIALS[name]
        assert library.record(name).source == f"{name}.bsdf"
        assert material.source == other.source
        assert len(material.file_sha256) == 64


def test_a_library_is_a_mapping(library):
    check_mapping(library)


def test_another_library_is_noticed(tmp_path):
    must_fail(check_mapping, Library(folder(tmp_path / "made", {"cells": MATERIALS["cells"]})))


def test_records_are_the_same_in_all(tmp_path, library):
    assert list(map(entry_of, library.records)) == list(map(entry_of, Library(tmp_path / "made").records))


def test_an_unknown_name_is_told_with_the_nearest(library):
    with pytest.raises(NoSuchMaterial, match=r"found none of the name nodes/botj; did you mean nodes/both\?$"):
        library["nodes/botj"]
    with pytest.raises(KeyError):
        library.record("neither")
    assert "did you mean nodes/neither?" in complaint(library.__getitem__, "neithr")
    assert "it has cells, nodes/both, nodes/neither" in complaint(library.data, "qqqq")


def check_cache(most, expected):
    """Which of the three are given again without being read, after all have been asked for, in order."""
    names = [f"{n}" for n in range(3)]
    data = packed(dict.fromkeys(names, MATERIALS["nodes/both"]))
    size = file.decode(MATERIALS["nodes/both"]).bytes_memory
    path = check_cache.folder / f"{most}.smrlib"
    path.write_bytes(data)
    with Library(path, cache=int(most * size)) as library:
        found = [library[name] for name in names]
        assert library.bytes_cached <= most * size
        again = [library[name] is one for name, one in zip(names[::-1], found[::-1], strict=True)]
    assert again == expected


def test_the_last_ones_are_kept(tmp_path):
    check_cache.folder = tmp_path
    check_cache(3, [True, True, True])
    check_cache(2.5, [True, True, False])
    check_cache(0.5, [False, False, False])
    must_fail(check_cache, 2.5, [False, True, True])


def check_requests(server, asked, most):
    before = len(server.sent)
    asked()
    assert len(server.sent) - before <= most[0]
    assert sum(server.sent[before:]) <= most[1]


def test_of_an_address_little_is_read(served):
    names = [f"{n:04d}" for n in range(200)]
    data = packed(dict.fromkeys(names, MATERIALS["cells"]))
    server = served(data)
    index = len(data) - len(names) * len(MATERIALS["cells"])
    made = []
    check_requests(server, lambda: made.append(Library(server.address)), (2, index + 1100))
    check_requests(server, lambda: made[0].records, (0, 0))
    check_requests(server, lambda: made[0]["0101"], (1, len(MATERIALS["cells"])))
    check_requests(server, lambda: made[0]["0101"], (0, 0))
    must_fail(check_requests, server, lambda: made[0]["0102"], (0, 0))


def test_a_server_without_ranges_sends_all_once(served):
    server = served(packed(), ranges=False)
    with pytest.warns(UserWarning, match="sends no parts of a file"):
        library = Library(server.address)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [library.data(name) for name in NAMES] == [MATERIALS[name] for name in NAMES]
    assert len(server.sent) == 1


@pytest.mark.parametrize("ranges", [True, False])
def test_what_an_address_does_not_hold_is_told(served, ranges):
    server = served(packed()[:-1], ranges=ranges)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cut = complaint(lambda: [Library(server.address).data(name) for name in NAMES])
    assert cut.startswith(f"{server.address}:nodes/neither: ")
    assert "cut off" in cut
    other = served(b"<!doctype html>" * 100, ranges=ranges)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert "expected a file of many materials" in complaint(Library, other.address)
    assert "there is no such file" in complaint(Library, other.address.replace("x.", "y."))
    assert "cannot be read" in complaint(Library, "http://127.0.0.1:9/x.smrlib")
    assert "expected an address" in complaint(Library, "wxyz://x/y.smrlib")


def test_what_is_an_address():
    assert remote.is_address("https://x/y.smrlib")
    assert remote.is_address("s3://bucket/y.smrlib")
    assert not remote.is_address("C:/x.smrlib")
    assert not remote.is_address("a:b//c.smrlib")


def test_threads_may_ask_at_the_same_time(tmp_path):
    names = [f"{n:02d}" for n in range(40)]
    kinds = list(MATERIALS.values())
    materials = {name: kinds[n % 3] for n, name in enumerate(names)}
    (tmp_path / "x.smrlib").write_bytes(packed(materials))
    size = file.decode(kinds[1]).bytes_memory
    expected = [file.decode(data).eval(A, B) for data in kinds]
    with Library(tmp_path / "x.smrlib", cache=3 * size) as library, ThreadPoolExecutor(8) as threads:
        found = list(threads.map(lambda name: library[name].eval(A, B), names * 5))
        assert library.bytes_cached <= 3 * size
    for number, values in enumerate(found):
        assert np.array_equal(values, expected[number % len(names) % 3])


def test_what_is_no_library_is_told(tmp_path):
    (tmp_path / "x.smrlib").write_bytes(MATERIALS["cells"])
    assert "another kind" in complaint(Library, tmp_path / "x.smrlib")
    assert "there is no such file" in complaint(Library, tmp_path / "y.smrlib")
    with pytest.raises(MaterialError, match="expected a library"):
        Library(tmp_path)


def test_a_folders_damaged_material_is_told(tmp_path):
    library = Library(folder(tmp_path / "made"))
    (tmp_path / "made/cells.smrl").write_bytes(MATERIALS["nodes/both"])
    assert "SHA-256" in complaint(library.data, "cells")
    assert complaint(library.data, "nodes/both") is None
    with pytest.raises(FormatError):
        pack(library, tmp_path / "x.smrlib")
    assert not (tmp_path / "x.smrlib").exists()


def test_a_file_is_packed_again_to_the_same_bytes(tmp_path):
    with Library(folder(tmp_path / "made")) as library:
        steps = []
        assert pack(library, tmp_path / "a.smrlib", progress=lambda *step: steps.append(step)) == sum(
            1 for _ in (tmp_path / "a.smrlib").read_bytes()
        )
        assert steps == [(n, 6) for n in range(1, 7)]
        with pytest.raises(OptionError, match="ends in"):
            pack(library, tmp_path / "a.zip")
    with Library(tmp_path / "a.smrlib") as library:
        pack(library, tmp_path / "b.smrlib")
    assert (tmp_path / "a.smrlib").read_bytes() == (tmp_path / "b.smrlib").read_bytes()


def test_a_material_in_a_file_is_one_everywhere():
    path = GOLDEN / "library-1.smrlib"
    assert load(f"{path}:nodes/both").name == file.decode(MATERIALS["nodes/both"]).name
    assert "expected the name of one of its 3 materials" in complaint(load, path)
    assert "did you mean nodes/both?" in complaint(load, f"{path}:nodes/botg")
    assert entry("cells").name == "cells"
    assert functools.reduce(lambda a, b: a and b, (len(load(f"{path}:{name}").file_sha256) == 64 for name in NAMES))
