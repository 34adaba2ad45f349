from functools import cache

import numpy as np
import pytest
from compact import CASES, FOLDS, GOOD, bomb, broken, hostile_streams, material, stream, whole, written
from helpers import must_fail
from hypothesis import given, settings
from hypothesis import strategies as st

from sommerl import _core
from sommerl.compression.smrl import reference_codec
from sommerl.compression.smrl.codes import coordinates, gain_codes, gain_values, shape_codes
from sommerl.compression.smrl.file import encode
from sommerl.system.errors import FormatError

# What a file says before its stream.
LAYOUTS = {name: {**folds, "version": 2} for name, folds in FOLDS.items()}
LAYOUTS["version 1"] = {"reciprocal": True, "mirrored": False, "version": 1}
LAYOUT = LAYOUTS["reciprocal"]
IN_EACH = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)


def core(data, layout=LAYOUT, simd=None):
    """What the core reads, in the form of the reference."""
    palette, (gain, shape) = _core.NodePalette.decode(data, **layout, simd=simd)
    assert (palette.reciprocal, palette.mirrored) == (layout["reciprocal"], layout["mirrored"])
    codes = palette.gains, [tuple(pair) for pair in palette.shapes]
    return palette.theta_h, palette.band, palette.theta_d, palette.phi_d, *codes, gain.tolist(), shape.tolist()


def plain(data, layout=LAYOUT):
    """What plain Python reads."""
    return reference_codec.decode(data, layout["mirrored"], layout["version"])


def fields(made):
    """What a stream of a material has to hold."""
    codes = (
        gain_codes(made.palette.gains).tolist(),
        [tuple(pair) for pair in shape_codes(coordinates(made.lut)).tolist()],
    )
    return *made.lattice.axes(), *codes, *made.index.tolist()


def palette(made):
    return _core.NodePalette(*fields(made)[:6], **made.lattice.folds)


def made_in(layout, case="smooth", seed=0):
    """A material that the layout holds."""
    folds = {name: layout[name] for name in ("reciprocal", "mirrored")}
    return material(case, seed, folds=folds, signed=layout["version"] > 1)


def changed(made):
    """The same with another gain or shape at the last node."""
    index = made.index[0 if len(made.palette.gains) > 1 else 1]
    index[-1] = 0 if index[-1] else 1
    return made


def check_reads(read, data, made, layout):
    assert read(data, layout) == fields(made)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("case", CASES)
@IN_EACH
def test_the_core_and_plain_python_read_what_was_written(case, seed, layout):
    made = made_in(layout, case, seed)
    data = whole(made, layout["version"])
    for read in (core, plain):
        check_reads(read, data, made, layout)
    if case != "minimal":
        must_fail(check_reads, core, data, changed(made_in(layout, case, seed)), layout)


def check_written(made, data):
    assert palette(made).encode(*made.index) == data
    assert stream(encode(made))[0] == data


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("folds", FOLDS.values(), ids=FOLDS)
def test_the_core_writes_what_plain_python_writes(case, folds):
    made = material(case, 3, folds=folds, signed=True)
    data = whole(made)
    check_written(made, data)
    if case != "minimal":
        must_fail(check_written, changed(made), data)


@pytest.mark.parametrize("bands", range(1, 7))
@IN_EACH
def test_bands(bands, layout):
    made = made_in(layout, (bands, 4, 9, 7, "walk"), bands)
    data = whole(made, layout["version"])
    for read in (core, plain):
        check_reads(read, data, made, layout)


def check_tells_apart(data, layout, other):
    assert taken(core, data, layout) != taken(core, data, other)


def test_one_layout_is_not_read_as_another():
    made = made_in(LAYOUT, (2, 5, 9, 7, "walk"), 1)
    data = whole(made)
    for name in ("both", "version 1"):
        check_tells_apart(data, LAYOUT, LAYOUTS[name])
    must_fail(check_tells_apart, data, LAYOUT, LAYOUT)
    for layout in ({"version": 0}, {"version": 3}, {"version": 1, "mirrored": True}):
        with pytest.raises(ValueError, match=r"^expected version 2, or version 1 reciprocal and not mirrored$"):
            core(data, LAYOUT | layout)
    with pytest.raises(ValueError, match=r"^expected version 2, or version 1"):
        core(data, LAYOUTS["neither"] | {"version": 1})


