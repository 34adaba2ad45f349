import hashlib
import json
import struct
import tracemalloc
import zlib
from pathlib import Path

import compact
import numpy as np
import pytest
from compact import FOLDS, arrays, broken, how, same_numbers, scale, sealed
from helpers import SMALL, lambertian_table, must_fail, random_directions
from hypothesis import given, settings
from hypothesis import strategies as st

from sommerl import Lattice, SomManBrdf, SommerlError, TrainOptions, load, save, train
from sommerl.compression.palette import GainsAndShapes
from sommerl.compression.smrl.file import CELLS_HEAD, SCALE, decode, encode
from sommerl.reflectance.nodes import NodeLattice
from sommerl.reflectance.origin import Source
from sommerl.system.errors import FormatError, MaterialError, OptionError
from sommerl.system.sealed_file import PREFIX

KINDS = ("cells", "nodes")
IN_EACH = [(folds, signed) for folds in FOLDS for signed in (False, True)]
GOLDEN = Path(__file__).parents[1] / "golden"
A, B = random_directions(20, 1), random_directions(20, 2)


def cells(seed=0, entries=9, lattice=SMALL):
    rng = np.random.default_rng(seed)
    index = rng.integers(0, entries, lattice.shape).astype(np.uint8 if entries <= 256 else np.uint16)
    return SomManBrdf(rng.random((entries, 3)), index, lattice, name="made up")


def made(kind, seed=0):
    """A material whose file is small."""
    material = cells(seed, 3, Lattice(3, 2, 3)) if kind == "cells" else compact.material((2, 2, 4, 4, "walk"), seed)
    material.options, material.metrics = {"seed": seed}, {"rmse": 0.25}
    material.source = Source("0123456789abcdef" * 4)
    return material


@pytest.fixture(params=KINDS)
def material(request):
    return made(request.param)


def body(material):
    return encode(material)[PREFIX.size :]


def plain(head, contents, *, kind=0, notes=b""):
    """A file without a name and a source."""
    return sealed(bytes([kind, 0, 0]) + struct.pack("<H", len(notes)) + notes + head + contents)


def deflated(payload):
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return packer.compress(payload) + packer.flush()


def test_only_compressed_materials_are_saved_and_under_their_extension(material, tmp_path):
    with pytest.raises(
        MaterialError, match=r"lambertian: expected a compressed material, found BrdfTable; sommerl.train"
    ):
        save(lambertian_table(), tmp_path / "x.smrl")
    for name in ("x.binary", "x", "smrl"):
        with pytest.raises(OptionError, match=f"{name}: expected a name that ends in .smrl, found"):
            save(material, tmp_path / name)
    assert not list(tmp_path.iterdir())


def cell_parts(material):
    """The head of a material of cells, and what is deflated."""
    head = CELLS_HEAD.pack(*material.lattice.shape, 1, 0, len(material.lut))
    return head, material.lut.tobytes() + material.index[material.lattice.above_horizon].tobytes()


def check_round_trip(before, after):
    assert same_numbers(before, after)
    for field in ("name", "options", "metrics", "source", "domain", "bytes_memory"):
        assert getattr(after, field) == getattr(before, field)


def test_round_trip(material, tmp_path):
    path = tmp_path / "small.smrl"
    assert save(material, path) == path.stat().st_size
    check_round_trip(material, load(path))
    check_round_trip(material, load(str(path)))
    other = decode(encode(material))
    other.lut[-1, -1] += 2.0**-40
    must_fail(check_round_trip, material, other)


@pytest.mark.parametrize("case", compact.CASES)
@pytest.mark.parametrize(("folds", "signed"), IN_EACH)
def test_round_trip_of_nodes(case, folds, signed):
    before = compact.material(case, 1, folds=FOLDS[folds], signed=signed)
    after = decode(encode(before))
    check_round_trip(before, after)
    assert np.array_equal(after.eval(A, B), before.eval(A, B))
    before.palette.signed = not signed
    must_fail(check_round_trip, before, after)


