"""Where the paper's materials come from, and the two ways in which its representation is learnt."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TypedDict

from ..compression.paper.options import Rule
from ..formats.load import load
from ..formats.registry import extensions, readable
from ..reflectance.brdf import Brdf
from ..reflectance.table import BrdfTable
from ..system.errors import FormatError, MaterialError

#: The paper's six, under the database's names.
NAMES = (
    "blue-metallic-paint",
    "yellow-matte-plastic",
    "purple-paint",
    "beige-fabric",
    "green-metallic-paint",
    "nickel",
)
STAND_INS = resources.files("sommerl.reproduction").joinpath("stand_ins")  #: a .smrl file for each of NAMES


class Learnt(TypedDict, total=False):
    """The options of `train` by which the two ways of learning differ."""

    rule: Rule
    alpha: float


#: By what they are called. The paper prints no rate for its equation; docs/method.md has the experiment.
RULES: dict[str, Learnt] = {"default": {}, "Eq. 2 as printed": {"rule": "paper", "alpha": 0.5}}
DEFAULT, PRINTED = RULES


@dataclass(frozen=True)
class Data:
    """The materials that the items are made from.

    source: a folder that holds files of these names in any known format, or an archive of neural BRDFs (.npz); None for
    the stand-ins that come with the package. called: what captions call them; made up if None.
    """

    source: Path | None = None
    called: str | None = None

    def place(self, name: str) -> str:
        """A material as `load` takes it. Raises FormatError if the folder has no such file, MaterialError if there is
        no stand-in of that name."""
        if self.source is None:
            if name not in NAMES:
                raise MaterialError(f"{name}: expected one of the stand-ins, {', '.join(NAMES)}")
            return str(STAND_INS / f"{name}.smrl")
        if self.source.is_file():
            return f"{self.source}:{name}"
        known = extensions(readable())
        for extension in known:
            if (path := self.source / f"{name}{extension}").is_file():
                return str(path)
        raise FormatError(f"{self.source}: there is no file {name} in it that ends in one of {', '.join(known)}")

    def brdf(self, name: str) -> Brdf:
        """A material as its file has it, under that name: captions say what it is."""
        found = load(self.place(name))
        found.name = name
        return found

    def table(self, name: str) -> BrdfTable:
        """A material as a table with trilinear lookup."""
        return BrdfTable.of(self.brdf(name)).with_interpolation("trilinear")

    def names(self) -> tuple[str, ...]:
        """All materials that there are, for the benchmark: the paper's six, and whatever else the folder holds."""
        if self.source is None or self.source.is_file():
            return NAMES
        known = [each for each in extensions(readable()) if each not in (".npz", ".npy", ".json")]
        found = {path.stem for path in self.source.iterdir() if path.is_file() and path.suffix.lower() in known}
        return (*(name for name in NAMES if name in found), *sorted(found - set(NAMES)))

    def networks(self) -> tuple[Path, ...]:
        """Archives of neural BRDFs that the folder holds."""
        return tuple(sorted(self.source.glob("*.npz"))) if self.source and self.source.is_dir() else ()

    def digest(self, name: str) -> str:
        """SHA-256 of the file that a material is in."""
        place = self.place(name)
        return digest_of(Path(place) if Path(place).is_file() else Path(place.rpartition(":")[0]))

    @property
    def compressed(self) -> bool:
        """Whether these materials are compact files themselves, as the stand-ins are that come with the package."""
        return self.source is None

    @property
    def caption(self) -> str:
        """What they are, as captions say it."""
        if self.called:
            return self.called
        if self.source is None:
            return "built-in NP stand-ins, themselves compressed"
        kind = "NBRDF stand-ins of" if self.source.is_file() else "the files in"
        return f"{kind} {self.source.absolute().name}"


@cache
def digest_of(path: Path) -> str:
    """The SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
