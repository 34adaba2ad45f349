"""library pack, list, find and sheet; and materials of a library as arguments of the other commands."""

import json
from pathlib import Path

import pytest
from helpers import complaint, must_fail, run, run_json
from library_files import MATERIALS, folder

from sommerl import Library, builtin, load
from sommerl.compression.compact.search import Compressor
from sommerl.compression.smrl import file
from sommerl.render.judge import Judge

NAMES = sorted(MATERIALS)
GOLD = Path(__file__).parent / "viewer" / "gold.smrl"
RED, BLUE = (0.4, 0.02, 0.02), (0.02, 0.02, 0.4)
HOSTILE = '<img src=x onerror="alert(1)">\x1b[31m'


@pytest.fixture
def made(tmp_path):
    return folder(tmp_path / "made", cells=RED, **{"nodes/both": BLUE})


@pytest.fixture
def packed(capsys, tmp_path, made):
    run_json(capsys, "library", "pack", made, "-o", tmp_path / "x.smrlib")
    return tmp_path / "x.smrlib"


def test_pack(capsys, tmp_path, made):
    found = run_json(capsys, "library", "pack", made, "-o", tmp_path / "x.smrlib")
    assert found["count"] == 3
    assert found["bytes_disk"] == (tmp_path / "x.smrlib").stat().st_size
    assert found["bytes_materials"] == sum(map(len, MATERIALS.values()))
    first = (tmp_path / "x.smrlib").read_bytes()
    status, out, _ = run(capsys, "library", "pack", made, "-o", tmp_path / "x.smrlib")
    assert (status, (tmp_path / "x.smrlib").read_bytes()) == (0, first)
    assert out.startswith("3 materials → ")
    status, _, err = run(capsys, "library", "pack", made, "-o", tmp_path / "x.zip")
    assert (status, "ends in .smrlib" in err) == (2, True)
    (tmp_path / "y.smrlib").write_text("mine")
    assert run(capsys, "library", "pack", made, "-o", tmp_path / "y.smrlib")[0] == 2
    assert (
        "other than the input" in run(capsys, "library", "pack", tmp_path / "x.smrlib", "-o", tmp_path / "x.smrlib")[2]
    )


def check_shared(found, library, sources, most):
    """Each material takes at most so many bytes, and is as far from its source as is said."""
    assert found["whole"] == {}
    with Library(library) as packed:
        for each in found["materials"]:
            record = packed.record(each["name"])
            assert record.bytes <= most
            metrics = Judge(load(sources / record.source)).metrics(packed[each["name"]])
            for key, value in metrics.items():
                assert each[key] == pytest.approx(value, rel=1e-5)
                assert record.metrics[key] == pytest.approx(value, rel=1e-5)


def test_pack_shared(capsys, tmp_path):
    sources, made, out = tmp_path / "in", tmp_path / "made", tmp_path / "x.smrlib"
    sources.mkdir()
    gold, fabric = GOLD.read_bytes(), file.encode(Compressor(builtin("red-fabric"), effort=1).of_size(900)[1])
    for name, data in (("gold", gold), ("red-fabric", fabric)):
        (sources / f"{name}.smrl").write_bytes(data)
    run_json(capsys, "library", "build", sources, "-o", made, "--target-size", 500, "--effort", 1, "--jobs", 1)
    pack = "library", "pack", made, "-o", out, "--shared"
    found = run_json(capsys, *pack, 300, "--sources", sources)
    check_shared(found, out, sources, 300)
    must_fail(check_shared, found, out, sources, 100)
    assert found["bytes_disk"] == out.stat().st_size
    assert {"mean", "worst", "worst_name"} == found["quality"]["psnr_soft_db"].keys()
    assert load(f"{out}:gold").eval([0, 0, 1], [0, 0, 1]).shape == (3,)
    status, said, _ = run(capsys, *pack, "0.3kB", "--sources", sources)
    assert (status, said.startswith("2 materials → ")) == (0, True)
    assert "dB in soft light" in said
    assert "expected both" in run(capsys, *pack, 300)[2]
    assert "expected both" in run(capsys, "library", "pack", made, "-o", out, "--sources", sources)[2]
    assert "--shared: expected 200" in run(capsys, *pack, 100, "--sources", sources)[2]
    (sources / "gold.smrl").write_bytes(MATERIALS["nodes/neither"])
    assert "found another content" in run(capsys, *pack, 300, "--sources", sources)[2]
    (sources / "gold.smrl").unlink()
    assert "found none" in run(capsys, *pack, 300, "--sources", sources)[2]


def check_list(found, names):
    assert [each["name"] for each in found["materials"]] == names
    for each in found["materials"]:
        assert load(each["input"]).name
        assert each["bytes_disk"] == len(MATERIALS[each["name"]])
        assert each["source"] == f"{each['name']}.bsdf"
        assert 0 <= each["gloss"] <= 1
        assert each["colour_srgb"].startswith("#")


