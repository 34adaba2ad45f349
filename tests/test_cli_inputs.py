"""Materials by folder, pattern and name, and the folders and labels of what is made of them."""

import pytest
from helpers import compact_material, lambertian_table, must_fail, run, run_json

from sommerl import TrainOptions, save, train
from sommerl.commands.inputs import expanded, labels
from sommerl.compression.compact import search
from sommerl.reflectance.nodes import NodeLattice

NODES = NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),))

QUICK = ["--clusters", "1", "--epochs", "1"]
SMALL = ["--size", "16", "--spp", "1"]


@pytest.fixture
def folder(tmp_path):
    """Two materials, one in a folder of its own below, a file that is none, and one that is not even called one."""
    folder = tmp_path / "in"
    (folder / "below").mkdir(parents=True)
    material, _ = train(lambertian_table(0.5), TrainOptions(clusters=1, epochs=1))
    for name in ("b", "a", "below/c"):
        save(material, folder / f"{name}.smrl")
    (folder / "broken.smrl").write_bytes(b"SMRL")
    (folder / "notes.txt").write_text("no material")
    return folder


def outputs(result):
    return [each["output"] for each in result["materials"]]


@pytest.mark.parametrize("given", ["{}", "{}/", "{}/*.smrl", "{}/[ab]*.smrl"])
def test_folders_and_patterns_are_compressed(capsys, folder, tmp_path, given):
    """In the order of their names, into a folder that is made; what cannot be read is left out and told."""
    out = tmp_path / "made" / "here.d"
    status, _, err = run(capsys, "compress", given.format(folder), "-o", out, *QUICK)
    assert status == 0
    assert err.count("\n") == 1
    assert err.startswith(f"warning: {folder / 'broken.smrl'}: expected")
    assert err.endswith("; it is left out\n")
    assert sorted(path.name for path in out.iterdir()) == ["a.smrl", "b.smrl"]


def check_expanded(given, names, folder):
    assert expanded([each.format(folder) for each in given]) == [name.format(folder) for name in names]


EXPANDED = [
    (["nickel", "{}"], ["nickel", "{}/a.smrl", "{}/b.smrl", "{}/broken.smrl"]),
    (["{}/[ab].smrl"], ["{}/a.smrl", "{}/b.smrl"]),
    (["{}/**/*.smrl"], ["{}/a.smrl", "{}/b.smrl", "{}/below/c.smrl", "{}/broken.smrl"]),
    (["{}/a.smrl", "{}/below/?.smrl"], ["{}/a.smrl", "{}/below/c.smrl"]),
    (["{}/none.smrl", "none"], ["{}/none.smrl", "none"]),
]


@pytest.mark.parametrize(("given", "names"), EXPANDED)
def test_what_a_name_stands_for(folder, given, names):
    check_expanded(given, names, folder)
    must_fail(check_expanded, given, [*names, "more"], folder)


def test_a_name_with_a_patterns_characters_is_that_file(capsys, folder):
    odd = folder / "[a].smrl"
    odd.write_bytes((folder / "a.smrl").read_bytes())
    check_expanded(["{}/[a].smrl"], ["{}/[a].smrl"], folder)
    assert run_json(capsys, "info", odd)["input"] == str(odd)


def test_a_folder_of_a_built_in_name_is_not_it(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "nickel").mkdir()
    check_expanded(["nickel"], ["nickel"], folder)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("{}/*.binary", "{}/*.binary: expected names of files that match, found none"),
        ("{}/empty", "{}/empty: expected a folder with materials, found none in it"),
        ("{}/broken.smrl", "{}/broken.smrl: expected"),
        ("{}/broken*", "{}/broken*: expected materials, found none that can be read"),
        ("{}/b*.2", "{}/b*.2: expected materials, found none that can be read"),
    ],
)
def test_nothing_to_compress(capsys, folder, tmp_path, given, sentence):
    (folder / "empty").mkdir()
    for name in ("broken.2", "brown.2"):
        (folder / name).write_bytes(b"SMRL")
    before = sorted(tmp_path.rglob("*"))
    status, out, err = run(capsys, "compress", given.format(folder), "-o", tmp_path / "out", *QUICK)
    assert (status, out) == (1, "")
    assert err.splitlines()[-1].startswith("error: " + sentence.format(folder))
    assert sorted(tmp_path.rglob("*")) == before


