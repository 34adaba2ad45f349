"""Renders that are stopped and go on."""

import numpy as np
import pytest
from helpers import check_sentence, lambertian_table, must_fail

from sommerl import builtin
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.render import checkpoint as checkpoints
from sommerl.render.checkpoint import MAGIC, Checkpoint, State, content, content_of
from sommerl.render.environment import default_environment
from sommerl.render.passes import _passes, render_all
from sommerl.render.scenes import sphere

SIZE, SPP = 16, 64
PASSES = 4  # of 16 samples a pixel, a scene


class Stopped(KeyboardInterrupt):
    pass


def spheres(environment):
    """The scenes of a job: small ones, whose materials are compiled in no time."""
    for albedo in (0.3, 0.6):
        brdf = MultiLobe("x", [Lobe(FAMILIES["lambertian"], (albedo, albedo, albedo), {})])
        yield lambda brdf=brdf: sphere(brdf, environment, size=SIZE)


class Job:
    """Two spheres, rendered in passes, with a checkpoint that is written after every pass."""

    def __init__(self, folder, monkeypatch):
        monkeypatch.setattr("sommerl.render.passes.SAMPLES_A_PASS", SIZE * SIZE * 16)
        monkeypatch.setattr(checkpoints, "SECONDS", 0.0)
        monkeypatch.setattr(checkpoints, "SHARE", 0)
        self.path, self.said, self.steps = folder / "out.png.sommerl-part", [], []

    def __call__(self, stop=0, material="1", resume=True, **options):
        kept = Checkpoint(self.path, {"material": material}, (SIZE, SIZE), self.said.append) if resume else None
        scenes = list(spheres(default_environment(32)))
        self.steps = []

        def advance(done, total):
            self.steps.append((done, total))
            if done == stop:
                raise Stopped

        images = render_all(scenes, **{"spp": SPP, "seed": 1} | options, progress=advance, checkpoint=kept)
        return np.stack([image.pixels for image in images]), kept


@pytest.fixture
def job(tmp_path, monkeypatch):
    return Job(tmp_path, monkeypatch)


def check_goes_on(job, stop, whole):
    with pytest.raises(Stopped):
        job(stop)
    assert job.path.exists()
    pixels, kept = job()
    assert kept.resumed
    assert job.said == []
    assert len(job.steps) <= 2 * PASSES - stop + 1
    assert np.array_equal(pixels, whole)
    kept.remove()
    assert not job.path.exists()


@pytest.mark.parametrize("stop", [1, 3, 4, 5, 7])
def test_stopped_anywhere_it_goes_on_to_the_same_pixels(job, stop):
    whole, _ = job(resume=False)
    check_goes_on(job, stop, whole)
    must_fail(check_goes_on, job, stop, whole + 1e-6)


def test_stopped_twice(job):
    whole, _ = job(resume=False)
    for stop in (2, 6):
        with pytest.raises(Stopped):
            job(stop)
    assert np.array_equal(job()[0], whole)


@pytest.mark.parametrize(
    ("options", "what"), [({"spp": 32}, "spp"), ({"seed": 2}, "seed"), ({"material": "2"}, "material")]
)
def test_another_render_starts_anew_and_says_so(job, options, what):
    with pytest.raises(Stopped):
        job(3)
    pixels, kept = job(**options)
    assert not kept.resumed
    anew = "this render starts anew, and replaces it after 0 s"
    assert job.said == [f"{job.path}: it is of a render with another {what}; {anew}"]
    assert np.array_equal(pixels, job(resume=False, **options)[0])
    kept.remove()
    assert not job.path.exists()


@pytest.mark.parametrize("stop", [0, 2])
def test_a_short_render_leaves_the_state_of_another(job, monkeypatch, stop):
    with pytest.raises(Stopped):
        job(3)
    before = job.path.read_bytes()
    monkeypatch.setattr(checkpoints, "SECONDS", 600.0)
    if stop:
        with pytest.raises(Stopped):
            job(stop, seed=2)
    else:
        job(seed=2)[1].remove()
    assert job.path.read_bytes() == before
    job.said.clear()
    assert job()[1].resumed
    assert job.said == []


def broken(data):
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 1
    return b"", b"text", data[:100], data[:-1], data[: len(data) // 2], bytes(flipped)


@pytest.mark.parametrize("number", range(6))
def test_a_broken_checkpoint_is_ignored_and_named(job, number):
    with pytest.raises(Stopped):
        job(3)
    whole = job.path.read_bytes()
    job.path.write_bytes(MAGIC + broken(whole[len(MAGIC) :])[number])
    pixels, kept = job()
    assert not kept.resumed
    (sentence,) = job.said
    check_sentence(sentence, str(job.path))
    assert "it is damaged or not a checkpoint" in sentence
    assert np.array_equal(pixels, job(resume=False)[0])


def test_short_renders_write_none(job, monkeypatch):
    job()
    assert job.path.exists()
    job.path.unlink()
    monkeypatch.setattr(checkpoints, "SECONDS", 600.0)
    job()
    assert not job.path.exists()


def test_passes_are_powers_of_two_and_add_up():
    for spp in (1, 2, 100, 256, 1000, 5000):
        for size in (8, 24, 100, 256, 2048):
            passes = _passes(spp, size * size)
            assert sum(passes) == spp
            assert all(n & (n - 1) == 0 for n in passes)
            assert max(passes) * size * size <= 2**22


def test_content_tells_materials_apart(small_table):
    assert content_of(builtin("nickel")) == content_of(builtin("nickel"))
    grey, lighter = (MultiLobe("x", [Lobe(FAMILIES["lambertian"], (a, a, a), {})]) for a in (0.5, 0.50001))
    table = lambertian_table(0.5)
    found = [content_of(brdf) for brdf in (grey, lighter, table, lambertian_table(0.50001))]
    assert len(set(found)) == 4
    assert content_of(small_table) != content_of(small_table.with_interpolation("nearest"))
    zeros = np.zeros(4)
    assert len({content(zeros), content(zeros, zeros), content(zeros[:3]), content(zeros.astype("f4"))}) == 4


def test_an_empty_state_is_not_worth_a_file(job):
    def fail():
        raise Stopped

    with pytest.raises(Stopped):
        render_all([fail], checkpoint=Checkpoint(job.path, {}, (SIZE, SIZE), print))
    assert not job.path.exists()


def test_writing_takes_a_small_share_of_the_time(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoints, "SECONDS", 0.0)
    kept = Checkpoint(tmp_path / "x", {}, (512, 512), print)
    state = State((), np.zeros((512, 512, 3)), 1)
    kept.save(state)
    kept.path.unlink()
    kept.save(state)
    assert not kept.path.exists()
    monkeypatch.setattr(checkpoints, "SHARE", 0)
    kept.save(state)
    assert kept.path.exists()
