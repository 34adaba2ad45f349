"""Which builds may write into a library's folder at the same time.

A build, or a shard of one, locks a range of `.sommerl/lock`: shard I of N the I-th of N equal parts, a build of its own
the whole. So shards run side by side, and whatever would write the same materials is refused, also shards of different
numbers. The ranges are POSIX record locks (fcntl), and not files with a process's number: the kernel gives a lock back
the moment its process ends, however it ends, so nobody has to guess whether an owner is alive, and no two take over the
same lock; and network file systems such as NFS have them between machines, where the number of a process says nothing.
Who holds a range is written beside it, for messages alone. On Windows, which has no such locks, there is none.
"""

from __future__ import annotations

import errno
import os
import re
import socket
import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from ..system import door
from ..system.errors import MaterialError, OptionError, SommerlError
from ..system.files import atomic_write, replacing_files
from ..system.visible import visible
from .index import INSIDE
from .record import parsed, written

if sys.platform != "win32":
    import fcntl

SPACE = 2**62  # bytes of the range of a whole build; the file itself is empty
MOST_SHARDS = 10**6
PATIENCE = 1.0  # seconds that a new owner has to write who it is
LARGEST_OWNER = 2**12  # bytes
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


@dataclass(frozen=True)
class Shard:
    """A part of a build: `number` of `count`, the first being 1. Raises OptionError for others."""

    number: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count <= MOST_SHARDS:
            raise OptionError(f"shard: expected I/N with I from 1 to N, found {self}")

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def part(self, of: int) -> range:
        """Its part of so many things in a row."""
        return range((self.number - 1) * of // self.count, self.number * of // self.count)


WHOLE = Shard()


class Lock:
    """The part of a library's folder that this process may write."""

    def __init__(self, handle: int, *, works: bool) -> None:
        self._handle, self._works = handle, works

    def widened(self) -> bool:
        """Whether nobody else is building; if so, nobody else can begin until the lock is given back. Where the file
        system has no locks, nobody is known to be, and whoever builds has been told to see to it."""
        return not self._works or _taken(self._handle, WHOLE)


@contextmanager
def locked(folder: Path, shard: Shard, warn: Callable[[str], None]) -> Generator[Lock]:
    """Within the block, nobody else writes what a shard of a build does.

    folder: the library's, with INSIDE in it. warn: called if the file system has no locks.
    Raises MaterialError if somebody else is at work there, OSError if the folder cannot be written to.
    """
    path = folder / INSIDE / "lock"
    works = True
    handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
    try:
        try:
            taken = _taken(handle, shard)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise OSError(error.errno, error.strerror, str(path)) from error
            warn(f"{folder}: expected a file system with locks, found none: see to it that no other build writes here")
            taken, works = True, False
        if not taken:
            raise MaterialError(f"{folder}: expected no other build in it, found {_owner(folder, shard)}")
        own = _name_owner(folder, shard)
        try:
            yield Lock(handle, works=works)
        finally:
            with suppress(OSError):
                own.unlink()
    finally:
        os.close(handle)  # gives the lock back


def _taken(handle: int, shard: Shard) -> bool:
    """Takes the lock of a shard, if nobody else has any of it."""
    if sys.platform == "win32":
        return True
    part = shard.part(SPACE)
    try:
        fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, len(part), part.start)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            return False
        raise
    return True


def _name_owner(folder: Path, shard: Shard) -> Path:
    """Writes who holds the lock, in place of those who held it and are gone."""
    for _, path in _owners(folder, shard):
        path.unlink(missing_ok=True)
    own = folder / INSIDE / f"owner-{shard.number}-of-{shard.count}.json"
    with replacing_files(overwrite=True), atomic_write(own) as out:
        out.write(written({"host": socket.gethostname(), "pid": os.getpid()}))
    return own


def _owner(folder: Path, shard: Shard) -> str:
    """Who holds a part of a shard's lock, for people."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        for other, path in _owners(folder, shard):
            try:
                said = parsed(door.read(path, LARGEST_OWNER))
            except SommerlError:
                continue
            about = cast(dict[str, Any], said) if isinstance(said, dict) else {}
            process = f"process {visible(str(about.get('pid')), 20)} on {visible(str(about.get('host')), 100)}"
            part = "" if other == WHOLE else f" with shard {other}"
            return f"{process} at work{part}; wait for it, or stop it"
        time.sleep(0.05)
    return "a process at work that has not said which it is; wait for it"


def _owners(folder: Path, shard: Shard) -> Iterator[tuple[Shard, Path]]:
    """The shards that share materials with one, and what their owners wrote."""
    wanted = shard.part(SPACE)
    for path in sorted((folder / INSIDE).glob("owner-*.json")):
        numbers = re.fullmatch(r"owner-(\d{1,7})-of-(\d{1,7})", path.stem)
        with suppress(OptionError):
            if numbers:
                other = Shard(*map(int, numbers.groups()))
                part = other.part(SPACE)
                if part.start < wanted.stop and wanted.start < part.stop:
                    yield other, path
