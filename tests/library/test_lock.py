"""Builds that would write the same materials exclude each other, also where owners die."""

import errno
import multiprocessing
import os
import signal
import socket
from contextlib import ExitStack, suppress

import pytest
from helpers import PATIENCE, must_fail

from sommerl.library import lock
from sommerl.library.lock import WHOLE, Shard, locked
from sommerl.system.errors import MaterialError

SPAWN = multiprocessing.get_context("spawn")


def hold(folder, shard, pipe):
    with locked(folder, shard, print):
        pipe.send("ready")
        with suppress(EOFError):
            pipe.recv()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / ".sommerl").mkdir()
    return tmp_path


@pytest.fixture
def holder(folder):
    """Starts a process that holds a lock until it is killed, or the pipe to it is closed. An event would not do: to set
    one is to wait for whoever sleeps at it, and a process that was killed in its sleep never answers."""
    with ExitStack() as stack:

        def start(shard):
            pipe, other_end = SPAWN.Pipe()
            process = SPAWN.Process(target=hold, args=(folder, shard, other_end))
            process.start()
            stack.callback(process.join)
            stack.callback(pipe.close)
            other_end.close()
            assert pipe.poll(60)
            assert pipe.recv() == "ready"
            return process, pipe

        yield start


def check_refused(folder, shard, sentence):
    try:
        with locked(folder, shard, print):
            found = None
    except MaterialError as error:
        found = str(error)
    assert found == sentence


def test_who_is_at_work_is_named_and_the_dead_are_not_waited_for(folder, holder):
    process, _ = holder(WHOLE)
    host = f"process {process.pid} on {socket.gethostname()} at work"
    sentence = f"{folder}: expected no other build in it, found {host}; wait for it, or stop it"
    check_refused(folder, WHOLE, sentence)
    check_refused(folder, Shard(2, 3), sentence)
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    assert list(folder.glob(".sommerl/owner-*"))  # it could not take its name away
    must_fail(check_refused, folder, WHOLE, sentence)
    assert not list(folder.glob(".sommerl/owner-*"))


def test_shards_work_side_by_side(folder, holder):
    process, pipe = holder(Shard(2, 4))
    named = f"process {process.pid} on {socket.gethostname()} at work with shard 2/4"
    sentence = f"{folder}: expected no other build in it, found {named}; wait for it, or stop it"
    for other in (WHOLE, Shard(2, 4), Shard(1, 2), Shard(1, 3), Shard(5, 16)):
        check_refused(folder, other, sentence)
    for other in (Shard(1, 4), Shard(3, 4), Shard(2, 2), Shard(1, 7), Shard(5, 8)):
        with locked(folder, other, print) as ours:
            assert not ours.widened()
    must_fail(check_refused, folder, Shard(1, 4), sentence)
    pipe.close()
    process.join()
    with locked(folder, Shard(1, 4), print) as ours:
        assert ours.widened()


def race(folder, start, results):
    """Takes the lock, if it can, and looks whether somebody else has it, too."""
    start.wait()
    try:
        with locked(folder, WHOLE, print):
            handle = os.open(folder / "held", os.O_CREAT | os.O_EXCL)
            os.close(handle)
            start.wait()
            os.unlink(folder / "held")
        results.put("had it")
    except MaterialError:
        start.wait()
        results.put("refused")


def test_a_dead_owner_s_lock_is_taken_by_one_alone(folder, holder):
    process, _ = holder(WHOLE)
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    start, results = SPAWN.Barrier(3, timeout=PATIENCE), SPAWN.Queue()
    racers = [SPAWN.Process(target=race, args=(folder, start, results)) for _ in range(3)]
    for racer in racers:
        racer.start()
    found = sorted(results.get(timeout=PATIENCE) for _ in racers)
    for racer in racers:
        racer.join()
    assert found == ["had it", "refused", "refused"]


def test_a_disk_without_locks_is_told(folder, monkeypatch):
    def refused(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock.fcntl, "lockf", refused)
    told = []
    with locked(folder, WHOLE, told.append) as without:
        assert told == [
            f"{folder}: expected a file system with locks, found none: see to it that no other build writes here"
        ]
        assert without.widened()  # and no error at the end of a build, which would leave it without an index
        with pytest.raises(OSError, match="No locks"):
            lock.Lock(0, works=True).widened()
