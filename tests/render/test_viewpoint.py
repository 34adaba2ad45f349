"""Views of scenes, and one light in place of an environment."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import complaint, lambertian_table, must_fail

from sommerl.render import scenes
from sommerl.render.passes import render
from sommerl.render.scene_registry import make_scene
from sommerl.render.viewpoint import DirectionalLight, Viewpoint, towards

GREY = lambertian_table(0.5)


def test_directions_are_those_of_the_scenes():
    assert np.allclose([towards(0, 0), towards(90, 0), towards(180, 0), towards(0, 90)], [
        (0, 0, 1), (1, 0, 0), (0, 0, -1), (0, 1, 0),
    ], atol=1e-15)  # fmt: skip
    assert np.allclose(np.linalg.norm([towards(12, 34), DirectionalLight(-70, 5).towards], axis=-1), 1)


def own(camera):
    """The view that a camera has."""
    x, y, z = np.subtract(camera.origin, camera.target)
    return Viewpoint(math.degrees(math.atan2(x, z)), math.degrees(math.atan2(y, math.hypot(x, z))))


@pytest.mark.parametrize("camera", [scenes.SPHERE, scenes.STANDING, scenes.LYING])
def test_a_scenes_own_view_is_one_of_them(camera):
    assert camera.seen_from(None) is camera
    assert np.allclose(camera.seen_from(own(camera)).origin, camera.origin)
    nearer = camera.seen_from(Viewpoint(200, 30, 2))
    assert (nearer.target, nearer.fov) == (camera.target, camera.fov)
    assert nearer.distance == pytest.approx(camera.distance / 2)


def test_docs_say_the_views_of_scenes():
    assert own(scenes.STANDING).elevation == pytest.approx(7.705, abs=5e-5)
    assert own(scenes.LYING).elevation == pytest.approx(45)


@pytest.mark.parametrize("values", [(361, 0), (0, 90), (0, -90), (0, 0, 0.05), (0, 0, 11), (math.nan, 0)])
def test_a_view_out_of_range(values):
    assert "expected" in complaint(Viewpoint, *values)
    assert complaint(Viewpoint, 0, 0) is None


def check_sphere(light, view, expected):
    """Of a Lambertian sphere under one light, each pixel is ρ cos θ_i."""
    image = render(make_scene("sphere", [GREY], environment=light, view=view, size=64), spp=64)
    camera = scenes.SPHERE.seen_from(view)
    points = hit(camera, 64)
    cosine = points @ np.array(expected.towards)
    lit = image.mask & (cosine > 0.1) & (points @ np.array(camera.origin) > 0.4 * camera.distance)
    assert lit.sum() > 500
    assert np.abs(image.pixels[lit] - 0.5 * cosine[lit][:, None]).max() < 0.01
    assert image.pixels[image.mask & (cosine < -0.2)].max(initial=0) == 0


def hit(camera, size):
    """Where the unit sphere is seen through the middle of each pixel; beside it, anything."""
    z = np.array(camera.origin) / camera.distance
    x = np.cross([0, 1, 0], z)
    x /= np.linalg.norm(x)
    u = ((np.arange(size) + 0.5) / size * 2 - 1) * math.tan(math.radians(camera.fov / 2))
    rays = u[None, :, None] * x - u[:, None, None] * np.cross(z, x) - z
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    along = camera.distance * (rays @ z)
    depth = -along - np.sqrt(np.maximum(along**2 - camera.distance**2 + 1, 0))
    return camera.distance * z + depth[..., None] * rays


@pytest.mark.parametrize(
    ("light", "view"), [(DirectionalLight(0, 30), None), (DirectionalLight(110, 40), Viewpoint(60, 50, 0.9))]
)
def test_one_light_of_irradiance_pi(light, view):
    check_sphere(light, view, light)
    must_fail(check_sphere, light, view, replace(light, azimuth=light.azimuth - 5))


def test_zoom_makes_things_larger():
    masks = [
        render(make_scene("sample", [GREY], view=Viewpoint(0, 60, zoom), size=64), spp=1).mask for zoom in (0.5, 1)
    ]
    assert masks[1].sum() == pytest.approx(4 * masks[0].sum(), rel=0.15)


@pytest.mark.parametrize("name", ["statue", "ball", "sample"])
def test_every_scene_turns(name):
    light = DirectionalLight(-60, 40)
    images = [render(make_scene(name, [GREY], environment=light, view=view, size=32), spp=16) for view in VIEWS]
    assert all(image.mask.sum() > 40 for image in images)
    assert not np.allclose(images[0].pixels, images[1].pixels, atol=0.02)


VIEWS = Viewpoint(0, 30), Viewpoint(120, 30)
