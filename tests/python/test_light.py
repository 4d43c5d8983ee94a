"""Skies, suns and rectangles: their arguments, and densities that integrate to one."""

import numpy as np
import OpenEXR
import pytest

import limitray as lr

SIDE = 256
CENTRES = (np.arange(SIDE, dtype=np.float32) + 0.5) / SIDE
SQUARE = np.stack([a.ravel() for a in np.meshgrid(CENTRES, CENTRES)])


def whole_sphere():
    """Unit directions (3, n), uniform."""
    z, angle = 2 * SQUARE[0] - 1, 2 * np.pi * SQUARE[1]
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), z, r * np.sin(angle)]).astype(np.float32)


def spotted(height=32, width=64):
    """A dim image with one bright spot."""
    image = np.full((height, width, 3), 0.1)
    image[9:11, 40:43] = (50, 40, 30)
    return image


def test_an_image_is_the_right_way_up():
    image = np.zeros((2, 4, 3))
    image[0] = (1, 1, 1)
    image[1, 0], image[1, 1], image[1, 2], image[1, 3] = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)
    sky = lr.ImageSky(image)
    half = np.sqrt(0.5)
    directions = np.array([(0, 1, 0), (-half, -half, -half), (half, -half, -half)], np.float32).T
    directions /= np.linalg.norm(directions, axis=0)
    above, left, right = sky.radiance(directions).T
    np.testing.assert_allclose(above, 1, atol=0.02)
    assert left[0] > 0.3 > left[2]
    assert right[1] > 0.3 > right[0]
    turned = lr.ImageSky(image, rotation_deg=90).radiance(directions).T
    np.testing.assert_allclose(turned[1], right * 0 + turned[1])
    assert turned[1][1] > 0.3, "what was ahead is now at the left"
    upright = lr.ImageSky(image, up=(0, 0, 1)).radiance(np.array([[0], [0], [1]], np.float32))
    np.testing.assert_allclose(upright, 1, atol=0.02)


def test_directions_of_an_image_follow_its_light():
    sky = lr.ImageSky(spotted())
    directions, density = sky.sample(SQUARE)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=0), 1, atol=1e-5)
    again = sky.density(directions)
    assert (np.abs(again - density) < 1e-3 * density).mean() > 0.999
    total = 4 * np.pi * sky.density(whole_sphere()).mean()
    np.testing.assert_allclose(total, 1, rtol=0.01)
    np.testing.assert_allclose((1 / density).mean(), 4 * np.pi, rtol=0.02)
    by_sampling = (sky.radiance(directions) / density).mean(axis=1)
    by_sphere = 4 * np.pi * sky.radiance(whole_sphere()).mean(axis=1)
    np.testing.assert_allclose(by_sampling, by_sphere, rtol=0.03)


def test_gradients_go_from_ground_to_zenith():
    sky = lr.GradientSky((0, 0, 1), (0, 1, 0), (1, 0, 0), up=(0, 0, 2))
    directions = np.array([(0, 0, 1), (1, 0, 0), (0, 0, -1)], np.float32).T
    np.testing.assert_allclose(sky.radiance(directions), np.eye(3)[::-1], atol=1e-6)


def test_sky_images_are_read_from_files(tmp_path):
    pixels = np.random.default_rng(0).random((4, 8, 3), np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": pixels}).write(str(tmp_path / "sky.exr"))
    read = lr.ImageSky.from_file(tmp_path / "sky.exr", scale=2)
    expected = lr.ImageSky(pixels, scale=2)
    np.testing.assert_array_equal(read.radiance(whole_sphere()), expected.radiance(whole_sphere()))
    with pytest.raises(FileNotFoundError):
        lr.ImageSky.from_file(tmp_path / "none.exr")


@pytest.mark.parametrize("light", [
    lr.Sun((1, 2, 3), (4, 5, 6), 20),
    lr.RectangleLight((0, 2, 0), (0.5, 0, 0), (0, 0, 1.5), (4, 5, 6)),
    lr.RectangleLight((0.3, -1, 0.2), (0.5, 0.5, 0), (0, 0, 1), (4, 5, 6), two_sided=True),
])  # fmt: skip
def test_ways_to_a_light_meet_it(light):
    points = np.zeros((3, SIDE * SIDE), np.float32)
    ways = light.sample(points, SQUARE)
    distances, radiance, density = light.meet(points, ways.directions)
    inner = np.isfinite(distances)
    assert inner.mean() > 0.99
    np.testing.assert_allclose(radiance[:, inner], ways.radiance[:, inner], rtol=1e-6)
    np.testing.assert_allclose(density[inner], ways.density[inner], rtol=1e-3)
    seen = light.meet(points, whole_sphere())
    np.testing.assert_allclose(4 * np.pi * seen[2].mean(), 1, rtol=0.05)


def test_rectangles_are_dark_behind():
    lamp = lr.RectangleLight((0, 2, 0), (0, 0, 1.5), (0.5, 0, 0))
    up = np.array([[0], [1], [0]], np.float32)
    distance, radiance, density = lamp.meet(0 * up, up)
    assert distance == 2
    assert not radiance.any()
    assert density == 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: lr.ConstantSky((1, -1, 1)), "radiance must be finite and at least 0"),
        (lambda: lr.GradientSky(up=(0, 0, 0)), "up must be finite and not 0"),
        (lambda: lr.ImageSky(np.zeros((0, 4, 3))), "image must have pixels"),
        (
            lambda: lr.ImageSky(np.full((2, 4, 3), -1.0)),
            "image must have pixels, all of them finite",
        ),
        (
            lambda: lr.ImageSky(np.ones((2, 4, 3)), scale=0),
            "scale must be finite and above 0, not 0",
        ),
        (lambda: lr.Sun((0, 0, 0)), "direction must not be 0"),
        (lambda: lr.Sun((0, 1, 0), angle_deg=0), "angle_deg must be above 0 and up to 90, not 0"),
        (lambda: lr.RectangleLight((0, 0, 0), (1, 0, 0), (1, 1, 0)), "be at right angles"),
        (lambda: lr.Material(roughness=0.0), "roughness must be 0.05 to 1, not 0.0"),
        (lambda: lr.Material(metallic=2), "metallic must be 0 to 1, not 2"),
        (lambda: lr.Material(ior=0.5), "ior must be 1 to 4, not 0.5"),
    ],
)
def test_wrong_arguments_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
