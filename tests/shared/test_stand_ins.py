"""The paper's cases on NP stand-ins: goals, not measured bests."""

import statistics

import pytest

from sommerl import TrainOptions, load_table, train
from sommerl.compression.smrl.file import encode
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment, load_environment

MATERIALS = (
    "blue-metallic-paint", "yellow-matte-plastic", "nickel", "purple-paint", "green-metallic-paint", "beige-fabric",
)  # fmt: skip


def metrics(path, environment, **options):
    table = load_table(path).with_interpolation("nearest")
    material, _ = train(table, TrainOptions(**options))
    return compare_on_sphere(table, [material], environment, spp=256)[0].metrics, len(encode(material))


@pytest.mark.parametrize(
    ("name", "clusters", "epochs", "goal"),
    [("yellow-matte-plastic", 64, 10, 41.2), ("blue-metallic-paint", 256, 50, 52.5)],
)
def test_psnr_over_the_frame_is_at_least_the_papers(stand_in, name, clusters, epochs, goal):
    found, _ = metrics(stand_in(name), default_environment(), clusters=clusters, epochs=epochs)
    assert found["psnr_frame_db"] >= goal


@pytest.mark.parametrize(
    ("name", "goal"),
    [
        ("yellow-matte-plastic", 56), ("nickel", 55), ("purple-paint", 55), ("green-metallic-paint", 55),
        ("beige-fabric", 55),
    ],
)  # fmt: skip
def test_psnr_over_the_object_with_1000_clusters(stand_in, name, goal):
    found, _ = metrics(stand_in(name), default_environment(), clusters=1000, epochs=30)
    assert found["psnr_object_db"] >= goal


def test_sizes_of_files_with_256_clusters(stand_in):
    sizes = [len(encode(train(load_table(stand_in(name)))[0])) for name in MATERIALS]
    assert statistics.median(sizes) <= 100_000
    assert max(sizes) <= 160_000


def test_a_measured_environment_serves_too(stand_in, probe):
    found, _ = metrics(stand_in("blue-metallic-paint"), load_environment(probe), clusters=64, epochs=2)
    assert 35 < found["psnr_object_db"] < found["psnr_frame_db"]
