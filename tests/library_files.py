"""Libraries for tests: files of many materials, taken apart and put together again, and folders."""

import hashlib
import io
import struct
import zlib
from dataclasses import replace
from pathlib import Path

from sommerl.compression.smrl import file
from sommerl.compression.smrl.library_file import COUNT, HEAD, SECTION, LibraryFile, write
from sommerl.compression.smrl.library_index import INDEX_HEAD, Entry
from sommerl.library import index
from sommerl.library.record import Record
from sommerl.library.traits import traits

GOLDEN = Path(__file__).parent / "golden"
MATERIALS = {
    "nodes/both": (GOLDEN / "nodes-2-both.smrl").read_bytes(),
    "nodes/neither": (GOLDEN / "nodes-2-neither.smrl").read_bytes(),
    "cells": (GOLDEN / "cells.smrl").read_bytes(),
}


def entry(name, number=0):
    digest = hashlib.sha256(name.encode()).hexdigest()
    metrics = {"psnr_soft_db": 40.5 + number, "log_error": 0.125} if number else {"psnr_soft_db": float("inf")}
    options = {"target_size": 400, "reciprocal": bool(number)}
    return Entry(
        name, f"{name}.bsdf", 1000 + number, digest if number else "", options, metrics, (0.5, 0.25, 0.0625), 0.75, 0.5
    )


def packed(materials=MATERIALS):
    """The bytes of a library with some materials."""
    out = io.BytesIO()
    write(out, [entry(name, number) for number, name in enumerate(materials)], materials.__getitem__)
    return out.getvalue()


def opened(data):
    return LibraryFile(lambda start, count: data[start : start + count], len(data))


def everything(data):
    """All that a library's bytes hold, by name."""
    library = opened(data)
    numbers = range(len(library.index))
    return {each.name: (each, file.decode(library.data(each.name))) for each in map(library.index.entry, numbers)}


def apart(data):
    """The sections of a library, [type, flags, bytes]; and the head and the columns of its index."""
    (count,) = COUNT.unpack_from(data, HEAD.size)
    at, sections = HEAD.size + COUNT.size + count * SECTION.size, []
    for number in range(count):
        kind, flags, size, _ = SECTION.unpack_from(data, HEAD.size + COUNT.size + number * SECTION.size)
        sections.append([kind, flags, data[at : at + size]])
        at += size
    index_ = sections[0][2]
    return sections, list(INDEX_HEAD.unpack_from(index_)), zlib.decompress(index_[INDEX_HEAD.size :], -15)


def together(sections, head=None, payload=None):
    """The bytes of a library of such parts, with checksums that are right."""
    if head is not None:
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        sections[0][2] = INDEX_HEAD.pack(*head) + packer.compress(payload) + packer.flush()
    rows = [SECTION.pack(kind, flags, len(data), zlib.crc32(data)) for kind, flags, data in sections]
    table = COUNT.pack(len(sections)) + b"".join(rows)
    start = struct.pack("<4sHI", b"SMLB", 1, zlib.crc32(table))
    return start + table + b"".join(data for _, _, data in sections)


def folder(path, materials=MATERIALS, **colours):
    """A library's folder, as `library build` makes it."""
    path.mkdir()
    (path / index.INSIDE).mkdir()
    records = {}
    for number, (name, data) in enumerate(materials.items()):
        place = f"{name}.smrl" if name.isascii() and name.replace("/", "").isalnum() else f"m{number}.smrl"
        (path / place).parent.mkdir(parents=True, exist_ok=True)
        (path / place).write_bytes(data)
        seen, digest = traits(file.decode(data)), hashlib.sha256(data).hexdigest()
        known = {"source": f"{name}.bsdf", "source_bytes": 1000, "source_sha256": "f" * 64}
        metrics, options = {"psnr_soft_db": 50.0 - number}, {"target_size": 400}
        looks = {"colour": colours.get(name, seen.colour), "gloss": seen.gloss, "metalness": seen.metalness}
        records[name] = Record(
            name, place, len(data), digest, options=options, metrics=metrics, **known, **looks
        )  # fmt: skip
    index.write_index(path, records)
    return path


def with_metric(name):
    """The bytes of a library whose only material has one metric, which may have a name that the writer refuses."""
    out = io.BytesIO()
    write(out, [replace(entry("cells"), metrics={"?": 1.0})], MATERIALS.__getitem__)
    sections, head, payload = apart(out.getvalue())
    named = name.encode()
    return together(
        sections, [*head[:2], head[2] + len(named) - 1, *head[3:]], payload.replace(b'"?"', b'"%s"' % named)
    )


#: Names of metrics may have 100 characters, of any number of bytes.
METRICS = [with_metric(100 * "é"), with_metric(101 * "é"), with_metric(100 * "e"), with_metric(101 * "e")]
