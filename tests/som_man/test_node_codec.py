import numpy as np
import pytest
from compact import CASES, Writer, broken, material, stream
from helpers import must_fail
from hypothesis import given, settings
from hypothesis import strategies as st

from sommerl import _core
from sommerl.errors import FormatError
from sommerl.som_man import reference_codec
from sommerl.som_man.codes import coordinates, gain_codes, shape_codes
from sommerl.som_man.file import encode


def core(data, simd=None):
    """What the core reads, in the form of the reference."""
    palette, (gain, shape) = _core.NodePalette.decode(data, simd)
    codes = palette.gains, [tuple(pair) for pair in palette.shapes]
    return palette.theta_h, palette.band, palette.theta_d, palette.phi_d, *codes, gain.tolist(), shape.tolist()


def fields(made):
    """What a stream of a material has to hold."""
    codes = gain_codes(made.gains).tolist(), [tuple(pair) for pair in shape_codes(coordinates(made.lut)).tolist()]
    return *made.lattice.axes(), *codes, made.gain_index.tolist(), made.index.tolist()


def palette(made):
    return _core.NodePalette(*fields(made)[:6])


def changed(made):
    """The same with another gain or shape at the last node."""
    index = made.gain_index if len(made.gains) > 1 else made.index
    index[-1] = 0 if index[-1] else 1
    return made


def check_reads(read, data, made):
    assert read(data) == fields(made)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("case", CASES)
def test_the_core_and_plain_python_read_what_was_written(case, seed):
    made = material(case, seed)
    data, _ = stream(encode(made))
    for read in (core, reference_codec.decode):
        check_reads(read, data, made)
    if case != "minimal":
        must_fail(check_reads, core, data, changed(material(case, seed)))


@pytest.mark.parametrize("bands", range(1, 7))
def test_bands(bands):
    made = material((bands, 4, 9, 7, "walk"), bands)
    data, _ = stream(encode(made))
    for read in (core, reference_codec.decode):
        check_reads(read, data, made)


def test_all_nodes_that_there_can_be():
    axes = [*range(63), 180]
    most = _core.NodePalette([*range(31), 180], [0] * 32, [axes], [[*range(64)]], [7, 900], [[-3, 4], [0, 0], [9, 9]])
    rng = np.random.default_rng(0)
    gain, shape = (rng.integers(0, n, 2**17).astype(np.uint16) for n in (2, 3))
    found, indices = _core.NodePalette.decode(most.encode(gain, shape))
    assert found.phi_d == most.phi_d
    assert np.array_equal(indices, (gain, shape))
    with pytest.raises(ValueError, match="lattice"):
        _core.NodePalette([*range(32), 180], [0] * 33, [axes], [[*range(64)]], [7], [[0, 0]])


def check_same_bytes(made, other):
    one = palette(made).encode(made.gain_index, made.index, "portable")
    for simd in _core.simd_paths():
        assert palette(other).encode(other.gain_index, other.index, simd) == one
        assert core(one, simd) == fields(made)


@pytest.mark.parametrize("case", CASES)
def test_instruction_sets_change_no_bit(case):
    check_same_bytes(material(case), material(case))
    if case != "minimal":
        must_fail(check_same_bytes, material(case), changed(material(case)))


def test_an_instruction_set_that_is_none():
    with pytest.raises(ValueError, match="simd"):
        core(b"", "abacus")


def check_measured(bits, data):
    assert abs(8 * len(data) - sum(bits)) < 16 + 1e-3 * sum(bits)


@pytest.mark.parametrize("case", ["smooth", "noise", "big-palettes", "late"])
def test_measured_bits_are_those_of_the_stream(case):
    made = material(case)
    bits = palette(made).measure(made.gain_index, made.index)
    data = palette(made).encode(made.gain_index, made.index)
    check_measured(bits, data)
    must_fail(check_measured, bits, data + bytes(9))


def taken(read, data):
    """What a reader reads, or None if it refuses."""
    try:
        return read(data)
    except (FormatError, ValueError):
        return None


def check_taken_or_refused(data, read=core):
    """Both readers agree; and a stream that is taken is the only one that holds what is in it."""
    found = taken(read, data)
    assert found == taken(reference_codec.decode, data)
    if found:
        again = _core.NodePalette(*found[:6]).encode(*(np.array(index, np.uint16) for index in found[6:]))
        assert again == data


@pytest.fixture(scope="module")
def small():
    return stream(encode(material((2, 1, 3, 3, "walk"), 4)))[0]


def careless(data):
    """Does not mind zeros at the end."""
    return core(data.rstrip(b"\0"))


def test_broken_streams(small):
    for data in broken(small):
        check_taken_or_refused(data)
    must_fail(check_taken_or_refused, small + b"\0", careless)


def test_nothing_follows(small):
    for case in CASES:
        data = stream(encode(material(case)))[0]
        for zeros in range(1, 9):
            assert taken(core, data + bytes(zeros)) is None
        assert taken(core, data + b"\xff" * 9) is None
    for byte in range(256):
        check_taken_or_refused(small + bytes([byte]))
        check_taken_or_refused(small[:-1] + bytes([byte]))


