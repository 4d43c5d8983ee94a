"""The integrator "path": energy, analytic cases, determinism, lights, and stopping."""

import numpy as np
import pytest
from shapes import REPOSITORY, cage, cube, scene_of

import limitray as lr

CAMERA = lr.Camera(eye=(0, 0, 6), center=(0, 0, 0), fov_deg=30)
FLOOR = lr.Mesh([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], [4], [0, 1, 2, 3])
CAGES = REPOSITORY / "tests/cages"
WHITE = lr.ConstantSky((1, 1, 1))


def lit(scene, camera=CAMERA, size=(32, 24), spp=16, **arguments):
    """Mean colour of the pixels that show a surface everywhere, and their standard error."""
    rgba = lr.render(scene, camera, *size, spp=spp, integrator="path", **arguments).rgba
    inside = rgba[rgba[..., 3] == 1][:, :3]
    assert len(inside) > 20
    return inside.mean(axis=0), inside.std(axis=0) / np.sqrt(len(inside))


def floor_scene(color=(0.5, 0.5, 0.5)):
    scene = scene_of(FLOOR)
    scene.set_material(0, lr.Material(color))
    return scene


def straight_down(x=0.0, z=0.0):
    """A camera that looks at a small spot of the floor."""
    return lr.Camera((x, 3, z), (x, 0, z), (0, 0, -1), 0.5)


def test_furnace_of_a_convex_shape():
    """Under a uniform sky a diffuse ball shows its colour, every sample exactly."""
    scene = scene_of(cube())
    for color in ((1, 1, 1), (0.2, 0.5, 0.9)):
        scene.set_material(0, lr.Material(color))
        mean, _ = lit(scene, sky=WHITE, spp=2)
        np.testing.assert_allclose(mean, color, rtol=1e-5)


@pytest.mark.parametrize("finish", [{}, {"roughness": 0.5}, {"roughness": 0.6, "metallic": 1.0}])
def test_furnace_of_a_hollow_shape(finish):
    """All light that enters a white cup leaves it, after many bounces and roulette."""
    scene = scene_of(cage("demo"))
    scene.set_material(0, lr.Material((1, 1, 1), **finish))
    camera = lr.Camera.frame(scene, 4 / 3, elevation_deg=60)
    mean, error = lit(scene, camera, sky=WHITE, max_depth=250)
    np.testing.assert_allclose(mean, 1, atol=0.01 + 3 * error.max())


def test_a_sky_image_lights_like_the_same_constant():
    """One is found by surfaces alone, the other is aimed at as well."""
    scene = scene_of(cage("demo"))
    camera = lr.Camera.frame(scene, 4 / 3)
    constant, _ = lit(scene, camera, sky=lr.ConstantSky((0.5, 1, 2)))
    image = lr.ImageSky(np.broadcast_to((0.5, 1.0, 2.0), (16, 32, 3)))
    np.testing.assert_allclose(lit(scene, camera, sky=image)[0], constant, rtol=0.01)


