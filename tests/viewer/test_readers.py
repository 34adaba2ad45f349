"""What the page's worker reads, and refuses: materials and environments."""

import struct
import zlib
from pathlib import Path

import compact
import numpy as np
import page_files
import pytest
import rgl_files
from helpers import must_fail
from in_node import program

from sommerl import Lattice
from sommerl.compression.smrl.file import encode
from sommerl.formats import merl
from sommerl.render import hdr
from sommerl.render.environment import default_environment

GOLDEN = Path(__file__).parents[1] / "golden"
# Counts the bytes of all arrays that are made, and the seconds of the processor: others may be at work on the machine.
ANSWER = """
import { readEnvironment } from "./images.js";
import { read, sentence } from "./readers.js";
let taken = 0;
for (const name of ["Uint8Array", "Uint16Array", "Uint32Array", "Float32Array", "Float64Array"]) {
    const construct = (plain, given) => {
        const made = new plain(...given);
        taken += made.buffer === given[0] ? 0 : made.byteLength;
        return made;
    };
    globalThis[name] = new Proxy(globalThis[name], { construct });
}
const flat = (value, step) => (ArrayBuffer.isView(value) ? Array.from(value).filter((_, i) => i % step === 0) : value);
async function answer({ environment, arrays, file, ...how }) {
    const start = process.cpuUsage();
    taken = 0;
    let found;
    try {
        found = environment ? await readEnvironment(file) : await read(file, how);
        const told = Object.entries(found).filter(([, value]) => arrays || !ArrayBuffer.isView(value));
        found = Object.fromEntries(told.map(([key, value]) => [key, flat(value, arrays)]));
    } catch (error) {
        found = { error: sentence(error) };
    }
    const { user, system } = process.cpuUsage(start);
    return { ...found, seconds: (user + system) / 1e6, taken };
}
"""
# What the page's worker answers when it is asked for an environment, and whether its arrays move to the page.
WORKER = """
import "./worker.js";
import { aliases } from "./environment.js";
async function answer({ file, black }) {
    if (black) return { aliases: [...aliases({ width: 4, height: 2, pixels: new Float32Array(24) }).data] };
    let told;
    globalThis.postMessage = (message, moved) => (told = { ...message, moved: moved?.length });
    await globalThis.onmessage({ data: { id: 7, do: "environment", file: file.byteLength ? file : null, name: "x" } });
    if (told.error) return told;
    const { environment, aliases: { data, ...size }, ...rest } = told;
    const pixels = [...environment.pixels.filter((_, i) => i % 37 === 0)];
    return { ...rest, ...environment, pixels, size, aliases: [...data] };
}
"""


@pytest.fixture(scope="module")
def node(tmp_path_factory):
    return program(tmp_path_factory.mktemp("js"), ANSWER)


def read(node, data, **how):
    return node([({"arrays": 1, **how}, data)])[0]


# MERL: negative values, values that are no numbers, cells below the horizon that hold rubbish.
PLANES = np.random.default_rng(1).random((3, 90, 90, 180)) * 1500
PLANES[:, :, :, ::7] -= 600
PLANES[0, 3, 2, 1], PLANES[1, 4, 2, 1], PLANES[:, 5, 2, 1] = np.nan, np.inf, -5
PLANES[:, ~Lattice().above_horizon] = -1


def check_same(found, wanted):
    assert np.allclose(found, wanted, rtol=1e-6, atol=1e-7)


def test_merl(node, tmp_path):
    data, step = page_files.merl(PLANES), 37
    wanted = merl.parse(tmp_path / "a.binary", data).values.reshape(-1)
    found = read(node, data, name="a.binary", arrays=step)
    assert (found["kind"], found["bytes"], found["name"]) == ("table", len(data), "a.binary")
    check_same(found["values"], wanted[::step])
    must_fail(check_same, found["values"], np.roll(wanted, 1)[::step])


