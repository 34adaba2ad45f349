"""Damaged files for every reader: each has to take them or to refuse them by an error of Sommerl's own, must not read
more than its limit, and what it takes has to be usable. Seeded; no network.

    uv run python benchmarks/hostile.py [--seconds 60] [--seed 0] [--readers smrl-nodes obj …] [--out FOLDER]

The seconds are shared out among the readers. Each runs in a process of its own, so that a crash of a library or a load
that does not end is survived and reported. What went wrong is kept in FOLDER, a file for each kind of fault; exit
status 1 if there is any.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import sommerl
from sommerl import Lattice
from sommerl.compression.palette import GainsAndShapes
from sommerl.compression.smrl import file as smrl
from sommerl.compression.smrl import library_file, library_index, node_parts
from sommerl.compression.smrl.codes import gain_values, shape_values
from sommerl.compression.smrl.shared import Shared
from sommerl.factored import file as fbrdf
from sommerl.factored.material import COLUMNS, ELEVATIONS, ROWS, FactoredBrdf
from sommerl.formats import (
    alta,
    cornell,
    fits,
    mbsdf,
    merl,
    nbrdf,
    numpy_files,
    safetensors,
    samples,
    smrlib,
    tensor,
    text,
    xompt,
)
from sommerl.models.multi_lobe import FAMILIES, Lobe
from sommerl.models.nbrdf import SHAPES, WEIGHTS
from sommerl.reflectance.nodes import NodeLattice
from sommerl.render import checkpoint
from sommerl.render.frame import Image
from sommerl.system import door, sealed_file
from sommerl.system.errors import FormatError, SommerlError

FRAME = (4, 5)  # pixels of a checkpoint's images
TOO_LONG = 20  # seconds for one load
KEPT = 5  # reproducers of a reader
EXTREMES = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)
NUMBERS = (b"0", b"-1", b"1e999", b"-1e38", b"1e308", b"1e-45", b"nan", b"inf", b"9" * 30, b"0x10", b"1_0", b"", b"--")

Mutate = Callable[[random.Random, bytes], bytes]


@dataclass(frozen=True)
class Reader:
    """What is attacked. seeds: valid files. load: of a path; what it returns is used by `use`. most: bytes that it may
    read. build: from a seed to a damaged file, if damage in the middle of a file has to pass a checksum first."""

    name: str
    suffix: str
    seeds: Callable[[], list[bytes]]
    load: Callable[[Path], Any]
    most: int
    use: Callable[[Any], None]
    build: Callable[[random.Random, bytes, Mutate], bytes] | None = None


@dataclass
class Report:
    """What was seen of one reader. faults: what they were, each with the name of a file that shows it."""

    reader: str
    mutations: int = 0
    accepted: int = 0
    refused: int = 0
    slowest: float = 0.0
    faults: dict[str, str] = field(default_factory=dict)

    def add(self, other: Report) -> None:
        self.mutations += other.mutations
        self.accepted += other.accepted
        self.refused += other.refused
        self.slowest = max(self.slowest, other.slowest)
        self.faults |= other.faults


class Counted(io.FileIO):
    """The door's file, which says how much is read of it."""

    bytes_read = opened = 0

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        Counted.opened += 1

    def read(self, size: int | None = -1) -> bytes:
        found = super().read(-1 if size is None else size)
        Counted.bytes_read += len(found)
        return found


def mutated(rng: random.Random, seed: bytes) -> bytes:
    """A file with one to four things changed, more often near its beginning."""
    data = bytearray(seed)
    for _ in range(rng.randint(1, 4)):
        if not data:
            break
        at = rng.randrange(min(len(data), rng.choice((16, 128, len(data), len(data)))))
        kind = rng.randrange(9)
        if kind == 0:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            data[at] = rng.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, rng.randrange(256)))
        elif kind in (2, 3):
            size = rng.choice((1, 2, 4, 8))
            value = (rng.choice(EXTREMES) + rng.choice((0, 0, -1, 1))) % 2 ** (8 * size)
            data[at : at + size] = value.to_bytes(size, rng.choice(("little", "big")))
        elif kind == 4:
            del data[rng.randrange(len(data)) :]
        elif kind == 5:
            data[at:at] = rng.randbytes(rng.choice((1, 2, 7, 64)))
        elif kind == 6:
            del data[at : at + rng.choice((1, 2, 4, 16))]
        elif kind == 7:
            length = rng.choice((1, 4, 16, 100))
            data[at:at] = data[at : at + length] * rng.choice((1, 1, 2, 50))
        else:
            numbers = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", bytes(data[at : at + 200])))
            if numbers:
                chosen = rng.choice(numbers)
                data[at + chosen.start() : at + chosen.end()] = rng.choice(NUMBERS)
    return bytes(data)


