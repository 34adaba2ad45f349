"""What a long render has reached, kept beside its output, so that the same command goes on from there."""

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
LARGEST_FILE = 2**31  # bytes: more than any sheet's
CHUNK = 2**20
LONGEST_NAME = 255 - 16  # bytes of a file's: a checkpoint that is set aside has a longer one
SECONDS = 10.0  # of rendering that a kill may cost; what is done sooner is never written
SHARE = 20  # … and at least that many times as long as writing takes
PROBES = 1024  # pairs of directions at which a material is looked at


@dataclass(frozen=True)
class State:
    """Images that are finished, and of the next one the sum of its samples (height, width, 3) and its passes so far."""

    images: tuple[Image, ...] = ()
    total: NDArray[np.float64] | None = None
    passes: int = 0


class Checkpoint:
    """A file that holds a state, and of which render.

    After what `sealed_file` writes come HEAD; the identity, JSON in UTF-8; of each image the pixels in single precision
    and a byte a pixel of the mask; and the sum of samples in double precision.

    path: see `checkpoint_of`. identity: everything that decides the pixels, by a name that a person understands;
    whatever else decides them is added by `render_all`. shape: height and width of the images. say: is given one
    sentence if the file that is there does not serve, or none can be written. channels: of the sum of samples.
    """

    path: Path
    resumed: bool  #: whether the render went on from a state that was loaded
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
        """Raises OptionError if something has that name that is no file."""
        self.path, self._identity, self._shape, self._say = path, dict(identity), shape, say
        self._channels = channels
        self.resumed = self.holds = False
        self._holds_another = False
        self._last, self._cost = time.monotonic(), 0.0
        self._writable = True
        if path.exists() and not path.is_file():
            raise OptionError(f"{path}: expected a checkpoint or nothing, found something else, which is kept")
        remove_left_over(path)

    @property
    def pixels(self) -> int:
        """The number of pixels of each image."""
        return self._shape[0] * self._shape[1]

    def load(self, identity: Mapping[str, str], images: int, passes: int) -> State:
        """The state to go on from, of a render of so many images in so many passes each.

        An empty one if there is no file, or it holds another render; or if it is damaged: it gets another name then.
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
            sentence = f"expected the same render, found another {visible(other[0])}"
            self._say(f"{self.path}: {sentence}; this one starts anew, and replaces it after {SECONDS:.0f} s")
            return State()
        self.resumed = self.holds = True
        return state

    def save(self, state: State, *, now: bool = False) -> None:
        """Writes the state, if enough time has passed to make that worth its cost, or `now`.

        If it cannot, says so once: that is no reason to stop rendering. What another render has reached is not given up
        for less than SECONDS of this one, whose options may be mistyped.
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
            self._say(f"{self.path}: {why}; the render goes on, but could not be resumed from here")
        self._last = time.monotonic()
        self._cost = self._last - started

    def remove(self) -> None:
        """The render is finished and written: its state goes; that of another render stays."""
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
        """The identity in the file, and the state if it is that of this render. Raises FormatError."""
        pixels = self.pixels
        head = sealed_file.PREFIX.size + HEAD.size + LONGEST_IDENTITY
        reader = self._reader(head + pixels * (13 * images + 8 * self._channels))
        length, count, done, there = reader.unpack(HEAD)
        found = _identity(reader.take(length))
        if found != self._identity:
            return found, State()
        if count > images or done > passes * (count < images) or there != (done > 0):
            raise FormatError("expected as many images and passes as the render has, found more")
        finished = tuple(
            Image(
                np.frombuffer(reader.take(12 * pixels), "<f4").astype(np.float32).reshape(*self._shape, 3),
                np.frombuffer(reader.take(pixels), np.uint8).reshape(self._shape) != 0,
            )
            for _ in range(count)
        )
        total = self._total(reader) if there else None
        if reader.rest():
            raise FormatError("expected the end of the file, found more")
        return found, State(finished, total, done)

    def _total(self, reader: sealed_file.Reader) -> NDArray[np.float64]:
        data = reader.take(8 * self._channels * self.pixels)
        return np.frombuffer(data, "<f8").reshape(*self._shape, self._channels)

    def _reader(self, most: int) -> sealed_file.Reader:
        """A reader of the file, checked as a whole: of as many bytes as this render can have written, and one more."""
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
        """Keeps a file that does not serve under another name."""
        why = error.strerror if isinstance(error, OSError) else visible(str(error))
        found = f"expected a checkpoint, found a damaged one or another file ({why})"
        try:
            aside = next(path for path in _names_aside(self.path) if not path.exists())
            self.path.rename(aside)
        except OSError as failure:
            self._writable = False
            self._say(f"{self.path}: {found}; the render starts anew, and keeps nothing ({failure.strerror})")
            return
        self._say(f"{self.path}: {found}; it is kept as {aside.name}, and the render starts anew")


def checkpoint_of(output: Path) -> Path:
    """Where the checkpoint of an image is kept."""
    name = f"{output.name}.sommerl-part"
    if len(os.fsencode(name)) > LONGEST_NAME:
        name = f"{hashlib.sha256(os.fsencode(output.name)).hexdigest()}.sommerl-part"
    return output.with_name(name)


def _names_aside(path: Path) -> Iterator[Path]:
    yield from (path.with_name(f"{path.name}.damaged{number}") for number in ("", *range(2, 1000)))
    raise OSError(errno.EEXIST, "too many that are damaged")


def _identity(text: bytes) -> dict[str, str]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError("expected an identity in JSON, found something else") from error
    if not isinstance(found, dict):
        raise FormatError("expected an identity, a JSON object, found something else")
    return {str(key): str(value) for key, value in cast(dict[Any, Any], found).items()}


def content(*arrays: NDArray[Any]) -> str:
    """A hash of arrays."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def content_of(brdf: Brdf) -> str:
    """A hash of a material: of what it reads, and of its values at fixed directions, which tell formulas apart."""
    directions = np.random.Generator(np.random.PCG64(0)).random((2, PROBES, 3)) * [2, 2, 1] - [1, 1, 0]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    buffers = brdf.buffers()
    return content(*(buffers[name] for name in sorted(buffers)), brdf.eval(*directions))