WHOLE = {
    "smrl": (GOLDEN / "nodes.smrl").read_bytes(),
    "bsdf": rgl_files.content(),
    "mbsdf": page_files.mbsdf(np.ones((3, 3, 4, 3))),
    "table": page_files.table(np.ones((4, 3, 5, 3)), Lattice(4, 3, 5)),
}
KINDS = {"smrl": "nodes", "bsdf": "rgl", "mbsdf": "grid", "table": "table"}


def check_kind(found, wanted):
    assert found.get("kind") == wanted


@pytest.mark.parametrize("format", WHOLE)
def test_content_tells_the_format(node, format):
    for how in ({"name": "x.binary"}, {"format": format}):
        check_kind(read(node, WHOLE[format], **how), KINDS[format])
    check_kind(read(node, page_files.deflated(WHOLE[format]), format=format, deflated=True), KINDS[format])
    must_fail(check_kind, read(node, b"x" + WHOLE[format], name="x.json"), KINDS[format])


def test_data_for_transmission_is_left_out(node):
    first, rest = WHOLE["mbsdf"].split(b"\n", 1)
    transmitted = b"MBSDF_DATA_TRANSMISSION=\n" + struct.pack("<3I", 0, 1, 1) + bytes(4)
    for data in (first + b"\n" + transmitted + b"\n" + rest, WHOLE["mbsdf"] + b"\n" + transmitted):
        found = read(node, data, name="x.mbsdf")
        check_kind(found, "grid")
        assert (found["thetas"], found["phis"]) == (3, 4)
    for data in (first + b"\n" + transmitted, first + 2 * (b"\n" + transmitted) + b"\n" + rest):
        assert "MBSDF_DATA_REFLECTION=" in sentences(node, [(data, "x.mbsdf")])[0]["error"]


def test_names_are_one_line_of_what_can_be_seen(node):
    made = compact.material("minimal")
    made.name = "<b>a\x1b[31m\u202eb\nc"
    assert read(node, encode(made))["name"] == "<b>a\ufffd[31m\ufffdb c"
    assert read(node, WHOLE["mbsdf"], name="a\u2028b.mbsdf")["name"] == "a b.mbsdf"


def head(data, at, layout, *numbers):
    changed = bytearray(data)
    struct.pack_into(layout, changed, at, *numbers)
    return bytes(changed)


