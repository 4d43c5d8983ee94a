"""Pictures: integrators, layers, determinism and the files they are saved in."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from shapes import cage, cube, scene_of, square

import limitray as lr

CAMERA = lr.Camera(eye=(0, 0, 6), center=(0, 0, 0), fov_deg=30)
SMALL = {"camera": CAMERA, "width": 40, "height": 30, "spp": 2}


@pytest.fixture(scope="module")
def scene():
    return scene_of(cube())


@pytest.mark.parametrize("integrator", ["ao", "facing", "normal", "uv"])
def test_integrators_show_the_cube_on_an_empty_background(scene, integrator):
    image = lr.render(scene, integrator=integrator, **SMALL)
    assert image.rgba.shape == (30, 40, 4)
    assert image.rgba.dtype == np.float32
    assert image.rgba[15, 20, 3] == 1
    assert image.rgba[15, 20, :3].min() > 0.05
    assert (image.rgba[0, 0] == 0).all()
    assert np.isfinite(image.rgba).all()
    assert image.rgba.min() >= 0


def test_integrators_show_what_they_are_named_after(scene):
    straight = lr.render(scene, integrator="facing", **SMALL).srgb()[15, 20]
    np.testing.assert_allclose(straight, 255, atol=3)
    normal = lr.render(scene, integrator="normal", **SMALL).srgb()[15, 20]
    np.testing.assert_allclose(normal, (128, 128, 255), atol=10)


def test_light_comes_from_the_sky():
    """A floor under an open sky is lit; under a lid close above it, it is nearly black."""
    floor = lr.Mesh([(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], [4], [0, 1, 2, 3])
    camera = lr.Camera((0, 0.2, 0), (0, 0, -0.3), (0, 1, 0), 20)
    lid = np.diag([40.0, 1, 40, 1])
    lid[1, 3] = 0.5
    open_scene, closed = scene_of(floor), scene_of(floor)
    closed.add_mesh(floor, transform=lid)
    lit, dark = (lr.render(s, camera, 16, 16, 8).rgba[..., :3].mean() for s in (open_scene, closed))
    assert lit > 0.3
    assert dark < 0.1 * lit


def test_a_seed_fixes_the_picture_for_any_number_of_threads():
    pictures = []
    for threads in (1, 2, 3):
        scene = lr.Scene(threads=threads)
        scene.add_mesh(cage("demo"))
        pictures.append(lr.render(scene, width=60, height=45, spp=2, seed=7).rgba)
    np.testing.assert_array_equal(pictures[1], pictures[0])
    np.testing.assert_array_equal(pictures[2], pictures[0])
    other = lr.render(scene, width=60, height=45, spp=2, seed=8).rgba
    assert (other != pictures[0]).any()


def test_more_samples_come_closer_to_the_limit(scene):
    many = lr.render(scene, **{**SMALL, "spp": 256}).rgba
    errors = [
        np.square(lr.render(scene, **{**SMALL, "spp": spp}).rgba - many).mean() for spp in (1, 16)
    ]
    assert errors[1] < errors[0] / 8


def test_layers_are_the_hits_of_pixel_centres(scene):
    names = ("depth", "normal", "position", "face", "patch")
    layers = lr.render(scene, aovs=names, **SMALL).aovs
    rays = lr.create_rays_pinhole(30, CAMERA.center, CAMERA.eye, CAMERA.up, 40, 30)
    hit = scene.cast_rays(rays, attributes=("points", "patch_ids"))
    keys = ("t_hit", "primitive_normals", "points", "primitive_ids", "patch_ids")
    for name, key in zip(names, keys, strict=True):
        np.testing.assert_array_equal(layers[name], hit[key])
    assert layers["depth"][0, 0] == np.inf
    assert layers["face"][0, 0] == lr.INVALID_ID
    assert layers["face"].dtype == np.uint32


def test_progress_reaches_the_total(scene):
    seen = []
    lr.render(scene, progress=lambda done, total: seen.append((done, total)), **SMALL)
    assert seen[-1] == (2400, 2400)
    assert seen == sorted(seen)


def test_an_interrupt_keeps_the_picture_so_far(scene):
    def stop(done, total):
        if done >= 1200:
            raise KeyboardInterrupt

    with pytest.raises(lr.RenderInterrupted) as caught:
        lr.render(scene, progress=stop, **{**SMALL, "spp": 9})
    assert isinstance(caught.value, KeyboardInterrupt)
    expected = lr.render(scene, **{**SMALL, "spp": 1})
    np.testing.assert_array_equal(caught.value.image.rgba, expected.rgba)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"width": 0}, "width must be an integer >= 1, not 0"),
        ({"height": 1.5}, "height must be an integer >= 1, not 1.5"),
        ({"spp": 0}, "spp must be an integer >= 1, not 0"),
        ({"seed": -1}, "seed must be an integer >= 0, not -1"),
        ({"integrator": "z"}, "integrator must be one of ao, facing, normal, uv, path, not 'z'"),
        ({"aovs": ("z",)}, "aovs must be one of depth, normal, position, face, patch, not 'z'"),
    ],
)
def test_wrong_arguments_are_named(scene, arguments, message):
    with pytest.raises(ValueError, match=message):
        lr.render(scene, **{**SMALL, **arguments})


def test_an_empty_scene_cannot_be_framed():
    with pytest.raises(ValueError, match="no surface"):
        lr.render(lr.Scene())


def test_png_files_hold_the_picture_on_its_background(scene, tmp_path):
    image = lr.render(scene, **SMALL)
    image.save(tmp_path / "cube.png")
    with Image.open(tmp_path / "cube.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), image.srgb())
    assert image._repr_png_() == (tmp_path / "cube.png").read_bytes()
    assert 40 < image.srgb()[0, 0].mean() < 250


def test_exr_files_hold_linear_colour_and_layers(scene, tmp_path):
    image = lr.render(scene, aovs=("depth", "normal", "face"), **SMALL)
    image.save(tmp_path / "cube.exr")
    channels = OpenEXR.File(str(tmp_path / "cube.exr"), separate_channels=True).channels()
    names = {"R", "G", "B", "A", "depth.Z", "normal.X", "normal.Y", "normal.Z", "face.id"}
    assert set(channels) == names
    for k, name in enumerate("RGBA"):
        np.testing.assert_array_equal(channels[name].pixels, image.rgba[..., k])
    np.testing.assert_array_equal(channels["depth.Z"].pixels, image.aovs["depth"])
    np.testing.assert_array_equal(channels["normal.Y"].pixels, image.aovs["normal"][..., 1])
    np.testing.assert_array_equal(channels["face.id"].pixels, image.aovs["face"])


def test_pictures_that_cannot_be_saved(scene, tmp_path):
    image = lr.render(scene, **SMALL)
    with pytest.raises(ValueError, match=r'must end in \.png or \.exr, not "\.jpg"'):
        image.save(tmp_path / "cube.jpg")
    for name in ("cube.png", "cube.exr"):
        with pytest.raises(FileNotFoundError):
            image.save(tmp_path / "nowhere" / name)


def test_no_self_shadowing_on_a_flat_sheet():
    """Every pixel of a lit plane gets the same light: shadow rays never hit where they start."""
    scene = scene_of(square())
    camera = lr.Camera((0.5, 0.5, 3), (0.5, 0.5, 0), (0, 1, 0), 15)
    image = lr.render(scene, camera, 64, 64, 16)
    assert (image.rgba[..., 3] == 1).all()
    assert image.rgba[..., 1].std() < 0.05 * image.rgba[..., 1].mean()