def test_list(capsys, made, packed):
    for library in (made, packed):
        check_list(run_json(capsys, "library", "list", library), NAMES)
        by_size = sorted(NAMES, key=lambda name: len(MATERIALS[name]))
        check_list(run_json(capsys, "library", "list", library, "--sort", "size"), by_size)
        reverse = run_json(capsys, "library", "list", library, "--sort", "size", "--reverse")
        check_list(reverse, by_size[::-1])
        must_fail(check_list, reverse, by_size)
        shown = run(capsys, "library", "list", library)[1]
        assert all(name in shown for name in NAMES)


def test_find(capsys, packed):
    def names(*options):
        return [each["name"] for each in run_json(capsys, "library", "find", packed, *options)["materials"]]

    assert names() == NAMES
    assert names("--name", "NODES") == ["nodes/both", "nodes/neither"]
    assert names("--colour", "crimson")[0] == "cells"
    assert names("--colour", "#00f", "--most", 1) == ["nodes/both"]
    assert names("--like", f"{packed}:nodes/neither", "--most", 1) == ["nodes/neither"]
    assert names("--name", "zzz") == []
    found = run_json(capsys, "library", "find", packed, "--like", f"{packed}:cells")["materials"]
    assert found[0]["distance"] == 0 < found[1]["distance"]
    gloss = found[0]["gloss"]
    assert "cells" in names("--gloss", f"{gloss:.3f}..1" if gloss > 0.5 else f"..{gloss + 0.001:.3f}")
    assert run(capsys, "library", "find", packed, "--name", "zzz")[1] == "No material is like that.\n"
    assert "nodes/both" in run(capsys, "library", "find", packed, "--colour", "blue")[1]


WRONG = {
    "a colour": (["--colour", "golld"], "--colour: expected a CSS colour's name"),
    "a range": (["--gloss", "0.9..0.1"], "--gloss: expected LOW..HIGH"),
    "no range": (["--metalness", "0.5"], "--metalness: expected LOW..HIGH"),
    "two orders": (["--colour", "red", "--like", "nickel"], "not allowed beside"),
    "none": (["--most", "0"], "--most: expected 1 to"),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_options_are_told(capsys, packed, what):
    options, said = WRONG[what]
    status, _, err = run(capsys, "library", "find", packed, *options)
    assert status == 2
    assert said in err


def test_a_material_of_a_library_is_one_for_every_command(capsys, tmp_path, packed):
    one = f"{packed}:nodes/both"
    assert run_json(capsys, "info", one)["preset"] == "compact"
    run_json(capsys, "convert", one, tmp_path / "out.smrl")
    assert (tmp_path / "out.smrl").read_bytes() == MATERIALS["nodes/both"]
    assert run_json(capsys, "view", one, "-o", tmp_path / "out.html")["bytes_page"] > 1000
    run_json(capsys, "render", one, "-o", tmp_path / "out.png", "--size", 8, "--spp", 1)
    run_json(capsys, "convert", one, tmp_path / "out.xml")
    assert "x.smrlib:nodes/both" in (tmp_path / "out.xml").read_text()
    assert "expected the name of one of its 3 materials" in run(capsys, "info", packed)[2]
    assert "did you mean cells?" in run(capsys, "info", f"{packed}:celsl")[2]


def test_sheet(capsys, tmp_path):
    materials = dict(zip(("plain", HOSTILE), MATERIALS.values(), strict=False))
    made = folder(tmp_path / "made", materials)
    found = run_json(capsys, "library", "sheet", made, "-o", tmp_path / "x.html")
    page = (tmp_path / "x.html").read_text()
    assert found["bytes_page"] == len(page.encode())
    assert len(found["materials"]) == 2
    listed = json.loads(page.partition('id="materials">')[2].partition("</script>")[0])
    assert sorted(each["label"] for each in listed) == sorted(["plain", HOSTILE.replace("\x1b", "�")])
    assert "<img src" not in page
    assert run(capsys, "library", "sheet", made, "-o", tmp_path / "x.html")[0] == 0
    assert run(capsys, "library", "sheet", made, "-o", tmp_path / "x.png")[0] == 2


def test_a_page_that_is_too_long_is_told(capsys, tmp_path, made, monkeypatch):
    from sommerl.commands import library_sheet

    monkeypatch.setattr(library_sheet, "LARGEST_PAGE", 1000)
    status, _, err = run(capsys, "library", "sheet", made, "-o", tmp_path / "x.html")
    assert (status, "expected materials for a page of at most" in err) == (2, True)
    assert not (tmp_path / "x.html").exists()


def test_what_is_no_library_is_told(capsys, tmp_path):
    for command in (["list"], ["find"], ["pack", "-o", tmp_path / "x.smrlib"], ["sheet", "-o", tmp_path / "x.html"]):
        status, _, err = run(capsys, "library", command[0], tmp_path / "none", *command[1:])
        assert (status, "there is no such file" in err) == (1, True)
    assert complaint(load, tmp_path / "none") is not None
    status, _, err = run(capsys, "library")
    assert (status, "required: COMMAND" in err) == (2, True)
