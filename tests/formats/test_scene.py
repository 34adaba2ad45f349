import json

import numpy as np
import pytest
from helpers import lambertian_table

from sommerl import TrainOptions, save, train
from sommerl.errors import FormatError
from sommerl.formats import scene
from sommerl.models.nbrdf import WEIGHTS
from sommerl.render.bsdf import register
from sommerl.render.llvm import mitsuba

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


def test_json(folder):
    scene.write(folder / "grey & white.smrl", folder / "grey.json")
    mi = mitsuba()
    register()
    bsdf = mi.load_dict(json.loads((folder / "grey.json").read_text()))
    assert "lambertian" in str(bsdf)


def test_a_member_of_an_archive(tmp_path, monkeypatch):
    np.savez(tmp_path / "all.npz", nickel=np.zeros(WEIGHTS), chrome=np.zeros(WEIGHTS))
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path)
    scene.write("all.npz:nickel", tmp_path / "sub" / "x.json")
    found = json.loads((tmp_path / "sub" / "x.json").read_text())
    assert found["filename"] == f"{tmp_path}/all.npz:nickel"
    scene.write("all.npz:nickel", tmp_path / "sub" / "x--y.xml")
    assert 'value="../all.npz:nickel"' in (tmp_path / "sub" / "x--y.xml").read_text()
    mi = mitsuba()
    register()
    mi.file_resolver().prepend(str(tmp_path / "sub"))
    assert "nickel (NBRDF)" in str(mi.load_dict(found | {"filename": "../all.npz:nickel"}))
    mi.load_file(str(tmp_path / "sub" / "x--y.xml"))
    assert "nickel (NBRDF)" in str(mi.load_dict(found))


def test_a_dollar_sign(tmp_path):
    (tmp_path / "pri$ce.smrl").write_bytes(b"")
    with pytest.raises(FormatError, match=r"without \$ in its name"):
        scene.write(tmp_path / "pri$ce.smrl", tmp_path / "x.xml")
    scene.write(tmp_path / "pri$ce.smrl", tmp_path / "x.json")


@pytest.mark.parametrize("name", ["a\x1b[2J", "a\nb", "a\u202eb", "a\udcff"])
def test_names_that_xml_cannot_hold_or_nobody_can_see(tmp_path, name):
    (tmp_path / f"{name}.smrl").write_bytes(b"")
    with pytest.raises(FormatError, match="expected names of characters that can be printed"):
        scene.write(tmp_path / f"{name}.smrl", tmp_path / "x.xml")
    scene.write(tmp_path / f"{name}.smrl", tmp_path / "x.json")
    assert json.loads((tmp_path / "x.json").read_text())["filename"] == str(tmp_path / f"{name}.smrl")


def test_a_built_in_is_named(tmp_path):
    scene.write("nickel", tmp_path / "x.json")
    assert json.loads((tmp_path / "x.json").read_text()) == {"type": "sommerl", "filename": "nickel"}
