"""The paper's cases on NBRDF stand-ins: goals, not measured bests."""

import pytest

from sommerl import TrainOptions, load_table, train
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment, load_environment
from sommerl.som_man.file import encode


def metrics(path, environment, **options):
    table = load_table(path).with_interpolation("nearest")
    material, _ = train(table, TrainOptions(**options))
    return compare_on_sphere(table, [material], environment, spp=256)[0].metrics, len(encode(material))


@pytest.mark.parametrize(
    ("name", "clusters", "epochs", "goal"),
    [("yellow-matte-plastic", 64, 10, 41.2), ("blue-metallic-paint", 256, 50, 52.5)],
)
def test_frame_psnr_is_at_least_the_papers(stand_in, name, clusters, epochs, goal):
    found, size = metrics(stand_in(name), default_environment(), clusters=clusters, epochs=epochs)
    assert found.psnr_frame_db >= goal
    assert size <= 160_000


def test_object_psnr_of_nickel_with_1000_clusters(stand_in):
    found, _ = metrics(stand_in("nickel"), default_environment(), clusters=1000, epochs=10)
    assert found.psnr_object_db >= 55


def test_a_measured_environment_serves_too(stand_in, probe):
    found, _ = metrics(stand_in("blue-metallic-paint"), load_environment(probe), clusters=64, epochs=2)
    assert 35 < found.psnr_object_db < found.psnr_frame_db
