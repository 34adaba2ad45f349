"""Long renders by the command `render`: stopped, and going on."""

import signal
import subprocess
import sys
import time

import pytest
from helpers import PATIENCE, interrupting, lambertian_table, launch, run, run_json

from sommerl import TrainOptions, save, train
from sommerl.commands import console
from sommerl.render import checkpoint, passes
from sommerl.render.environment import default_environment
from sommerl.render.images import write_image

SMALL = ["--size", "24", "--spp", "4"]


def material(path, albedo):
    """One that Mitsuba compiles in no time."""
    save(train(lambertian_table(albedo), TrainOptions(clusters=1, epochs=1))[0], path)
    return path


@pytest.fixture
def grey(tmp_path):
    return material(tmp_path / "grey.smrl", 0.5)


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
EAGER = """
import sys
from sommerl.commands import console
from sommerl.render import checkpoint, passes
console.INTERVAL = 1e9
checkpoint.SECONDS = 0.0
passes.SAMPLES_A_PASS = {}
from sommerl.__main__ import main
sys.exit(main())
"""


SCALAR = """
import warnings
warnings.simplefilter("ignore")
from sommerl.render import llvm
llvm.jit.has_llvm = lambda dr: False
"""


def start(*arguments, before="", samples=2**14):
    """The command, which writes its checkpoint after each of many short passes, of so many samples."""
    return launch([sys.executable, "-c", before + EAGER.format(samples), *map(str, arguments)])


OWN = """<scene version="3.0.0">
  <integrator type="path"/>
  <sensor type="perspective"><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/><rfilter type="box"/>
    </film></sensor>
  <emitter type="constant"/>
  <shape type="sphere"><bsdf type="sommerl"><string name="filename" value="{}"/></bsdf></shape>
</scene>
"""


@pytest.mark.parametrize(
    ("kind", "before", "own"),
    [
        (signal.SIGKILL, "", False),
        (signal.SIGINT, "", False),
        (signal.SIGTERM, "", False),
        (signal.SIGINT, SCALAR, False),
        (signal.SIGKILL, "", True),
        (signal.SIGTERM, "", True),
    ],
    ids=["kill", "int", "term", "scalar", "kill-own", "term-own"],
)
def test_killed_and_started_again_it_goes_on_to_the_same_image(capsys, monkeypatch, tmp_path, grey, kind, before, own):
    """Without LLVM, Mitsuba hands over a pass that was interrupted as it is, with a part of its pixels black."""
    (tmp_path / "own.xml").write_text(OWN.format(grey))
    # In Python, each sample takes long.
    size, spp, short = (16, 128, {"before": before, "samples": 2**12}) if before else (32, 1024, {})
    scene = [tmp_path / "own.xml"] if own else ["--scene", "statue", grey, "--size", size]
    options = "render", *scene, "--spp", spp
    whole, path = tmp_path / "whole.exr", tmp_path / "out.exr"
    part = tmp_path / "out.exr.sommerl-part"
    process = start(*options, "-o", path, "--json", **short)
    deadline = time.monotonic() + PATIENCE
    while not part.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    if before:
        time.sleep(0.15)  # into the next pass
    process.send_signal(kind)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == (-kind if kind == signal.SIGKILL else 130)
    assert part.exists()
    assert not path.exists()
    assert (f"{part}: from here, the same command goes on" in err) == (kind != signal.SIGKILL)
    again = start(*options, "-o", path, "--json", **short)
    out, err = again.communicate(timeout=PATIENCE)
    assert (again.returncode, err) == (0, "")
    assert '"resumed": true' in out
    assert ('"variant": "scalar_rgb"' in out) == bool(before)
    assert not part.exists()
    if before:
        out, _ = start(*options, "-o", whole, "--json", **short).communicate(timeout=PATIENCE)
        assert '"resumed": false' in out
    else:
        monkeypatch.setattr(passes, "SAMPLES_A_PASS", 2**14)
        assert not run_json(capsys, *options, "-o", whole)["resumed"]
    assert path.read_bytes() == whole.read_bytes()


