"""What a long render has reached, kept beside its output, so that the same command goes on from there."""

from __future__ import annotations

import hashlib
import io
import json
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..brdf import Brdf
from ..errors import OptionError
from ..files import atomic_write

MAGIC = b"SMRLPART"  # how a checkpoint begins; an archive of NumPy's follows
SECONDS = 10.0  # of rendering that a kill may cost; what is done sooner is never written
SHARE = 20  # … and at least that many times as long as writing takes
PROBES = 1024  # pairs of directions at which a material is looked at


@dataclass(frozen=True)
class Image:
    """A rendered frame: linear RGB (height, width, 3), and which pixels' centres show an object (height, width)."""

    pixels: NDArray[np.float32]
    mask: NDArray[np.bool_]


@dataclass(frozen=True)
class State:
    """Images that are finished, and of the next one the sum of its samples (height, width, 3) and its passes so far."""

    images: tuple[Image, ...] = ()
    total: NDArray[np.float64] | None = None
    passes: int = 0


class Checkpoint:
    """A file that holds a state, and of which render.

    path: see `checkpoint_of`. identity: everything that decides the pixels, by a name that a person understands;
    whatever else decides them is added by `render_all`. say: is given one sentence if the file that is there does not
    serve, or none can be written.
    """

    path: Path
    resumed: bool  #: whether the render went on from a state that was loaded
    holds: bool  #: whether the file holds a state of this render

    def __init__(self, path: Path, identity: Mapping[str, str], say: Callable[[str], None]) -> None:
        """Raises OptionError if something else has that name: it is not to be written over."""
        self.path, self._identity, self._say = path, dict(identity), say
        self.resumed = self.holds = False
        self._holds_another = False
        self._last, self._cost = time.monotonic(), 0.0
        self._writable = True
        if path.exists() and not (path.is_file() and _starts_with_magic(path)):
            raise OptionError(f"{path}: expected a checkpoint or nothing, found something else, which is kept")

    def load(self, identity: Mapping[str, str]) -> State:
        """The state to go on from: an empty one if there is no file, or not one of the same render."""
        self._identity |= identity
        self._last = time.monotonic()
        if not self.path.exists():
            return State()
        try:
            with np.load(io.BytesIO(self.path.read_bytes()[len(MAGIC) :]), allow_pickle=False) as file:
                found = json.loads(str(file["identity"]))
                other = [key for key in self._identity | found if self._identity.get(key) != found.get(key)]
                if other:
                    self._holds_another = True
                    sentence = f"expected the same render, found another {other[0]}"
                    self._say(f"{self.path}: {sentence}; this one starts anew, and replaces it after {SECONDS:.0f} s")
                    return State()
                images = tuple(map(Image, file["pixels"], file["masks"]))
                passes = int(file["passes"])
                state = State(images, file["total"] if passes else None, passes)
        except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile):
            self._say(f"{self.path}: expected a checkpoint, found a broken one; the render starts anew")
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
        images = state.images
        arrays: dict[str, Any] = {
            "identity": json.dumps(self._identity),
            "pixels": np.array([image.pixels for image in images]),
            "masks": np.array([image.mask for image in images]),
            "total": np.zeros(0) if state.total is None else state.total,
            "passes": state.passes,
        }
        try:
            with atomic_write(self.path) as out:
                out.write(MAGIC)
                np.savez(out, **arrays)
            self.holds, self._holds_another = True, False
        except OSError as error:
            self._writable = False
            self._say(f"{self.path}: {error.strerror}; the render goes on, but could not be resumed from here")
        self._last = time.monotonic()
        self._cost = self._last - started

    def remove(self) -> None:
        """The render is finished and written: its state goes, and what is broken; that of another render stays."""
        if not self._holds_another:
            self.path.unlink(missing_ok=True)


def checkpoint_of(output: Path) -> Path:
    """Where the checkpoint of an image is kept."""
    return output.with_name(f"{output.name}.sommerl-part")


def _starts_with_magic(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


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
