"""Libraries are built: what becomes a material, what is done again, and what is kept when something goes wrong."""

import errno
import json
import os
import shutil
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import complaint, must_fail, run, run_json
from libraries import HERE, METHOD, QUICK, built, contents, names, source, sources

import sommerl
from sommerl import TrainOptions, load
from sommerl.commands import library_build
from sommerl.library import build as building
from sommerl.library.build import part
from sommerl.library.engines import Engine
from sommerl.library.index import record_files, records
from sommerl.library.lock import Shard
from sommerl.library.sources import Material
from sommerl.library.verify import verify
from sommerl.library.work import Method
from sommerl.models.nbrdf import WEIGHTS
from sommerl.system import files


@pytest.fixture(autouse=True)
def one_thread(monkeypatch):
    monkeypatch.setenv("SOMMERL_THREADS", "1")


@pytest.fixture(scope="module")
def made_once(tmp_path_factory):
    place = tmp_path_factory.mktemp("library")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOMMERL_THREADS", "1")
        built(sources(place / "in", 4), place / "out")
    return place


@pytest.fixture
def library(made_once, tmp_path):
    """A folder of four materials, and the library of it."""
    for name in ("in", "out"):
        shutil.copytree(made_once / name, tmp_path / name)
    return tmp_path / "in", tmp_path / "out"


def check_library(output, wanted):
    assert list(records(output)) == sorted(wanted)
    assert verify(output) == (len(wanted), [])
    assert not list(output.rglob(".sommerl-*"))


def test_every_material_below_a_folder_becomes_one(library):
    folder, output = library
    check_library(output, ["m0", "m2", "below/m1", "below/m3"])
    must_fail(check_library, output, ["m0", "m2", "below/m1"])
    record = records(output)["below/m1"]
    assert (record.file, record.source) == ("below/m1.smrl", "below/m1.smrl")
    assert record.bytes == (output / "below" / "m1.smrl").stat().st_size
    assert record.source_bytes == (folder / "below" / "m1.smrl").stat().st_size
    assert record.options == METHOD.noted()
    assert set(record.metrics) == {"psnr_soft_db", "psnr_lamp_db", "log_error", "log_error_grazing", "albedo_ratio"}
    assert record_files(output) == []  # all are in the index


def check_done(found, made, kept):
    assert (names(found.made), names(found.kept)) == (made, kept)


def test_what_is_done_is_not_done_again(library):
    folder, output = library
    before = contents(output)
    os.utime(folder / "m0.smrl", (1, 1))  # not time decides, but content
    report = built(folder, output)[0]
    check_done(report, [], ["below/m1", "below/m3", "m0", "m2"])
    must_fail(check_done, report, ["m0"], ["below/m1", "below/m3", "m2"])
    assert contents(output) == before


def test_what_has_changed_is_done_again(library, monkeypatch):
    folder, output = library
    monkeypatch.setattr(building, "work", made_up)
    source(folder / "m0.smrl", seed=9)
    (output / "m2.smrl").unlink()
    (output / "below" / "m1.smrl").write_bytes(b"SMRL damaged")
    check_done(built(folder, output)[0], ["below/m1", "m0", "m2"], ["below/m3"])
    other = Method(TrainOptions(clusters=3, epochs=1))
    assert len(built(folder, output, other)[0].made) == 4
    assert len(built(folder, output, other)[0].kept) == 4
    check_library(output, ["m0", "m2", "below/m1", "below/m3"])


def test_a_source_that_is_gone_is_told_and_its_material_kept(capsys, library):
    folder, output = library
    (folder / "m0.smrl").unlink()
    report = built(folder, output)[0]
    assert (report.gone, report.removed) == (["m0"], [])
    check_library(output, ["m0", "m2", "below/m1", "below/m3"])
    shutil.rmtree(folder / "below")
    status, _, err = run(capsys, "library", "build", folder, "-o", output, *QUICK)
    assert (status, err) == (
        0,
        f"warning: {output}: expected a source of each material, found none of below/m1, below/m3, m0; "
        "--prune removes these\n",
    )
    assert run_json(capsys, "library", "build", folder, "-o", output, *QUICK, "--prune")["removed"] == [
        "below/m1",
        "below/m3",
        "m0",
    ]
    check_library(output, ["m2"])
    assert not (output / "below").exists()