def test_info_of_several_is_a_table(capsys, folder):
    found = run(capsys, "info", folder / "a.smrl", "nickel", folder / "b.smrl", folder / "below" / "c.smrl")
    assert (found[0], found[2]) == (0, "")
    head, *rows = [line for line in found[1].splitlines() if "│" in line or "┃" in line]
    assert head.replace("┃", "").split() == ["material", "kind", "lattice", "palette", "lookup", "memory", "disk"]
    assert [row.replace("│", "").split()[:2] for row in rows] == [
        ["a.smrl", "paper"],
        ["nickel", "model"],
        ["b.smrl", "paper"],
        ["c.smrl", "paper"],
    ]
    assert "8×8×12" in rows[0]
    listed = run_json(capsys, "info", folder / "a.smrl", "nickel")["materials"]
    assert [each["kind"] for each in listed] == ["som-man", "model"]


def check_created(capsys, path, *arguments):
    status, _, err = run(capsys, *arguments)
    assert (status, err) == (0, "")
    assert path.is_file()


def test_output_folders_are_made(capsys, folder, tmp_path):
    lines = {
        "x.h": ["convert", folder / "a.smrl"],
        "x.fbrdf": ["factor", "nickel", "--lobes", "1", "--terms", "1", "-o"],
        "x.png": ["plot", "nickel", "--kind", "theta-h", "-o"],
        "x.json": ["fit", "nickel", "--model", "lambertian", "--samples", "1000", "--starts", "1", "-o"],
        "x.exr": ["render", "nickel", *SMALL, "-o"],
        "x.smrl": ["compress", folder / "a.smrl", *QUICK, "-o"],
    }
    for name, words in lines.items():
        path = tmp_path / name.replace(".", "-") / "made" / name
        check_created(capsys, path, *words, path)
    path = tmp_path / "bare" / "a.smrl"
    check_created(capsys, path, "compress", folder / "a.smrl", *QUICK, "-o", path.parent)
    must_fail(check_created, capsys, tmp_path / "elsewhere" / "x.h", "convert", folder / "a.smrl", tmp_path / "x.h")


def test_folders_for_nothing_are_removed(capsys, folder, tmp_path):
    """But those that were there before, and those in which something is, stay."""
    (tmp_path / "before").mkdir()
    before = sorted(tmp_path.rglob("*"))
    for arguments in (
        ("compress", "nickle", "-o", tmp_path / "before" / "a" / "b" / "x.smrl"),
        ("compress", folder / "a.smrl", "nickle", "-o", tmp_path / "out"),
        ("plot", "nickel", "--kind", "palette", "-o", tmp_path / "out" / "x.png"),
        ("render", folder / "broken.smrl", "-o", tmp_path / "out" / "x.png"),
    ):
        assert run(capsys, *arguments)[0] == 1
        assert sorted(tmp_path.rglob("*")) == before
    good = "compress", folder / "a.smrl", *QUICK, "-o", tmp_path / "out" / "x.smrl"
    assert run(capsys, *good)[0] == 0
    assert (tmp_path / "out" / "x.smrl").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["{}/a.smrl", "{}/b.smrl", "-o", "{}/x.smrl"], 2, "x.smrl: expected a folder for 2 inputs, found the name of"),
        (["{}/a.smrl", "{}/b.smrl", "-o", "{}/notes.txt"], 1, "notes.txt: expected a folder, found something else"),
        (
            ["{}/a.smrl", "{}/a.smrl", "-o", "{}/out"],
            2,
            "IN: expected different names, found two that would be written",
        ),
        (["{}/a.smrl", "-o", "{}/x.bin"], 2, "x.bin: expected a name that ends in .smrl, found '.bin'"),
    ],
)
def test_where_several_cannot_go(capsys, folder, arguments, status, message):
    before = sorted(folder.rglob("*"))
    found, out, err = run(capsys, "compress", *(each.format(folder) for each in arguments), *QUICK)
    assert (found, out) == (status, "")
    assert message in err
    assert sorted(folder.rglob("*")) == before


