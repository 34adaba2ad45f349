"""Files that hold what a render has reached: damage of any kind costs what was reached, and nothing else."""

import struct
import zlib

import numpy as np
import pytest
from helpers import must_fail

from sommerl.render import checkpoint
from sommerl.render.checkpoint import Checkpoint, State, checkpoint_of
from sommerl.render.frame import Image
from sommerl.system import sealed_file
from sommerl.system.errors import OptionError

SHAPE = (2, 3)
IDENTITY = {"material": "nickel", "scene": "sphere"}
IMAGES, PASSES = 3, 4


def image(seed):
    rng = np.random.default_rng(seed)
    return Image(rng.random((*SHAPE, 3)).astype(np.float32), rng.random(SHAPE) < 0.5)


STATE = State((image(0), image(1)), np.random.default_rng(2).random((*SHAPE, 3)), 3)


def saved(path, state=STATE, identity=IDENTITY, shape=SHAPE):
    Checkpoint(path, identity, shape, print).save(state, now=True)
    return path.read_bytes()


def loaded(path, shape=SHAPE):
    """The state that is gone on from, and what is said."""
    said = []
    kept = Checkpoint(path, IDENTITY, shape, said.append)
    return kept.load({}, IMAGES, PASSES), said


def check_same(a, b):
    assert a.passes == b.passes
    assert len(a.images) == len(b.images)
    for one, other in zip(a.images, b.images, strict=True):
        np.testing.assert_array_equal(one.pixels, other.pixels)
        np.testing.assert_array_equal(one.mask, other.mask)
    assert (a.total is None) == (b.total is None)
    if a.total is not None:
        np.testing.assert_array_equal(a.total, b.total)


@pytest.mark.parametrize("state", [STATE, State((image(0),)), State((image(0), image(1), image(2)))])
def test_a_state_comes_back_as_it_was(tmp_path, state):
    saved(tmp_path / "part", state)
    found, said = loaded(tmp_path / "part")
    check_same(found, state)
    must_fail(check_same, found, State((image(3),), STATE.total, 3))
    assert said == []


def check_set_aside(path, content):
    """One sentence, a new start, and the file under another name."""
    path.write_bytes(content)
    state, said = loaded(path)
    assert (state.images, state.total, state.passes) == ((), None, 0)
    assert len(said) == 1
    assert said[0].startswith(f"{path}: it is damaged or not a checkpoint (")
    assert said[0].endswith(f"; it is kept as {path.name}.damaged, and the render starts anew")
    assert said[0].isprintable()
    assert not path.exists()
    aside = path.with_name(f"{path.name}.damaged")
    assert aside.read_bytes() == content
    aside.unlink()


def test_every_flipped_bit_and_every_length(tmp_path):
    path = tmp_path / "part"
    whole = saved(path)
    must_fail(check_set_aside, path, whole)
    for bit in range(8 * len(whole)):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        check_set_aside(path, bytes(damaged))
    for length in range(len(whole)):
        check_set_aside(path, whole[:length])
    check_set_aside(path, whole + b"\0")


def test_random_damage(tmp_path):
    path = tmp_path / "part"
    whole = saved(path)
    rng = np.random.default_rng(0)
    for _ in range(2000):
        damaged = np.frombuffer(whole, np.uint8).copy()
        start, length = rng.integers(len(whole)), rng.integers(1, 40)
        damaged[start : start + length] = rng.integers(0, 256, len(damaged[start : start + length]))
        content = damaged.tobytes()[: rng.integers(1, len(whole) + 1)]
        if content != whole:
            check_set_aside(path, content)


def sealed(head, identity=b'{"material": "nickel", "scene": "sphere"}', rest=b""):
    return sealed_file.sealed(b"SMRP", 1, struct.pack("<IIII", *head) + identity + rest)