def attack(reader: Reader, seconds: float, seed: int, folder: Path, out: Path | None = None) -> Report:
    """Damages files and loads them, for so long, in this process. folder: where the file of the moment lies."""
    rng, report = random.Random(f"{reader.name} {seed}"), Report(reader.name)
    seeds, path, original = reader.seeds(), folder / f"file{reader.suffix}", door.FileIO
    door.FileIO = Counted  # pyright: ignore
    started = time.monotonic()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for whole in seeds:
                accepted = report.accepted
                _attempt(reader, path, whole, report, out)
                if report.accepted == accepted:
                    _fault(report, "a whole file is refused", path, out)
            _giant(reader, path, seeds[0], report, out)
            while time.monotonic() - started < seconds:
                whole = rng.choice(seeds)
                inside = reader.build and rng.random() < 0.7
                data = reader.build(rng, whole, mutated) if inside and reader.build else mutated(rng, whole)
                _attempt(reader, path, data, report, out)
    finally:
        door.FileIO = original  # pyright: ignore
    return report


def _attempt(reader: Reader, path: Path, data: bytes, report: Report, out: Path | None) -> None:
    path.write_bytes(data)
    _load(reader, path, min(len(data), reader.most + 1), report, out)


def _giant(reader: Reader, path: Path, whole: bytes, report: Report, out: Path | None) -> None:
    """A file that begins like a whole one and is longer than anything; and one that says that it is empty."""
    with path.open("wb") as stream:
        stream.write(whole)
        stream.truncate(2**40)
    accepted = report.accepted
    _load(reader, path, reader.most + 1, report, None)
    path.unlink()
    if report.accepted > accepted:
        _fault(report, "a file of 2⁴⁰ bytes is taken", path, out)


def _load(reader: Reader, path: Path, most: int, report: Report, out: Path | None) -> None:
    Counted.bytes_read = Counted.opened = 0
    started = time.perf_counter()
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, TOO_LONG)  # which ends the process
    try:
        reader.use(reader.load(path))
        report.accepted += 1
    except SommerlError as error:
        report.refused += 1
        if not str(error).isprintable():
            _fault(report, "a message of more than one line", path, out)
    except Exception as error:
        at = traceback.extract_tb(error.__traceback__)[-1]
        _fault(report, f"{type(error).__name__}: {error} ({Path(at.filename).name}:{at.lineno})"[:200], path, out)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        _fault(report, f"{type(error).__name__}: {error}"[:200], path, out)  # a panic of the core
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
    report.mutations += 1
    report.slowest = max(report.slowest, time.perf_counter() - started)
    if Counted.bytes_read > most or Counted.opened > 1:
        _fault(report, f"reads more than it may ({most} bytes, once)", path, out)


def _fault(report: Report, what: str, path: Path, out: Path | None) -> None:
    if what in report.faults or len(report.faults) >= KEPT:
        return
    kept = ""
    if out and path.exists():
        out.mkdir(parents=True, exist_ok=True)
        kept = str(out / f"{report.reader}-{len(report.faults)}{path.suffix}")
        shutil.copy(path, kept)
    report.faults[what] = kept


