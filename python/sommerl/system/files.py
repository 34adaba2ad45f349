"""Writing files: none is ever half-written, and none that is somebody else's is lost.

A command (`keeping`) replaces what Sommerl wrote, which carries a mark (`MARKS`), and nothing else: no file of a
measured format and none without such a mark, unless it is told to. As a library, Sommerl replaces any file, as
`numpy.save` does.
"""

from __future__ import annotations

import errno
import hashlib
import io
import os
import re
import stat
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from .errors import OptionError
from .interrupt import temporaries, undisturbed

if sys.platform != "win32":
    import fcntl

# How files that Sommerl writes begin, and what else is in their first or last bytes, as a pattern. A format that is
# added to those that are written has its line here.
MARKS: tuple[tuple[bytes, bytes], ...] = (
    (b"SMRL", b""),
    (b"FBRD", b""),
    (b"SMRP", b""),
    (b"\x89PNG\r\n\x1a\n", rb'tEXtSoftware\0"?Sommerl'),
    (b"v/1\x01", rb"Software\0string\0\x07\0\0\0Sommerl"),
    (b"%PDF-", rb"/Creator \(Sommerl\)"),
    (b"<?xml ", rb"<dc:title>Sommerl</dc:title>"),
    (b"<!doctype html>", rb'<meta name="generator" content="Sommerl">'),
    (b"<scene ", rb"<!-- Written by Sommerl"),
    (b"// ", rb"\A// [^\n]*\n// Written by Sommerl"),
    (b"{", rb'\A\{\s*"sommerl_fits"'),
    (b"{", rb'\A\{\s*"comment": "Written by Sommerl\.'),
    # The tables of `paper` have no place for a mark, but heads of their own.
    (b"material,model,error,error_som_man,paper,paper_som_man\n", b""),
    (b"model,psnr_frame_db,psnr_object_db,paper_db\n", b""),
)
LOOKED_AT = 2**14  # bytes at either end
# Of these formats, there is no telling whether a file was measured or made.
MEASURED = (".binary", ".bsdf", ".brdf", ".npy", ".npz", ".h5", ".hdf5")

_replacing: ContextVar[bool] = ContextVar("replacing", default=True)


@contextmanager
def keeping(*, overwrite: bool) -> Generator[None]:
    """Within the block, only files that Sommerl wrote are replaced, unless `overwrite`."""
    before = _replacing.set(overwrite)
    try:
        yield
    finally:
        _replacing.reset(before)


@contextmanager
def atomic_write(path: Path) -> Generator[BinaryIO]:
    """A file to write to that takes the name `path` when, and only when, the block ends without an error.

    A file that had the name before is replaced then, and hands on its mode. A pipe or a device is written to instead.
    Raises OSError if it cannot be written, and OptionError if a command is to keep what has that name by then; that is
    then still there.
    """
    target = _target(path)
    if target is None:
        content = io.BytesIO()
        yield content
        with _named(path), path.open("wb") as out:
            out.write(content.getvalue())
        return
    remove_left_over(target)
    temporary = None
    try:
        with _named(target):
            with undisturbed():
                temporary = _opened(target)
            yield temporary.out
            temporary.out.flush()
            os.fsync(temporary.out.fileno())  # a disk that is full may say so this late
        with undisturbed():
            if _target(path) != target:
                raise OSError(errno.EEXIST, "cannot be written (something else has taken its name)", str(path))
            temporary.take_place(target)
    finally:
        if temporary:
            with undisturbed():
                temporary.discard()


def check_writable(path: Path) -> None:
    """Raises now what writing a file of that name would raise later, after long work: OSError, OptionError.

    Temporary files that killed runs left beside it are removed.
    """
    target = _target(path)
    if target is None:
        if not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, "cannot be written (Permission denied)", str(path))
        return
    if not target.parent.is_dir():
        folder = target.parent if path.is_symlink() else path.parent  # as typed
        raise FileNotFoundError(errno.ENOENT, f"cannot be written: there is no folder {folder}", str(path))
    remove_left_over(target)
    with _named(target), tempfile.TemporaryFile(dir=target.parent):
        pass