SHAPE_OF_VNDF = WHOLE["bsdf"].index(b"vndf") + 4 + 11  # in the file's head
MBSDF = WHOLE["mbsdf"].index(b"=\n") + 2
HOSTILE = {  # what is read, and what is said
    "nothing": (b"", "x.smrl", "at least 10 bytes"),
    "of no kind": (b"hello", "x.txt", "expected a material file"),
    "another kind by its name": (b"hello, world", "x.bsdf", "tensor file"),
    "merl, dimensions": (struct.pack("<3i", 90, 90, 2**31 - 1), "x.binary", "dimensions"),
    "merl, cut off": (page_files.merl(PLANES)[:-1], "x.binary", "34992012 bytes"),
    "merl, short": (b"1234", "x.binary", "12 bytes"),
    "merl, nothing in it": (page_files.merl(np.zeros((3, 90, 90, 180))), "x.binary", "positive"),
    "table, cells": (head(WHOLE["table"], 4, "<3H", 65535, 65535, 65535), "x", "cells"),
    "table, none": (head(WHOLE["table"], 4, "<3H", 0, 65535, 1), "x", "cells"),
    "table, other": (head(WHOLE["table"], 4, "<3H", 90, 90, 180), "x", "bytes"),
    "table, flags": (head(WHOLE["table"], 10, "<B", 3), "x", "flags"),
    "mbsdf, size": (head(WHOLE["mbsdf"], MBSDF, "<3I", 1, 2**32 - 1, 2**32 - 1), "x", "directions"),
    "mbsdf, none": (head(WHOLE["mbsdf"], MBSDF, "<3I", 1, 0, 5), "x", "directions"),
    "mbsdf, larger": (head(WHOLE["mbsdf"], MBSDF, "<3I", 1, 100, 100), "x", "bytes of data"),
    "mbsdf, type": (head(WHOLE["mbsdf"], MBSDF, "<I", 7), "x", "type"),
    "mbsdf, no numbers": (WHOLE["mbsdf"][:-4] + b"\xff\xff\xff\x7f", "x", "finite"),
    "rgl, size": (head(WHOLE["bsdf"], SHAPE_OF_VNDF, "<4Q", 1, 4, 2**40, 2**40), "x", "vndf"),
    "rgl, size-2": (head(WHOLE["bsdf"], SHAPE_OF_VNDF, "<4Q", 1, 4, 2**63, 2), "x", "vndf"),
    "rgl, empty": (head(WHOLE["bsdf"], SHAPE_OF_VNDF, "<4Q", 1, 4, 0, 0), "x", "vndf"),
    "rgl, fields": (head(WHOLE["bsdf"], 14, "<I", 2**32 - 1), "x", "number of fields"),
    "rgl, version": (head(WHOLE["bsdf"], 12, "<H", 2), "x", "version"),
    "rgl, anisotropic": (rgl_files.content(phi_i=np.zeros(8, np.float32)), "x", "isotropic"),
    "rgl, two angles": (rgl_files.content(phi_i=np.zeros(2, np.float32)), "x", "vndf"),
    "rgl, no field": (rgl_files.content(ndf=None), "x", "ndf"),
    "rgl, no colours": (rgl_files.content(rgb=None), "x", "wavelengths"),
    "rgl, order": (rgl_files.content(theta_i=np.array([0, 1, 0.5, 1.5], np.float32)), "x", "theta_i"),
    "rgl, one row": (rgl_files.content(ndf=np.ones((1, 9), np.float32)), "x", "ndf"),
    "rgl, zeros": (rgl_files.content(vndf=np.zeros((1, 4, 8, 9), np.float32)), "x", "vndf"),
    "rgl, zeros-2": (rgl_files.content(sigma=np.zeros((2, 7), np.float32)), "x", "sigma"),
    "rgl, negative": (rgl_files.content(ndf=np.full((2, 9), -1, np.float32)), "x", "ndf"),
    "rgl, no number": (rgl_files.content(rgb=np.full((1, 4, 3, 5, 5), np.nan, np.float32)), "x", "rgb"),
    "rgl, large": (rgl_files.content(rgb=np.full((1, 4, 3, 5, 5), 1e31, np.float32)), "x", "rgb"),
    "rgl, type": (rgl_files.content(rgb=np.ones((1, 4, 3, 5, 5))), "x", "rgb"),
    "rgl, jacobian": (rgl_files.content(jacobian=np.ones(2, np.uint8)), "x", "jacobian"),
    "work": (compact.sealed(compact.bomb()), "x.smrl", ""),
}


def sentences(node, files):
    return node([({"name": name}, data) for data, name in files])


def check_told(found, length, about=""):
    """One sentence, at once, and no more memory than a reader of the longest file may take for a start."""
    said = found.get("error", "")
    assert said
    assert about in said
    assert "\n" not in said
    assert "damaged or too large" not in said  # which stands for an error that nobody thought of
    check_bounded(found, length)


def check_bounded(found, length):
    assert found["seconds"] < 1
    assert found["taken"] < 2**26 + 8 * length


def test_hostile_files(node):
    for (data, _, about), found in zip(
        HOSTILE.values(), sentences(node, [h[:2] for h in HOSTILE.values()]), strict=True
    ):
        check_told(found, len(data), about)
    fine = sentences(node, [(WHOLE["mbsdf"], "x")])[0]
    must_fail(check_told, fine, 100)
    check_bounded(fine, 100)
    for change in ({"seconds": 1.5}, {"taken": 2**27}):
        must_fail(check_bounded, fine | change, 100)
    for message in ("", "two\nlines", "expected a whole file, found one that is damaged or too large"):
        must_fail(check_told, fine | {"error": message}, 100)


@pytest.mark.parametrize("name", [*WHOLE, *(path.name for path in sorted(GOLDEN.glob("*.smrl")))])
def test_every_truncated_length(node, name):
    data = WHOLE.get(name) or (GOLDEN / name).read_bytes()
    lengths = range(len(data)) if len(data) < 1000 else range(0, len(data), 7)
    for length, found in zip(lengths, sentences(node, [(data[:n], "x." + name) for n in lengths]), strict=True):
        check_told(found, length)


