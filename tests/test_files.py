import os
import socket
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from helpers import SMALL, compact_material, complaint, lambertian_table, must_fail
from sampled import NODES

from sommerl import MERL, BrdfTable, TrainOptions, builtin, train
from sommerl.commands import paper
from sommerl.commands.demo import write_page
from sommerl.compression.smrl import file as smrl
from sommerl.factored import file as fbrdf
from sommerl.factored.fit import FactorOptions, factor
from sommerl.formats import fits, merl, rgl_export, scene
from sommerl.formats.shader import source as shader
from sommerl.formats.shader.language import LANGUAGES
from sommerl.plots import lobes, page
from sommerl.render.images import write_image
from sommerl.reproduction import report, section
from sommerl.reproduction.cells import Setting, Store
from sommerl.reproduction.data import Data
from sommerl.reproduction.items import ITEMS
from sommerl.system.errors import OptionError
from sommerl.system.files import atomic_write, check_writable, replacing_files


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    path = tmp_path / "out"
    path.write_bytes(b"before")

    def write_half():
        with atomic_write(path) as out:
            out.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]
    with atomic_write(path) as out:
        out.write(b"after")
    assert path.read_bytes() == b"after"
    assert path.stat().st_mode & 0o444 == 0o444


def test_the_longest_names_work_and_errors_speak_of_the_file_meant(tmp_path):
    with atomic_write(tmp_path / ("n" * 255)) as out:
        out.write(b"x")
    for write in (check_writable, lambda path: atomic_write(path).__enter__()):
        with pytest.raises(OSError, match="cannot be written") as caught:
            write(Path("/proc/x.smrl"))
        assert caught.value.filename == "/proc/x.smrl"


def check_named(write, path, typed):
    with pytest.raises(OSError, match="cannot be written") as caught:
        write(path)
    assert caught.value.filename == typed