def remove_left_over(path: Path) -> None:
    """Removes the temporary files of runs that were killed while they wrote a file of that name."""
    path = Path(os.path.realpath(path))
    try:
        left = [entry.path for entry in os.scandir(path.parent) if entry.name.startswith(_prefix(path))]
    except OSError:
        return
    for temporary in left:
        _remove_if_left(temporary)


def _target(path: Path) -> Path | None:
    """The file that is to be written for a name: where links lead. None for a pipe or a device, which has no content to
    replace. Raises OSError or OptionError for what cannot be written or is to be kept."""
    target = Path(os.path.realpath(path))  # a link stays a link
    try:
        with _named(path):
            found = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return target
    if stat.S_ISFIFO(found.st_mode) or stat.S_ISCHR(found.st_mode):
        return None
    if not stat.S_ISREG(found.st_mode):
        kinds = {stat.S_IFDIR: "directory", stat.S_IFSOCK: "socket", stat.S_IFBLK: "block device"}
        kind = kinds.get(stat.S_IFMT(found.st_mode), "thing of another kind")
        code = errno.EISDIR if kind == "directory" else errno.EINVAL
        raise OSError(code, f"expected a file to write, found a {kind}", str(path))
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, "cannot be written (Permission denied)", str(path))
    if found.st_size and not _replacing.get():
        if any(name.suffix.lower() in MEASURED for name in (path, target)):
            raise OptionError(
                f"{path}: expected a new name, found a file of a measured format; --overwrite replaces it"
            )
        if not _ours(path):
            raise OptionError(
                f"{path}: expected a new name or a file that Sommerl wrote, found another file; --overwrite replaces it"
            )
    return target


def _ours(path: Path) -> bool:
    """Whether a file carries the mark of one that Sommerl wrote."""
    try:
        with path.open("rb") as file:
            head = file.read(LOOKED_AT)
            file.seek(max(file.tell(), os.fstat(file.fileno()).st_size - LOOKED_AT))
            ends = head + file.read(LOOKED_AT)
    except OSError:
        return False
    return any(head.startswith(start) and re.search(mark, ends) for start, mark in MARKS)


@dataclass
class _Temporary:
    """A file under another name. It is locked for as long as it is open: one that is not was left by a killed run."""

    out: BinaryIO
    path: str

    def take_place(self, target: Path) -> None:
        """Takes the name, and the mode of the file that had it; that of a new one is what the umask leaves."""
        try:
            mode = stat.S_IMODE(target.stat().st_mode)
        except FileNotFoundError:
            umask = os.umask(0)
            os.umask(umask)
            mode = 0o666 & ~umask  # mkstemp makes files that only their owner can read
        with _named(target):
            os.chmod(self.path, mode)
            if sys.platform == "win32":
                self.out.close()
            os.replace(self.path, target)
        temporaries.discard(self.path)

    def discard(self) -> None:
        """Closes the file, and removes it unless it has taken its name."""
        with suppress(OSError):
            self.out.close()  # what could not be written is tried once more
        if self.path in temporaries:
            with suppress(OSError):
                os.unlink(self.path)
            temporaries.discard(self.path)


def _opened(target: Path) -> _Temporary:
    while True:
        handle, path = tempfile.mkstemp(dir=target.parent, prefix=_prefix(target))
        temporaries.add(path)
        _lock(handle)
        if os.path.exists(path):
            return _Temporary(os.fdopen(handle, "wb"), path)
        os.close(handle)  # before it was locked, another run took it for one that was left
        temporaries.discard(path)


def _prefix(target: Path) -> str:
    """How the names of temporary files for a target begin: of the same length for the longest names."""
    return f".sommerl-{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:16]}-"


def _lock(handle: int) -> None:
    """Locks a file for as long as it is open, where there are locks."""
    if sys.platform != "win32":
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)


def _remove_if_left(temporary: str) -> None:
    """Removes a temporary file that nobody has open."""
    with suppress(OSError):  # somebody has, or has removed it, or it is not ours to remove
        if sys.platform == "win32":
            os.unlink(temporary)  # which fails for one that is open
            return
        handle = os.open(temporary, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.unlink(temporary)
        finally:
            os.close(handle)


@contextmanager
def _named(path: Path) -> Generator[None]:
    """Errors speak of the file that was meant, not of a temporary one."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"cannot be written ({error.strerror})", str(path)) from error