def test_closed_rooms_gain_and_lose_nothing():
    """A small lamp of power P inside a ball of area A and albedo a: an integrating sphere.

    From a point of a sphere all others are seen equally, so that after its first reflection light
    is everywhere the same: the radiance of bounce k is a^k P / (A pi), k = 2, 3, ...
    """
    lamp = lr.RectangleLight((0, 0, 0), (0.02, 0, 0), (0, 0, 0.02), (100, 100, 100), two_sided=True)
    power = 2 * np.pi * 100 * 0.04**2
    ball = lr.Mesh.from_file(CAGES / "icosahedron_smooth.obj")
    triangles = ball.to_triangles(4)
    a, b, c = (triangles.points[triangles.indices[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    scene = scene_of(ball)
    scene.set_material(0, lr.Material((0.5, 0.5, 0.5)))
    camera = lr.Camera((0, 0.3, 0), (0, 1, 0.3), (0, 0, 1), 90)
    one, two, all_bounces = (
        lit(scene, camera, (64, 48), 16, lights=[lamp], max_depth=depth)[0][0]
        for depth in (1, 2, 40)
    )
    unit = power / (area * np.pi)
    np.testing.assert_allclose(two - one, 0.5**2 * unit, rtol=0.03)
    np.testing.assert_allclose(all_bounces - one, 0.5**2 / (1 - 0.5) * unit, rtol=0.03)


def test_the_sun_by_its_cosine():
    scene = floor_scene((0.5, 0.25, 1))
    for elevation in (90, 30):
        angle = np.radians(elevation)
        sun = lr.Sun((np.cos(angle), np.sin(angle), 0), (3, 2, 1), angle_deg=0.5)
        mean, _ = lit(scene, straight_down(), (8, 8), lights=[sun])
        expected = np.array((0.5, 0.25, 1)) * (3, 2, 1) * np.sin(angle) / np.pi
        np.testing.assert_allclose(mean, expected, rtol=1e-3)


def parallel_rectangle_factor(x, y):
    """Form factor from a point to a rectangle x by y above it, in units of the distance.

    One corner stands over the point (the textbook's configuration factor B-3 or C-11).
    """
    a, b = np.hypot(1, x), np.hypot(1, y)
    return (x / a * np.arctan(y / a) + y / b * np.arctan(x / b)) / (2 * np.pi)


@pytest.mark.parametrize("height", [0.4, 2.0])
def test_a_rectangle_converges_to_its_form_factor(height):
    """The error falls as samples are added; near the light both ways of finding it count."""
    scene = floor_scene((1, 1, 1))
    lamp = lr.RectangleLight((0, height, 0), (0.7, 0, 0), (0, 0, 0.5), (2, 2, 2))
    camera = lr.Camera((0, 0.2, 0), (0, 0, 0), (0, 0, -1), 0.5)
    expected = 2 * 4 * parallel_rectangle_factor(0.7 / height, 0.5 / height)
    errors = []
    for spp in (1, 16):
        image = lr.render(scene, camera, 24, 24, spp, "path", lights=[lamp]).rgba
        errors.append(np.sqrt(np.square(image[..., 0] - expected).mean()))
    mean, standard_error = lit(scene, camera, (24, 24), 64, lights=[lamp])
    np.testing.assert_allclose(mean, expected, atol=4 * standard_error.max() + 1e-5)
    assert errors[1] < errors[0] / 4


def test_rectangles_shine_to_one_side_and_hide_what_is_behind():
    scene = floor_scene()
    spot = straight_down()
    facing_up = lr.RectangleLight((0, 1, 0), (0, 0, 0.1), (0.1, 0, 0), (1, 1, 1))
    assert (lr.render(scene, spot, 8, 8, 1, "path", lights=[facing_up]).rgba == 1).all()
    facing_down = lr.RectangleLight((0, 1, 0), (0.1, 0, 0), (0, 0, 0.1), (1, 1, 1))
    seen = lr.render(scene, spot, 8, 8, 1, "path", lights=[facing_down]).rgba
    assert not seen[..., :3].any()
    assert (seen[..., 3] == 1).all()
    beside = lr.Camera((0.5, 3, 0), (0, 0, 0), (0, 0, -1), 0.5)
    sun = lr.Sun((0, 1, 0), (1, 1, 1))
    bright, _ = lit(scene, beside, (8, 8), lights=[sun])
    dark, _ = lit(scene, beside, (8, 8), lights=[sun, facing_up], max_depth=1)
    assert bright[0] > 0.1
    assert dark[0] == 0


def test_light_that_is_reflected_twice():
    """A wall beside the floor bleeds its colour onto it."""
    scene = floor_scene((0.8, 0.8, 0.8))
    wall = scene.add_mesh(
        lr.Mesh([(1, 0, -1), (1, 0, 1), (1, 2, 1), (1, 2, -1)], [4], [0, 1, 2, 3])
    )
    scene.set_material(wall, lr.Material((0.9, 0.05, 0.05)))
    sun = lr.Sun((-1, 0.5, 0), (3, 3, 3))
    spot = straight_down(0.8)
    one, _ = lit(scene, spot, (8, 8), lights=[sun], max_depth=1)
    two, _ = lit(scene, spot, (8, 8), lights=[sun], max_depth=2, spp=64)
    assert np.ptp(one) < 1e-6
    assert two[0] > two[1] * 1.1
    np.testing.assert_allclose(two[1], two[2])


def test_the_background_is_the_sky():
    colors = np.zeros((64, 8, 3))
    colors[:32], colors[32:] = (0.1, 0.2, 0.9), (0.3, 0.2, 0.1)
    image = lr.render(scene_of(cube()), CAMERA, 40, 30, 1, "path", sky=lr.ImageSky(colors))
    np.testing.assert_allclose(image.background[0, 0], (0.1, 0.2, 0.9), atol=1e-6)
    np.testing.assert_allclose(image.background[-1, 0], (0.3, 0.2, 0.1), atol=1e-6)
    assert not image.rgba[0, 0].any()
    studio = lr.render(scene_of(cube()), CAMERA, 40, 30, 1, "path")
    assert 0.05 < studio.rgba[15, 20, :3].min()


def test_a_seed_fixes_the_picture_for_any_number_of_threads():
    pictures = []
    for threads in (1, 2, 3):
        scene = lr.Scene(threads=threads)
        scene.add_mesh(cage("demo"))
        scene.set_material(0, lr.Material((0.8, 0.5, 0.3), roughness=0.4))
        pictures.append(lr.render(scene, None, 300, 240, 2, "path", seed=7).rgba)
    np.testing.assert_array_equal(pictures[1], pictures[0])
    np.testing.assert_array_equal(pictures[2], pictures[0])
    other = lr.render(scene, None, 300, 240, 2, "path", seed=8).rgba
    assert (other != pictures[0]).any()


def test_an_interrupt_keeps_the_samples_so_far():
    def stop(done, total):
        if done >= 2 * 40 * 30:
            raise KeyboardInterrupt

    scene = scene_of(cage("demo"))
    with pytest.raises(lr.RenderInterrupted) as caught:
        lr.render(scene, None, 40, 30, 64, "path", progress=stop)
    expected = lr.render(scene, None, 40, 30, 2, "path")
    np.testing.assert_allclose(caught.value.image.rgba, expected.rgba, atol=1e-6)


def test_denoising_comes_closer_to_the_limit():
    pytest.importorskip("pyoidn", reason="the extra limitray[denoise] is not installed")
    scene = scene_of(cage("demo"))
    camera = lr.Camera.frame(scene, 4 / 3)
    pictures = [
        lr.render(scene, camera, 128, 96, spp, "path", denoise=denoise).linear()
        for spp, denoise in ((128, False), (2, False), (2, True))
    ]
    noisy, clean = (np.square(picture - pictures[0]).mean() for picture in pictures[1:])
    assert clean < noisy / 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"integrator": "ao", "sky": WHITE}, 'are for the integrator "path", not ao'),
        ({"integrator": "ao", "denoise": True}, 'are for the integrator "path", not ao'),
        ({"max_depth": 0}, "max_depth must be an integer >= 1, not 0"),
        ({"lights": [lr.Sun((0, 1, 0))] * 30}, "lights must be at most 29, not 30"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        lr.render(scene_of(cube()), CAMERA, 8, 8, 1, **{"integrator": "path", **arguments})
