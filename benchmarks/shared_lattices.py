"""How good materials are that share lattices in one file, and those that were no examples for what is shared.

    uv run python benchmarks/stand_in_library.py OUT --count 1
    uv run python benchmarks/shared_lattices.py OUT.bases.npz [--size 330] [--held-out 10]

The first command decodes the 99 stand-ins of Zheng et al.'s neural processes, as tables of 90 × 24 × 36 cells. All are
packed, and measured against these tables; and then every HELD-OUT-th, with what was learnt from the others alone.
"""

from __future__ import annotations

import argparse
import hashlib
import io
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from stand_in_library import Values, material

from sommerl.compression.compact.sharing import Example, train
from sommerl.compression.smrl import library_file
from sommerl.compression.smrl.library_index import Entry
from sommerl.compression.smrl.shared import Shared
from sommerl.library.share import compressed
from sommerl.library.traits import traits

PICTURES = ("psnr_soft_db", "psnr_lamp_db")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bases", type=Path)
    parser.add_argument("--size", type=int, default=330)
    parser.add_argument("--held-out", type=int, default=10)
    options = parser.parse_args()
    with np.load(options.bases) as held:
        tables: dict[str, Values] = dict(held)
    names = list(tables)
    unseen = names[options.held_out // 2 :: options.held_out]
    packed(tables, names, names, options.size)
    packed(tables, [name for name in names if name not in unseen], unseen, options.size)


def packed(tables: Mapping[str, Values], examples: Iterable[str], names: list[str], size: int) -> None:
    """Learns from some materials, and says what a file of others takes and how good they are."""

    def example(name: str) -> Example:
        return Example(lambda: material(name, tables[name]), traits(material(name, tables[name])).gloss, True, False)

    learnt = [example(name) for name in examples]
    shared = train(learnt, size)
    data: dict[str, bytes] = {}
    entries: list[Entry] = []
    for name in names:
        source = material(name, tables[name])
        data[name], metrics = compressed(source, shared, size)
        digest = hashlib.sha256(tables[name].tobytes()).hexdigest()
        entries.append(Entry(name, f"{name}.smrl", tables[name].nbytes, digest, {"target_size": size}, metrics))
    together, apart = (written(entries, data, each) for each in (shared, None))
    print(f"{len(names)} materials, learnt from {len(learnt)}: {together} B; the same values as whole files: {apart} B")
    for key in PICTURES:
        values = [entry.metrics[key] for entry in entries]
        print(f"  {key}: mean {np.mean(values):.2f} dB, worst {min(values):.2f} dB")


def written(entries: list[Entry], data: Mapping[str, bytes], shared: Shared | None) -> int:
    """The bytes of a file of materials."""
    out = io.BytesIO()
    return library_file.write(out, entries, data.__getitem__, shared)


if __name__ == "__main__":
    main()
