import contextlib

import numpy as np
import pytest
from helpers import SMALL, complaint, lambertian_table, must_fail

from sommerl import BrdfTable, TrainOptions, load, save, train
from sommerl.commands.demo import write_page
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.plots.contact_sheet import captioned, shortened, tiled
from sommerl.render import hdr
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import LIGHTS, default_environment, load_environment
from sommerl.render.images import difference, encode, side_by_side, signed_difference, write_image
from sommerl.render.llvm import mitsuba
from sommerl.render.passes import render
from sommerl.render.scenes import FILL, sphere
from sommerl.system.errors import FormatError

WHITE = np.ones((16, 32, 3), np.float32)
mi = mitsuba()


def interior(mask):
    """Pixels that show nothing but the object."""
    return np.logical_and.reduce([np.roll(mask, shift, (0, 1)) for shift in ((1, 0), (-1, 0), (0, 1), (0, -1))])


def check_albedo(brdf, albedo):
    """In a uniformly white environment, a Lambertian sphere has the radiance ρ everywhere."""
    image = render(sphere(brdf, WHITE, size=48), spp=64)
    pixels = image.pixels[interior(image.mask)]
    assert pixels.mean() == pytest.approx(albedo, rel=5e-3)
    assert np.abs(pixels / albedo - 1).max() < 0.3


def test_a_lambertian_table_comes_back_as_its_albedo_through_the_whole_chain(tmp_path):
    material, _ = train(lambertian_table(0.45), TrainOptions(clusters=1, epochs=1))
    save(material, tmp_path / "grey.smrl")
    check_albedo(load(tmp_path / "grey.smrl"), 0.45)
    must_fail(check_albedo, load(tmp_path / "grey.smrl"), 0.47)


def test_same_seed_same_pixels_another_seed_others(small_table):
    environment = default_environment(32)

    def pixels(seed):
        return render(sphere(small_table, environment, size=16), spp=8, seed=seed).pixels

    assert np.array_equal(pixels(3), pixels(3))
    assert not np.array_equal(pixels(3), pixels(4))


def test_any_seed_serves_and_none_repeats_another(small_table):
    scene = sphere(small_table, WHITE, size=8)
    images = [render(scene, spp=2, seed=seed).pixels.tobytes() for seed in (0, 1, 65536, 2**40)]
    assert len(set(images)) == 4


def test_passes_add_up_and_are_reported(small_table, monkeypatch):
    scene = sphere(small_table, default_environment(32), size=16)
    whole = render(scene, spp=64)
    monkeypatch.setattr("sommerl.render.passes.SAMPLES_A_PASS", 16 * 16 * 24)
    steps = []
    parts = render(scene, spp=64, progress=lambda *step: steps.append(step))
    assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]  # of 16 samples, a power of two
    assert not np.array_equal(parts.pixels, whole.pixels)
    assert parts.pixels[parts.mask].mean() == pytest.approx(whole.pixels[whole.mask].mean(), rel=0.05)


def test_mask_is_the_disc():
    mask = render(sphere(lambertian_table(), WHITE, size=64), spp=1).mask
    y, x = np.mgrid[:64, :64] + 0.5
    disc = np.hypot(x - 32, y - 32) < FILL * 32
    assert (mask != disc).mean() < 0.005


def test_comparison_measures_the_representation_and_not_the_noise(small_table):
    found = compare_on_sphere(small_table, [small_table], default_environment(32), size=24, spp=4)[0]
    assert found.metrics["psnr_frame_db"] == np.inf
    assert (found.pictures()[2] == 0).all()


def test_comparison_of_several_candidates_in_order():
    grey, darker, darkest = lambertian_table(0.5), lambertian_table(0.45), lambertian_table(0.3)
    steps = []
    found = compare_on_sphere(grey, [darker, darkest], WHITE, size=24, spp=4, progress=lambda *s: steps.append(s))
    assert found[0].metrics["psnr_object_db"] > found[1].metrics["psnr_object_db"]
    assert steps == [(1, 3), (2, 3), (3, 3)]