@settings(deadline=None, max_examples=150)
@given(st.binary(max_size=60))
def test_any_bytes(data):
    check_taken_or_refused(data)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32), st.integers(1, 5), st.integers(0, 3), st.sampled_from(["walk", "random", "late"]))
def test_any_material(seed, bands, inner, manner):
    made = material((bands, inner, 1 + seed % 40, 1 + seed % 33, manner), seed)
    data, _ = stream(encode(made))
    for read in (core, reference_codec.decode):
        check_reads(read, data, made)


def written(bands=1, theta_h=(0,), rows=(), axes=((0,), (0,)), gains=1, shapes=1, palette=()):
    """A stream that starts with such numbers: bands; inner nodes and steps of θ_h; rows of bands; inner nodes and steps
    of θ_d and φ_d; numbers of gains and shapes; codes, with numbers of contexts."""
    writer = Writer()
    counts, *steps = ([2048] * 24 for _ in range(4))
    writer.number(bands - 1, counts)
    for number in (axis := iter(theta_h)):
        writer.number(number, counts)
        for step in axis:
            writer.number(step, steps[0])
    for number in rows:
        writer.number(number - 1, counts)
    for i, (inner, *places) in enumerate(axes):
        writer.number(inner, counts)
        for step in places:
            writer.number(step, steps[1 + i % 2])
    counts, *steps = ([2048] * 24 for _ in range(4))
    writer.number(gains - 1, counts)
    writer.number(shapes - 1, counts)
    for number, context in palette:
        writer.number(number, steps[context])
    return writer.finish()


FULL = [64, *[0] * 64]
GOOD = [(4095, 0), (0, 1), (0, 2)]
HOSTILE = {
    "bands": {"bands": 17},
    "bands-2": {"bands": 2**21 - 1},
    "axis": {"theta_h": [1, 179]},
    "axis-2": {"theta_h": [180, *[0] * 180]},
    "axis-3": {"theta_h": [2**21 - 2, *[0] * 180]},
    "axis-4": {"theta_h": [1, 2**21 - 2]},
    "band": {"bands": 2, "rows": [3]},
    "band-2": {"bands": 2, "rows": [2]},
    "band-3": {"bands": 3, "rows": [2]},
    "nodes": {"theta_h": [62, *[0] * 62], "axes": (FULL, FULL)},
    "gains": {"gains": 1025},
    "shapes": {"shapes": 1025},
    "gain": {"palette": [(4096, 0)]},
    "gain-2": {"gains": 2, "palette": [(4095, 0), (0, 0)]},
    "shape": {"palette": [(4095, 0), (2049, 1)]},
    "shape-2": {"palette": [(4095, 0), (0, 1), (2049, 2)]},
    "shape-3": {"palette": [(4095, 0), (0, 1), (2050, 2)]},
}


def complaint_of(read, data):
    try:
        read(data)
    except (FormatError, ValueError) as error:
        return str(error)
    return ""


def check_refused(data, what):
    for read in (core, reference_codec.decode):
        assert f"{what}:" in complaint_of(read, data)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_numbers(name):
    check_refused(written(**HOSTILE[name]), name.split("-")[0])
    must_fail(check_refused, written(palette=GOOD), name.split("-")[0])


@pytest.mark.parametrize(
    ("what", "numbers"),
    [
        ("gain", {"palette": GOOD}),
        ("band", {"bands": 2, "rows": [1], "axes": [[0]] * 4, "palette": GOOD}),
        ("axis", {"theta_h": [1, 178], "palette": GOOD}),
        ("nodes", {"theta_h": [30, *[0] * 30], "axes": ([62, *[0] * 62], [63, *[0] * 63])}),
        ("shape", {"palette": [(0, 0), (2048, 1), (2048, 2)]}),
        ("shape", {"palette": [(0, 0), (0, 1), (2047, 2)]}),
    ],
)
def test_numbers_at_their_bounds(what, numbers):
    """Whatever is wrong with the stream, it is not these."""
    assert what in {name.split("-")[0] for name in HOSTILE}
    assert f"{what}:" not in complaint_of(core, written(**numbers))


@pytest.mark.parametrize(
    "change",
    [
        (1, [0, 2, 0]),  # bands
        (1, [1, 1, 0]),
        (0, [0, 90, 90]),
        (2, [[0, 170], [0, 180]]),
        (4, []),
        (4, [4, 4]),
        (4, [4, 3]),
        (4, [4096]),
        (4, list(range(1025))),
        (5, []),
        (5, [[0, 0]] * 1025),
        (5, [[3, 0], [2, 0]]),
        (5, [[0, 1025]]),
        (5, [[-1025, 0]]),
    ],
)
def test_palettes_that_cannot_be_written(change):
    fine = [[0, 30, 180], [0, 1, 1], [[0, 180]] * 2, [[0, 90]] * 2, [1, 2], [[0, 1], [0, 1]]]
    _core.NodePalette(*fine)
    fine[change[0]] = change[1]
    with pytest.raises(ValueError, match=r"^(lattice|palette): expected "):
        _core.NodePalette(*fine)


def test_entries_that_are_none():
    made = material()
    for index in (made.index[:-1], np.full_like(made.index, len(made.lut))):
        with pytest.raises(ValueError, match="an entry of the palette for each node"):
            palette(made).encode(made.gain_index, index)
