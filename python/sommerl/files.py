"""Writing files so that none is ever half-written."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def atomic_write(path: Path) -> Generator[BinaryIO]:
    """A file to write to that takes the name `path` when, and only when, the block ends without an error.

    Raises OSError if it cannot be written; whatever had that name before is then still there.
    """
    path = Path(os.path.realpath(path))  # a link stays a link
    with _named(path):
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".sommerl-")
    try:
        with _named(path), os.fdopen(handle, "wb") as out:
            yield out
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)  # mkstemp makes files that only their owner can read
        with _named(path):
            os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def check_writable(path: Path) -> None:
    """Raises OSError now if a file of that name could not be written later, after long work."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "expected a file to write, found a directory", str(path))
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, f"cannot be written: there is no folder {path.parent}", str(path))
    with _named(path), tempfile.TemporaryFile(dir=path.parent):
        pass


@contextmanager
def _named(path: Path) -> Generator[None]:
    """Errors speak of the file that was meant, not of a temporary one."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"cannot be written ({error.strerror})", str(path)) from error