def test_changed_bytes(node):
    """Nothing but a sentence or a material comes of them."""
    rng = np.random.default_rng(3)
    files = []
    for data in WHOLE.values():
        for _ in range(300):
            changed = bytearray(data)
            for at in rng.integers(0, min(len(data), 400), rng.integers(1, 4)):
                changed[at] = rng.choice([0, 1, 127, 128, 255, changed[at] ^ 1])
            files.append((bytes(changed), "x"))
    found = sentences(node, files)
    refused = [one for one in found if "error" in one]
    assert len(found) > len(refused) > 100
    for one in found:
        check_bounded(one, 10_000)
    for one in refused:
        check_told(one, 10_000)


def test_what_is_deflated_has_an_end(node):
    """A stream of 2^28 zeros, and one that is cut off."""
    coder, zeros = zlib.compressobj(9, wbits=-15), bytes(2**20)
    bomb = b"".join(coder.compress(zeros) for _ in range(2**8)) + coder.flush()
    found = node(
        [({"format": "table", "deflated": True}, data) for data in (bomb, page_files.deflated(WHOLE["table"])[:-3])]
    )
    assert "deflated, found more" in found[0]["error"]
    assert "damaged or cut off" in found[1]["error"]


RGBE = np.random.default_rng(2).integers(0, 256, (6, 230, 4)).astype(np.uint8)
RGBE[2, :, 1], RGBE[:, 5, 3] = 7, 0
COLOURS = np.random.default_rng(3).random((37, 19, 4)).astype(np.float32) * 9
ODD = COLOURS.copy()
ODD[0, 0], ODD[1, 1, 0], ODD[2, 2, 1] = np.nan, -1, np.inf


def environment(node, data, **how):
    return read(node, data, environment=True, name="x", **how)


@pytest.mark.parametrize("encoded", [True, False])
def test_hdr(node, encoded):
    data = page_files.hdr(RGBE, encoded)
    found = environment(node, data)
    wanted = hdr.decode(data)
    assert (found["width"], found["height"]) == (230, 6)
    check_same(np.reshape(found["pixels"], wanted.shape), wanted)
    must_fail(check_same, np.reshape(found["pixels"], wanted.shape), wanted[::-1])


@pytest.mark.parametrize("compression", [0, 2, 3])
@pytest.mark.parametrize(("dtype", "names"), [("<f4", "RGB"), ("<f2", "RGBA"), ("<u4", "BGR"), ("<f4", "Y")])
def test_exr(node, compression, dtype, names):
    pixels = COLOURS[..., : len(names)]
    found = environment(node, page_files.exr(pixels, compression, dtype, names))
    wanted = pixels.astype(dtype).astype(np.float32)[..., [names.find(c) if c in names else 0 for c in "RGB"]]
    assert (found["width"], found["height"]) == (19, 37)
    check_same(np.reshape(found["pixels"], wanted.shape), wanted)
    must_fail(check_same, np.reshape(found["pixels"], wanted.shape), wanted[::-1])


def test_pixels_that_are_no_light(node):
    found = np.reshape(environment(node, page_files.exr(ODD[..., :3], 0))["pixels"], (37, 19, 3))
    assert (found[0, 0] == 0).all()
    assert (found[1, 1, 0], found[2, 2, 1]) == (0, 65504)


