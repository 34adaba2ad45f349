"""What the materials of a library's file share: parts of streams, the section, and its training."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import complaint, must_fail
from library_files import GOLDEN, MATERIALS, apart, entry, everything, opened, packed, together

from sommerl import builtin
from sommerl.compression.compact import effort as efforts
from sommerl.compression.compact.search import Compressor
from sommerl.compression.compact.sharing import EXAMPLES, Example, examples_used, train
from sommerl.compression.smrl import file, library_file, node_parts, reference_codec, shared
from sommerl.compression.smrl.shared import PART, Shared
from sommerl.reflectance.nodes import NodeLattice
from sommerl.system.errors import FormatError, MaterialError

GOLDENS = ("nodes-2-both", "nodes-2-mirrored", "nodes-2-neither", "nodes-2-reciprocal")
SOMETHING = {name: file.load(GOLDEN / f"{name}.smrl") for name in GOLDENS}
KNOWN = {"name": "x", "source_sha256": ""}


def learnt(material):
    weights, levels = node_parts.coded(material).learnt(*material.index)
    return np.float32(weights).tolist(), np.float32(levels).tolist()


COMMON = Shared(tuple(each.lattice for each in SOMETHING.values()), learnt(SOMETHING["nodes-2-both"]))


def check_same(found, material):
    assert found.lattice == material.lattice
    assert np.array_equal(found.index, material.index)
    assert np.array_equal(found.node_values, material.node_values)
    assert (found.palette.scale, found.palette.signed) == (material.palette.scale, material.palette.signed)


@pytest.mark.parametrize("name", GOLDENS)
def test_parts_hold_the_material(name):
    material = SOMETHING[name]
    part = COMMON.part(material)
    check_same(COMMON.material(part, KNOWN), material)
    assert len(part) < len(file.encode(material))
    must_fail(check_same, COMMON.material(COMMON.part(SOMETHING["nodes-2-mirrored"]), KNOWN), SOMETHING["nodes-2-both"])


def by_the_reference(part, common):
    """The indices of a part, read in plain Python from what docs/format.md says."""
    lattice = common.lattices[part[0]]
    axes = tuple(list(map(list, axis)) if isinstance(axis[0], tuple) else list(axis) for axis in lattice.axes())
    return reference_codec.decode_part(part[PART.size :], axes, lattice.mirrored, common.prior)


def check_reference(material, part, common):
    *_, gain, shape = by_the_reference(part, common)
    assert [gain, shape] == material.index.tolist()


@pytest.mark.parametrize("name", GOLDENS)
def test_plain_python_reads_the_same(name):
    part = COMMON.part(SOMETHING[name])
    check_reference(SOMETHING[name], part, COMMON)
    weights, levels = COMMON.prior
    other = replace(COMMON, prior=(weights, [2 * level for level in levels]))
    with pytest.raises((AssertionError, FormatError)):
        check_reference(SOMETHING[name], part, other)


def test_what_is_known_beforehand_takes_fewer_bits():
    def bits(prior):
        material = SOMETHING["nodes-2-both"]
        return node_parts.coded(material, prior).measure(*material.index)[1]

    assert bits(COMMON.prior) < bits(None)


def test_the_section_is_read():
    data = COMMON.encode()
    assert Shared.decode(data) == COMMON
    for wrong in (data[:-1], data + b"\0", b"\0" + data[1:], data[:1] + b"\xff\xff\x7f\x7f" + data[5:], b""):
        assert complaint(Shared.decode, wrong) is not None
    twice = Shared((COMMON.lattices[0],) * 2, COMMON.prior)
    assert "differ" in complaint(Shared.decode, twice.encode())
    with pytest.raises(FormatError, match="1 to 255"):
        Shared((), COMMON.prior).encode()


def test_damaged_parts_are_refused():
    part = COMMON.part(SOMETHING["nodes-2-both"])
    cut = [part[:length] for length in range(len(part))]
    changed = [bytes([len(COMMON.lattices)]) + part[1:], part[:1] + b"\xff" + part[2:], part + b"\0"]
    for wrong in changed:
        with pytest.raises(FormatError):
            COMMON.material(wrong, KNOWN)
    for wrong in cut:  # which are refused, or the only bytes of another material
        try:
            found = COMMON.material(wrong, KNOWN)
        except FormatError:
            continue
        assert COMMON.part(found) == wrong
    assert COMMON.part(file.load(GOLDEN / "cells.smrl")) is None
    assert Shared(COMMON.lattices[1:], COMMON.prior).part(SOMETHING["nodes-2-both"]) is None


def library(common):
    import io

    out = io.BytesIO()
    entries = [entry(name, number) for number, name in enumerate(MATERIALS)]
    library_file.write(out, entries, MATERIALS.__getitem__, common)
    return out.getvalue()


def check_kept(data):
    found = everything(data)
    for number, name in enumerate(MATERIALS):
        kept, material = found[name]
        assert replace(kept, bytes=0) == entry(name, number)
        assert material.name == ("cells" if name == "cells" else name)
        original = file.decode(MATERIALS[name])
        assert np.array_equal(material.index, original.index)
        assert np.array_equal(material.lut, original.lut)


def test_a_library_whose_materials_share():
    data = library(COMMON)
    plain = packed()
    assert [opened(data).index.kind(number) for number in range(3)] == [0, 1, 1]  # cells, and two of nodes
    shared_bytes = len(COMMON.encode()) + shared.BYTE.size
    assert len(data) < len(plain) + shared_bytes
    found = everything(data)
    for name in ("nodes/both", "nodes/neither"):
        check_same(found[name][1], file.decode(MATERIALS[name]))
        assert found[name][0].bytes < len(MATERIALS[name])
        assert found[name][1].options == entry(name).options | {"reciprocal": name.endswith("neither")}
    sections, *_ = apart(data)
    assert [kind for kind, *_ in sections] == [1, 3, 2]
    without = [sections[0], sections[2]]
    assert "kind" in complaint(everything, together(without))
    assert "one index" in complaint(everything, together([*sections[:2], *sections[1:]]))
    assert complaint(everything, together([sections[0], [3, 1, sections[1][2][:-1]], sections[2]])) is not None
    assert complaint(everything, together(sections)) is None  # nothing was changed: the twin


BUILTIN = ("purple-paint", "nickel", "red-fabric", "blue-metallic-paint")


@pytest.fixture(scope="module")
def trained():
    examples = [Example(lambda name=name: builtin(name), gloss, True, True) for gloss, name in enumerate(BUILTIN[:3])]
    steps = []
    found = train(examples, 300, effort=efforts.of(1), progress=lambda *step: steps.append(step))
    assert steps == [(1, 3), (2, 3), (3, 3)]
    return found


def test_training_is_repeatable_and_written(trained):
    assert Shared.decode(trained.encode()) == trained
    assert len(trained.lattices) == 3
    assert all(each.reciprocal and each.mirrored for each in trained.lattices)


@pytest.mark.parametrize("name", BUILTIN[2:])
def test_materials_on_shared_lattices_take_no_more_than_asked(trained, name):
    """Also of one that was no example."""
    brdf = builtin(name)
    _, material = Compressor(brdf, effort=1, shared=trained).of_size(300)
    assert material.lattice in trained.lattices
    assert 200 < len(trained.part(material)) <= 300
    _, alone = Compressor(brdf, effort=1).of_size(len(trained.part(material)) + 20)
    rng = np.random.default_rng(0)
    wi, wo = rng.normal(size=(2, 5000, 3)) + np.array([0.0, 0.0, 3.0])
    wi, wo = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (wi, wo))

    def error(each):
        return np.mean((np.cbrt(each.eval(wi, wo)) - np.cbrt(brdf.eval(wi, wo))) ** 2)

    assert error(material) < error(alone)


def test_lattices_that_fold_too_much_are_not_taken(trained):
    class Lopsided(type(builtin("nickel"))):
        reciprocal = False
        mirrored = False

        def f_r(self, wi, wo, buffers):
            r, g, b = super().f_r(wi, wo, buffers)
            return r * (1.5 + wi[0] * wo[1]), g, b

    lopsided = builtin("nickel")
    lopsided.__class__ = Lopsided
    with pytest.raises(MaterialError, match="fold"):
        Compressor(lopsided, effort=1, shared=trained)


def test_examples_are_of_like_gloss_and_not_too_many():
    many = [Example(lambda: builtin("nickel"), gloss, True, False) for gloss in np.linspace(0, 1, 200)]
    assert examples_used(many) == 6 * EXAMPLES
    assert examples_used(many[:5]) == 5
    assert isinstance(COMMON.lattices[0], NodeLattice)
