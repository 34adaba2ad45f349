"""Versions of a material in the page: compressed to some sizes, or with some numbers of clusters."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial

from ..compression.compact.search import CompactOptions
from ..compression.material import SomManBrdf
from ..compression.paper.options import TrainOptions
from ..compression.paper.train import train
from ..reflectance.brdf import Brdf
from ..reflectance.table import BrdfTable
from ..render.compress import compress
from ..system.errors import OptionError
from .held import Held, held

Progress = Callable[[int, int], None]
Bars = Callable[[str], AbstractContextManager[Progress | None]]  #: makes a progress bar, given what it is of


@dataclass(frozen=True)
class Source:
    """A material that is shown. label: what it is called, as no other. name: what a command takes for it, "" if nothing
    does. stem: what the files of its versions are called, the label if ""."""

    brdf: Brdf
    label: str
    name: str = ""
    stem: str = ""

    def held(self) -> Held:
        """The material itself. The size is known of what has a file of its own, not of one of several in a file."""
        size = os.path.getsize(self.name) if os.path.isfile(self.name) else None
        return held(self.brdf, self.label, name=self.name or None, size=size)

    def compressed(self, versions: Sequence[Version], bar: Bars = lambda what: nullcontext()) -> Iterator[Held]:
        """Its versions, which are made one after the other."""
        for version in versions:
            with bar(f"{self.label}: {version.step}") as progress:
                material = version.made(self.brdf, progress)
            file = f"{self.stem or self.label}-{version.suffix}.smrl"
            words = ("sommerl", "compress", self.name, "-o", file, *version.words)
            yield held(
                material,
                f"{self.label}, {version.step}",
                name=file,
                group=self.label,
                step=version.step,
                command=shlex.join(words) if self.name else "",
            )


@dataclass(frozen=True)
class Version:
    """One way to compress. step: what the page calls it. suffix, words: of the command that does it: what it adds to
    the name of its file, and its options."""

    options: CompactOptions | TrainOptions
    step: str
    suffix: str
    words: tuple[str, ...]

    @classmethod
    def of_size(cls, size: int, among: Sequence[int]) -> Version:
        """The preset compact, in at most so many bytes. among: the sizes beside which its step is to be told.

        Raises OptionError for a size out of range.
        """
        options = CompactOptions(target_size=size)
        step = shown_size(size)
        if list(map(shown_size, among)).count(step) > 1:
            step = f"{size:,} B"
        return cls(options, step, str(size), ("--target-size", str(size)))

    @classmethod
    def of_clusters(cls, clusters: int) -> Version:
        """The preset paper, with so many entries. Raises OptionError for a number out of range."""
        return cls(TrainOptions(clusters=clusters), f"M = {clusters}", f"M{clusters}", ("--clusters", str(clusters)))

    def made(self, brdf: Brdf, progress: Progress | None) -> SomManBrdf:
        """Compresses a material."""
        if isinstance(self.options, CompactOptions):
            size, seed = self.options.target_size, self.options.seed
            return compress(brdf, target_size=size, seed=seed, progress=progress)[0]
        return train(BrdfTable.of(brdf), self.options, progress=progress)[0]


def shown_size(size: int) -> str:
    """A number of bytes as the page writes it: 2,700 B, or 12.4 kB."""
    if size < 10_000:
        return f"{size:,} B"
    return f"{size / 1000:#.3g}".rstrip(".") + " kB" if size < 999_500 else f"{size / 1000:,.0f} kB"


def asked(sizes: Sequence[int] = (), clusters: Sequence[int] = ()) -> list[Version]:
    """The versions that are asked for: by clusters, then by sizes. Raises OptionError for what is out of range."""
    kinds: list[tuple[str, str, Callable[[int], Version], Sequence[int]]] = [
        ("clusters", "clusters", Version.of_clusters, clusters),
        ("sizes", "target_size", partial(Version.of_size, among=sizes), sizes),
    ]
    found: list[Version] = []
    for name, parameter, make, values in kinds:
        if len(set(values)) < len(values):
            raise OptionError(f"{name}: expected different numbers, found {', '.join(map(str, values))}")
        try:
            found += [make(value) for value in values]
        except OptionError as error:
            raise OptionError(f"{name}{str(error).removeprefix(parameter)}") from error
    return found