def test_the_environment_stands_as_documented():
    """Its upper rows are above, its middle column is behind the camera, and what lies right of that is to the left."""

    def lit(rows, columns):
        environment = np.full((64, 128, 3), 1e-4, np.float32)
        environment[rows, columns] = 1
        image = render(sphere(lambertian_table(), environment, size=32), spp=64)
        return image.pixels[..., 0], interior(image.mask)

    pixels, inside = lit(slice(None), slice(60, 68))
    assert pixels[inside].mean() > 0.02  # the camera sees the lit side …
    assert pixels[0, 0] == pixels[-1, -1] == pytest.approx(1e-4)  # … and not the light
    pixels, _ = lit(slice(8), slice(None))
    assert pixels[6:14, 12:20].mean() > 2 * pixels[18:26, 12:20].mean()
    pixels, _ = lit(slice(24, 40), slice(90, 102))
    assert pixels[12:20, 4:12].mean() > 2 * pixels[12:20, 20:28].mean()


def test_the_default_environment_has_what_a_material_needs_to_show():
    radiance = default_environment()
    assert radiance.shape == (512, 1024, 3)
    assert np.isfinite(radiance).all()
    assert (radiance > 0).all()
    sizes = [sigma for _, _, sigma, _ in LIGHTS]
    assert len(LIGHTS) >= 4
    assert max(sizes) > 15
    assert min(sizes) < 1
    assert radiance.max() / np.median(radiance) > 1000


def test_environment_from_a_file(tmp_path):
    radiance = default_environment(16)
    write_image(tmp_path / "probe.exr", radiance)
    assert np.allclose(load_environment(tmp_path / "probe.exr"), radiance, rtol=1e-3)
    write_image(tmp_path / "dark.exr", 0 * radiance)
    with pytest.raises(FormatError, match="the image is black"):
        load_environment(tmp_path / "dark.exr")
    (tmp_path / "text.exr").write_text("no image")
    with pytest.raises(FormatError, match="it is not an OpenEXR, Radiance HDR or PFM image that can be read"):
        load_environment(tmp_path / "text.exr")


def test_images_that_are_no_lights_are_refused(tmp_path):
    grey = np.full((8, 16, 3), 128, np.uint8)
    for name, pixels in (("a.png", grey), ("a.jpg", grey), ("deep.png", grey.astype(np.uint16))):
        mi.Bitmap(pixels).write(str(tmp_path / name))
        with pytest.raises(FormatError, match=f"{name}: expected an image of high dynamic range"):
            load_environment(tmp_path / name)
    mi.Bitmap(default_environment(8)).write(str(tmp_path / "a.hdr"))
    assert load_environment(tmp_path / "a.hdr").shape == (8, 16, 3)


def exr(radiance):
    """The bytes of an image, and where in them its window's numbers are."""
    data = encode(radiance)
    return bytearray(data), data.index(b"dataWindow\0box2i\0") + 21


def test_images_that_are_not_twice_as_wide_as_high_are_told(tmp_path):
    told = []
    write_image(tmp_path / "probe.exr", default_environment(16))
    load_environment(tmp_path / "probe.exr", told.append)
    assert told == []
    write_image(tmp_path / "square.exr", np.ones((16, 16, 3), np.float32))
    assert load_environment(tmp_path / "square.exr", told.append).shape == (16, 16, 3)
    assert told == [
        f"{tmp_path / 'square.exr'}: the image has 16 × 16 pixels, and is stretched to be twice as wide as high"
    ]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 8 +X 16\n" + bytes(1000)),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 200000\n" + bytes(1000)),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"),
        ("a.pfm", b"PF\n100000 50000\n-1\n" + bytes(1000)),
        ("a.pfm", b"PF\n0 0\n-1\n"),
        ("a.exr", b"v/1\x01"),
        ("a.exr", b"v/1\x01\x02\0\0\0" + b"x" * 100),
    ],
)
def test_heads_that_ask_for_too_much_or_nothing(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError, match=f"{name}: it is not an OpenEXR, Radiance HDR or PFM image that can be read"):
        load_environment(tmp_path / name)


