import json
import os
import re
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
from helpers import check_sentence, complaint, lambertian_table, must_fail

from sommerl import TrainOptions, save, train
from sommerl.formats import scene
from sommerl.models.nbrdf import WEIGHTS
from sommerl.render.bsdf import register, snippet
from sommerl.render.llvm import mitsuba
from sommerl.system.errors import FormatError

SCENE = """<scene version="3.0.0">
  <include filename="grey.xml"/>
  <integrator type="path"/>
  <sensor type="perspective"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
  <emitter type="constant"/>
  <shape type="rectangle"><transform name="to_world"><scale value="9"/></transform><ref id="grey"/></shape>
</scene>
"""


@pytest.fixture
def folder(tmp_path):
    material, _ = train(lambertian_table(0.5), TrainOptions(clusters=1, epochs=1))
    save(material, tmp_path / "grey & white.smrl")
    (tmp_path / "snippets").mkdir()
    return tmp_path


def test_xml(folder):
    scene.write(folder / "grey & white.smrl", folder / "snippets" / "grey.xml")
    (folder / "snippets" / "scene.xml").write_text(SCENE)
    mi = mitsuba()
    register()
    image = np.array(mi.render(mi.load_file(str(folder / "snippets" / "scene.xml")), spp=256))
    assert image.mean() == pytest.approx(0.5, rel=0.02)


def check_place(path, expected):
    assert json.loads(path.read_text())["filename"] == expected


def test_both_snippets_name_the_same_place(folder):
    """Relative to the snippet, also where that lies behind a link."""
    (folder / "link").symlink_to(folder / "snippets" / "deep")
    (folder / "snippets" / "deep").mkdir()
    for where, expected in (
        ("", "grey & white.smrl"),
        ("snippets", "../grey & white.smrl"),
        ("link", "../../grey & white.smrl"),
    ):
        for extension in ("xml", "json"):
            scene.write(folder / "grey & white.smrl", folder / where / f"grey.{extension}")
        check_place(folder / where / "grey.json", expected)
        must_fail(check_place, folder / where / "grey.json", str(folder / "grey & white.smrl"))
        assert f"value={quoteattr(expected)}" in (folder / where / "grey.xml").read_text()
        mitsuba()
        register()
        assert "lambertian" in str(mitsuba().load_dict(snippet(folder / where / "grey.json")))


NAMES = ["a b", "q\"u'o", "am&p", "da--sh", "ä日", "do.t", "co:lon", "<x>", "back\\slash", "-x", "nickel"]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_every_kind_from_another_folder(folder, tmp_path, monkeypatch, name):
    """The material, the folder and the snippet have it."""
    (folder / name).mkdir()
    material = folder / name / f"{name}.smrl"
    material.write_bytes((folder / "grey & white.smrl").read_bytes())
    for extension in ("xml", "json"):
        scene.write(material, folder / "snippets" / f"{name}.{extension}")
    monkeypatch.chdir("/")
    mi = mitsuba()
    register()
    assert "lambertian" in str(mi.load_dict(snippet(folder / "snippets" / f"{name}.json")))
    # As the head of the XML says.
    head = (folder / "snippets" / f"{name}.xml").read_text()
    include, id_ = re.search(r"<include filename=(.*)/>, and <ref id=(.*)/> in", head, re.DOTALL).groups()
    text = SCENE.replace('"grey.xml"', include).replace('"grey"', id_)
    (folder / "snippets" / "scene.xml").write_text(text)
    shapes = mi.load_file(str(folder / "snippets" / "scene.xml")).shapes()
    assert any("lambertian" in str(shape.bsdf()) for shape in shapes)


def test_json_by_the_resolver(folder):
    """Without our function, Mitsuba's own way of finding files serves."""
    scene.write(folder / "grey & white.smrl", folder / "snippets" / "grey.json")
    found = json.loads((folder / "snippets" / "grey.json").read_text())
    assert "snippet('grey.json')" in found["comment"]
    mi = mitsuba()
    register()
    with pytest.raises(RuntimeError, match="there is no such file"):
        mi.load_dict(found)
    before = mi.file_resolver()
    mi.set_file_resolver(mi.FileResolver(before))
    mi.file_resolver().append(str(folder / "snippets"))
    try:
        assert "lambertian" in str(mi.load_dict(found))
    finally:
        mi.set_file_resolver(before)


def test_a_member_of_an_archive(tmp_path, monkeypatch):
    np.savez(tmp_path / "all.npz", nickel=np.zeros(WEIGHTS), chrome=np.zeros(WEIGHTS))
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path)
    for name in ("x.json", "x--y.xml"):
        scene.write("all.npz:nickel", tmp_path / "sub" / name)
    check_place(tmp_path / "sub" / "x.json", "../all.npz:nickel")
    assert 'value="../all.npz:nickel"' in (tmp_path / "sub" / "x--y.xml").read_text()
    mi = mitsuba()
    register()
    monkeypatch.chdir("/")
    found = snippet(tmp_path / "sub" / "x.json")
    assert found["filename"].endswith("all.npz:nickel")
    assert "nickel (NBRDF)" in str(mi.load_dict(found))
    mi.load_file(str(tmp_path / "sub" / "x--y.xml"))


@pytest.mark.parametrize("name", ["pri$ce", "a\x01b", "a\x1b[2J", "a\nb", "a\u202eb"])
def test_what_xml_cannot_hold(tmp_path, name):
    for material, path in ((tmp_path / f"{name}.smrl", tmp_path / "x.xml"), ("nickel", tmp_path / f"{name}.xml")):
        (tmp_path / f"{name}.smrl").write_bytes(b"")
        with pytest.raises(FormatError, match=r"without \$, of characters that can be printed"):
            scene.write(material, path)
        assert not path.exists()
        scene.write(material, path.with_suffix(".json"))
        assert path.with_suffix(".json").read_text().isascii()


def test_names_that_are_no_text(tmp_path):
    name = os.fsdecode(b"\xff.smrl")
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(FormatError, match=r"of characters that can be printed, .*, found .\.smrl; .json takes others"):
        scene.write(tmp_path / name, tmp_path / "x.xml")
    scene.write(tmp_path / name, tmp_path / "x.json")
    assert json.loads((tmp_path / "x.json").read_text())["filename"] == name


def test_a_built_in_is_named(tmp_path):
    scene.write("nickel", tmp_path / "x.json")
    check_place(tmp_path / "x.json", "nickel")
    assert snippet(tmp_path / "x.json")["filename"] == "nickel"
    register()
    assert "nickel" in str(mitsuba().load_dict(snippet(tmp_path / "x.json")))


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"filename": 3}', '{"type": "sommerl"}', "[" * 40000, "\x00", " " * 70000, None]
)
def test_what_is_no_snippet(tmp_path, text):
    path = tmp_path / "x.json"
    if text is not None:
        path.write_text(text)
    message = complaint(snippet, path)
    assert message
    check_sentence(message, str(path))