def in_child(reader: Reader, seconds: float, seed: int, out: Path) -> Report:
    """The same in a process of its own, again and again if it dies."""
    report, started, tries = Report(reader.name), time.monotonic(), 0
    while (left := seconds - (time.monotonic() - started)) > 0 and tries < KEPT:
        with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
            command = [sys.executable, __file__, "--child", reader.name, "--seconds", str(left)]
            command += ["--seed", str(seed + 1000 * tries), "--folder", folder, "--out", str(out)]
            ended = subprocess.run(command, capture_output=True, text=True, errors="replace")
            found = Path(folder) / "report.json"  # and not what it prints: Mitsuba prints, too
            if ended.returncode == 0 and found.exists():
                report.add(Report(**json.loads(found.read_text())))
                break
            how = "does not end" if ended.returncode == -signal.SIGALRM else f"status {ended.returncode}"
            last = (ended.stderr.strip().splitlines() or [""])[-1]
            _fault(report, f"the process ends: {how} {last}"[:200], Path(folder) / f"file{reader.suffix}", out)
            tries += 1
    return report


DIRECTIONS = np.random.default_rng(0).normal(size=(2, 16, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=-1, keepdims=True)
DIRECTIONS[..., 2] = np.abs(DIRECTIONS[..., 2])


def evaluated(brdf: Any) -> None:
    if not np.isfinite(brdf.eval(*DIRECTIONS)).all() or not brdf.name.isprintable():
        raise ArithmeticError("a material that was taken is not finite, or its name cannot be shown")


def sealed(rng: random.Random, whole: bytes, mutate: Mutate) -> bytes:
    """Our own files, damaged below their checksum."""
    body = mutate(rng, whole[sealed_file.PREFIX.size :])
    return whole[:6] + struct.pack("<I", zlib.crc32(body)) + body


def inflated(head: Callable[[bytes], int]) -> Callable[[random.Random, bytes, Mutate], bytes]:
    """The same, half of the time damaged below the compression, too. head: where the compressed part begins."""

    def build(rng: random.Random, whole: bytes, mutate: Mutate) -> bytes:
        if rng.random() < 0.5:
            return sealed(rng, whole, mutate)
        at = head(whole)
        payload = bytearray(zlib.decompress(whole[at:], -zlib.MAX_WBITS))
        for _ in range(rng.randint(1, 4)):
            place = rng.randrange(len(payload))
            part = rng.choice((rng.randbytes(8), b"\xff" * 8, b"\0" * 8, struct.pack("<d", rng.choice((1e308, -1e-9)))))
            payload[place : place + 8] = part[: len(payload) - place]
        body = whole[sealed_file.PREFIX.size : at] + sealed_file.deflated(bytes(payload))
        return whole[:6] + struct.pack("<I", zlib.crc32(body)) + body

    return build


def zipped(rng: random.Random, whole: bytes, mutate: Mutate) -> bytes:
    """An archive of damaged arrays."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as archive, zipfile.ZipFile(out, "w") as copy:
        for member in archive.namelist():
            data = archive.read(member)
            copy.writestr(member, mutate(rng, data) if rng.random() < 0.5 else data)
    return out.getvalue()


KNOWN: dict[str, Any] = {"name": "seed", "options": {"seed": 1, "source_facts": {"samples": 3}}}
FIRST_NODES = Path(__file__).parents[1] / "tests" / "golden" / "nodes.smrl"  # of version 1: nobody writes it any more


def cells_seeds() -> list[bytes]:
    rng, cells = np.random.default_rng(0), Lattice(3, 4, 5)
    made = sommerl.SomManBrdf(rng.random((4, 3)), rng.integers(0, 4, cells.shape).astype(np.uint8), cells, **KNOWN)
    return [smrl.encode(made)]


def nodes_seeds() -> list[bytes]:
    rng, files = np.random.default_rng(0), [FIRST_NODES.read_bytes()]
    lut, gains = shape_values(np.array([[-3, 0], [0, 1], [5, 7]])), gain_values(np.array([-200, 3, 900]))
    for reciprocal in (False, True):
        for mirrored in (False, True):
            phi_d = ((0, 90, 180) if mirrored else (0, 90), (0,))
            lattice = NodeLattice((0, 60, 180), (0, 0, 1), ((0, 90, 180), (0, 180)), phi_d, reciprocal, mirrored)
            gain, shape = (rng.integers(0, 3, lattice.size).astype(np.uint16) for _ in range(2))
            entries = GainsAndShapes(gains, lut, 0.04, signed=reciprocal != mirrored)
            files.append(smrl.encode(sommerl.SomManBrdf(entries, np.stack([gain, shape]), lattice, **KNOWN)))
    return files


def stream_of_cells(whole: bytes) -> int:
    at = sealed_file.PREFIX.size + 1
    at += 1 + whole[at]
    at += 1 + whole[at]
    at += 2 + struct.unpack_from("<H", whole, at)[0]
    return at + smrl.CELLS_HEAD.size


def library_seeds() -> list[bytes]:
    """Libraries of some materials, of one, and of some that share their lattices."""
    materials = {f"{kind}/{number}": data for kind, seeds in (("nodes", nodes_seeds), ("cells", cells_seeds))
                 for number, data in enumerate(seeds())}  # fmt: skip
    files: list[bytes] = []
    for names, shared in ((list(materials), None), (list(materials)[:1], None), (list(materials), common()[0])):
        out = io.BytesIO()
        entries = [
            library_index.Entry(name, f"{name}.bsdf", 7, "ab" * 32, {"seed": 1}, {"psnr_soft_db": 50.0})
            for name in names
        ]
        library_file.write(out, entries, materials.__getitem__, shared)
        files.append(out.getvalue())
    return files


def in_library(path: Path) -> Any:
    """The last material in a library."""
    with door.opened(path) as file:
        names = smrlib.names(path, file)
        return smrlib.parse(path, file, names[-1] if names else "")


def below_sums(rng: random.Random, whole: bytes, mutate: Mutate) -> bytes:
    """A library, damaged below its checksums: in the table of sections, in one of them, or in what the index inflates
    to."""
    at = library_file.HEAD.size
    (count,) = library_file.COUNT.unpack_from(whole, at)
    at += library_file.COUNT.size
    rows = [library_file.SECTION.unpack_from(whole, at + n * library_file.SECTION.size) for n in range(count)]
    at += count * library_file.SECTION.size
    sections: list[bytes] = []
    for _, _, size, _ in rows:
        sections.append(whole[at : at + size])
        at += size
    damaged = rng.randrange(-2, count)
    if damaged == -2:
        front = library_index.INDEX_HEAD.size
        head, payload = sections[0][:front], zlib.decompress(sections[0][front:], -zlib.MAX_WBITS)
        sections[0] = head + sealed_file.deflated(mutate(rng, payload))
    elif damaged >= 0:
        sections[damaged] = mutate(rng, sections[damaged])
    table = library_file.COUNT.pack(count) + b"".join(
        library_file.SECTION.pack(kind, flags, len(data), crc and zlib.crc32(data))
        for (kind, flags, _, crc), data in zip(rows, sections, strict=True)
    )
    if damaged == -1:
        table = mutate(rng, table)
    return library_file.HEAD.pack(library_file.MAGIC, 1, zlib.crc32(table)) + table + b"".join(sections)


def common() -> tuple[Shared, list[sommerl.SomManBrdf]]:
    """What some materials share, and they."""
    materials = [smrl.decode(data) for data in nodes_seeds()]
    lattices = dict.fromkeys(each.lattice for each in materials if isinstance(each.lattice, NodeLattice))
    weights, levels = node_parts.coded(materials[0]).learnt(*materials[0].index)
    prior = np.float32(weights).tolist(), np.float32(levels).tolist()
    return Shared(tuple(lattices), prior), materials


def part_seeds() -> list[bytes]:
    shared, materials = common()
    return [part for each in materials if (part := shared.part(each))]


def part_of_library(path: Path) -> Any:
    return common()[0].material(door.read(path, smrl.LONGEST_FILE), KNOWN)


def fbrdf_seeds() -> list[bytes]:
    rng = np.random.default_rng(0)
    parts = (rng.random(shape) for shape in ((ELEVATIONS, 2, 3), (ROWS, 2, 2), (COLUMNS, 2, 2), (2, 2)))
    return [fbrdf.encode(FactoredBrdf(*parts, name="seed"))]


def stream_of_factors(whole: bytes) -> int:
    at = sealed_file.PREFIX.size
    at += 1 + whole[at]
    return at + 1 + whole[at] + fbrdf.TERMS.size


def rgl_seeds() -> list[bytes]:
    rng = np.random.default_rng(0)
    arrays: dict[str, np.ndarray[Any, Any]] = {
        "phi_i": np.zeros(1),
        "theta_i": np.array([0, 1.0, 1.5]),
        "ndf": np.ones((2, 4)),
        "sigma": np.ones((2, 4)),
        "vndf": 0.2 + rng.random((1, 3, 4, 4)),
        "luminance": np.ones((1, 3, 3, 3)),
    }
    single = {name: array.astype("<f4") for name, array in arrays.items()} | {"jacobian": np.ones(1, np.uint8)}
    spectral = {"wavelengths": np.array([400, 550, 700], "<f4"), "spectra": rng.random((1, 3, 3, 3, 3)).astype("<f4")}
    files: list[bytes] = []
    for colours in ({"rgb": rng.random((1, 3, 3, 3, 3)).astype("<f4")}, spectral):
        out = io.BytesIO()
        tensor.write(out, single | colours)
        files.append(out.getvalue())
    return files


def rows(columns: int) -> np.ndarray[Any, Any]:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.random((40, 4)) * [1.4, 6, 1.4, 6], rng.random((40, columns))])


def table_of_text(header: str, columns: int) -> bytes:
    out = io.StringIO()
    np.savetxt(out, rows(columns), "%.4f", delimiter="," if "," in header else " ", header=header, comments="")
    return out.getvalue().encode()


CSV = "theta_i_rad,phi_i_rad,theta_o_rad,phi_o_rad,r,g,b"


def npy(array: np.ndarray[Any, Any]) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def npz(**arrays: np.ndarray[Any, Any]) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def weights() -> np.ndarray[Any, Any]:
    return np.random.default_rng(0).normal(scale=0.3, size=WEIGHTS)


def layers() -> dict[str, np.ndarray[Any, Any]]:
    rng = np.random.default_rng(0)
    found: dict[str, np.ndarray[Any, Any]] = {}
    for number, (inputs, outputs) in enumerate(SHAPES, 1):
        found |= {f"fc{number}": rng.normal(size=(inputs, outputs)) / 5, f"b{number}": rng.normal(size=outputs) / 5}
    return found


def hdf5_seeds() -> list[bytes]:
    import h5py

    files: list[bytes] = []
    for options in ({}, {"libver": "latest"}):
        out = io.BytesIO()
        with h5py.File(out, "w", **options) as file:
            for number in (1, 2, 3):
                for name, part in (("kernel:0", "fc"), ("bias:0", "b")):
                    file[f"model_weights/d{number}/{name}"] = layers()[f"{part}{number}"].astype("f4")
        files.append(out.getvalue())
    return files


def keras3_seeds() -> list[bytes]:
    import h5py

    out, archive = io.BytesIO(), io.BytesIO()
    with h5py.File(out, "w") as file:
        for number in (1, 2, 3):
            for place, part in ((0, "fc"), (1, "b")):
                file[f"layers/dense_{number}/vars/{place}"] = layers()[f"{part}{number}"].astype("f4")
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as copy:
        copy.writestr("config.json", b"{}")
        copy.writestr(nbrdf.KERAS, out.getvalue())
    return [archive.getvalue()]


def safetensors_seeds() -> list[bytes]:
    header: dict[str, Any] = {"__metadata__": {"format": "pt"}}
    data = b""
    for name, array in layers().items():
        part = array.T.astype("<f4").tobytes()
        place = f"net.{name[-1]}.{'weight' if name[0] == 'f' else 'bias'}"
        shape = list(array.T.shape)
        header[place] = {"dtype": "F32", "shape": shape, "data_offsets": [len(data), len(data) + len(part)]}
        data += part
    text_of_header = json.dumps(header).encode()
    return [safetensors.LENGTH.pack(len(text_of_header)) + text_of_header + data]


def mbsdf_seeds() -> list[bytes]:
    values = np.random.default_rng(0).normal(0.3, 0.2, (4, 4, 5, 3)).astype("<f4")
    head = mbsdf.FIRST_LINE + b"MBSDF_DATA_REFLECTION=\n"
    grey = head + mbsdf.HEAD.pack(0, 4, 5) + values[..., 0].tobytes()
    return [head + mbsdf.HEAD.pack(1, 4, 5) + values.tobytes(), grey + b"\nMBSDF_DATA_TRANSMISSION=\n" + bytes(16)]


def xompt_seeds() -> list[bytes]:
    rows = [[nm, a, b, c, 0.3] for nm in (4.5e-7, 6e-7) for a in (0.0, 0.5) for b in (0.1, 1.0) for c in (0.0, 2.0)]
    content = {"metadata": {"openMaterial3dVersion": "1.0.0"}, "brdf": {"lookupTable": rows, "wavelengths": [1]}}
    return [json.dumps(content).encode(), json.dumps(content, indent=4).encode()]


def zemax_seeds() -> list[bytes]:
    def axis(name: str, angles: str) -> str:
        return f"{name}  {len(angles.split())}\n{angles}\n"

    head = "#x\nSource  Measured\nSymmetry  PlaneSymmetrical\nSpectralContent  Monochrome\nScatterType  BRDF\n"
    axes = axis("SampleRotation", "0") + axis("AngleOfIncidence", "10 40") + axis("ScatterAzimuth", "0 90 180")
    block = "TIS 0.1\n" + "1.0 0.5 0.1\n" * 3
    return [f"{head}{axes}{axis('ScatterRadial', '0 20 60')}\nMonochrome\nDataBegin\n{block * 2}DataEnd\n".encode()]


def alta_seeds() -> list[bytes]:
    head = "#DIM {}\n#PARAM_IN {}\n#PARAM_OUT {}"
    four = head.format("4 3", "SPHERICAL_TL_PL_TV_PV", "XYZ_COLOR")
    return [table_of_text(four, 3), table_of_text(four.replace("4 3", "4 1").replace("XYZ_COLOR", "INV_STERADIAN"), 1)]


def alta_samples(path: Path) -> Any:
    return alta.samples_of(path, door.read(path, text.LARGEST_FILE)).samples


def text_samples(path: Path) -> Any:
    return samples.samples_of(path, door.read(path, numpy_files.LARGEST_FILE)).samples


def csv_seeds() -> list[bytes]:
    """As people write them."""
    named = table_of_text(CSV, 3)
    odd = named.replace(b",", b";").replace(b".", b",").replace(b"\n", b"\r\n")
    units = named.replace(b"_rad", b"").replace(b"\n", b"\nrad,rad,rad,rad,1/sr,1/sr,1/sr\n", 1)
    noted = b"Instrument: x\n\n" + named + b"\nend\n"
    spectral = named.replace(b"r,g,b", b"450,R550,650nm", 1)
    return [named, odd, units, noted, spectral, named.decode().encode("utf-16"), named.replace(b"e-", b"D-")]


def fits_seeds() -> list[bytes]:
    shape = {p.name: (p.low + p.high) / 2 for p in FAMILIES["ggx"].parameters}
    lobes = [Lobe(FAMILIES["lambertian"], (0.1, 0.2, 0.3), {}), Lobe(FAMILIES["ggx"], (0.1, 0.2, 0.3), shape)]
    content = fits.content("seed", [{"model": "ggx", "parameters": [lobe.as_json() for lobe in lobes]}])
    return [json.dumps(content).encode()]


def merl_seeds() -> list[bytes]:
    lattice = Lattice()
    planes = np.random.default_rng(0).random((3, *lattice.shape))
    return [np.array(lattice.shape, "<i4").tobytes() + planes.tobytes()]


OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1//1 3//1 2//1\nf 1//1 2//1 4//1\nf 1 4 3\nf 2 3 4\n"
PLY_HEAD = (
    "ply\nformat {} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n"
    "property list uchar int vertex_indices\nend_header\n"
)


def ply_seeds() -> list[bytes]:
    points, faces = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    lines = [*(" ".join(map(str, point)) for point in points), *(f"3 {a} {b} {c}" for a, b, c in faces)]
    binary = points.astype("<f4").tobytes() + b"".join(struct.pack("<Biii", 3, *face) for face in faces)
    return [
        PLY_HEAD.format("ascii").encode() + "\n".join(lines).encode() + b"\n",
        PLY_HEAD.format("binary_little_endian").encode() + binary,
    ]


def image_seeds(kind: str) -> list[bytes]:
    from sommerl.render.environment import default_environment
    from sommerl.render.llvm import mitsuba

    mi = mitsuba()
    files: list[bytes] = []
    for pixels in (default_environment(4), default_environment(16).astype(np.float16 if kind == "OpenEXR" else "f4")):
        stream = mi.MemoryStream()
        mi.Bitmap(np.ascontiguousarray(pixels)).write(stream, getattr(mi.Bitmap.FileFormat, kind))
        files.append(bytes(stream.raw_buffer()))
    return files


def load_environment(path: Path) -> Any:
    from sommerl.render import environment

    return environment.load_environment(path)


def load_mesh(path: Path) -> Any:
    from sommerl.render import meshes

    mesh = meshes.load_mesh(path)
    return np.concatenate([mesh.positions.ravel(), mesh.normals.ravel()])


def finite(numbers: Any) -> None:
    if not np.isfinite(numbers).all():
        raise ArithmeticError("what was taken is not finite")


def without_table(module: Any) -> Callable[[Path], Any]:
    """A reader of samples that stops before their table, which takes a hundred times as long as reading."""

    def load(path: Path) -> Any:
        original = module.to_table
        module.to_table = lambda found, **_: found
        try:
            return module.read(path)
        finally:
            module.to_table = original

    return load


def sampled(found: Any) -> None:
    finite(found.wi)
    finite(found.wo)


LARGEST_IMAGE = 2**30


def checkpoint_seeds() -> list[bytes]:
    rng = np.random.default_rng(0)
    image = Image(rng.random((*FRAME, 3)).astype("f4"), rng.random(FRAME) < 0.5)
    states = checkpoint.State((image,), rng.random((*FRAME, 3)), 2), checkpoint.State((image, image))
    with tempfile.TemporaryDirectory() as folder:
        for number, state in enumerate(states):
            _render(Path(folder) / str(number)).save(state, now=True)
        return [(Path(folder) / str(number)).read_bytes() for number in range(len(states))]


def resumed(path: Path) -> checkpoint.State:
    """What a render goes on from; a FormatError where it starts anew."""
    said: list[str] = []
    state = _render(path, said.append).load({}, images=2, passes=5)
    if said:
        aside = path.with_name(f"{path.name}.damaged")
        if aside.exists():
            aside.rename(path)
        raise FormatError(said[0])
    return state


def _render(path: Path, say: Callable[[str], None] = print) -> checkpoint.Checkpoint:
    return checkpoint.Checkpoint(path, {"scene": "sphere"}, FRAME, say)


def resumable(state: checkpoint.State) -> None:
    images = [(image.pixels.shape, image.mask.shape) for image in state.images]
    total = state.total is None or state.total.shape == (*FRAME, 3)
    if images != [((*FRAME, 3), FRAME)] * len(images) or not total or state.passes > 5:
        raise ArithmeticError("a state that was taken is of another shape than the render")


READERS = [
    Reader("smrl-nodes", ".smrl", nodes_seeds, sommerl.load, smrl.LONGEST_FILE, evaluated, sealed),
    Reader(
        "smrl-cells", ".smrl", cells_seeds, sommerl.load, smrl.LONGEST_FILE, evaluated,
        inflated(stream_of_cells),
    ),
    Reader("library", ".smrlib", library_seeds, in_library, smrlib.MOST_READ, evaluated, below_sums),
    Reader("part", ".part", part_seeds, part_of_library, smrl.LONGEST_FILE, evaluated),
    Reader(
        "fbrdf", ".fbrdf", fbrdf_seeds, sommerl.load, fbrdf.LONGEST_FILE, evaluated, inflated(stream_of_factors)
    ),
    Reader("rgl", ".bsdf", rgl_seeds, sommerl.load, tensor.LARGEST_FILE, evaluated),
    Reader("fits", ".json", fits_seeds, sommerl.load, fits.LARGEST_FILE, evaluated),
    Reader(
        "nbrdf-npy", ".npy", lambda: [npy(weights()), npy(weights().astype("f4"))], sommerl.load,
        numpy_files.LARGEST_FILE, evaluated,
    ),
    Reader(
        "nbrdf-npz", ".npz", lambda: [npz(**layers()), npz(nickel=weights())], sommerl.load,
        numpy_files.LARGEST_FILE, evaluated, zipped,
    ),
    Reader("nbrdf-h5", ".h5", hdf5_seeds, sommerl.load, nbrdf.LARGEST_FILE, evaluated),
    Reader("nbrdf-keras", ".keras", keras3_seeds, sommerl.load, numpy_files.LARGEST_FILE, evaluated, zipped),
    Reader("safetensors", ".safetensors", safetensors_seeds, sommerl.load, nbrdf.LARGEST_FILE, evaluated),
    Reader("mbsdf", ".mbsdf", mbsdf_seeds, sommerl.load, mbsdf.LARGEST_FILE, evaluated),
    Reader("xompt", ".xompt", xompt_seeds, sommerl.load, xompt.LARGEST_FILE, evaluated),
    Reader("zemax", ".bsdf", zemax_seeds, sommerl.load, text.LARGEST_FILE, evaluated),
    Reader("alta", ".dat", alta_seeds, alta_samples, text.LARGEST_FILE, sampled),
    Reader(
        "astm", ".astm", lambda: [table_of_text(f"NUM_POINTS 40\nVARS {CSV}", 3)], text_samples,
        numpy_files.LARGEST_FILE, sampled,
    ),
    Reader("samples-csv", ".csv", csv_seeds, text_samples, numpy_files.LARGEST_FILE, sampled),
    Reader(
        "samples-npz", ".npz", lambda: [npz(**dict(zip(CSV.split(","), rows(3).T, strict=True)))],
        text_samples, numpy_files.LARGEST_FILE, sampled, zipped,
    ),
    Reader("samples-table", ".csv", lambda: [table_of_text(CSV, 3)], sommerl.load, text.LARGEST_FILE, evaluated),
    Reader(
        "cornell", ".brdf", lambda: [table_of_text("3\n400 500 600", 3)], without_table(cornell), text.LARGEST_FILE,
        sampled,
    ),
    Reader("merl", ".binary", merl_seeds, sommerl.load, merl.LARGEST_FILE, evaluated),
    Reader("obj", ".obj", lambda: [OBJ], load_mesh, LARGEST_IMAGE, finite),
    Reader("ply", ".ply", ply_seeds, load_mesh, LARGEST_IMAGE, finite),
    Reader("exr", ".exr", lambda: image_seeds("OpenEXR"), load_environment, LARGEST_IMAGE, finite),
    Reader("hdr", ".hdr", lambda: image_seeds("RGBE"), load_environment, LARGEST_IMAGE, finite),
    Reader("pfm", ".pfm", lambda: image_seeds("PFM"), load_environment, LARGEST_IMAGE, finite),
    Reader("checkpoint", ".sommerl-part", checkpoint_seeds, resumed, checkpoint.LARGEST_FILE, resumable, sealed),
    # Any other reader of files: a name, the extension, seeds, what loads a path, how much it may read, what uses it.
]  # fmt: skip
BY_NAME = {reader.name: reader for reader in READERS}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all readers together (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--readers", nargs="+", choices=BY_NAME, default=list(BY_NAME))
    parser.add_argument("--out", type=Path, default=Path("hostile"), help="folder for files that show faults")
    parser.add_argument("--child", choices=BY_NAME, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        report = attack(BY_NAME[options.child], options.seconds, options.seed, options.folder, options.out)
        (options.folder / "report.json").write_text(json.dumps(asdict(report)))
        return 0
    faults = 0
    print(f"{'reader':14} {'mutations':>10} {'accepted':>9} {'refused':>9} {'slowest':>9}  faults")
    for name in options.readers:
        report = in_child(BY_NAME[name], options.seconds / len(options.readers), options.seed, options.out)
        faults += len(report.faults)
        counts = f"{report.mutations:10} {report.accepted:9} {report.refused:9} {report.slowest:8.3f}s"
        print(f"{name:14} {counts}  {len(report.faults)}", flush=True)
        for what, kept in report.faults.items():
            print(f"    {what}  {kept}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
