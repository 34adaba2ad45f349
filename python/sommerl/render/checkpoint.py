"""Checkpoints: files in which a long render saves what it has reached, so that the same command can resume it."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import struct
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from ..reflectance.brdf import Brdf
from ..system import sealed_file
from ..system.errors import FormatError, OptionError, SommerlError
from ..system.files import atomic_write, remove_left_over
from ..system.visible import visible
from .frame import Image

MAGIC, VERSION = b"SMRP", 1
HEAD = struct.Struct("<IIII")  # length of the identity, number of images, passes, whether there is a sum of samples
LONGEST_IDENTITY = 2**24  # bytes
LARGEST_FILE = 2**31  # bytes: more than any render needs
CHUNK = 2**20  # bytes read at a time
LONGEST_NAME = 255 - 16  # bytes of a file name, with room for ".damaged" and a number
SECONDS = 10.0  # between two checkpoints at least; a shorter render writes none
SHARE = 20  # … and at least this many times as long as writing one takes
PROBES = 1024  # pairs of directions at which a material is evaluated for its hash


@dataclass(frozen=True)
class State:
    """What a render has reached.

    images: those that are finished. total: the sum of samples of the next one, (height, width, channels). passes: the
    number of its passes that are done.
    """

    images: tuple[Image, ...] = ()
    total: NDArray[np.float64] | None = None
    passes: int = 0


class Checkpoint:
    """The checkpoint file of one render.

    The file has the head of `sealed_file`; HEAD; the identity, JSON in UTF-8; for each finished image its pixels in
    single precision and its mask, a byte a pixel; and the sum of samples in double precision.

    path: see `checkpoint_of`. identity: everything that the pixels depend on, under names for people; `render_all` adds
    what it knows itself. shape: height and width of the images. say: called with one sentence if an existing file
    cannot be used, or if the file cannot be written. channels: of the sum of samples.
    """

    path: Path
    resumed: bool  #: whether the render was resumed from the file
    holds: bool  #: whether the file holds a state of this render

    def __init__(
        self,
        path: Path,
        identity: Mapping[str, str],
        shape: tuple[int, int],
        say: Callable[[str], None],
        *,
        channels: int = 3,
    ) -> None:
        """Raises OptionError if `path` exists and is not a file."""
        self.path, self._identity, self._shape, self._say = path, dict(identity), shape, say
        self._channels = channels
        self.resumed = self.holds = False
        self._holds_another = False
        self._last, self._cost = time.monotonic(), 0.0
        self._writable = True
        if path.exists() and not path.is_file():
            raise OptionError(f"{path}: the render's checkpoint needs this name, which something else has: rename that")
        remove_left_over(path)

    @property
    def pixels(self) -> int:
        """The number of pixels of each image."""
        return self._shape[0] * self._shape[1]

    def load(self, identity: Mapping[str, str], images: int, passes: int) -> State:
        """The state to resume from. identity: what is added to the identity. images, passes: of the whole render.

        It is empty if there is no file, if the file is of another render, or if it is damaged; a damaged file is
        renamed.
        """
        self._identity |= identity
        self._last = time.monotonic()
        if not self.path.exists():
            return State()
        try:
            found, state = self._decoded(images, passes)
        except (OSError, SommerlError) as error:
            self._set_aside(error)
            return State()
        other = [key for key in self._identity | found if self._identity.get(key) != found.get(key)]
        if other:
            self._holds_another = True
            why = f"it is of a render with another {visible(other[0])}"
            self._say(f"{self.path}: {why}; this render starts anew, and replaces it after {SECONDS:.0f} s")
            return State()
        self.resumed = self.holds = True
        return state

    def save(self, state: State, *, now: bool = False) -> None:
        """Writes the state if enough time has passed since the last time (SECONDS and SHARE), or if `now` is set.

        If the file cannot be written, the render goes on, and this is said once. The checkpoint of another render is
        replaced only after SECONDS, even with `now`, since this render's options may have been mistyped.
        """
        started = time.monotonic()
        now = now and not self._holds_another
        if not self._writable or (not now and started - self._last < max(SECONDS, SHARE * self._cost)):
            return
        try:
            with atomic_write(self.path) as out:
                self._encode(state, out)
            self.holds, self._holds_another = True, False
        except (OSError, OptionError) as error:
            self._writable = False
            why = error.strerror if isinstance(error, OSError) else "something else has its name"
            self._say(f"{self.path}: {why}; the render goes on, but cannot be resumed if it is stopped")
        self._last = time.monotonic()
        self._cost = self._last - started

    def remove(self) -> None:
        """Removes the file once the image is written. The checkpoint of another render stays."""
        if self.holds:
            self.path.unlink(missing_ok=True)

    def _encode(self, state: State, out: BinaryIO) -> None:
        identity = json.dumps(self._identity).encode()
        there = state.total is not None
        parts: list[Any] = [HEAD.pack(len(identity), len(state.images), state.passes, there), identity]
        for image in state.images:
            parts += [np.ascontiguousarray(image.pixels, "<f4"), np.ascontiguousarray(image.mask, np.uint8)]
        if state.total is not None:
            parts.append(np.ascontiguousarray(state.total, "<f8"))
        sealed_file.write_sealed(out, MAGIC, VERSION, parts)

    def _decoded(self, images: int, passes: int) -> tuple[dict[str, str], State]:
        """The identity in the file, and the state, which is empty if the identity differs. Raises FormatError."""
        pixels = self.pixels
        head = sealed_file.PREFIX.size + HEAD.size + LONGEST_IDENTITY
        reader = self._reader(head + pixels * (13 * images + 8 * self._channels))
        length, count, done, there = reader.unpack(HEAD)
        found = _identity(reader.take(length))
        if found != self._identity:
            return found, State()
        if count > images or done > passes * (count < images) or there != (done > 0):
            raise FormatError("it has more images or passes than the render")
        finished = tuple(
            Image(
                np.frombuffer(reader.take(12 * pixels), "<f4").astype(np.float32).reshape(*self._shape, 3),
                np.frombuffer(reader.take(pixels), np.uint8).reshape(self._shape) != 0,
            )
            for _ in range(count)
        )
        total = self._total(reader) if there else None
        if reader.rest():
            raise FormatError("it has bytes after its end")
        return found, State(finished, total, done)

    def _total(self, reader: sealed_file.Reader) -> NDArray[np.float64]:
        data = reader.take(8 * self._channels * self.pixels)
        return np.frombuffer(data, "<f8").reshape(*self._shape, self._channels)

    def _reader(self, most: int) -> sealed_file.Reader:
        """A reader of the file, whose checksum has been checked.

        Only the first `most` + 1 bytes are kept in memory: this render cannot have written more than `most`.
        """
        kept, crc, length = bytearray(), 0, 0
        with self.path.open("rb") as file:
            kept += file.read(sealed_file.PREFIX.size)
            while chunk := file.read(CHUNK):
                crc = zlib.crc32(chunk, crc)
                kept += chunk[: max(0, most + 1 - len(kept))]
                length += len(chunk)
                if length > LARGEST_FILE:
                    raise FormatError(f"expected at most {LARGEST_FILE} bytes, found more")
        data = bytes(kept)
        sealed_file.check(crc, data, MAGIC, VERSION, "checkpoint")
        return sealed_file.Reader(data, sealed_file.PREFIX.size)

    def _set_aside(self, error: Exception) -> None:
        """Renames a file that cannot be read, so that it is kept, and says so."""
        why = error.strerror if isinstance(error, OSError) else visible(str(error))
        found = f"it is damaged or not a checkpoint ({why})"
        try:
            aside = next(path for path in _names_aside(self.path) if not path.exists())
            self.path.rename(aside)
        except OSError as failure:
            self._writable = False
            self._say(f"{self.path}: {found}; the render starts anew, without checkpoints ({failure.strerror})")
            return
        self._say(f"{self.path}: {found}; it is kept as {aside.name}, and the render starts anew")


def checkpoint_of(output: Path) -> Path:
    """The path of the checkpoint of an image."""
    name = f"{output.name}.sommerl-part"
    if len(os.fsencode(name)) > LONGEST_NAME:
        name = f"{hashlib.sha256(os.fsencode(output.name)).hexdigest()}.sommerl-part"
    return output.with_name(name)


def _names_aside(path: Path) -> Iterator[Path]:
    """Names for a damaged file, of which the first free one is taken. Raises OSError if all are taken."""
    yield from (path.with_name(f"{path.name}.damaged{number}") for number in ("", *range(2, 1000)))
    raise OSError(errno.EEXIST, "there are too many damaged ones already")


def _identity(text: bytes) -> dict[str, str]:
    """The identity in a file. Raises FormatError if it is not a JSON object."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError("its identity is not JSON") from error
    if not isinstance(found, dict):
        raise FormatError("its identity is not a JSON object")
    return {str(key): str(value) for key, value in cast(dict[Any, Any], found).items()}


def content(*arrays: NDArray[Any]) -> str:
    """A hash of the types, shapes and values of arrays."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def content_of(brdf: Brdf) -> str:
    """A hash of a material: of its buffers, and of its values at fixed directions, which differ between formulas."""
    directions = np.random.Generator(np.random.PCG64(0)).random((2, PROBES, 3)) * [2, 2, 1] - [1, 1, 0]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    buffers = brdf.buffers()
    return content(*(buffers[name] for name in sorted(buffers)), brdf.eval(*directions))