def check_versions(data, kind):
    assert struct.unpack_from("<4sH", data) == (b"SMRL", {"cells": 1, "nodes": 2}[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_nodes_are_written_as_version_2_and_cells_as_version_1(kind):
    check_versions(encode(made(kind)), kind)
    must_fail(check_versions, compact.in_version_1(made("nodes")), "nodes")


@pytest.mark.parametrize("case", compact.CASES)
def test_version_1_is_read(case):
    before = compact.material(case, 2)
    data = compact.in_version_1(before)
    assert data[4] == 1
    check_round_trip(before, decode(data))
    other = compact.material(case, 2, folds=FOLDS["neither"])
    must_fail(check_round_trip, other, decode(data))


@pytest.mark.parametrize("lattice", [Lattice(1, 1, 1), Lattice(1, 2, 1, False), Lattice(5, 4, 3, False), SMALL])
@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
def test_round_trip_of_cells(lattice, interpolation):
    before = cells(1, 4, lattice).with_interpolation(interpolation)
    after = decode(encode(before))
    check_round_trip(before, after)
    assert np.array_equal(after.eval(A, B), before.eval(A, B))


@pytest.mark.parametrize(("clusters", "dtype"), [(256, np.uint8), (257, np.uint16)])
def test_smallest_index_type(small_table, clusters, dtype):
    material, _ = train(small_table, TrainOptions(clusters=clusters, epochs=1, alpha=0.001))
    assert material.clusters == clusters
    after = decode(encode(material))
    assert after.index.dtype == dtype
    check_round_trip(material, after)


def test_the_same_material_gives_the_same_bytes(small_table):
    one, other = (encode(train(small_table, TrainOptions(clusters=9, epochs=2))[0]) for _ in range(2))
    assert one == other


def numbers(material):
    """The SHA-256 of all that a lookup reads."""
    lattice = material.lattice.axes() if not material.grid else (*material.lattice.shape, material.lattice.reciprocal)
    said = [lattice, material.interpolation, scale(material).hex()]
    flags = PLAIN if material.grid else [*material.lattice.folds.values(), *how(material)]
    said += flags if flags != PLAIN else []
    head = json.dumps(said)
    return hashlib.sha256(head.encode() + b"".join(part.tobytes() for part in arrays(material))).hexdigest()


PLAIN = [True, False, False, False]  # reciprocal, mirrored, signed, smooth, as all of version 1
NUMBERS = {
    "cells": "913e749eb881f4fccfa484c0a99302f08a75242e85d66e9bce20b580e9857493",
    "nodes": "a615619ef7e248e2ccb59cd9e6e8ff0db66fdc3e74a35be52f621df69ace5c94",
    "nodes-2-reciprocal": "4e0137585f3ec6336271205c83626530a14ce09f574524aad8c817e323a816e5",
    "nodes-2-mirrored": "1e2e38b845415242468facdb2ad703b3ec9e95defc019c00bdba9a8246f60489",
    "nodes-2-both": "5ec2cafd653e27e272a2ffb8ab5bf1fb2dde6901129064948cbd28f546d0c4a3",
    "nodes-2-neither": "ea3c88cf90c5bf2269b0755bf39cc5dd2402032c06c421ec719e70607d192736",
}


def check_golden(data, name):
    material = decode(data)
    assert numbers(material) == NUMBERS[name]
    if name.startswith("nodes-2"):  # zlib's bytes may change; these may not
        assert encode(material) == data
    if name == "nodes":  # which nobody writes any more
        assert compact.in_version_1(material) == data
        assert numbers(decode(encode(material))) == NUMBERS[name]


@pytest.mark.parametrize("name", NUMBERS)
def test_golden_files(name):
    """Files from when each format became stable: they are never to be written anew."""
    data, kind = (GOLDEN / f"{name}.smrl").read_bytes(), name.split("-")[0]
    check_golden(data, name)
    must_fail(check_golden, encode(made(kind)), name)
    material = decode(data)
    assert material.name.startswith(f"golden {kind}")
    assert len(material.source.sha256) == 64


@pytest.mark.parametrize("name", FOLDS)
def test_golden_files_of_version_2_are_those_of_the_generator(name):
    made = decode((GOLDEN / f"nodes-2-{name}.smrl").read_bytes())
    check_round_trip(compact.golden(name), made)
    must_fail(check_round_trip, compact.golden("both" if name != "both" else "neither"), made)


def check_damage_is_named(data, path):
    path.write_bytes(data)
    message = ""
    try:
        load(path)
    except FormatError as error:
        message = str(error)
    assert message.startswith(f"{path}: expected ")


def test_every_damage_is_refused(material, tmp_path):
    path, data = tmp_path / "x.smrl", encode(material)
    for damaged in broken(data):
        check_damage_is_named(damaged, path)
    for more in (b"\0", b"SMRL", bytes(100)):
        check_damage_is_named(data + more, path)
    must_fail(check_damage_is_named, data, path)


def check_refused_or_usable(data, read=decode):
    """What an attacker sends, with a checksum that fits."""
    found = error = None
    try:
        found = read(data)
    except Exception as other:
        error = other
    if found is None:
        assert isinstance(error, FormatError), repr(error)
        assert "\n" not in str(error)
        return
    assert np.isfinite(found.eval(A, B)).all()
    assert same_numbers(found, decode(encode(found)))


def read_without_care(data):
    return struct.unpack_from("<d", data, 10**6)


def test_broken_files_with_a_checksum_that_fits(material):
    for each in broken(body(material)):
        check_refused_or_usable(sealed(each))
    must_fail(check_refused_or_usable, encode(material), read_without_care)


@pytest.mark.parametrize("name", ["version 1", "mirrored", "both", "neither"])
def test_broken_nodes_of_each_kind(name):
    if name == "version 1":
        data = compact.in_version_1(compact.material((2, 1, 3, 3, "walk"), 4))
    else:
        data = encode(compact.material((2, 1, 3, 3, "walk"), 4, folds=FOLDS[name], signed=True))
    for each in broken(data[PREFIX.size :]):
        check_refused_or_usable(sealed(each, data[4]))


@pytest.mark.parametrize("kind", KINDS)
@settings(deadline=None, max_examples=100)
@given(st.data())
def test_files_broken_at_several_places(kind, data):
    each = bytearray(body(made(kind)))
    for at, byte in data.draw(st.lists(st.tuples(st.integers(0, len(each) - 1), st.integers(0, 255)), max_size=6)):
        each[at] = byte
    check_refused_or_usable(sealed(bytes(each[: data.draw(st.integers(len(each) // 2, len(each)))])))


@settings(deadline=None, max_examples=100)
@given(
    st.binary(max_size=80),
    st.sampled_from([b"\0\0\0\0\0", b"\1\0\0\0\0", b"\1\0\0\0\0\0\0\0\x3f", b""]),
    st.sampled_from([1, 2]),
)
def test_any_bytes(data, head, version):
    check_refused_or_usable(sealed(head + data, version))


def check_nothing_may_follow(body, more):
    refused = False
    try:
        decode(sealed(body + more))
    except FormatError:
        refused = True
    assert refused


def test_bytes_at_the_end_are_refused(material):
    with pytest.raises(FormatError, match="damaged"):
        decode(encode(material) + b"\0")
    for more in (b"\0", bytes(3), bytes(100), b"\xff" * 9):
        check_nothing_may_follow(body(material), more)
    must_fail(check_nothing_may_follow, body(material), b"")


@pytest.mark.parametrize("version", [0, 3, 7, 65535])
def test_other_versions_are_refused_by_name(material, version):
    """Before anything else: their checksum may be another."""
    for contents in (body(material), b""):
        data = sealed(contents, version)
        for each in (data, data[:6] + bytes(4) + data[10:]):
            with pytest.raises(FormatError, match=f"expected version 1 or 2, found version {version};"):
                decode(each)


def test_cells_are_of_version_1_alone():
    assert decode(sealed(body(made("cells")), 1)).grid
    with pytest.raises(FormatError, match="expected kind 1, found 0"):
        decode(sealed(body(made("cells")), 2))
    for version, kinds in ((1, "0 or 1"), (2, "1")):
        with pytest.raises(FormatError, match=f"expected kind {kinds}, found 2"):
            decode(sealed(b"\2" + body(made("cells"))[1:], version))


def test_other_files_are_refused():
    for data in (b"", b"SMRL", b"\x89PNG" + bytes(30)):
        with pytest.raises(FormatError, match="expected"):
            decode(data)


CELLS = (3, 2, 3, 1, 0, 3)


@pytest.mark.parametrize(
    ("head", "what"),
    [
        ((0, 2, 3, 1, 0, 3), "lattice of 1 to"),
        ((3, 2, 0, 1, 0, 3), "lattice of 1 to"),
        ((65535, 65535, 65535, 1, 0, 3), "lattice of 1 to"),
        ((2048, 2049, 1, 1, 0, 3), "lattice of 1 to"),
        ((3, 2, 3, 2, 0, 3), "flags"),
        ((3, 2, 3, 1, 2, 3), "flags"),
        ((3, 2, 3, 1, 0, 0), "LUT"),
        ((3, 2, 3, 1, 0, 65537), "LUT"),
        ((3, 2, 3, 1, 0, 2**32 - 1), "LUT"),
        ((3, 2, 3, 1, 0, 2), "expected a stream of"),
        ((3, 2, 3, 1, 0, 4), "expected a stream of"),
        ((3, 2, 4, 1, 0, 3), "expected a stream of"),
    ],
)
def test_hostile_heads_of_cells(head, what):
    fine, payload = cell_parts(made("cells"))
    assert fine == CELLS_HEAD.pack(*CELLS)
    decode(plain(fine, deflated(payload)))
    with pytest.raises(FormatError, match=what):
        decode(plain(CELLS_HEAD.pack(*head), deflated(payload)))


def test_an_entry_outside_the_lut_or_no_reflectance_is_refused():
    head, payload = cell_parts(made("cells"))
    with pytest.raises(FormatError, match="indices below 3"):
        decode(plain(head, deflated(payload[:-1] + b"\x03")))
    for bad in (np.nan, np.inf, -1.0, 3.5e38):
        with pytest.raises(FormatError, match="LUT entries"):
            decode(plain(head, deflated(struct.pack("<d", bad) + payload[8:])))


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_that_is_none_is_refused(scale):
    stream, head = compact.stream(encode(made("nodes")))
    decode(sealed(head + stream))
    with pytest.raises(FormatError, match="positive scale"):
        decode(sealed(head[:-5] + SCALE.pack(scale) + head[-1:] + stream))
    stream, head = compact.stream(compact.in_version_1(made("nodes")))
    decode(sealed(head + stream, 1))
    with pytest.raises(FormatError, match="positive scale"):
        decode(sealed(head[:-4] + SCALE.pack(scale) + stream, 1))


def test_flags():
    stream, head = compact.stream(encode(compact.material("minimal")))
    for flags in range(256):
        data = sealed(head[:-1] + bytes([flags]) + stream)
        if flags > 15:
            with pytest.raises(FormatError, match=f"^expected flags from 0 to 15, found {flags}$"):
                decode(data)
        else:
            found = decode(data)  # of a lattice with one node in φ_d, which means the same with all folds
            assert (found.lattice.reciprocal, found.lattice.mirrored) == (flags & 1 > 0, flags & 2 > 0)
            assert how(found) == [flags & 4 > 0, flags & 8 > 0]


def check_allocates(data, most):
    """Refused, and with no more bytes in use than that on the way."""
    tracemalloc.start()
    try:
        with pytest.raises(FormatError):
            decode(data)
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()


def test_a_bomb_stops_at_the_size_that_the_head_says():
    head, _ = cell_parts(made("cells"))
    bomb = plain(head, deflated(bytes(2**26)))
    check_allocates(bomb, 2**20)
    must_fail(check_allocates, bomb, 2**10)
    check_allocates(plain(CELLS_HEAD.pack(2048, 2048, 1, 1, 0, 65536), b"\x03\0"), 2**28)


@pytest.mark.parametrize(
    "notes",
    [
        *(b"[]", b"null", b"3", b"{", b"\xff\xfe", b"{}x", b"[" * 30000, b'{"a":' * 9000),
        *(b'{"a":' * 33 + b"1" + b"}" * 33, b'{"a":1e999}', b'{"a":' + b"9" * 400 + b"}", b'{"options":null}'),
        *(b'{"options":3}', b'{"metrics":[]}', b'{"metrics":{"rmse":NaN}}', b'{"metrics":{"rmse":-Infinity}}'),
        '{"options":{}}'.encode("utf-16"),
    ],
)
def test_notes_that_are_none_are_refused(notes):
    head, payload = cell_parts(made("cells"))
    assert decode(plain(head, deflated(payload), notes=b'{"options":{"a":1},"more":3}')).options == {"a": 1}
    with pytest.raises(FormatError, match="expected"):
        decode(plain(head, deflated(payload), notes=notes))


def test_what_a_file_cannot_hold(material):
    material.metrics = {"rmse": np.nan}
    with pytest.raises(FormatError, match="JSON"):
        encode(material)
    material.metrics = {str(number): "x" * 1000 for number in range(64)}
    material.options = {str(number): "x" * 100 for number in range(64)}
    with pytest.raises(FormatError, match="notes of at most"):
        encode(material)
    material.metrics, material.name = {}, "ä" * 200
    assert decode(encode(material)).name == "ä" * 127


@pytest.mark.parametrize(
    ("lattice", "what"),
    [
        (NodeLattice((0, 90, 180), (0, 1, 0), ((0, 180),) * 2, ((0,),) * 2), "bands in order"),
        (NodeLattice((*range(16), 180), tuple(range(17)), ((0, 180),) * 17, ((0,),) * 17), "bands in order"),
        (NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),)), None),
        *((NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),), **folds), None) for folds in FOLDS.values()),
    ],
)
def test_lattices_that_cannot_be_written(lattice, what):
    index = np.zeros(lattice.size, np.uint16)
    material = SomManBrdf(GainsAndShapes([0.0], np.ones((1, 3)), 1.0), np.stack([index, index]), lattice, name="x")
    if what is None:
        check_round_trip(material, decode(encode(material)))
        return
    with pytest.raises(FormatError, match=f"x: lattice: .*{what}"):
        encode(material)


def test_palettes_that_cannot_be_written():
    grey = np.ones((1, 3))
    for gains, lut in (([0.001], grey), ([0.0], np.full((1, 3), 0.9)), ([1.5, 0.5], grey), ([-0.5, -1.5], grey)):
        index = np.zeros((2, 4), np.uint16)
        lattice = NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),))
        with pytest.raises(FormatError, match=r"x: .*palette"):
            encode(SomManBrdf(GainsAndShapes(gains, lut, 1.0), index, lattice, name="x"))


