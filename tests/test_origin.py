"""What a compressed material says of what it was made from."""

import json
import re
import zlib
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from factored_brdfs import made
from helpers import lambertian_table, must_fail, run, run_json

from sommerl import BrdfTable, TrainOptions, save, train
from sommerl.compression.compact import search
from sommerl.compression.compact.search import CompactOptions
from sommerl.compression.smrl import file
from sommerl.factored import file as fbrdf
from sommerl.factored.fit import FactorOptions, factor
from sommerl.formats.load import load
from sommerl.reflectance.origin import MOST_LINKS, source_of
from sommerl.reflectance.reciprocal import reciprocal
from sommerl.system.errors import FormatError
from sommerl.system.sealed_file import PREFIX

GOLDEN = Path(__file__).parent / "golden"
QUICK = TrainOptions(clusters=1, epochs=1)
FILES = {"cells.smrl": "som-man", "nodes.smrl": "som-man", "factored.fbrdf": "factored"}


def digest(path):
    return sha256(Path(path).read_bytes()).hexdigest()


def check_made_from(material, path, kind):
    """That it is of the file, and what the file was made from follows."""
    before = load(path)
    assert material.source.sha256 == digest(path)
    assert [link["kind"] for link in material.source.chain()] == [kind, "source"]
    assert [link["sha256"] for link in material.source.chain()] == [digest(path), before.source.sha256]
    assert {link["name"] for link in material.source.chain()} == {before.name}


@pytest.fixture(scope="module", params=FILES)
def source(request):
    return GOLDEN / request.param


def test_by_the_preset_paper(tmp_path, source):
    material, _ = train(BrdfTable.of(load(source)), QUICK)
    save(material, tmp_path / "x.smrl")
    check_made_from(load(tmp_path / "x.smrl"), source, FILES[source.name])
    before = load(source)
    before.file_sha256 = before.source.sha256  # as it was: the original's hash
    must_fail(check_made_from, train(BrdfTable.of(before), QUICK)[0], source, FILES[source.name])


def test_by_the_preset_compact(tmp_path, source):
    """In the size that was asked for."""
    material, report = search.compress(load(source), CompactOptions(target_size=900, effort=1))
    written = save(material, tmp_path / "x.smrl")
    assert written <= 900
    assert written in [tried[0] for tried in report.tried]
    check_made_from(load(tmp_path / "x.smrl"), source, FILES[source.name])


def test_by_factoring(tmp_path):
    material = factor(load(GOLDEN / "cells.smrl"), FactorOptions(1, 1))
    check_made_from(material, GOLDEN / "cells.smrl", "som-man")
    fbrdf.save(material, tmp_path / "x.fbrdf")
    again = load(tmp_path / "x.fbrdf")  # whose format has no room for more
    assert again.source.sha256 == digest(GOLDEN / "cells.smrl")
    assert again.source.chain() == ()


def test_a_chain_grows_to_its_bound_and_keeps_its_ends(tmp_path):
    """In the middle, links are left out."""
    table = lambertian_table()
    path = tmp_path / "0.smrl"
    save(train(table, QUICK)[0], path)
    hashes = [table.source.sha256, digest(path)]
    for number in range(1, MOST_LINKS + 4):
        material, _ = train(BrdfTable.of(load(path)), QUICK)
        path = tmp_path / f"{number}.smrl"
        save(material, path)
        found = [link["sha256"] for link in load(path).source.chain()]
        newest = hashes[::-1]
        assert found == (newest if len(newest) <= MOST_LINKS else newest[: MOST_LINKS - 1] + newest[-1:])
        hashes.append(digest(path))


def test_what_is_made_from_no_compressed_material_says_nothing():
    """And its file is what it was."""
    for table in (lambertian_table(), BrdfTable.of(load("nickel"))):
        material, _ = train(table, QUICK)
        assert material.source.made_from == ()
        assert b"made_from" not in file.encode(material)
        assert material.source.sha256 == table.source.sha256
    for name in FILES:
        before = load(GOLDEN / name)
        encode = fbrdf.encode if name.endswith(".fbrdf") else file.encode
        again = (fbrdf if name.endswith(".fbrdf") else file).decode(encode(before))
        assert (again.source.sha256, again.source.made_from) == (before.source.sha256, ())


def check_same_source(made):
    """That the mean of both orders of a compressed material says the same of its source as the material."""
    before = load(GOLDEN / "factored.fbrdf")
    assert (source_of(made), made.kind) == (source_of(before), before.kind)


def test_of_a_mean_of_both_orders(tmp_path):
    mean = reciprocal(load(GOLDEN / "factored.fbrdf"))
    check_same_source(mean)
    material, _ = search.compress(mean, CompactOptions(target_size=900, effort=1))
    save(material, tmp_path / "x.smrl")
    check_made_from(load(tmp_path / "x.smrl"), GOLDEN / "factored.fbrdf", "factored")
    mean.file_sha256 = ""
    must_fail(check_same_source, mean)


