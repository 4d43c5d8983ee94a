"""Cameras: rays as Open3D makes them, and automatic framing."""

import numpy as np
import pytest
from shapes import CAGES, cage, cube, scene_of

import limitray as lr


def test_the_middle_ray_looks_at_the_center():
    rays = lr.create_rays_pinhole(90, (1, 2, 3), (1, 2, 8), (0, 1, 0), 5, 3)
    assert rays.shape == (3, 5, 6)
    assert rays.dtype == np.float32
    np.testing.assert_array_equal(rays[..., :3], np.broadcast_to((1, 2, 8), (3, 5, 3)))
    np.testing.assert_allclose(rays[1, 2, 3:], (0, 0, -1), atol=1e-7)


def test_field_of_view_is_horizontal_and_depth_is_t():
    rays = lr.create_rays_pinhole(60, (0, 0, 0), (0, 0, 4), (0, 1, 0), 400, 200)
    half = np.tan(np.radians(30))
    np.testing.assert_allclose(rays[0, 0, 3:], (-half * 399 / 400, half * 199 / 400, -1), atol=1e-6)
    np.testing.assert_allclose(
        rays[-1, -1, 3:], (half * 399 / 400, -half * 199 / 400, -1), atol=1e-6
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"eye": (0, 0, 0)}, "eye and center must differ"),
        ({"up": (0, 0, 2)}, "up must not be 0 or parallel"),
        ({"up": (0, 0, 0)}, "up must not be 0 or parallel"),
        ({"fov_deg": 180}, "fov_deg must be above 0 and below 180, not 180"),
        ({"fov_deg": float("nan")}, "fov_deg must be"),
        ({"eye": (0, np.inf, 1)}, "eye must be finite"),
        ({"center": (0, 1)}, r"center must have shape \(3,\), not \(2,\)"),
        ({"width_px": 0}, "width_px must be an integer >= 1, not 0"),
        ({"height_px": 2.5}, "height_px must be an integer >= 1, not 2.5"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    right = {"fov_deg": 40, "center": (0, 0, 0), "eye": (0, 0, 4), "up": (0, 1, 0)}
    with pytest.raises(ValueError, match=message):
        lr.create_rays_pinhole(**{**right, "width_px": 4, "height_px": 3, **arguments})


@pytest.mark.parametrize("path", CAGES, ids=lambda path: path.stem)
@pytest.mark.parametrize("aspect", [0.5, 2.0])
def test_framing_shows_everything_and_fills_the_picture(path, aspect):
    scene = scene_of(lr.Mesh.from_file(path))
    camera = lr.Camera.frame(scene, aspect, margin=0.05)
    width, height = (200, 100) if aspect > 1 else (100, 200)
    rays = lr.create_rays_pinhole(
        camera.fov_deg, camera.center, camera.eye, camera.up, width, height
    )
    rows, columns = np.nonzero(scene.test_occlusions(rays))
    assert rows.min() > 0
    assert columns.min() > 0
    assert rows.max() < height - 1
    assert columns.max() < width - 1
    filled = max(np.ptp(rows) / height, np.ptp(columns) / width)
    assert 0.84 <= filled <= 0.95


@pytest.mark.parametrize(
    ("up", "azimuth", "expected"),
    [
        ((0, 1, 0), 0, (0, 0, -1)),
        ((0, 1, 0), 90, (-1, 0, 0)),
        ((0, 0, 1), 0, (0, 1, 0)),
        ((0, 0, 1), 90, (-1, 0, 0)),
    ],
)
def test_the_front_is_seen_at_azimuth_0(up, azimuth, expected):
    camera = lr.Camera.frame(scene_of(cube()), 1, azimuth, 0, up)
    np.testing.assert_allclose(camera.axes()[2], expected, atol=1e-6)


def test_framing_looks_down_from_the_elevation():
    camera = lr.Camera.frame(scene_of(cage("demo")), 1, 20, 35, (0, 0, 1))
    assert camera.axes()[2] @ (0, 0, -1) == pytest.approx(np.sin(np.radians(35)))
    with pytest.raises(ValueError, match="elevation_deg must be between -90 and 90, not 90"):
        lr.Camera.frame(scene_of(cube()), elevation_deg=90)


@pytest.mark.parametrize(("width", "height"), [(300, 200), (500, 200), (100, 300)])
def test_a_gate_is_seen_whole_in_pictures_of_any_shape(width, height):
    """The corner of the gate is in the picture, on its border in at least one direction."""
    camera = lr.Camera((0, 0, 0), (0, 0, -1), fov_deg=90, aspect=1.5)
    x, y = np.array([0.0, width]), np.array([height, 0.0])
    rays = camera.rays(x, y, width, height)
    right, top = rays[1, 3], rays[1, 4]
    assert min(right / 1, top / (2 / 3)) == pytest.approx(1)
    assert right / top == pytest.approx(width / height)
    np.testing.assert_allclose(rays[0, 3:5], [-right, -top], atol=1e-12)


def test_the_gate_reaches_the_renderer():
    """A square that fills the gate of 3:2: three quarters of the width of a picture of 2:1."""
    square = lr.Mesh([(-3, -2, 0), (3, -2, 0), (3, 2, 0), (-3, 2, 0)], [4], [0, 1, 2, 3],
                     corner_indices=[0, 1, 2, 3], corner_sharpnesses=[np.inf] * 4)  # fmt: skip
    camera = lr.Camera((0, 0, 3), (0, 0, 0), fov_deg=90, aspect=1.5)
    seen = lr.render(scene_of(square), camera, 80, 40, 4, "facing").rgba[..., 3]
    assert (seen[:, 10:70] == 1).all()
    assert (seen[:, :10] == 0).all()
    assert (seen[:, 70:] == 0).all()
    with pytest.raises(ValueError, match="aspect must be a number above 0, not 0"):
        lr.Camera((0, 0, 3), (0, 0, 0), aspect=0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"aspect": 0}, "aspect must be a number above 0, not 0"),
        ({"fov_deg": np.nan}, "fov_deg must be above 0 and below 180, not nan"),
        ({"margin": 0.5}, "margin must be at least 0 and below 0.5, not 0.5"),
        ({"azimuth_deg": np.inf}, "azimuth_deg must be finite, not inf"),
        ({"elevation_deg": np.nan}, "elevation_deg must be between -90 and 90, not nan"),
        ({"up": (0, 0, 0)}, "up must not be 0"),
        ({"up": (0, np.nan, 0)}, "up must be finite"),
    ],
)
def test_wrong_arguments_of_frame_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        lr.Camera.frame(scene_of(cube()), **arguments)
