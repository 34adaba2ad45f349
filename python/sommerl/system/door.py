"""The door that files come in by: readers get bytes, and open nothing themselves.

A file is opened once, without waiting, and has to be a regular one: nobody waits for a pipe, and no device is read. Of
what it holds, at most one byte more than its reader takes is read, whatever the system says of its length. All that is
said of it, its digest too, is of these bytes: it does not matter who changes it meanwhile.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from io import FileIO
from pathlib import Path

from .errors import FormatError

HEAD_BYTES = 4096
STEP = 2**20  # bytes that are read at once of a file that is longer than it says
KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
WITHOUT_WAITING: int = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)


class File:
    """An open file. head: its first bytes, HEAD_BYTES at most."""

    def __init__(self, path: Path, stream: FileIO) -> None:
        self.path, self._stream = path, stream
        self.head = stream.read(HEAD_BYTES) or b""

    def read(self, most: int) -> bytes:
        """All of it. Raises FormatError if it is longer than `most` bytes, or cannot be read; to be called once."""
        with _told(self.path):
            length = os.fstat(self._stream.fileno()).st_size
            if length > most:
                raise FormatError(f"{self.path}: expected at most {most} bytes, found {length}")
            parts, size = [self.head], len(self.head)
            while size <= most:  # it may have grown, or be one of those that say that they are empty
                wanted = length + 1 - size if size <= length else min(STEP, most + 1 - size)
                part = self._stream.read(wanted) or b""
                if not part:
                    return b"".join(parts)
                parts.append(part)
                size += len(part)
        raise FormatError(f"{self.path}: expected at most {most} bytes, found more")


@contextmanager
def opened(path: str | Path, what: str = "a file") -> Generator[File]:
    """A file to read. what: a reader takes, for people. Raises FormatError if it is not there, no regular file, or
    cannot be read."""
    path = Path(path)

    def opener(name: str, flags: int) -> int:
        handle = os.open(name, flags | WITHOUT_WAITING)
        kind = stat.S_IFMT(os.fstat(handle).st_mode)
        if kind != stat.S_IFREG:
            os.close(handle)
            raise FormatError(f"{path}: expected {what}, found {KINDS.get(kind, 'something else')}")
        return handle

    with ExitStack() as stack:
        with _told(path, what):
            stream = stack.enter_context(FileIO(path, opener=opener))
            file = File(path, stream)
        yield file


def read(path: str | Path, most: int, what: str = "a file") -> bytes:
    """The bytes of a file of at most `most`. Raises FormatError, as `opened` does."""
    with opened(path, what) as file:
        return file.read(most)


@contextmanager
def copied(data: bytes, suffix: str) -> Generator[Path]:
    """A file of our own with these bytes, for readers that take nothing but a file; it is gone afterwards."""
    with ExitStack() as stack:
        try:
            path = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="sommerl-"))) / f"copy{suffix}"
            path.write_bytes(data)
        except OSError as error:
            raise FormatError(f"{tempfile.gettempdir()}: cannot be written ({error.strerror or error})") from error
        yield path


@contextmanager
def _told(path: Path, what: str = "a file") -> Generator[None]:
    """Says in one sentence what the system says."""
    try:
        yield
    except FileNotFoundError as error:
        raise FormatError(f"{path}: expected {what}, found none") from error
    except (OSError, ValueError) as error:  # the latter for names that no file can have
        raise FormatError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