def test_a_file_in_the_place_of_a_checkpoint_that_is_none(capsys, tmp_path, grey):
    part = tmp_path / "x.png.sommerl-part"
    part.mkdir()
    status, _, err = run(capsys, "render", grey, "-o", tmp_path / "x.png", *SMALL)
    assert status == 2
    assert err == f"error: {part}: the render's checkpoint needs this name, which something else has: rename that\n"
    assert not (tmp_path / "x.png").exists()
    part.rmdir()
    for number, content in (("", b""), (2, b"something else"), (3, b"SMRP\1\0 and nothing more")):
        part.write_bytes(content)
        status, _, err = run(capsys, "render", grey, "-o", tmp_path / "x.png", *SMALL)
        aside = tmp_path / f"{part.name}.damaged{number}"
        assert status == 0
        assert err.startswith(f"warning: {part}: it is damaged or not a checkpoint (")
        assert err.endswith(f"; it is kept as {aside.name}, and the render starts anew\n")
        assert err.count("\n") == 1
        assert aside.read_bytes() == content
        assert not part.exists()


CHANGES = {
    "size": ["--size", "25"],
    "seed": ["--seed", "1"],
    "spp": ["--spp", "65"],
    "sampler": ["--sampler", "cosine"],
    "environment": ["--envmap", "{}/light.exr"],
    "mesh": ["--mesh", "{}/mesh.obj"],
    "material 1": ["{}/other.smrl"],
    "reference 1": ["--against", "{}/other.smrl"],
    "scene": ["--scene", "sphere"],
}


@pytest.mark.parametrize("what", CHANGES)
def test_whatever_decides_the_pixels_makes_it_another_render(capsys, tmp_path, monkeypatch, grey, what):
    monkeypatch.setattr(checkpoint, "SECONDS", 0.0)
    monkeypatch.setattr(passes, "SAMPLES_A_PASS", 2**13)
    write_image(tmp_path / "light.exr", default_environment(16))
    (tmp_path / "mesh.obj").write_text(TRIANGLE)
    material(tmp_path / "other.smrl", 0.6)
    usual = ["--scene", "statue", str(grey), "--size", "24", "--spp", "64", "--seed", "0", "-o", f"{tmp_path}/x.exr"]
    with monkeypatch.context() as patch:
        patch.setattr(console, "progress", interrupting)
        with pytest.raises(KeyboardInterrupt):
            run(capsys, "render", *usual)
    change = [each.format(tmp_path) for each in CHANGES[what]]
    given = [each for each in usual if each != str(grey)] if what == "material 1" else usual
    status, _, err = run(capsys, "render", *given, *change)
    assert status == 0
    assert f"it is of a render with another {what}; this render starts anew" in err


def test_a_checkpoint_that_cannot_be_written_stops_nothing(capsys, tmp_path, monkeypatch, grey):
    def full(path):
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(checkpoint, "SECONDS", 0.0)
    monkeypatch.setattr(passes, "SAMPLES_A_PASS", 2**10)
    monkeypatch.setattr(checkpoint, "atomic_write", full)
    status, _, err = run(capsys, "render", grey, "-o", tmp_path / "x.png", *SMALL)
    assert status == 0
    assert err.count("\n") == 1
    assert "No space left on device; the render goes on" in err
    assert (tmp_path / "x.png").exists()


ONE_CPU = """
import os, sys
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
from sommerl.__main__ import main
sys.exit(main())
"""


def test_one_processor_will_do(capsys, tmp_path, grey):
    """Mitsuba's readers and writers of OpenEXR wait for a second thread."""
    write_image(tmp_path / "light.exr", default_environment(16))
    options = "render", grey, "--envmap", tmp_path / "light.exr", *SMALL
    done = subprocess.run([sys.executable, "-c", ONE_CPU, *map(str, options), "-o", tmp_path / "x.exr"], timeout=120)
    assert done.returncode == 0
    run_json(capsys, *options, "-o", tmp_path / "y.exr")
    assert (tmp_path / "x.exr").read_bytes() == (tmp_path / "y.exr").read_bytes()
