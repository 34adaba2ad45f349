"""Writing files: no file is ever half-written, and commands do not overwrite files that Sommerl did not write.

Files that Sommerl writes carry a mark (`MARKS`). Within `replacing_files`, which commands use, an existing file is
replaced only if it has such a mark and is not of a format in which measurements come (`MEASURED`), unless the user asks
for it with --overwrite. As a library, Sommerl replaces any file, as `numpy.save` does.
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
from .interrupt import hold_interrupts, temporaries

if sys.platform != "win32":
    import fcntl

# Of each format that Sommerl writes: how its files begin, and a regular expression that is found in their first or last
# WITHIN bytes. Every new format needs a line here, or commands would not replace their own files.
MARKS: tuple[tuple[bytes, bytes], ...] = (
    (b"SMRL", b""),
    (b"SMLB", b""),
    (b"FBRD", b""),
    (b"SMRP", b""),
    (b"# Written by Sommerl\n", b""),
    (b"{", rb'\A\{\s*"\$schema"[^{}]*"metadata": \{[^{}]*"description": "Written by Sommerl\.'),
    (b"\x89PNG\r\n\x1a\n", rb'tEXtSoftware\0"?Sommerl'),
    (b"v/1\x01", rb"Software\0string\0\x07\0\0\0Sommerl"),
    (b"%PDF-", rb"/Creator \(Sommerl\)"),
    (b"<?xml ", rb"<dc:title>Sommerl</dc:title>"),
    (b"<!doctype html>", rb'<meta name="generator" content="Sommerl">'),
    (b"<scene ", rb"<!-- Written by Sommerl"),
    (b"// ", rb"\A// [^\n]*\n// Written by Sommerl"),
    (b"{", rb'\A\{\s*"sommerl_fits"'),
    (b"{", rb'\A\{\s*"comment": "Written by Sommerl\.'),
    (b"{", rb'\A\{\s*"sommerl_(paper|cell)"'),
    (b"<!-- ", rb"\A<!-- Written by Sommerl -->"),
    (b"# ", rb"\A# Written by Sommerl: residuals"),
    (b"<svg ", rb"<!-- Written by Sommerl -->"),
    (b"<?xml ", rb"<!-- Written by Sommerl -->"),
    (b"{", rb'\A\{\s*"asset": \{\s*"version": "2\.0",\s*"generator": "Sommerl'),
    (b"{", rb'\A\{\s*"sommerl_(texture|buffers)"'),
    (b"\xabKTX 20", rb"KTXwriter\0Sommerl"),
    (b"", rb"Written by Sommerl\Z"),  # arrays for buffers, which have no head
    (b"RIFF", rb"Sommerl"),  # WebP, whose metadata are at its end
)
WITHIN = 2**14  # bytes at the beginning and at the end of a file in which its mark is searched for
# Files of these formats may be measurements, whoever wrote them.
MEASURED = (".binary", ".bsdf", ".brdf", ".mbsdf", ".npy", ".npz", ".h5", ".hdf5")

_replacing: ContextVar[bool] = ContextVar("replacing", default=True)


@contextmanager
def replacing_files(*, overwrite: bool) -> Generator[None]:
    """Within the block, only files that Sommerl wrote may be replaced; with `overwrite`, any file."""
    before = _replacing.set(overwrite)
    try:
        yield
    finally:
        _replacing.reset(before)


@contextmanager
def atomic_write(path: Path) -> Generator[BinaryIO]:
    """A file to write to, which gets the name `path` only if the block ends without an error.

    Until then it has a temporary name in the same folder. An existing file of that name is replaced at the end, and
    the new one gets its permissions. If `path` is a pipe or a device, the bytes are written to it at the end.
    Raises OSError if the file cannot be written, and OptionError if there is a file that must not be replaced (see
    `replacing_files`), even if it has appeared in the meantime; that file stays as it is.
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
        with _named(path):
            with hold_interrupts():
                temporary = _opened(target)
            yield temporary.out
            temporary.out.flush()
            os.fsync(temporary.out.fileno())  # only now may the system report that the disk is full
        with hold_interrupts():
            if _target(path) != target:
                raise OSError(
                    errno.EEXIST, "cannot be written (another file or folder has taken its name meanwhile)", str(path)
                )
            with _named(path):
                temporary.take_place(target)
    finally:
        if temporary:
            with hold_interrupts():
                temporary.discard()