IMAGE = page_files.exr(COLOURS[..., :3], 3)
HUGE = (0, 0, 2**30, 2**30)
HOSTILE_IMAGES = {
    "of no kind": (b"\x89PNG....", "found another kind"),
    "hdr, size": (page_files.hdr(RGBE).replace(b"-Y 6 +X 230", b"-Y 999999999 +X 999999999"), "pixels"),
    "hdr, larger": (page_files.hdr(RGBE).replace(b"-Y 6 +X 230", b"-Y 5000 +X 5000"), "cut off"),
    "hdr, no format": (page_files.hdr(RGBE).replace(b"FORMAT", b"F"), "lines with a format"),
    "hdr, run": (page_files.hdr(RGBE)[:60] + bytes([0, 255]) * 3000, "run"),
    "exr, size": (page_files.exr(COLOURS[..., :3], 3, window=HUGE), "pixels"),
    "exr, larger": (page_files.exr(COLOURS[..., :3], 3, window=(0, 5, 3999, 4004)), "cut off"),
    "exr, negative": (page_files.exr(COLOURS[..., :3], 3, window=(0, 0, -9, -9)), "pixels"),
    "exr, wide": (page_files.exr(np.ones((1, 8193, 3)), 3), "8192 pixels along each side"),
    "exr, high": (page_files.exr(np.ones((8193, 1, 3)), 3), "8192 pixels along each side"),
    "exr, black": (page_files.exr(-COLOURS[..., :3], 3), "black"),
    "hdr, black": (page_files.hdr(0 * RGBE), "black"),
    "exr, no channels": (page_files.exr(COLOURS[..., :2], 0, names="RG"), "R, G, B"),
    "exr, compression": (IMAGE.replace(b"compression\0\1\0\0\0\3", b"compression\0\1\0\0\0\4"), "PIZ"),
    "exr, tiles": (head(IMAGE, 4, "<I", 0x202), "scan lines"),
    "exr, another width": (page_files.exr(COLOURS[..., :3], 3, window=(0, 5, 15, 41)), "bytes"),
}


def test_hostile_images(node):
    for data, about in HOSTILE_IMAGES.values():
        check_told(environment(node, data), len(data), about)
    must_fail(check_told, environment(node, IMAGE), len(IMAGE), "")


def test_truncated_images(node):
    for data, step in ((page_files.hdr(RGBE), 11), (IMAGE, 7), (page_files.exr(COLOURS[..., :3], 0, "<f2"), 41)):
        cut = [({"environment": True, "name": "x"}, data[:length]) for length in range(0, len(data), step)]
        for found in node(cut):
            check_told(found, len(data))


@pytest.fixture(scope="module")
def worker(tmp_path_factory):
    return program(tmp_path_factory.mktemp("worker"), WORKER)


def check_aliases(found, pixels):
    """A table that draws cells as often as their light is, but for a share of 2% that is even."""
    share, other, probability, _ = np.reshape(found, (-1, 4)).T
    rows, columns = 128, 256
    height, width, _ = pixels.shape
    sine = np.sin((np.arange(height) + 0.5) / height * np.pi)
    i, k = np.arange(height) * rows // height, np.arange(width) * columns // width
    weight = np.zeros((rows, columns))
    np.add.at(weight, (i[:, None], k[None]), sine[:, None] * pixels.sum(axis=-1))
    light = weight.sum()
    wanted = 0.98 * weight.reshape(-1) / light * weight.size + 0.02 if light > 0 else np.ones(weight.size)
    assert np.allclose(probability, wanted, rtol=1e-4)
    drawn = share + np.bincount(other.astype(int), 1 - share, weight.size)
    assert np.allclose(drawn, wanted, rtol=1e-3, atol=1e-3)


def check_answer(found, pixels):
    assert (found["id"], found["moved"]) == (7, 2)
    assert (found["height"], found["width"], 3) == pixels.shape
    assert np.allclose(found["pixels"], pixels.reshape(-1)[::37], rtol=1e-4, atol=1e-6)
    assert found["size"] == {"width": 256, "height": 128}
    check_aliases(found["aliases"], pixels)


def test_the_worker_prepares_environments(worker):
    built_in, read, refused, black = worker(
        [({}, b""), ({}, IMAGE), ({}, page_files.hdr(0 * RGBE)), ({"black": True}, b"")]
    )
    for found, pixels in ((built_in, default_environment()), (read, COLOURS[..., :3])):
        check_answer(found, pixels)
        must_fail(check_answer, found, pixels[::-1])
    must_fail(check_aliases, read["aliases"], COLOURS[::-1, :, :3])
    assert "black" in refused["error"]
    check_aliases(black["aliases"], np.zeros((2, 4, 3)))
