"""Textures: formats, colour spaces, wrap modes, tiles, and filtering."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image as PillowImage

import limitray as lr
from limitray.image import srgb_to_linear
from limitray.material import Footprint, base_colors, finish

RAMP = np.stack([np.arange(8.0)] * 3, axis=1)[np.newaxis]  # (1, 8, 3): value i at texel i


def column(texture, *s):
    """Red at (s, 0.5)."""
    return texture.sample([(x, 0.5) for x in s])[:, 0]


def test_lower_left_is_the_origin():
    image = np.zeros((2, 2, 3))
    image[1, 0] = (1, 0, 0)  # lower left in the file
    image[0, 1] = (0, 1, 0)  # upper right
    texture = lr.Texture(image, "clamp", "clamp")
    np.testing.assert_array_equal(
        texture.sample([(0.25, 0.25), (0.75, 0.75), (0.25, 0.75)]),
        [(1, 0, 0), (0, 1, 0), (0, 0, 0)],
    )


def test_lookup_is_linear_between_texel_centres():
    texture = lr.Texture(RAMP)
    s = np.linspace(0.5, 7.5, 50) / 8
    np.testing.assert_allclose(column(texture, *s), 8 * s - 0.5, atol=1e-6)


@pytest.mark.parametrize(
    ("wrap", "left", "right", "far"),
    [("repeat", 7, 0, 2), ("mirror", 0, 7, 2), ("clamp", 0, 7, 7), ("black", 0, 0, 0)],
)
def test_wrap_modes(wrap, left, right, far):
    texture = lr.Texture(RAMP, wrap, "clamp")
    centre = 0.5 / 8
    values = column(texture, -centre, 1 + centre, 2 + 5 * centre)
    np.testing.assert_allclose(values, [left, right, far])


def test_png_and_jpeg_are_srgb(tmp_path):
    pixels = np.full((8, 8, 3), (188, 64, 255), np.uint8)
    PillowImage.fromarray(pixels).save(tmp_path / "t.png")
    PillowImage.fromarray(pixels).save(tmp_path / "t.jpg", quality=100)
    expected = srgb_to_linear(pixels[0, 0] / 255.0)
    for name, tolerance in (("t.png", 1e-6), ("t.jpg", 0.02)):
        texture = lr.Texture.from_file(tmp_path / name)
        np.testing.assert_allclose(texture.sample([(0.5, 0.5)])[0], expected, atol=tolerance)
    raw = lr.Texture.from_file(tmp_path / "t.png", color_space="raw")
    np.testing.assert_allclose(raw.sample([(0.5, 0.5)])[0], pixels[0, 0] / 255.0, atol=1e-6)


def test_grey_palette_alpha_and_16_bit_images(tmp_path):
    PillowImage.new("L", (2, 2), 255).save(tmp_path / "grey.png")
    PillowImage.new("RGBA", (2, 2), (0, 255, 0, 7)).save(tmp_path / "alpha.png")
    PillowImage.new("RGB", (2, 2), (255, 0, 0)).convert("P").save(tmp_path / "palette.png")
    PillowImage.fromarray(np.full((2, 2), 13107, np.uint16)).save(tmp_path / "deep.png")
    expected = {"grey": (1, 1, 1), "alpha": (0, 1, 0), "palette": (1, 0, 0), "deep": (0.2,) * 3}
    for name, colour in expected.items():
        texture = lr.Texture.from_file(tmp_path / f"{name}.png")
        np.testing.assert_allclose(texture.sample([(0.5, 0.5)])[0], colour, atol=1e-5)


def test_exr_is_linear(tmp_path):
    channels = {name: np.full((4, 4), value, np.float32) for name, value in zip("RGB", (5, 0.5, 2))}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(tmp_path / "t.exr"))
    texture = lr.Texture.from_file(tmp_path / "t.exr")
    np.testing.assert_allclose(texture.sample([(0.5, 0.5)])[0], (5, 0.5, 2))
    OpenEXR.File(header, {"Y": channels["R"]}).write(str(tmp_path / "y.exr"))
    grey = lr.Texture.from_file(tmp_path / "y.exr")
    np.testing.assert_allclose(grey.sample([(0.5, 0.5)])[0], (5, 5, 5))
    OpenEXR.File(header, {"R": channels["R"]}).write(str(tmp_path / "r.exr"))
    with pytest.raises(ValueError, match=r"r\.exr: .*no channel G"):
        lr.Texture.from_file(tmp_path / "r.exr")


def test_udim_tiles(tmp_path):
    for tile, colour in ((1001, (255, 0, 0)), (1002, (0, 255, 0)), (1011, (0, 0, 255))):
        PillowImage.new("RGB", (4, 4), colour).save(tmp_path / f"skin.{tile}.png")
    (tmp_path / "skin.note.png").write_bytes(b"not a tile")
    texture = lr.Texture.from_file(tmp_path / "skin.<UDIM>.png")
    assert texture.tiles == (1001, 1002, 1011)
    places = [(0.5, 0.5), (1.01, 0.99), (0.5, 1.5), (1.5, 1.5), (-0.5, 0.5)]
    np.testing.assert_array_equal(
        texture.sample(places), [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0), (0, 0, 0)]
    )
    with pytest.raises(FileNotFoundError, match="UDIM"):
        lr.Texture.from_file(tmp_path / "none.<UDIM>.png")


def test_a_wide_footprint_sees_the_mean():
    checker = np.indices((64, 64)).sum(axis=0)[..., np.newaxis] % 2 * np.ones(3)
    texture = lr.Texture(checker)
    rng = np.random.default_rng(0)
    st = rng.random((200, 2))
    np.testing.assert_allclose(texture.sample(st, (0.5, 0), (0, 0.5)), 0.5, atol=1e-6)
    assert np.ptp(texture.sample(st)) > 0.8
    # A stretched footprint is blurred as if it were a quarter as long.
    stretched = texture.sample(st, (4 / 64, 0), (0, 0.5 / 64))
    np.testing.assert_array_equal(stretched, texture.sample(st, (2 / 64, 0), (0, 2 / 64)))


def test_levels_blend_smoothly():
    rng = np.random.default_rng(1)
    texture = lr.Texture(rng.random((33, 20, 3)))
    width = np.linspace(0.01, 1, 400)
    st = np.tile((0.37, 0.61), (400, 1))
    values = texture.sample(st, width[:, np.newaxis] * [1, 0], width[:, np.newaxis] * [0, 1])
    assert np.abs(np.diff(values, axis=0)).max() < 0.05
    coarsest = texture.sample([(0.1, 0.2)], (9, 0), (0, 9))[0]
    np.testing.assert_allclose(values[-1], coarsest, atol=0.2)


def test_images_of_any_size():
    for shape in ((1, 1), (1, 5), (7, 3), (2, 9)):
        texture = lr.Texture(np.full((*shape, 3), 0.25))
        rng = np.random.default_rng(2)
        st = rng.normal(size=(100, 2)) * 5
        d = rng.normal(size=(2, 100, 2))
        np.testing.assert_allclose(texture.sample(st, *d), 0.25, atol=1e-7)


def test_footprint_is_that_of_neighbouring_pixels():
    """Ray differentials against rays through the neighbouring pixels."""
    square = lr.Mesh([(0, 0, 0), (3, 0, 0), (3, 2, 0), (0, 2, 0)], [4], [0, 1, 2, 3])
    scene = lr.Scene()
    scene.add_mesh(square)
    camera = lr.Camera(eye=(1, -1, 2), center=(1.5, 1, 0), up=(0, 0, 1), fov_deg=20)
    rays = camera.rays(np.array([50.0, 50.001, 50]), np.array([40.0, 40, 40.001]), 100, 80)
    hits = scene.cast_rays(rays, attributes=("points", "sub_quads", "dp_du", "dp_dv"))
    steps = rays[1:, 3:] - rays[0, 3:]
    middle = {name: values[:1] for name, values in hits.items()}
    spread = Footprint.of_rays(middle, rays[:1, 3:], *steps)
    moved = hits["points"][1:] - hits["points"][0]
    np.testing.assert_allclose([spread.d_dx[0], spread.d_dy[0]], moved, rtol=1e-3, atol=1e-9)
    uv = hits["primitive_uvs"][1:] - hits["primitive_uvs"][0]
    found = np.concatenate(spread.parameters(middle))
    np.testing.assert_allclose(found, uv, rtol=1e-3, atol=1e-8)


def textured_square(texture):
    st = lr.FaceVarying([(0, 0), (1, 0), (1, 1), (0, 1)])
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    # The rule `all`: the map is linear, like the square itself.
    square = lr.Mesh(points, [4], [0, 1, 2, 3], "edgeAndCorner", "all", primvars={"st": st})
    scene = lr.Scene()
    scene.set_material(scene.add_mesh(square), lr.Material(texture=texture))
    return scene


def test_colours_of_hits_are_those_of_the_image():
    rng = np.random.default_rng(3)
    texture = lr.Texture(rng.random((16, 16, 3)), "clamp", "clamp")
    scene = textured_square(texture)
    st = rng.random((500, 2))
    rays = np.concatenate([st, np.ones((500, 1)), np.tile((0, 0, -1.0), (500, 1))], axis=1)
    hits = scene.cast_rays(rays, attributes=("sub_quads", "dp_du", "dp_dv"))
    np.testing.assert_allclose(base_colors(scene, hits), texture.sample(st), atol=1e-6)


def test_far_textures_do_not_flicker():
    """One sample a pixel of a fine checker seen from afar: the mean, not noise."""
    checker = np.indices((256, 256)).sum(axis=0)[..., np.newaxis] % 2 * np.ones(3)
    scene = textured_square(lr.Texture(checker))
    camera = lr.Camera(eye=(0.5, 0.5, 3), center=(0.5, 0.5, 0), fov_deg=19)
    image = lr.render(scene, camera, 48, 48, 1, "ao").rgba[16:32, 16:32, :3]
    plain = lr.Scene()
    plain_square = lr.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3])
    plain.set_material(plain.add_mesh(plain_square), lr.Material((0.5, 0.5, 0.5)))
    expected = lr.render(plain, camera, 48, 48, 1, "ao").rgba[16:32, 16:32, :3]
    np.testing.assert_allclose(image, expected, atol=0.02)


def test_errors(tmp_path):
    with pytest.raises(ValueError, match=r"image must have shape \(n, n, 3\)"):
        lr.Texture(np.zeros((4, 4)))
    with pytest.raises(ValueError, match="image must not be empty"):
        lr.Texture(np.zeros((0, 4, 3)))
    with pytest.raises(ValueError, match="wrap_s must be one of repeat"):
        lr.Texture(RAMP, "round")
    with pytest.raises(FileNotFoundError):
        lr.Texture.from_file(tmp_path / "none.png")
    (tmp_path / "bad.png").write_bytes(b"no image")
    with pytest.raises(ValueError, match=r"bad\.png: cannot be read as an image"):
        lr.Texture.from_file(tmp_path / "bad.png")
    (tmp_path / "bad.exr").write_bytes(b"no image")
    with pytest.raises(ValueError, match=r"bad\.exr: cannot be read as an image"):
        lr.Texture.from_file(tmp_path / "bad.exr")
    with pytest.raises(ValueError, match=r'unknown texture format "\.tif"'):
        lr.Texture.from_bytes(b"", "x.tif")


def test_materials_of_faces():
    square = lr.Mesh(
        [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)],
        [4, 4],
        [0, 1, 4, 3, 1, 2, 5, 4],
    )
    scene = lr.Scene()
    mesh = scene.add_mesh(square)
    red, green = lr.Material((1, 0, 0)), lr.Material((0, 1, 0))
    scene.set_material(mesh, [red, green], [1, 0])
    moved = [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    copy = scene.add_instance(mesh, moved)
    scene.set_material(copy, green)
    rays = np.array([(x, 0.5, 1, 0, 0, -1.0) for x in (0.5, 1.5, 5.5, 6.5)])
    hits = scene.cast_rays(rays, attributes=("sub_quads", "dp_du", "dp_dv"))
    expected = [(0, 1, 0), (1, 0, 0), (0, 1, 0), (0, 1, 0)]
    np.testing.assert_array_equal(base_colors(scene, hits), expected)
    with pytest.raises(ValueError, match="indices into the 1 materials"):
        scene.set_material(mesh, red, [0, 1])
    with pytest.raises(ValueError, match="material must not be empty"):
        scene.set_material(mesh, [])
    with pytest.raises(ValueError, match="geometry_id must be below 2"):
        scene.set_material(2, red)


def test_adjusted_textures_are_the_same_image():
    rng = np.random.default_rng(2)
    image = rng.random((5, 7, 3))
    texture = lr.Texture(image, "mirror", "clamp")
    st, d_dx, d_dy = (rng.random((50, 2)) * scale for scale in (1, 0.3, 0.2))
    matrix = np.array([[0.5, -2.0, 0.25], [1.5, 0.75, -1.0]])
    found = texture.adjusted(matrix, (2, 3, 4), -0.5, channel=1).sample(st, d_dx, d_dy)
    turned = st @ matrix[:, :2].T + matrix[:, 2]
    plain = texture.sample(turned, d_dx @ matrix[:, :2].T, d_dy @ matrix[:, :2].T)
    np.testing.assert_allclose(found, plain[:, [1, 1, 1]] * [2, 3, 4] - 0.5, atol=1e-12)
    again = texture.adjusted(matrix).adjusted().sample(st, d_dx, d_dy)
    np.testing.assert_array_equal(again, texture.sample(st, d_dx, d_dy))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"transform": np.eye(3)}, r"transform must have shape \(2, 3\), not \(3, 3\)"),
        ({"transform": np.full((2, 3), np.nan)}, "transform must be finite"),
        ({"scale": (1, 2)}, "scale must"),
        ({"bias": np.inf}, "bias must be finite"),
        ({"channel": 3}, "channel must be 0, 1, 2 or None, not 3"),
    ],
)
def test_errors_of_adjusted(arguments, message):
    with pytest.raises(ValueError, match=message):
        lr.Texture(RAMP).adjusted(**arguments)


def test_textures_of_the_finish():
    """Red gives roughness, kept in its range, green metallic; constants without coordinates."""
    points, counts, indices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3]
    st = lr.FaceVarying(np.array(points)[:, :2], indices)
    scene = lr.Scene()
    scene.add_mesh(lr.Mesh(points, counts, indices, primvars={"st": st}))
    bare = np.eye(4)
    bare[0, 3] = 5
    scene.add_mesh(lr.Mesh(points, counts, indices), transform=bare)
    image = lr.Texture(np.array([[(0.0, 1.0, 0), (0.5, 0.25, 0)]]))
    material = lr.Material(
        roughness=0.75,
        metallic=0.5,
        roughness_texture=image,
        metallic_texture=image.adjusted(channel=1),
    )
    assert not material.is_plain
    for mesh in (0, 1):
        scene.set_material(mesh, material)
    rays = np.array([(x, 0.5, 1, 0, 0, -1.0) for x in (0.25, 0.75, 5.5)])
    found = finish(scene, scene.cast_rays(rays, attributes=("sub_quads", "dp_du", "dp_dv")))
    np.testing.assert_allclose(found.roughness, [0.05, 0.5, 0.75], atol=1e-7)
    np.testing.assert_allclose(found.metallic, [1, 0.25, 0.5], atol=1e-7)
    pictures = [
        lr.render(scene, lr.Camera((0.5, 0.5, 2), (0.5, 0.5, 0)), 16, 16, 4, "path").rgba
        for _ in (1, 2)
    ]
    np.testing.assert_array_equal(*pictures)
    with pytest.raises(ValueError, match="metallic_texture needs a roughness, got none"):
        lr.Material(metallic_texture=image)
