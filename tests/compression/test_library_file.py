import dataclasses
import random
import tracemalloc
import zlib

import numpy as np
import pytest
from helpers import complaint, must_fail
from library_files import GOLDEN, MATERIALS, apart, entry, everything, opened, packed, together

from sommerl.compression.smrl import library_file
from sommerl.compression.smrl.library_index import COLUMNS, INDEX_HEAD, ROW, Index
from sommerl.system.errors import FormatError

WHOLE = packed()
NAMES = sorted(MATERIALS)
TOGETHER = sum(map(len, MATERIALS.values()))
MEMORY = 2**20  # bytes


def check_kept(data):
    """A library holds all materials of MATERIALS, and all that is known of them."""
    found = everything(data)
    assert list(found) == NAMES
    for number, name in enumerate(MATERIALS):
        kept = dataclasses.replace(entry(name, number), bytes=len(MATERIALS[name]))
        assert found[name][0] == kept
    assert all(opened(data).data(name) == MATERIALS[name] for name in NAMES)


def test_what_is_written_is_read():
    check_kept(WHOLE)
    must_fail(check_kept, packed({"cells": MATERIALS["cells"]}))
    other = MATERIALS | {"cells": MATERIALS["nodes/both"]}
    must_fail(check_kept, packed(other))


def test_the_order_does_not_matter():
    assert packed(dict(reversed(MATERIALS.items())))[:6] == WHOLE[:6]
    entries = [entry(name, number) for number, name in enumerate(MATERIALS)]
    written = []
    for order in (entries, entries[::-1]):
        out = library_file_bytes(order)
        written.append(out)
    assert written[0] == written[1] == WHOLE


def library_file_bytes(entries):
    import io

    out = io.BytesIO()
    assert library_file.write(out, entries, MATERIALS.__getitem__) == len(out.getvalue())
    return out.getvalue()


def test_the_golden_file_is_read_for_ever():
    check_kept((GOLDEN / "library-1.smrlib").read_bytes())


def check_refused(data):
    assert complaint(everything, data) is not None


def test_every_truncated_length_is_refused():
    for length in range(len(WHOLE)):
        check_refused(WHOLE[:length])
        cut = complaint(lambda n=length: library_file.LibraryFile(lambda s, c: WHOLE[:n][s : s + c]).data("cells"))
        assert length > len(WHOLE) - TOGETHER or cut is not None
    check_refused(WHOLE + b"\0")
    must_fail(check_refused, WHOLE)


def test_every_changed_byte_is_noticed():
    for at in range(len(WHOLE)):
        check_refused(WHOLE[:at] + bytes([WHOLE[at] ^ 1 << at % 8]) + WHOLE[at + 1 :])


def test_a_damaged_material_spoils_no_other():
    data = bytearray(WHOLE)
    data[-1] ^= 1
    library = opened(bytes(data))
    assert library.data(NAMES[0]) == MATERIALS[NAMES[0]]
    assert "damaged" in complaint(library.data, NAMES[-1])


def column(name, number=0):
    """Where the number of a column is in the index, of the material of that number, and how long it is."""
    at = 0
    for each, kind, width in COLUMNS:
        size = np.dtype(kind).itemsize
        if each == name:
            return at + number * size, size
        at += size * width * len(MATERIALS)
    raise KeyError(name)


def with_number(name, value, number=0):
    sections, head, payload = apart(WHOLE)
    at, size = column(name, number)
    return together(sections, head, payload[:at] + int(value).to_bytes(size, "little") + payload[at + size :])


def with_text(old, new):
    sections, head, payload = apart(WHOLE)
    assert payload.count(old) >= 1
    assert len(old) == len(new)
    return together(sections, head, payload.replace(old, new))


def with_head(**values):
    sections, head, payload = apart(WHOLE)
    for at, value in values.items():
        head[["count", "metrics", "common", "names", "sources"].index(at)] = value
    return together(sections, head, payload)


def with_sections(change):
    sections, _, _ = apart(WHOLE)
    return together(change(sections))


def twice():
    sections, head, payload = apart(packed({"aa": MATERIALS["cells"], "ab": MATERIALS["cells"]}))
    return together(sections, head, payload.replace(b"aaab", b"aaaa"))


def bomb(size):
    sections, head, _ = apart(WHOLE)
    head[0] = size // ROW
    return together(sections, head, b"\0" * size)


def bomb_of_nothing(size):
    sections, head, _ = apart(WHOLE)
    return together(sections, [0] * len(head), b"\0" * size)