def test_intact_files_that_hold_what_no_render_writes(tmp_path):
    """Also with the right checksum: made by a hand that knows the format."""
    path = tmp_path / "part"
    identity = b'{"material": "nickel", "scene": "sphere"}'
    size, pixels = len(identity), SHAPE[0] * SHAPE[1]
    one, total = bytes(13 * pixels), bytes(24 * pixels)
    path.write_bytes(sealed((size, 1, 2, 1), rest=one + total))
    assert len(loaded(path)[0].images) == 1
    for content in (
        sealed((size, 1, 0, 0), rest=one[:-1]),
        sealed((size, 1, 0, 0), rest=one + b"\0"),
        sealed((size, 2**32 - 1, 0, 0), rest=one),
        sealed((size, IMAGES + 1, 0, 0), rest=one * (IMAGES + 1)),
        sealed((size, 0, PASSES + 1, 1), rest=total),
        sealed((size, IMAGES, 1, 1), rest=one * IMAGES + total),
        sealed((size, 0, 0, 1), rest=total),
        sealed((size, 0, 1, 0)),
        sealed((size, 0, 1, 7), rest=total),
        sealed((2**32 - 1, 0, 0, 0)),
        sealed((2, 0, 0, 0), b"[]"),
        sealed((2, 0, 0, 0), b"\xff\xff"),
        sealed((10**5, 0, 0, 0), b"[" * 10**5),
        sealed_file.sealed(b"SMRP", 2, b"newer"),
        sealed_file.sealed(b"SMRL", 1, b"a material"),
        b"",
    ):
        check_set_aside(path, content)


def test_another_shape_is_another_render_or_none(tmp_path):
    path = tmp_path / "part"
    saved(path, State((Image(np.zeros((4, 4, 3), np.float32), np.zeros((4, 4), bool)),)), shape=(4, 4))
    check_set_aside(path, path.read_bytes())
    saved(path, State((Image(np.zeros((40, 40, 3), np.float32), np.zeros((40, 40), bool)),)), {"size": "40"}, (40, 40))
    whole = path.read_bytes()
    state, said = loaded(path)
    assert state.images == ()
    assert "it is of a render with another material" in said[0]
    assert path.read_bytes() == whole


def test_files_that_are_much_too_long(tmp_path, monkeypatch):
    """No more is kept of them than the render needs; of the longest, not even the checksum is computed."""
    path = tmp_path / "part"
    longest = 10 + 16 + 100 + SHAPE[0] * SHAPE[1] * (13 * IMAGES + 24)
    monkeypatch.setattr(checkpoint, "LONGEST_IDENTITY", 100)
    monkeypatch.setattr(checkpoint, "CHUNK", 64)
    whole = sealed_file.sealed(b"SMRP", 1, bytes(5000))
    path.write_bytes(whole)
    kept = Checkpoint(path, IDENTITY, SHAPE, print)
    assert len(kept._reader(longest).rest()) == longest + 1 - sealed_file.PREFIX.size
    check_set_aside(path, whole)
    monkeypatch.setattr(checkpoint, "LARGEST_FILE", 4000)
    path.write_bytes(whole)
    assert "expected at most 4000 bytes, found more" in loaded(path)[1][0]


def test_a_second_damaged_file_and_one_that_cannot_be_set_aside(tmp_path, monkeypatch):
    path = tmp_path / "part"
    for number in ("", "2", "3"):
        path.write_bytes(b"SMRP?")
        assert f"kept as part.damaged{number}, and" in loaded(path)[1][0]
    path.write_bytes(b"SMRP?")

    def refuse(self, target):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(type(path), "rename", refuse)
    said = []
    kept = Checkpoint(path, IDENTITY, SHAPE, said.append)
    assert kept.load({}, IMAGES, PASSES) == State()
    kept.save(STATE, now=True)
    kept.remove()
    assert len(said) == 1
    assert said[0].endswith("the render starts anew, without checkpoints (Permission denied)")
    assert path.read_bytes() == b"SMRP?"


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(OptionError, match="the render's checkpoint needs this name"):
        Checkpoint(tmp_path, IDENTITY, SHAPE, print)


def test_the_longest_names_have_a_checkpoint(tmp_path):
    path = checkpoint_of(tmp_path / ("n" * 251 + ".png"))
    saved(path)
    check_same(loaded(path)[0], STATE)
    check_set_aside(path, b"")
    assert checkpoint_of(tmp_path / "x.png").name == "x.png.sommerl-part"


def test_the_checksum_is_of_all(tmp_path):
    whole = saved(tmp_path / "part")
    assert struct.unpack_from("<I", whole, 6)[0] == zlib.crc32(whole[10:])
