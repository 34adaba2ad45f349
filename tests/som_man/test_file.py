import json
import lzma
import struct
import zlib

import numpy as np
import pytest
from helpers import SMALL, must_fail

from sommerl import SomManBrdf, SommerlError, TrainOptions, load, save, train
from sommerl.errors import FormatError, MaterialError
from sommerl.som_man.file import FILTERS, PREFIX, decode, encode


@pytest.fixture
def material(small_table):
    material, _ = train(small_table, TrainOptions(clusters=9, epochs=2))
    material.metrics = {"rmse": 0.25}
    return material


def sealed(header, payload):
    """A file with the given header and payload and a checksum that fits."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    body = text + lzma.compress(payload, lzma.FORMAT_RAW, filters=FILTERS)
    return PREFIX.pack(b"SMRL", 0, zlib.crc32(struct.pack("<I", len(text)) + body), len(text)) + body


def parts(material):
    """The header and the payload of a material's file."""
    data = encode(material)
    length = PREFIX.unpack_from(data)[3]
    header = json.loads(data[PREFIX.size : PREFIX.size + length])
    return header, lzma.decompress(data[PREFIX.size + length :], lzma.FORMAT_RAW, filters=FILTERS)


def check_round_trip(before, after):
    assert np.array_equal(after.lut, before.lut)
    assert np.array_equal(after.index, before.index)
    assert after.index.dtype == before.index.dtype
    for field in ("name", "lattice", "interpolation", "options", "metrics", "source_sha256"):
        assert getattr(after, field) == getattr(before, field)


def test_round_trip(material, tmp_path):
    path = tmp_path / "small.smrl"
    assert save(material, path) == path.stat().st_size
    check_round_trip(material, load(path))
    must_fail(check_round_trip, material, train_again(material))


def train_again(material):
    """The same file with one index changed."""
    header, payload = parts(material)
    return decode(sealed(header, payload[:-1] + bytes([payload[-1] ^ 1])))


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


def test_every_truncation_is_refused(material):
    data = encode(material)
    for length in range(len(data)):
        with pytest.raises(FormatError):
            decode(data[:length])


def test_every_changed_byte_is_refused(material):
    data = encode(material)
    for position in range(len(data)):
        broken = bytearray(data)
        broken[position] ^= 0x41
        with pytest.raises(FormatError):
            decode(bytes(broken))


def test_bytes_at_the_end_are_refused(material):
    with pytest.raises(FormatError, match="damaged"):
        decode(encode(material) + b"\0")
    header, payload = parts(material)
    with pytest.raises(FormatError, match="bytes of LUT and index"):
        decode(sealed(header, payload + b"\0"))


def test_a_newer_version_is_refused_by_name(material):
    data = bytearray(encode(material))
    data[4] = 7
    with pytest.raises(FormatError, match="expected version 0, found version 7"):
        decode(bytes(data))


@pytest.mark.parametrize(
    "change",
    [
        {"clusters": 10**9},
        {"clusters": 0},
        {"clusters": -1},
        {"clusters": 8},
        {"clusters": "9"},
        {"clusters": True},
        {"lattice": {"theta_h": 10**6, "theta_d": 10**6, "phi_d": 10**6}},
        {"lattice": {"theta_h": 0, "theta_d": 1, "phi_d": 1}},
        {"lattice": {"theta_h": 8.0, "theta_d": 8, "phi_d": 12}},
        {"lattice": {"depth": 3}},
        {"lattice": {"theta_h": 8, "theta_d": 8, "phi_d": 12, "reciprocal": "maybe"}},
        {"lattice": None},
        {"interpolation": "psychic"},
        {"interpolation": ["nearest"]},
        {"options": 3},
        {"metrics": "good"},
    ],
)
def test_hostile_headers_are_refused_before_anything_is_allocated(material, change):
    header, payload = parts(material)
    decode(sealed(header, payload))  # as it is, it is fine
    with pytest.raises(FormatError):
        decode(sealed(header | change, payload))


@pytest.mark.parametrize(
    "header", [b"", b"[]", b"null", b"{", b"\xff\xfe", b"{}", b'{"lattice": 1e999}', b"[" * 100000]
)
def test_headers_that_are_none_are_refused(header):
    with pytest.raises(FormatError):
        decode(sealed(header, b""))


def test_an_entry_outside_the_lut_or_no_reflectance_is_refused(material):
    header, payload = parts(material)
    with pytest.raises(FormatError, match="indices below 9"):
        decode(sealed(header, payload[:-1] + b"\x09"))
    for bad in (np.nan, np.inf, -1.0):
        with pytest.raises(FormatError, match="LUT entries"):
            decode(sealed(header, struct.pack("<d", bad) + payload[8:]))


def test_a_bomb_stops_at_the_size_that_the_header_says(material):
    header, _ = parts(material)
    with pytest.raises(FormatError, match="bytes of LUT and index"):
        decode(sealed(header, bytes(2**26)))


def test_errors_name_the_file(material, tmp_path):
    path = tmp_path / "cut.smrl"
    path.write_bytes(encode(material)[:-1])
    with pytest.raises(SommerlError, match=r"cut\.smrl: expected the checksum"):
        load(path)


def test_paths_may_be_strings(material, tmp_path):
    save(material, f"{tmp_path}/x.smrl")
    check_round_trip(material, load(f"{tmp_path}/x.smrl"))


def test_a_file_that_cannot_be_one_is_not_read(tmp_path):
    path = tmp_path / "huge.smrl"
    with path.open("wb") as stream:
        stream.write(b"SMRL\0\0")
        stream.truncate(2**40)
    with pytest.raises(FormatError, match="expected at most"):
        load(path)


def test_an_index_of_another_type_is_refused(small_table):
    for dtype in (np.int32, np.float32):
        with pytest.raises(MaterialError, match="unsigned index"):
            SomManBrdf(np.ones((1, 3)), np.zeros(SMALL.shape, dtype), SMALL, name="x")


def test_sizes_are_counted_as_stated(material):
    assert material.bytes_paper == 4 * SMALL.size + 24 * 9
    assert material.bytes_memory == SMALL.size + 9 * 24