def test_all_nodes_that_there_can_be():
    axes = [*range(63), 180]
    most = _core.NodePalette([*range(31), 180], [0] * 32, [axes], [[*range(64)]], [7, 900], [[-3, 4], [0, 0], [9, 9]])
    rng = np.random.default_rng(0)
    gain, shape = (rng.integers(0, n, 2**17).astype(np.uint16) for n in (2, 3))
    found, indices = _core.NodePalette.decode(most.encode(gain, shape), **LAYOUT)
    assert found.phi_d == most.phi_d
    assert np.array_equal(indices, (gain, shape))
    with pytest.raises(ValueError, match="lattice"):
        _core.NodePalette([*range(32), 180], [0] * 33, [axes], [[*range(64)]], [7], [[0, 0]])


def check_same_bytes(made, other):
    one = palette(made).encode(*made.index, "portable")
    for simd in _core.simd_paths():
        assert palette(other).encode(*other.index, simd) == one
        assert core(one, LAYOUT | made.lattice.folds, simd) == fields(made)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("folds", FOLDS.values(), ids=FOLDS)
def test_instruction_sets_change_no_bit(case, folds):
    one, other = (material(case, folds=folds, signed=True) for _ in range(2))
    check_same_bytes(one, other)
    if case != "minimal":
        must_fail(check_same_bytes, one, changed(other))


def test_an_instruction_set_that_is_none():
    with pytest.raises(ValueError, match="simd"):
        core(b"", LAYOUT, "abacus")


def check_measured(bits, data):
    assert abs(8 * len(data) - sum(bits)) < 16 + 1e-3 * sum(bits)


@pytest.mark.parametrize("case", ["smooth", "noise", "big-palettes", "late"])
@pytest.mark.parametrize("folds", FOLDS.values(), ids=FOLDS)
def test_measured_bits_are_those_of_the_stream(case, folds):
    made = material(case, folds=folds)
    bits = palette(made).measure(*made.index)
    data = palette(made).encode(*made.index)
    check_measured(bits, data)
    must_fail(check_measured, bits, data + bytes(9))


def taken(read, data, layout=LAYOUT):
    """What a reader reads, or what it says if it refuses."""
    try:
        return read(data, layout)
    except (FormatError, ValueError) as error:
        return str(error)


def check_taken_or_refused(data, layout, read=core):
    """Both readers agree; and a stream that is taken is the only one that holds what is in it."""
    found = taken(read, data, layout)
    assert found == taken(plain, data, layout)
    if not isinstance(found, str):
        folds = layout["reciprocal"], layout["mirrored"]
        again = _core.NodePalette(*found[:6], *folds).encode(*(np.array(index, np.uint16) for index in found[6:]))
        if layout["version"] > 1:
            assert again == data
        else:
            assert core(again) == found


def small(layout):
    return whole(made_in(layout, (2, 1, 3, 3, "walk"), 4), layout["version"])


def careless(data, layout):
    """Does not mind zeros at the end."""
    return core(data.rstrip(b"\0"), layout)


@IN_EACH
def test_broken_streams(layout):
    for data in broken(small(layout)):
        check_taken_or_refused(data, layout)
    must_fail(check_taken_or_refused, small(layout) + b"\0", layout, careless)


@IN_EACH
def test_nothing_follows(layout):
    for case in CASES:
        made = made_in(layout, case)
        data = palette(made).encode(*made.index) if layout["version"] > 1 else whole(made, 1)
        for zeros in range(1, 9):
            assert isinstance(taken(core, data + bytes(zeros), layout), str)
        assert isinstance(taken(core, data + b"\xff" * 9, layout), str)
    short = small(layout)
    for byte in range(256):
        check_taken_or_refused(short + bytes([byte]), layout)
        check_taken_or_refused(short[:-1] + bytes([byte]), layout)


@settings(deadline=None, max_examples=300)
@given(st.binary(max_size=60), st.sampled_from(list(LAYOUTS.values())))
def test_any_bytes(data, layout):
    check_taken_or_refused(data, layout)


@settings(deadline=None, max_examples=80)
@given(
    st.integers(0, 2**32),
    st.integers(1, 5),
    st.integers(0, 3),
    st.sampled_from(["walk", "random", "late"]),
    st.sampled_from(list(FOLDS.values())),
)
def test_any_material(seed, bands, inner, manner, folds):
    made = material((bands, inner, 1 + seed % 40, 1 + seed % 33, manner), seed, folds=folds, signed=seed % 2 > 0)
    data, _ = stream(encode(made))
    for read in (core, plain):
        check_reads(read, data, made, LAYOUT | folds)


def complaint_of(read, *arguments):
    try:
        read(*arguments)
    except (FormatError, ValueError) as error:
        return str(error)
    return ""