LABELS = [
    (["x.binary", "y.smrl"], ["x", "y"], ["x", "y"]),
    (["m/x.binary", "m/x.smrl"], ["x", "x"], ["x.binary", "x.smrl"]),
    (["m/x.smrl", "n/x.smrl"], ["x", "x"], ["m/x.smrl", "n/x.smrl"]),
    (["x.binary", "y.smrl"], ["x", "x"], ["x.binary", "y.smrl: x"]),
    (["nickel", "n.smrl"], ["nickel (SGD)", "nickel (SGD)"], ["nickel (SGD)", "n.smrl: nickel (SGD)"]),
    (["x.smrl", "x.smrl"], ["x", "x"], ["x", "x"]),
]


def check_label(sources, names, expected):
    assert labels(sources, names) == expected


@pytest.mark.parametrize(("sources", "names", "expected"), LABELS)
def test_labels_are_files_where_names_are_equal(sources, names, expected):
    check_label(sources, names, expected)
    must_fail(check_label, sources, names, expected[::-1] if len(set(expected)) > 1 else ["x.smrl"] * 2)


def test_a_is_the_reference_and_render_says_the_same(capsys, folder, tmp_path):
    """Also in words, and with both sides' names told apart."""
    dark, _ = train(lambertian_table(0.25), TrainOptions(clusters=1, epochs=1))
    (tmp_path / "other").mkdir()
    save(dark, tmp_path / "other" / "a.smrl")
    a, b = str(folder / "a.smrl"), str(tmp_path / "other" / "a.smrl")
    compared = run_json(capsys, "compare", a, b, *SMALL)
    rendered = run_json(capsys, "render", b, "--against", a, "-o", tmp_path / "x.png", *SMALL)
    for key in ("reference", "candidate", "table_relative_error", "psnr_object_db"):
        assert compared[key] == rendered[key]
    assert compared["table_relative_error"] == pytest.approx(0.5, rel=1e-3)  # of A, and 1 of B
    assert (compared["reference"], compared["candidate"]) == tuple(
        f"{source}: lambertian (nearest)" for source in (a, b)
    )
    said = ["".join(run(capsys, *words)[1].split()) for words in (
        ("compare", a, b, *SMALL), ("render", b, "--against", a, "-o", tmp_path / "x.png", *SMALL),
    )]  # fmt: skip
    assert f"{b}against{a}" in said[0]
    assert f"{b}:lambertian(nearest)against{a}:lambertian(nearest)" in said[1]
    assert said[1].endswith(f"Wrote{tmp_path}/x.png,{tmp_path}/x.reference.png,{tmp_path}/x.against.png")


def test_convert_to_a_size(capsys, tmp_path, monkeypatch):
    """As `compress` does it, also on the way to source code. The search itself is tested elsewhere."""
    asked = []

    def found(brdf, options, **_):
        asked.append((brdf.name, options))
        return compact_material(NODES, 2, 2), search.CompactReport(40.0, 1.0, [])

    monkeypatch.setattr("sommerl.compression.compact.search.compress", found)
    save(compact_material(NODES, 2, 2, name="other"), tmp_path / "in.smrl")
    for source in ("red-fabric", tmp_path / "in.smrl"):
        result = run_json(capsys, "convert", source, tmp_path / "x.smrl", "--target-size", "0.8kB")
        assert result["options"] == {"target_size": 800, "target_psnr": None, "effort": 5, "seed": 0}
        assert result["preset"] == "compact"
        assert (result["input"], result["bytes_disk"]) == (str(source), (tmp_path / "x.smrl").stat().st_size)
        run_json(capsys, "compress", source, "-o", tmp_path / "y.smrl", "--target-size", "800")
        run_json(capsys, "convert", source, tmp_path / "x.h", "--target-size", "800")
    assert asked == [
        (name, search.CompactOptions(target_size=800)) for name in ["red-fabric (SGD stand-in)"] * 3 + ["other"] * 3
    ]
    assert (tmp_path / "x.smrl").read_bytes() == (tmp_path / "y.smrl").read_bytes()
    assert "material_x" in (tmp_path / "x.h").read_text()
