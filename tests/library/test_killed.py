"""Builds that are killed or interrupted: what they leave is whole, no process goes on, and the next one goes on."""

import os
import signal
import time
from pathlib import Path

import pytest
from helpers import must_fail
from libraries import QUICK, alive, built, contents, sources, started

from sommerl.library import build as building
from sommerl.library.index import records
from sommerl.library.verify import verify

BROKEN = """
import sys
from contextlib import contextmanager
from pathlib import Path
from sommerl.library import build
@contextmanager
def in_place(path):
    class Slow:
        def write(self, data):
            import time
            Path(path).write_bytes(data[:20]); time.sleep(600)
    yield Slow()
build.atomic_write = in_place
from sommerl.__main__ import main
if __name__ == "__main__":
    sys.exit(main())
"""


def waited(what):
    """Until something is so; the test's own limit of time ends what never is."""
    while not what():
        time.sleep(0.01)


def children(pid):
    return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def files(output):
    return [path for path in output.rglob("*.smrl") if ".sommerl" not in path.parent.parts]


def killed(folder, output, number, program=("-m", "sommerl")):
    """Kills a build when its first file is there; returns its processes, its exit status and what it said."""
    process = started("library", "build", folder, "-o", output, *QUICK, "--jobs", 2, program=program)
    waited(lambda: files(output) or process.poll() is not None)
    workers = children(process.pid)
    process.send_signal(number)
    _, said = process.communicate()
    return workers, process.returncode, said


def check_whole(output):
    """Whatever has a record is whole, and what has none would be read, too."""
    records(output)
    _, faults = verify(output)
    assert all(fault.sentence.endswith("expected a record of it, found none") for fault in faults)
    assert all(path.read_bytes()[-1:] and path.stat().st_size > 20 for path in files(output))


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_build_goes_on_where_it_was_stopped(tmp_path, monkeypatch, number):
    monkeypatch.setenv("SOMMERL_THREADS", "1")
    folder, output = sources(tmp_path / "in", 6), tmp_path / "out"
    workers, status, said = killed(folder, output, number)
    assert workers
    if number == signal.SIGINT:
        assert (status, said) == (130, "error: interrupted; nothing was left half-written\n")
    else:
        assert (status, said) == (-number, "")
    waited(lambda: not any(map(alive, workers)))
    check_whole(output)
    done = records(output)
    assert len(done) < 6
    (output / "below").mkdir(exist_ok=True)
    (output / "below" / ".sommerl-0123456789abcdef-abc").write_bytes(b"half")  # as a killed build may leave
    report = built(folder, output)[0]
    assert {record.name for record in report.kept} == done.keys()
    assert len(report.made) + len(report.kept) == 6
    built(folder, tmp_path / "undisturbed")
    assert contents(output) == contents(tmp_path / "undisturbed")


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_a_writer_that_is_not_whole_is_noticed(tmp_path):
    script = tmp_path / "broken.py"
    script.write_text(BROKEN)
    killed(sources(tmp_path / "in", 1), tmp_path / "out", signal.SIGKILL, (script,))
    must_fail(check_whole, tmp_path / "out")


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_a_worker_that_is_killed_costs_no_material(tmp_path):
    """As one that the system kills for its memory: what it had begun is done once more."""
    folder, output = sources(tmp_path / "in", 6), tmp_path / "out"
    process = started("library", "build", folder, "-o", output, *QUICK, "--jobs", 2)
    waited(lambda: files(output) or process.poll() is not None)
    spawned = [pid for pid in children(process.pid) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    os.kill(spawned[0], signal.SIGKILL)
    out, err = process.communicate()
    assert process.returncode == 0
    assert "error" not in err
    assert "6 made" in out
    assert verify(output) == (6, [])


def test_two_steps_of_a_material_are_in_order(tmp_path, monkeypatch):
    """A record is never there before its file: killed between both, the material is done again."""
    monkeypatch.setenv("SOMMERL_THREADS", "1")
    folder, output = sources(tmp_path / "in", 1), tmp_path / "out"

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(building.index, "write_record", interrupted)
        with pytest.raises(KeyboardInterrupt):
            built(folder, output)
    assert files(output)
    assert records(output) == {}
    assert len(built(folder, output)[0].made) == 1
    assert verify(output) == (1, [])