def check_window_is_refused(path, change):
    data, at = exr(default_environment(8))
    data[at : at + 16] = change(np.frombuffer(data[at : at + 16], "<i4")).astype("<i4").tobytes()
    path.write_bytes(bytes(data))
    assert (
        complaint(load_environment, path) == f"{path}: it is not an OpenEXR, Radiance HDR or PFM image that can be read"
    )


def test_windows_of_images(tmp_path):
    path = tmp_path / "x.exr"
    check_window_is_refused(path, lambda window: window + np.array([0, 0, 10**6, 10**6]))
    check_window_is_refused(path, lambda window: window * 0 - 1)
    check_window_is_refused(path, lambda window: np.array([-(2**31), -(2**31), 2**31 - 1, 2**31 - 1]))
    must_fail(check_window_is_refused, path, lambda window: window)


def hdr_of(radiance):
    stream = mi.MemoryStream()
    mi.Bitmap(np.ascontiguousarray(radiance)).write(stream, mi.Bitmap.FileFormat.RGBE)
    return bytes(stream.raw_buffer())


def check_hdr(found, data, folder):
    (folder / "by_mitsuba.hdr").write_bytes(data)
    assert np.array_equal(found, np.array(mi.Bitmap(str(folder / "by_mitsuba.hdr"))))


@pytest.mark.parametrize("height", [3, 4, 16, 200])
def test_radiance_files_hold_what_mitsuba_finds_in_them(tmp_path, height):
    """In runs and, where lines are short, without."""
    radiance = default_environment(height) * np.where(np.arange(2 * height) % 5 == 4, 1e-30, 1e9)[:, None]
    data = hdr_of(radiance.astype(np.float32))
    check_hdr(hdr.decode(data), data, tmp_path)
    must_fail(check_hdr, hdr.decode(data) * np.float32(1.001), data, tmp_path)


def test_damaged_runs(tmp_path):
    """Each byte of a line, changed: Mitsuba's decoder writes beyond its memory for some."""
    data = hdr_of(default_environment(8))
    _, _, at = hdr.size(data)
    assert data[at : at + 2] == b"\2\2"
    for place in range(at, at + 100):
        for value in (0, 1, 127, 128, 129, 255):
            changed = data[:place] + bytes([value]) + data[place + 1 :]
            with contextlib.suppress(ValueError):
                assert hdr.decode(changed).shape == (8, 16, 3)
    for length in range(at, len(data)):
        with pytest.raises(
            ValueError, match=r"a line of another width|runs that do not make up a line|buffer is smaller"
        ):
            hdr.decode(data[:length])


def test_names_of_channels_that_are_no_text(tmp_path):
    """Mitsuba quotes them in its own sentence, and fails over it."""
    data, _ = exr(default_environment(8))
    at = data.index(b"chlist\0") + 11
    data[at] = 0xA9
    (tmp_path / "x.exr").write_bytes(bytes(data))
    assert "that can be read" in str(complaint(load_environment, tmp_path / "x.exr"))


def test_images_are_written_and_read_back(tmp_path):
    rng = np.random.default_rng(0)
    bytes8 = rng.integers(0, 256, (5, 7, 3), np.uint8)
    write_image(tmp_path / "a.png", bytes8)
    assert np.array_equal(np.array(mi.Bitmap(str(tmp_path / "a.png"))), bytes8)
    linear = rng.random((5, 7, 3)).astype(np.float32)
    write_image(tmp_path / "a.exr", linear)
    assert np.array_equal(np.array(mi.Bitmap(str(tmp_path / "a.exr"))), linear)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.exr", "a.png"]


def test_difference_is_absolute_and_eightfold():
    a, b = np.array([[[10, 10, 200]]], np.uint8), np.array([[[13, 8, 0]]], np.uint8)
    assert difference(a, b).tolist() == difference(b, a).tolist() == [[[24, 16, 255]]]
    assert side_by_side([a, b]).shape == (1, 2, 3)