def test_what_a_folder_that_cannot_be_read_may_hold_is_not_gone(library, monkeypatch):
    folder, output = library
    listed = os.listdir

    def refused(path):
        if Path(path).name == "below":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return listed(path)

    monkeypatch.setattr(os, "listdir", refused)
    report, _, failed = built(folder, output, prune=True)
    assert failed == [f"{folder / 'below'}: cannot be read (Permission denied)"]
    assert (report.gone, report.removed) == ([], [])
    check_library(output, ["m0", "m2", "below/m1", "below/m3"])


def test_a_material_that_fails_stops_no_other(capsys, tmp_path):
    folder, output = sources(tmp_path / "in", 2), tmp_path / "out"
    (folder / "bad.binary").write_bytes(b"no table")
    (folder / "notes.txt").write_text("no material")
    status, out, err = run(capsys, "library", "build", folder, "-o", output, *QUICK, "--json")
    told = f"{folder / 'bad.binary'}: expected a MERL header of 12 bytes, found 8"
    total = "IN: expected to compress 3 materials, found 1 that failed"
    assert (status, err) == (1, f"error: {told}\nerror: {total}\n")
    answer = json.loads(out)
    assert (answer["made"], answer["kept"], answer["failed"]) == (2, 0, 1)
    assert answer["materials"][-1] == {"input": str(folder / "bad.binary"), "error": told}
    assert answer["bytes_before"] == sum(each["bytes_source"] for each in answer["materials"][:-1])
    assert answer["ratio"] == answer["bytes_before"] / answer["bytes_after"]
    soft = [each["psnr_soft_db"] for each in answer["materials"][:-1]]
    assert answer["quality"]["psnr_soft_db"]["mean"] == pytest.approx(sum(soft) / 2)
    assert answer["quality"]["psnr_soft_db"]["worst"] == min(soft)
    check_library(output, ["m0", "below/m1"])
    (folder / "bad.binary").unlink()
    status, out, err = run(capsys, "library", "build", folder, "-o", output, *QUICK)
    assert (status, err) == (0, "")
    assert "2 there already" in out


def check_same_bytes(one, other):
    assert contents(one) == contents(other)


def test_the_same_bytes_by_any_number_of_processes(capsys, library, tmp_path):
    """Also those that `compress` writes."""
    folder, output = library
    for jobs in (1, 2):
        made = run_json(capsys, "library", "build", folder, "-o", tmp_path / str(jobs), *QUICK, "--jobs", jobs)
        assert made["made"] == 4
        check_same_bytes(tmp_path / str(jobs), output)
    single = tmp_path / "single.smrl"
    run_json(capsys, "compress", folder / "m0.smrl", "-o", single, *QUICK)
    assert single.read_bytes() == (output / "m0.smrl").read_bytes()
    single.replace(output / "m2.smrl")
    must_fail(check_same_bytes, tmp_path / "1", output)


def check_shards(parts, whole):
    assert sorted(name for part in parts for name in part) == sorted(whole)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_shards_are_all_together_the_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(building, "work", made_up)
    folder, output = sources(tmp_path / "in", 5), tmp_path / "out"
    built(folder, output)
    parts = [names(built(folder, tmp_path / "parts", shard=Shard(i, 3))[0].made) for i in (2, 1, 3)]
    check_shards(parts, records(output))
    check_same_bytes(tmp_path / "parts", output)
    many = [Material(f"m{i}", "", "", "", ()) for i in range(1001)]
    for count in (1, 2, 7, 2000):
        parts = [[each.name for each in part(many, Shard(i, count))] for i in range(1, count + 1)]
        check_shards(parts, [each.name for each in many])
        must_fail(check_shards, [*parts, ["m1"]], [each.name for each in many])


@pytest.mark.parametrize("text", ["0/4", "5/4", "1", "1/0", "-1/4", "a/b", "1/4/2", "9999999/9999999"])
def test_shards_that_there_are_not(capsys, tmp_path, text):
    status, _, err = run(capsys, "library", "build", tmp_path, "-o", tmp_path / "out", f"--shard={text}")
    assert status == 2
    assert err.startswith("error: --shard: expected I/N")
    assert not (tmp_path / "out").exists()


def npz(path, **arrays):
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **arrays)


