"""Opening and reading input files. Readers of formats get bytes from here, and open no files themselves.

Only regular files are read: a pipe could make us wait for ever, and a device may have no end. A file is opened once and
read once, so that its SHA-256 and its contents are of the same bytes even if somebody changes it meanwhile. Each reader
says how long its files may be; at most one byte more than that is read, whatever length the system reports.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from io import FileIO
from pathlib import Path
from threading import Lock

from .errors import FormatError

HEAD_BYTES = 4096
STEP = 2**20  # bytes read at a time once a file has turned out longer than the system said
KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
# Opening a pipe would otherwise wait for a writer, and opening a terminal could make it ours.
WITHOUT_WAITING: int = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)


class File:
    """An open file. head: its first bytes, at most HEAD_BYTES, from which formats are recognised."""

    def __init__(self, path: Path, stream: FileIO) -> None:
        self.path, self._stream = path, stream
        self.head = stream.read(HEAD_BYTES) or b""
        self._turn = Lock()  # the stream has one place

    @property
    def length(self) -> int:
        """What the system says of the file's length [bytes]."""
        return os.fstat(self._stream.fileno()).st_size

    def part(self, start: int, count: int) -> bytes:
        """So many bytes from a place on, or as many as there are; threads may ask at the same time.

        Files are not mapped into memory: reading what somebody else cuts off meanwhile would end the process. Raises
        FormatError if the file cannot be read.
        """
        end = start + count
        if end <= len(self.head):
            return self.head[start:end]
        known = self.head[start:]
        with self._turn, _readable(self.path):
            self._stream.seek(start + len(known))
            parts, missing = [known], count - len(known)
            while missing and (part := self._stream.read(min(missing, STEP))):
                parts.append(part)
                missing -= len(part)
        return b"".join(parts)

    def read(self, most: int) -> bytes:
        """The whole content. Call it once. Raises FormatError if it is longer than `most` bytes or cannot be read."""
        with _readable(self.path):
            length = self.length
            if length > most:
                raise FormatError(f"{self.path}: expected at most {most} bytes, found {length}")
            parts, size = [self.head], len(self.head)
            while size <= most:  # the file may have grown; some files of the system report a length of 0
                wanted = length + 1 - size if size <= length else min(STEP, most + 1 - size)
                part = self._stream.read(wanted) or b""
                if not part:
                    return b"".join(parts)
                parts.append(part)
                size += len(part)
        raise FormatError(f"{self.path}: expected at most {most} bytes, found more")


@contextmanager
def opened(path: str | Path, what: str = "a file") -> Generator[File]:
    """Opens a file for reading. what: the kind of file that is needed, for the error message.

    Raises FormatError if the file does not exist, is not a regular file, or cannot be read.
    """
    path = Path(path)

    def opener(name: str, flags: int) -> int:
        handle = os.open(name, flags | WITHOUT_WAITING)
        kind = stat.S_IFMT(os.fstat(handle).st_mode)
        if kind != stat.S_IFREG:
            os.close(handle)
            raise FormatError(f"{path}: expected {what}, found {KINDS.get(kind, 'something else')}")
        return handle

    with ExitStack() as stack:
        with _readable(path):
            stream = stack.enter_context(FileIO(path, opener=opener))
            file = File(path, stream)
        yield file


def read(path: str | Path, most: int, what: str = "a file") -> bytes:
    """The bytes of a file. Raises FormatError if there are more than `most`, and where `opened` does."""
    with opened(path, what) as file:
        return file.read(most)


@contextmanager
def copied(data: bytes, suffix: str) -> Generator[Path]:
    """The path of a temporary file with these bytes, for libraries that can read only files. Removed afterwards."""
    with ExitStack() as stack:
        try:
            path = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="sommerl-"))) / f"copy{suffix}"
            path.write_bytes(data)
        except OSError as error:
            raise FormatError(f"{tempfile.gettempdir()}: cannot be written ({error.strerror or error})") from error
        yield path


@contextmanager
def _readable(path: Path) -> Generator[None]:
    """Turns errors of the system into a FormatError that names the file."""
    try:
        yield
    except FileNotFoundError as error:
        raise FormatError(f"{path}: there is no such file") from error
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have, as with a zero byte
        raise FormatError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