def test_errors_name_files_as_typed(tmp_path, monkeypatch):
    """Relative, or the link that leads to it; also where the last step fails."""

    def write(path):
        with atomic_write(path):
            pass

    (tmp_path / "link").symlink_to("/proc/x.smrl")
    monkeypatch.chdir("/proc")
    for each in (check_writable, write):
        check_named(each, Path("x.smrl"), "x.smrl")
        check_named(each, tmp_path / "link", str(tmp_path / "link"))
        must_fail(check_named, lambda path, each=each: each(path.resolve()), Path("x.smrl"), "x.smrl")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, "replace", lambda temporary, _: os.rmdir(temporary))
    check_named(write, Path("y.smrl"), "y.smrl")
    assert [each.name for each in tmp_path.iterdir()] == ["link"]


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")
    with replacing_files(overwrite=False):
        check_writable(tmp_path / "link")  # and one that leads nowhere yet, to what will be there
        with atomic_write(tmp_path / "link") as out:
            out.write(b"x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_bytes() == b"x"
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(OSError, match="cannot be written"):
        check_writable(tmp_path / "loop")


def test_what_cannot_be_written_is_said_beforehand(tmp_path):
    check_writable(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OSError, match="it is a directory, not a file"):
        check_writable(tmp_path)
    with pytest.raises(OSError, match="no folder"):
        check_writable(tmp_path / "none" / "out")


def test_the_mode_of_a_replaced_file_is_kept(tmp_path):
    path = tmp_path / "x.smrl"
    for mode in (0o640, 0o666, 0o600):
        path.write_bytes(b"SMRL")
        path.chmod(mode)
        with replacing_files(overwrite=False), atomic_write(path) as out:
            out.write(b"SMRL again")
        assert stat.S_IMODE(path.stat().st_mode) == mode


def test_a_file_that_cannot_be_written_is_not_replaced(tmp_path, monkeypatch):
    path = tmp_path / "x.smrl"
    path.write_bytes(b"SMRL")
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # as its mode says, which root would not be told
    for overwrite in (False, True):
        with replacing_files(overwrite=overwrite), pytest.raises(PermissionError, match="cannot be written"):
            check_writable(path)


def written_by_all(folder):
    """A file of every format that a command writes and that has room for a mark."""
    material = compact_material(NODES)
    smrl.save(material, folder / "nodes.smrl")
    smrl.save(train(lambertian_table(), TrainOptions(clusters=1, epochs=1))[0], folder / "cells.smrl")
    fbrdf.save(factor(BrdfTable.sampled(builtin("chrome"), SMALL), FactorOptions(1, 1)), folder / "x.fbrdf")
    for extension in LANGUAGES:
        shader.write(material, folder / f"x{extension}")
    for name, extension in (("xml", ".xml"), ("snippet", ".json")):
        scene.write("nickel", folder / f"{name}{extension}")
    fits.write(folder / "fits.json", "nickel", [{"model": "ggx"}])
    pixels = lambertian_table().values[:, :, 0]
    write_image(folder / "x.exr", pixels.astype("f4"))
    write_image(folder / "x.png", (255 * pixels).astype("u1"))
    write_page(folder / "x.html", "title", [("a", (255 * pixels).astype("u1"))], {"a": "b"}, "note")
    for extension in page.FORMATS:
        figure = page.matplotlib().Figure()
        lobes(figure.add_subplot(projection="polar"), builtin("nickel"))
        page.save(figure, folder / f"plot{extension}")
    setting = Setting(Data())
    cell = ITEMS["fig3"].plan(setting)[0]
    outcome = cell.work(setting)
    Store(folder).save(cell, "key", outcome)
    files = [folder / f"report.{extension}" for extension in ("html", "md", "json")]
    paper._write(folder, files, report.made(["fig3"], setting, {cell.name: outcome}, "sommerl paper"))
    (folder / "x.webp").write_bytes(section.webp((255 * pixels).astype("u1")))
    return sorted(path for path in folder.rglob("*") if path.is_file())


def check_kept(path):
    """A command does not replace it, and says how it would."""
    before = path.read_bytes()
    with replacing_files(overwrite=False):
        for write in (check_writable, lambda path: atomic_write(path).__enter__()):
            message = complaint(write, path)
            assert message is not None
            assert message.startswith(f"{path}: there is already a file of this name")
            assert message.endswith(": choose another name, or replace it with --overwrite")
    assert path.read_bytes() == before


def check_replaced(path):
    try:
        with replacing_files(overwrite=False):
            check_writable(path)
            with atomic_write(path) as out:
                out.write(b"new")
    except OptionError as error:
        raise AssertionError(str(error)) from error
    assert path.read_bytes() == b"new"


def test_what_sommerl_wrote_is_replaced_and_nothing_else(tmp_path):
    for path in written_by_all(tmp_path):
        written = path.read_bytes()
        must_fail(check_kept, path)
        unmarked = written.replace(b"Sommerl", b"Someone").replace(b"sommerl", b"someone")
        path.write_bytes(unmarked if unmarked != written else b"X" + written[1:])
        check_kept(path)
        must_fail(check_replaced, path)
        path.write_bytes(b"\n" + written)
        check_kept(path)
        path.write_bytes(written)
        check_replaced(path)


def test_measurements_are_kept_under_any_name_and_also_if_we_wrote_them(tmp_path):
    merl.write(BrdfTable.sampled(builtin("nickel"), MERL), tmp_path / "x.binary")
    rgl_export.write(builtin("nickel"), tmp_path / "x.bsdf")
    for name in ("x.binary", "x.bsdf"):
        content = (tmp_path / name).read_bytes()
        for other in (name, name.upper(), "y.smrl", "y.png", "y.h", "y.json"):
            (tmp_path / other).write_bytes(content)
            check_kept(tmp_path / other)
    # What is measured decides, and not what it is called; and an extension, whatever is in the file.
    (tmp_path / "innocent.png").unlink(missing_ok=True)
    (tmp_path / "innocent.png").symlink_to(tmp_path / "x.binary")
    check_kept(tmp_path / "innocent.png")
    for extension in (".binary", ".BSDF", ".brdf", ".npy", ".npz", ".h5", ".hdf5"):
        (tmp_path / f"z{extension}").write_bytes(b"SMRL")
        check_kept(tmp_path / f"z{extension}")
    with replacing_files(overwrite=True):
        check_writable(tmp_path / "x.binary")
    (tmp_path / "empty.binary").touch()
    check_replaced(tmp_path / "empty.binary")


def test_a_file_that_appears_meanwhile_is_kept(tmp_path):
    path = tmp_path / "x.smrl"

    def write():
        with replacing_files(overwrite=False), atomic_write(path) as out:
            out.write(b"SMRL new")
            path.write_bytes(b"somebody else's")

    with pytest.raises(OptionError, match="which Sommerl did not write: choose another name"):
        write()
    assert path.read_bytes() == b"somebody else's"
    assert list(tmp_path.iterdir()) == [path]


def test_pipes_and_devices_are_written_to(tmp_path):
    fifo = tmp_path / "x.smrl"
    os.mkfifo(fifo)
    check_writable(fifo)  # does not wait for a reader
    read = []
    reader = threading.Thread(target=lambda: read.append(fifo.read_bytes()))
    reader.start()
    with atomic_write(fifo) as out:
        out.write(b"con")
        out.write(b"tent")
    reader.join()
    assert read == [b"content"]
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    (tmp_path / "null.smrl").symlink_to("/dev/null")
    with replacing_files(overwrite=False), atomic_write(tmp_path / "null.smrl") as out:
        out.write(b"x")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)

    def fill():
        with atomic_write(Path("/dev/full")) as out:
            out.write(b"x")

    with pytest.raises(OSError, match="No space left") as caught:
        fill()
    assert caught.value.filename == "/dev/full"


def test_sockets_are_refused(tmp_path):
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "x.smrl"))
        for write in (check_writable, lambda path: atomic_write(path).__enter__()):
            with pytest.raises(OSError, match="cannot be written: it is a socket, not a file"):
                write(tmp_path / "x.smrl")
    assert stat.S_ISSOCK((tmp_path / "x.smrl").stat().st_mode)


HALF = """
import os, sys
from pathlib import Path
from sommerl.system.files import atomic_write
with atomic_write(Path(sys.argv[1])) as out:
    out.write(b"half")
    out.flush()
    print(flush=True)
    sys.stdin.read()
"""


def writer(path):
    """A process that has written half a file."""
    process = subprocess.Popen(
        [sys.executable, "-c", HALF, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    process.stdout.readline()
    return process


@pytest.mark.parametrize("name", ["x.smrl", "n" * 250 + ".smrl", "[a]*?.smrl"])
def test_what_killed_runs_left_is_removed_and_what_others_write_is_not(tmp_path, name):
    path = tmp_path / name
    killed, other, alive = writer(path), writer(tmp_path / "other.smrl"), writer(path)
    for process in (killed, other):
        process.kill()
        process.communicate()
    assert len(list(tmp_path.iterdir())) == 3
    check_writable(path)
    assert len(list(tmp_path.iterdir())) == 2
    check_writable(tmp_path / "other.smrl")
    with atomic_write(path) as out:
        out.write(b"mine")
    assert path.read_bytes() == b"mine"
    assert len(list(tmp_path.iterdir())) == 2
    alive.communicate("")
    assert path.read_bytes() == b"half"
    assert list(tmp_path.iterdir()) == [path]