def test_files_that_hold_many_and_materials_in_many_files(tmp_path, monkeypatch):
    """Of an archive each material, of six arrays of one material one; names that are no paths are made some."""
    weights = 0.1 * np.random.default_rng(0).standard_normal((3, WEIGHTS))
    npz(tmp_path / "in" / "a" / "many.npz", gold=weights[0], **{"../evil": weights[1], "x:y": weights[2]})
    npz(tmp_path / "in" / "one.npz", only=weights[0])
    shapes = {"fc1": (6, 21), "b1": (21,), "fc2": (21, 21), "b2": (21,), "fc3": (21, 3), "b3": (3,)}
    for name, shape in shapes.items():
        np.save(tmp_path / "in" / f"six_{name}.npy", np.zeros(shape))
    np.save(tmp_path / "in" / "other_fc1.npy", np.zeros((6, 21)))  # five are missing
    monkeypatch.setattr(building, "work", made_up)
    report, _, failed = built(tmp_path / "in", tmp_path / "out")
    found = {record.name: record.file for record in report.made}
    assert found == {
        "a/many:../evil": "a/many/%2E.%2Fevil.smrl",
        "a/many:gold": "a/many/gold.smrl",
        "a/many:x:y": "a/many/x%3Ay.smrl",
        "one": "one.smrl",
        "six_fc1": "six_fc1.smrl",
        "other_fc1": "other_fc1.smrl",
    }
    assert failed == []
    for record in report.made:
        if record.name != "other_fc1":
            assert load(tmp_path / "in" / record.source)
    np.save(tmp_path / "in" / "six_b3.npy", np.ones(3))
    check_done(built(tmp_path / "in", tmp_path / "out")[0], ["six_fc1"], sorted(found.keys() - {"six_fc1"}))


MADE_UP = []


def made_up(job):
    """A result without work, of a job whose file is there."""
    from sommerl.library.sources import content
    from sommerl.library.traits import Traits
    from sommerl.library.work import Made

    if not MADE_UP:
        MADE_UP.append((Path(__file__).parents[1] / "golden" / "nodes.smrl").read_bytes())
    size, digest = content(job.parts)
    return Made(MADE_UP[0], size, digest, {"psnr_soft_db": 50.0}, Traits((0.5, 0.5, 0.5), 0.5, 0.0))


def check_refused(folder, output, part_of_sentence):
    assert part_of_sentence in (complaint(built, folder, output) or "")


def test_two_sources_of_one_name_are_refused_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(building, "work", None)
    for one, other in (("a/x.binary", "a/x.csv"), ("a/x.binary", "a/X.binary")):
        folder = tmp_path / other.replace("/", "-")
        for name in (one, other):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(b"\0")
        check_refused(folder, tmp_path / "out", "expected a name for each material, found two that would be a/x.smrl: ")
        assert not (tmp_path / "out").exists()
    must_fail(check_refused, sources(tmp_path / "in", 1), tmp_path, "expected a name for each")


def test_folders_that_cannot_be_used(tmp_path):
    folder = sources(tmp_path / "in", 1)
    check_refused(folder, folder, "does not hold the sources")
    check_refused(folder, tmp_path, "does not hold the sources")
    check_refused(tmp_path / "missing", tmp_path / "out", "expected a folder of materials")
    (tmp_path / "empty").mkdir()
    check_refused(tmp_path / "empty", tmp_path / "out", "found none in it")
    assert not (tmp_path / "out").exists()


def test_a_library_within_its_sources_is_no_source(tmp_path):
    folder = sources(tmp_path / "in", 2)
    assert names(built(folder, folder / "library")[0].made) == ["below/m1", "m0"]
    assert names(built(folder, folder / "library")[0].kept) == ["below/m1", "m0"]


def test_links_and_what_is_hidden(tmp_path, monkeypatch):
    monkeypatch.setattr(building, "work", made_up)
    folder, elsewhere = sources(tmp_path / "in", 2), sources(tmp_path / "elsewhere", 1)
    (folder / "linked").symlink_to(elsewhere)
    (folder / "below" / "loop").symlink_to(folder)
    (folder / "broken.binary").symlink_to(tmp_path / "missing")
    source(folder / ".hidden" / "x.smrl")
    source(folder / ".y.smrl")
    os.mkfifo(folder / "pipe.binary")
    report, warned, failed = built(folder, tmp_path / "out")
    assert names(report.made) == ["below/m1", "linked/m0", "m0"]
    assert warned == [
        f"{folder / 'below' / 'loop'}: expected a folder, found a link back to one that it is in; it is passed over"
    ]
    assert sorted(failed) == [
        f"{folder / 'broken.binary'}: there is no such file",
        f"{folder / 'pipe.binary'}: expected a file, found a pipe",
    ]