def test_one_that_was_never_a_file():
    """Has no hash; a table of it, that of its values."""
    brdf = made()
    source = source_of(brdf)
    chain = source.made_from
    assert source.sha256 == ""
    assert [link["kind"] for link in chain] == ["factored", "source"]
    assert chain[1]["sha256"] == brdf.source.sha256
    table = BrdfTable.of(brdf)
    assert table.source.sha256 == BrdfTable.sampled(brdf).source.sha256


def test_convert_copies_it(capsys, tmp_path):
    save(train(BrdfTable.of(load(GOLDEN / "cells.smrl")), QUICK)[0], tmp_path / "a.smrl")
    run_json(capsys, "convert", tmp_path / "a.smrl", tmp_path / "b.smrl")
    assert digest(tmp_path / "a.smrl") == digest(tmp_path / "b.smrl")


def check_against(result, path):
    link = {"kind": "som-man", "name": load(path).name, "sha256": digest(path)}
    assert result["measured_against"] == link
    assert result["made_from"][0] == link
    assert result["source_sha256"] == digest(path)


def test_commands_say_so(capsys, tmp_path):
    """That an error of nothing at all is one against a compressed material."""
    a, b = tmp_path / "a.smrl", tmp_path / "b.smrl"
    save(train(lambertian_table(), QUICK)[0], a)
    quick = "--clusters", 1, "--epochs", 1
    made = run_json(capsys, "compress", a, "-o", b, *quick)
    assert made["metrics"]["relative_error"] < 1e-9
    check_against(made, a)
    check_against(run_json(capsys, "info", b), a)
    must_fail(check_against, run_json(capsys, "info", a), a)
    first = run_json(capsys, "info", a)
    assert first["made_from"] is None
    assert first["measured_against"] == {"kind": "source", "name": "lambertian", "sha256": first["source_sha256"]}
    for arguments in (("compress", a, "-o", b, *quick), ("info", b)):
        text = re.sub(r"[\s│]+", " ", run(capsys, *arguments)[1])
        assert f"made from lambertian, som-man, {digest(a)[:12]} ← lambertian, source," in text
        assert "lambertian: a compressed material, not a measurement" in text
    assert "made from" not in run(capsys, "info", a)[1]
    assert run_json(capsys, "info", "nickel")["measured_against"] is None


def with_notes(data, notes):
    """A file with other notes."""
    start = PREFIX.size + 1
    start += 1 + data[start]
    start += 1 + data[start]
    length = int.from_bytes(data[start : start + 2], "little")
    body = data[PREFIX.size : start] + len(notes).to_bytes(2, "little") + notes + data[start + 2 + length :]
    magic, version, _ = PREFIX.unpack_from(data)
    return PREFIX.pack(magic, version, zlib.crc32(body)) + body


LINK, NEXT = {"kind": "som-man", "name": "a"}, {"kind": "source", "name": "a", "sha256": "0f" * 32}


@pytest.mark.parametrize(
    "chain",
    [
        None,
        3,
        "x",
        {},
        [],
        [3],
        [None],
        [[]],
        [{}],
        [NEXT],
        [LINK, LINK],
        [LINK | {"kind": "x"}],
        [LINK | {"kind": 1}],
        [LINK | {"name": None}],
        [LINK | {"name": "a" * 256}],
        [LINK | {"more": "x"}],
        [LINK, NEXT | {"sha256": 3}],
        [LINK, NEXT | {"sha256": "0f"}],
        [LINK, NEXT | {"sha256": "0F" * 32}],
        [LINK, NEXT | {"sha256": "0f" * 32 + "\n"}],
        [LINK, NEXT | {"kind": ["source"]}],
        [LINK, *[NEXT] * MOST_LINKS],
        [0] * 20_000,
    ],
)
def test_a_hostile_chain(chain):
    data = (GOLDEN / "cells.smrl").read_bytes()
    with pytest.raises(FormatError, match="made_from: expected a list"):
        file.decode(with_notes(data, json.dumps({"made_from": chain}).encode()))


def test_a_chain_that_is_one():
    """With what no terminal should obey made visible."""
    data = (GOLDEN / "cells.smrl").read_bytes()
    chain = [LINK | {"name": "a\x1b[31m"}, NEXT, NEXT | {"sha256": ""}]
    found = file.decode(with_notes(data, json.dumps({"made_from": chain}).encode()))
    assert [link["name"] for link in found.source.made_from] == ["a\ufffd[31m", "a", "a"]
    assert np.array_equal(found.index, file.decode(data).index)