def test_errors_name_the_file(material, tmp_path):
    path = tmp_path / "cut.smrl"
    path.write_bytes(encode(material)[:-1])
    with pytest.raises(SommerlError, match=r"cut\.smrl: expected the checksum"):
        load(path)


def test_a_file_that_cannot_be_one_is_not_read(tmp_path):
    path = tmp_path / "huge.smrl"
    with path.open("wb") as stream:
        stream.write(b"SMRL\1\0")
        stream.truncate(2**40)
    with pytest.raises(FormatError, match="expected at most"):
        load(path)


def test_an_index_of_another_type_is_refused(small_table):
    for dtype in (np.int32, np.float32):
        with pytest.raises(MaterialError, match="unsigned index"):
            SomManBrdf(np.ones((1, 3)), np.zeros(SMALL.shape, dtype), SMALL, name="x")


def check_found(index, largest):
    with pytest.raises(MaterialError, match=f"expected indices below 1, found {largest}$"):
        SomManBrdf(np.ones((1, 3)), index, SMALL, name="x")


def test_an_index_beyond_the_lut_is_refused_and_named():
    """But for cells below the horizon, which are not read."""
    index = np.where(SMALL.above_horizon, 0, 9).astype(np.uint8)
    assert SomManBrdf(np.ones((1, 3)), index, SMALL, name="x").index.max() == 0
    index[0, 0, 0] = 5
    check_found(index, 5)
    with pytest.raises(AssertionError):
        check_found(index, 9)


def test_sizes_are_counted_as_stated():
    assert cells().bytes_paper == 4 * SMALL.size + 24 * 9
    assert cells().bytes_memory == SMALL.size + 9 * 24