def check_writable(path: Path) -> None:
    """Raises the error (OSError or OptionError) that writing the file would raise, so that it comes before long work.

    Also removes temporary files that were left beside it by runs that were killed.
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
    with _named(path), tempfile.TemporaryFile(dir=target.parent):
        pass


def remove_left_over(path: Path) -> None:
    """Removes temporary files that were left by runs that were killed while they wrote a file of this name."""
    path = Path(os.path.realpath(path))
    try:
        left = [entry.path for entry in os.scandir(path.parent) if entry.name.startswith(_prefix(path))]
    except OSError:
        return
    for temporary in left:
        _remove_if_left(temporary)


def remove_all_left_over(folder: Path) -> None:
    """Removes temporary files that were left by runs that were killed, of any name, in a folder and all below it."""
    for place, _, names in os.walk(folder):
        for name in names:
            if re.fullmatch(r"\.sommerl-[0-9a-f]{16}-\w+", name):
                _remove_if_left(os.path.join(place, name))


def _target(path: Path) -> Path | None:
    """The file to write for a path, with symbolic links followed; None for a pipe or a character device.

    Raises OSError if it cannot be written, OptionError if there is a file that must not be replaced.
    """
    target = Path(os.path.realpath(path))  # the file that a link leads to is replaced, not the link
    try:
        with _named(path):
            found = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return target
    if stat.S_ISFIFO(found.st_mode) or stat.S_ISCHR(found.st_mode):
        return None
    if not stat.S_ISREG(found.st_mode):
        kinds = {stat.S_IFDIR: "directory", stat.S_IFSOCK: "socket", stat.S_IFBLK: "block device"}
        kind = kinds.get(stat.S_IFMT(found.st_mode), "special file")
        code = errno.EISDIR if kind == "directory" else errno.EINVAL
        raise OSError(code, f"cannot be written: it is a {kind}, not a file", str(path))
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, "cannot be written (Permission denied)", str(path))
    if found.st_size and not _replacing.get():
        if any(name.suffix.lower() in MEASURED for name in (path, target)):
            raise OptionError(
                f"{path}: there is already a file of this name, which may be a measurement: choose another name, or "
                "replace it with --overwrite"
            )
        if not _ours(path):
            raise OptionError(
                f"{path}: there is already a file of this name, which Sommerl did not write: choose another name, or "
                "replace it with --overwrite"
            )
    return target


def _ours(path: Path) -> bool:
    """Whether a file carries the mark of one that Sommerl wrote."""
    try:
        with path.open("rb") as file:
            head = file.read(WITHIN)
            file.seek(max(file.tell(), os.fstat(file.fileno()).st_size - WITHIN))
            ends = head + file.read(WITHIN)
    except OSError:
        return False
    return any(head.startswith(start) and re.search(mark, ends) for start, mark in MARKS)


@dataclass
class _Temporary:
    """A file under a temporary name. It is locked while it is open; if it is not locked, its run was killed."""

    out: BinaryIO
    path: str

    def take_place(self, target: Path) -> None:
        """Gives the file its final name, and the permissions of the file that it replaces or of a new one."""
        try:
            mode = stat.S_IMODE(target.stat().st_mode)
        except FileNotFoundError:
            umask = os.umask(0)
            os.umask(umask)
            mode = 0o666 & ~umask  # mkstemp makes files that only their owner can read, unlike `open`
        os.chmod(self.path, mode)
        if sys.platform == "win32":
            self.out.close()
        os.replace(self.path, target)
        temporaries.discard(self.path)

    def discard(self) -> None:
        """Closes the file, and removes it if it still has its temporary name."""
        with suppress(OSError):
            self.out.close()  # writes what is still buffered, which may fail
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
        os.close(handle)  # another run has removed the file, since it was not locked yet
        temporaries.discard(path)


def _prefix(target: Path) -> str:
    """How names of temporary files for a target begin: with a hash, since its own name may be too long to add to."""
    return f".sommerl-{hashlib.sha256(os.fsencode(target.name)).hexdigest()[:16]}-"


def _lock(handle: int) -> None:
    """Locks a file for as long as it is open, if the system and the disk have locks."""
    if sys.platform != "win32":
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)


def _remove_if_left(temporary: str) -> None:
    """Removes a temporary file unless a running process has it open."""
    with suppress(OSError):  # it is open, has been removed already, or belongs to another user
        if sys.platform == "win32":
            os.unlink(temporary)  # on Windows, fails if the file is open
            return
        handle = os.open(temporary, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.unlink(temporary)
        finally:
            os.close(handle)


@contextmanager
def _named(path: Path) -> Generator[None]:
    """Makes errors name the file to be written, as typed, instead of its temporary file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"cannot be written ({error.strerror})", str(path)) from error