def check_refused(data, what, layout, read=plain):
    one, other = (complaint_of(each, data, layout) for each in (core, read))
    assert f"{what}:" in one
    assert one == other


@IN_EACH
def test_hostile_numbers(layout):
    for name, data in hostile_streams(layout["version"], layout["mirrored"]).items():
        check_refused(data, name.split("-")[0], layout)
        must_fail(check_refused, written(palette=GOOD), name.split("-")[0], layout)


@cache
def told(data, version):
    """What plain Python says of a stream that is not mirrored. It does not know what else a layout has."""
    return complaint_of(reference_codec.decode, data, False, version)


def plain_once(data, layout):
    """`plain`, where that takes seconds: once for all layouts that are the same to it."""
    assert not layout["mirrored"]
    raise FormatError(told(data, layout["version"]))


@pytest.mark.parametrize("name", ["version 1", "reciprocal", "neither"])
def test_a_bomb_is_refused(name):
    """It does not keep a reader busy: a few bytes may mean no more than some millions of entries within reach."""
    data = bomb()
    assert len(data) < 100
    check_refused(data, "entries within reach", LAYOUTS[name], plain_once)
    assert complaint_of(core, data).endswith(f"expected at most {2**22 + 2**11 * len(data)}, found more")


def any_entries(entries):
    """As many nodes as there can be, with any of so many gains and shapes."""
    rng = np.random.default_rng(entries)
    axes = [*range(31), 180], [0] * 32, [[*range(63), 180]], [[*range(64)]]
    made = _core.NodePalette(*axes, list(range(entries)), [[i, 0] for i in range(entries)])
    return made, rng.integers(0, entries, (2, 2**17)).astype(np.uint16)


def check_not_too_much(entries):
    made, indices = any_entries(entries)
    complaint = complaint_of(lambda each: core(made.encode(*each)), indices)
    assert complaint == ""


def test_no_more_is_written_than_is_read():
    check_not_too_much(256)
    must_fail(check_not_too_much, 257)
    made, indices = any_entries(300)
    made.measure(*indices)
    with pytest.raises(ValueError, match=f"^entries within reach: expected at most {2**26}, found more$"):
        made.encode(*indices)


@pytest.mark.parametrize(
    ("what", "numbers"),
    [
        ("gain", {"palette": [(8189, 0), (0, 1), (0, 2)]}),
        ("gain", {"palette": [(8190, 0), (0, 1), (0, 2)]}),
        ("band", {"bands": 2, "rows": [1], "axes": [[0]] * 4, "palette": GOOD}),
        ("axis", {"theta_h": [1, 178], "palette": GOOD}),
        ("nodes", {"theta_h": [30, *[0] * 30], "axes": ([62, *[0] * 62], [63, *[0] * 63])}),
        ("shape", {"palette": [(0, 0), (2048, 1), (2048, 2)]}),
        ("shape", {"palette": [(0, 0), (0, 1), (2047, 2)]}),
    ],
)
def test_numbers_at_their_bounds(what, numbers):
    """Whatever is wrong with the stream, it is not these."""
    assert what in {name.split("-")[0] for name in hostile_streams()}
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
        (4, [-4096]),
        (7, True),
        (4, list(range(1025))),
        (5, []),
        (5, [[0, 0]] * 1025),
        (5, [[3, 0], [2, 0]]),
        (5, [[0, 1025]]),
        (5, [[-1025, 0]]),
    ],
)
def test_palettes_that_cannot_be_written(change):
    fine = [[0, 30, 180], [0, 1, 1], [[0, 180]] * 2, [[0, 90]] * 2, [1, 2], [[0, 1], [0, 1]], True, False]
    _core.NodePalette(*fine)
    fine[change[0]] = change[1]
    with pytest.raises(ValueError, match=r"^(lattice|palette): expected "):
        _core.NodePalette(*fine)


def check_opposites(values):
    codes = np.arange(-4095, 4096)
    assert np.array_equal(values(-codes), -values(codes))
    assert np.array_equal(gain_codes(values(codes)), codes)


def test_negative_codes_stand_for_negative_gains():
    check_opposites(gain_values)
    must_fail(check_opposites, lambda codes: gain_values(np.abs(codes)))
    assert gain_codes(np.array([-1e12, -1.5, -0.0, 0.0, 1e12])).tolist() == [-4095, -256, 0, 0, 4095]


def test_entries_that_are_none():
    made = material()
    gain, shape = made.index
    for index in (shape[:-1], np.full_like(shape, len(made.lut))):
        with pytest.raises(ValueError, match="an entry of the palette for each node"):
            palette(made).encode(gain, index)