HOSTILE = {
    "many materials": (lambda: with_head(count=2**32 - 1), "fits a file"),
    "many metrics": (lambda: with_head(metrics=255), "stream"),
    "long names": (lambda: with_head(names=2**32 - 1), "fits a file"),
    "long common parts": (lambda: with_head(common=2**32 - 1), "fits a file"),
    "a bomb": (lambda: bomb(2**27), "fits a file"),
    "a bomb in an empty index": (lambda: bomb_of_nothing(2**26), "stream of 0 bytes"),
    "a longer material": (lambda: with_number("length", 2**32 - 1), "parts"),
    "a material over the next": (lambda: with_number("length", len(MATERIALS["cells"]) + 1), "parts"),
    "a longer name": (lambda: with_number("name_length", 2**16 - 1), "parts"),
    "another kind": (lambda: with_number("kind", 1), "kind"),
    "other options": (lambda: with_number("options", 9), "options"),
    "names out of order": (lambda: with_text(b"cellsnodes/both", b"zellsnodes/both"), "sorted"),
    "a name twice": (lambda: twice(), "sorted"),
    "a zero byte": (lambda: with_text(b"nodes/neither", b"nodes/neithe\0"), "zero"),
    "no UTF-8": (lambda: with_text(b"cellsnodes", b"cell\xffnodes"), "UTF-8"),
    "no JSON": (lambda: with_text(b'"metrics":', b'"metrics"::'[:10]), None),
    "another JSON": (lambda: with_text(b'"metrics"', b'"matrics"'), "metrics"),
    "options of other kinds": (lambda: with_text(b":400}", b":[0]}"), "options"),
    "an unknown section that is needed": (
        lambda: with_sections(lambda s: [*s, [9, 1, b"x"]]),
        "type 9, which is needed",
    ),
    "no index": (lambda: with_sections(lambda s: s[1:]), "one index"),
    "two indices": (lambda: with_sections(lambda s: [s[0], *s]), "one index"),
    "many sections": (lambda: with_sections(lambda s: s + [[9, 0, b""]] * 63), "table"),
    "no section": (lambda: together([[1, 1, b""]])[:10] + b"\0\0", "table"),
    "a newer version": (lambda: WHOLE[:4] + b"\2" + WHOLE[5:], "newer"),
    "another file": (lambda: MATERIALS["cells"], "another kind"),
    "a short index": (lambda: with_sections(lambda s: [[1, 1, b"x"], s[1]]), "at least"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_files_are_refused(what):
    make, said = HOSTILE[what]
    data = make()
    tracemalloc.start()
    try:
        found = complaint(everything, data)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    same = what == "no JSON"  # nothing was changed: the twin
    assert (found is None) == same
    assert said is None or said in found
    assert most < MEMORY


def test_sections_that_need_not_be_known_are_passed_over():
    check_kept(with_sections(lambda s: [*s, [9, 0, b"tables"]]))
    check_kept(with_sections(lambda s: [s[0], [9, 0, b"tables"], s[1]]))


def test_an_unknown_name_is_told_with_the_nearest():
    assert "did you mean nodes/both" in complaint(opened(WHOLE).data, "nodes/botj")
    assert "it has cells, nodes/both, nodes/neither" in complaint(opened(WHOLE).data, "qqqqqqq")


def check_found(number_of):
    """By bisection, every name has the number that it has in the order; no other has one."""
    names = [f"{n:03d}" for n in range(1, 200, 2)]
    data = packed(dict.fromkeys(names, MATERIALS["cells"]))
    index = opened(data).index
    assert [number_of(index, name) for name in names] == list(range(len(names)))
    assert {number_of(index, f"{n:03d}") for n in range(0, 200, 2)} == {None}
    assert number_of(index, "") is number_of(index, "zzz") is number_of(index, "\ud800") is None


def test_names_are_found_by_bisection():
    check_found(Index.number)
    must_fail(check_found, lambda index, name: next((n for n, each in enumerate(index.names()) if each >= name), None))


def test_little_is_read_for_one_material():
    names = [f"a/{n:04d}" for n in range(300)]
    data = packed(dict.fromkeys(names, MATERIALS["cells"]))
    asked = []

    def read(start, count):
        asked.append(count)
        return data[start : start + count]

    library_file.LibraryFile(read, len(data)).data(names[70])
    assert len(asked) == 3
    assert sum(asked) < len(data) / 5


REFUSED = {
    "a name twice": [entry("cells"), entry("cells", 1)],
    "no name": [dataclasses.replace(entry("cells"), name="")],
    "a name that is no text": [dataclasses.replace(entry("cells"), name="\ud800")],
    "a long name": [dataclasses.replace(entry("cells"), name="x" * 2**15)],
    "a digest": [dataclasses.replace(entry("cells"), source_sha256="ff")],
    "bytes": [dataclasses.replace(entry("cells"), source_bytes=-1)],
    "options": [dataclasses.replace(entry("cells"), options={"a": [1]})],
    "options that are no JSON": [dataclasses.replace(entry("cells"), options={"a": {1, 2}})],
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_could_not_be_read_is_not_written(what):
    import io

    out = io.BytesIO()
    with pytest.raises(FormatError):
        library_file.write(out, REFUSED[what], lambda name: MATERIALS["cells"])
    assert out.getvalue() == b""


def test_a_material_that_is_damaged_or_changes_is_told():
    import io

    data = MATERIALS["cells"]
    with pytest.raises(FormatError, match=r"^cells: expected the checksum"):
        library_file.write(io.BytesIO(), [entry("cells")], lambda name: data[:-1] + bytes([data[-1] ^ 1]))
    turns = iter([data, MATERIALS["nodes/both"]])
    with pytest.raises(FormatError, match="changed meanwhile"):
        library_file.write(io.BytesIO(), [entry("cells")], lambda name: next(turns))


def test_random_damage_below_the_checksums():
    rng = random.Random(0)
    sections, head, payload = apart(WHOLE)
    refused = 0
    for _ in range(400):
        changed = bytearray(payload)
        for _ in range(rng.randint(1, 3)):
            changed[rng.randrange(len(changed))] = rng.choice((0, 1, 127, 255))
        refused += complaint(everything, together([list(each) for each in sections], head, bytes(changed))) is not None
    assert 100 < refused <= 400
    assert zlib.crc32(WHOLE) == zlib.crc32(packed())
    assert INDEX_HEAD.size == 17
