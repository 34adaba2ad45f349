"""Builds by Dask's distributed scheduler: a real one and real workers, on this machine, one of which is killed."""

import json
import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest
from helpers import must_fail, run
from libraries import QUICK, built, contents, sources, started

from sommerl.library import engines
from sommerl.library.verify import verify


class Cluster:
    """A scheduler, and workers by their processes."""

    def __init__(self, folder, stack):
        self._file, self._stack, self.workers = folder / "scheduler.json", stack, []
        self.scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-jupyter"
        )
        while not self._file.exists():
            time.sleep(0.05)
        self.address = json.loads(self._file.read_text())["address"]

    def add_worker(self):
        options = "--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60"
        self.workers.append(self._start("worker", *options))

    def _start(self, what, *options):
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", self._file, *options]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        return process


@pytest.fixture
def cluster(tmp_path):
    with ExitStack() as stack:
        made = Cluster(tmp_path, stack)
        for _ in range(2):
            made.add_worker()
        yield made


def check_same(output, other):
    assert contents(output) == contents(other)


def test_a_cluster_builds_the_same_also_if_a_worker_is_killed(cluster, tmp_path, monkeypatch):
    monkeypatch.setenv("SOMMERL_THREADS", "1")
    folder, output = sources(tmp_path / "in", 6), tmp_path / "out"
    process = started("library", "build", folder, "-o", output, *QUICK, "--cluster", cluster.address)
    while process.poll() is None and not list(output.glob("**/*.smrl")):
        time.sleep(0.01)
    cluster.workers[0].kill()
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert "error" not in err
    assert "6 made" in out
    assert verify(output) == (6, [])
    built(folder, tmp_path / "here")
    check_same(output, tmp_path / "here")
    (output / "m0.smrl").unlink()
    must_fail(check_same, output, tmp_path / "here")


def test_a_cluster_that_is_not_there(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(engines, "CONNECTING", 0.2)
    folder = sources(tmp_path / "in", 1)
    options = "library", "build", folder, "-o", tmp_path / "out", *QUICK
    status, _, err = run(capsys, *options, "--cluster", "tcp://127.0.0.1:9")
    assert status == 2
    assert err.startswith("error: --cluster: expected Dask's scheduler at tcp://127.0.0.1:9, found none (")
    assert err.count("\n") == 1
    status, _, err = run(capsys, *options, "--cluster", "x", "--jobs", 2)
    assert status == 2
    assert "not allowed beside" in err


@pytest.mark.parametrize("dies", [True, False], ids=["scheduler", "build"])
def test_waiting_for_workers_ends_in_a_sentence(tmp_path, dies):
    """By the death of the scheduler, or an interruption."""
    with ExitStack() as stack:
        alone = Cluster(tmp_path, stack)
        folder = sources(tmp_path / "in", 1)
        process = started("library", "build", folder, "-o", tmp_path / "out", *QUICK, "--cluster", alone.address)
        assert process.stderr.readline() == (
            f"warning: {alone.address}: expected workers of Dask's scheduler, found none yet; "
            "the build waits for them\n"
        )
        if dies:
            alone.scheduler.kill()
            expected = 1, "error: cluster: expected it to go on, found its work cancelled; run again\n"
        else:
            process.send_signal(signal.SIGINT)
            expected = 130, "error: interrupted; nothing was left half-written\n"
        _, err = process.communicate(timeout=120)
        assert (process.returncode, err) == expected