def check_full_disk(capsys, folder, output, monkeypatch, full_at):
    """The second material finds the disk full: one sentence, and a library with the first."""
    written = []

    @contextmanager
    def full(path):
        written.append(path)
        with files.atomic_write(path) as out:
            yield out
            if len(written) == full_at:
                raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(building, "atomic_write", full)
        patch.setattr(building, "work", made_up)
        patch.setattr(library_build, "_engine", lambda options: HERE)
        status, _, err = run(capsys, "library", "build", folder, "-o", output, *QUICK)
    assert (status, err) == (1, f"error: {written[-1]}: cannot be written (No space left on device)\n")
    assert len(written) == full_at


def test_a_full_disk_is_one_sentence(capsys, tmp_path, monkeypatch):
    folder, output = sources(tmp_path / "in", 3), tmp_path / "out"
    check_full_disk(capsys, folder, output, monkeypatch, 2)
    assert len(records(output)) == 1
    check_library(output, list(records(output)))
    monkeypatch.setattr(building, "work", made_up)
    assert len(built(folder, output)[0].made) == 2
    check_library(output, ["m0", "m2", "below/m1"])
    monkeypatch.setattr(building, "HOPELESS", ())
    must_fail(check_full_disk, capsys, folder, tmp_path / "other", monkeypatch, 2)


def test_what_is_no_material_of_ours_is_not_replaced(capsys, tmp_path, monkeypatch):
    folder, output = sources(tmp_path / "in", 2), tmp_path / "out"
    output.mkdir()
    (output / "m0.smrl").write_text("my own notes")
    monkeypatch.setattr(library_build, "_engine", lambda options: HERE)
    status, _, err = run(capsys, "library", "build", folder, "-o", output, *QUICK)
    assert status == 1
    assert err.startswith(f"error: {output / 'm0.smrl'}: there is already a file of this name")
    assert (output / "m0.smrl").read_text() == "my own notes"
    assert list(records(output)) == ["below/m1"]
    assert run(capsys, "library", "build", folder, "-o", output, *QUICK, "--overwrite")[0] == 0
    check_library(output, ["m0", "below/m1"])


class Fragile(Executor):
    """Breaks at one job, and is then of no use: as a pool of processes, one of which is killed."""

    def __init__(self, culprit):
        self._culprit, self._broken = culprit, False

    def submit(self, work, job):
        future = Future()
        self._broken = self._broken or job.path.endswith(self._culprit)
        future.set_exception(BrokenExecutor()) if self._broken else future.set_result(work(job))
        return future


def test_a_process_that_dies_takes_no_other_material_with_it(tmp_path, monkeypatch):
    monkeypatch.setattr(building, "work", made_up)
    folder = sources(tmp_path / "in", 6)
    opened = []

    @contextmanager
    def fragile():
        opened.append(1)
        yield Fragile("m2.smrl")

    report, _, failed = built(folder, tmp_path / "out", engine=Engine(fragile, 3))
    assert sorted(names(report.made)) == ["below/m1", "below/m3", "below/m5", "m0", "m4"]
    assert failed == [
        f"{folder / 'm2.smrl'}: expected a process to compress it, found it killed, again and again; "
        "is there enough memory?"
    ]
    assert len(opened) > 2


def test_a_source_that_changes_meanwhile_is_told(tmp_path, monkeypatch):
    from sommerl.library import work

    folder = sources(tmp_path / "in", 1)

    def changed(path):
        found = load(path)
        source(Path(path), seed=5)
        return found

    monkeypatch.setattr(work, "load", changed)
    assert "changed while it was read" in built(folder, tmp_path / "out")[2][0]
    assert list(records(tmp_path / "out")) == []


def test_an_error_that_nobody_thought_of_is_one_material_s(tmp_path, monkeypatch):
    def failing(job):
        if "m0" in job.path:
            raise KeyError("key")
        return made_up(job)

    monkeypatch.setattr(building, "work", failing)
    report, _, failed = built(sources(tmp_path / "in", 2), tmp_path / "out")
    assert names(report.made) == ["below/m1"]
    assert failed == [
        f"{tmp_path / 'in' / 'm0.smrl'}: something went wrong that Sommerl did not expect: KeyError ('key')"
    ]


def test_method_is_noted(tmp_path):
    one = Method(sommerl.TrainOptions()).noted()
    assert one["preset"] == "paper"
    assert one != replace(METHOD, reciprocal=True).noted()