def test_signed_difference_is_grey_where_images_agree():
    a = np.full((1, 4, 3), 100, np.uint8)
    b = a + np.array([0, 4, 0, 0], np.uint8)[None, :, None] - np.array([0, 0, 4, 100], np.uint8)[None, :, None]
    same, brighter, darker, far = signed_difference(a, b)[0].astype(int)
    assert same.tolist() == [128, 128, 128]
    assert brighter[0] > 128 > brighter[2]
    assert darker[0] < 128 < darker[2]
    assert far.tolist() == [130, 235, 255]


def test_sheets_keep_every_pixel_and_stay_in_order():
    pictures = [np.full((40, 50, 3), value, np.uint8) for value in (10, 20, 30)]
    sheet = tiled(pictures, 2)
    assert sheet.shape == (80, 100, 3)
    assert [sheet[y, x, 0] for y, x in ((0, 0), (0, 50), (40, 0), (40, 50))] == [10, 20, 30, 0]
    labelled = captioned([("one", pictures[0]), ("$two_", pictures[1]), ("ΔE", pictures[2])], 2, ["a note"])
    band = (labelled.shape[0] - 80) // 3
    assert (labelled[:40, :50] == 10).all()
    assert (labelled[40 + band : 80 + band, :50] == 30).all()
    assert (labelled[40 + band : 80 + 2 * band, 50:] == 255).all()
    for rows, columns in ((slice(40, 40 + band), slice(50)), (slice(-band, None), slice(None))):
        letters = labelled[rows, columns]
        assert letters.min() < 100 < 200 < np.median(letters)


def test_notes_are_never_cut_off():
    """They go on in another line; one that is too long for a line gets smaller letters."""
    picture = [("", np.zeros((40, 100, 3), np.uint8))]

    def sheet(*notes):
        return captioned(picture, 1, notes)

    band = sheet("a").shape[0] - sheet().shape[0]
    assert sheet("a", "b").shape == sheet("a").shape
    assert sheet("a" * 12, "b" * 12).shape[0] == sheet("a").shape[0] + band
    long_ = sheet("W" * 40)
    assert long_.shape == sheet("a").shape
    assert (long_[-band:, [0, -1]] == 255).all()
    assert long_[-band:].min() < 200


def test_long_captions_lose_their_middle():
    assert shortened("short", 10) == "short"
    assert shortened("blue-metallic-paint", 9) == "blue…aint"
    assert [len(shortened("x" * 50, most)) for most in (9, 10, 11)] == [9, 10, 11]


def test_page_holds_its_pictures_and_escapes_its_text(tmp_path):
    picture = np.zeros((2, 2, 3), np.uint8)
    path = tmp_path / "index.html"
    write_page(path, "<b> & co", [("one", picture), ("two", picture)], {"PSNR": "50 dB"}, "a < b")
    page = path.read_text()
    assert page.count("data:image/png;base64,") == 2
    assert "&lt;b&gt; &amp; co" in page
    assert "<td>50 dB</td>" in page
    assert encode(picture).startswith(b"\x89PNG")


def test_a_material_with_one_entry_and_one_with_sixteen_bit_indices_render(small_table):
    for clusters in (1, 300):
        material, _ = train(small_table, TrainOptions(clusters=clusters, epochs=1, alpha=0.001))
        assert np.isfinite(render(sphere(material, WHITE, size=8), spp=4).pixels).all()


def check_black(brdf, most):
    image = render(sphere(brdf, WHITE, size=16), spp=4)
    assert image.pixels[interior(image.mask)].max() <= most


def test_black_material_renders_black():
    black = MultiLobe("black", [Lobe(FAMILIES["lambertian"], (0.0, 0.0, 0.0), {})])
    check_black(black, 0.0)
    values = np.zeros((*SMALL.shape, 3))
    values[0, 0, 0] = 1e-30  # a table has to have some light
    check_black(BrdfTable(values, SMALL), 1e-30)
    must_fail(check_black, BrdfTable(values, SMALL), 0.0)
