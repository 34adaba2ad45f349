"""What a long render has reached, kept beside its output, so that the same command goes on from there."""

from __future__ import annotations

import hashlib
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
from ..files import atomic_write

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

    path: OUTPUT.part as a rule. identity: everything that decides the pixels, by a name that a person understands;
    whatever else decides them is added by `render_all`. say: is given one sentence if the file that is there does not
    serve.
    """

    path: Path
    resumed: bool  #: whether the render went on from a state that was loaded

    def __init__(self, path: Path, identity: Mapping[str, str], say: Callable[[str], None]) -> None:
        self.path, self._identity, self._say = path, dict(identity), say
        self.resumed = False
        self._last, self._cost = time.monotonic(), 0.0

    def load(self, identity: Mapping[str, str]) -> State:
        """The state to go on from: an empty one if there is no file, or not one of the same render."""
        self._identity |= identity
        self._last = time.monotonic()
        if not self.path.exists():
            return State()
        try:
            # Opened here, since NumPy leaves a file open that turns out to be broken.
            with self.path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                found = json.loads(str(file["identity"]))
                other = [key for key in self._identity | found if self._identity.get(key) != found.get(key)]
                if other:
                    self._say(f"{self.path}: expected the same render, found another {other[0]}; it starts anew")
                    return State()
                images = tuple(map(Image, file["pixels"], file["masks"]))
                passes = int(file["passes"])
                state = State(images, file["total"] if passes else None, passes)
        except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile):
            self._say(f"{self.path}: expected a checkpoint, found a broken one; the render starts anew")
            return State()
        self.resumed = True
        return state

    def save(self, state: State, *, now: bool = False) -> None:
        """Writes the state, if enough time has passed to make that worth its cost, or `now`.

        Raises OSError if it cannot be written.
        """
        started = time.monotonic()
        if not now and started - self._last < max(SECONDS, SHARE * self._cost):
            return
        images = state.images
        arrays: dict[str, Any] = {
            "identity": json.dumps(self._identity),
            "pixels": np.array([image.pixels for image in images]),
            "masks": np.array([image.mask for image in images]),
            "total": np.zeros(0) if state.total is None else state.total,
            "passes": state.passes,
        }
        with atomic_write(self.path) as out:
            np.savez(out, **arrays)
        self._last = time.monotonic()
        self._cost = self._last - started

    def remove(self) -> None:
        """The render is finished and written: nothing is left to go on from."""
        self.path.unlink(missing_ok=True)


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
