"""Arguments of wrong kinds: each is a ValueError that names the argument and what was given."""

import numpy as np
import pytest
from shapes import REPOSITORY, cage, scene_of, square

import limitray as lr

RAYS = np.tile([0.3, 0.2, 5, 0, 0, -1.0], (4, 1))
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
PLACE = {"geometry_ids": [0], "primitive_ids": [0], "sub_quads": [0], "primitive_uvs": [(0, 0)]}


@pytest.fixture(scope="module")
def scene():
    return scene_of(cage("cube_seams"))


def seen(rays):
    return scene_of(cage("cube_seams")).cast_rays(rays)["t_hit"]


@pytest.mark.parametrize(
    ("rays", "message"),
    [
        (RAYS.astype(object), "rays must have dtype float32 or float64, not object"),
        (RAYS.astype(complex), "rays must have dtype float32 or float64, not complex128"),
        ([[10**30] * 6], "rays must have dtype"),
        ([[1.0, 2.0], [3.0]], "rays must be an array of numbers"),
        (np.ma.masked_array(RAYS, mask=np.eye(4, 6)), "rays must not be masked: fill the 4 masked"),
        (None, "rays must have dtype"),
        (5.0, r"rays must have shape \(..., 6\), not \(\)"),
    ],
)
def test_rays(scene, rays, message):
    with pytest.raises(ValueError, match=message):
        scene.cast_rays(rays)


def test_rays_of_any_layout():
    expected = seen(RAYS)
    unaligned = np.frombuffer(b"\0" + RAYS.tobytes(), np.uint8)[1:].view(np.float64).reshape(4, 6)
    for rays in (
        *(RAYS[::-1, ::-1][:, ::-1], np.asfortranarray(RAYS), unaligned, RAYS.tolist()),
        *(RAYS.astype(">f8"), np.broadcast_to(RAYS[0], (4, 6)), np.ma.masked_array(RAYS)),
    ):
        np.testing.assert_array_equal(seen(rays), expected)
    np.testing.assert_array_equal(seen(RAYS.astype(">f4")), seen(RAYS.astype("<f4")))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"tnear": 1j}, "tnear must be a real number or an array, not complex128"),
        ({"tnear": [-1, 0, -2, 0]}, "tnear must be at least 0 and not NaN, got -1"),
        ({"tfar": np.nan}, "tfar must be at least 0 and not NaN, got nan"),
        (
            {"attributes": "points"},
            r'attributes must be a sequence of names, such as \("points",\)',
        ),
        ({"attributes": (1,)}, "attributes must hold names, not 1"),
        ({"attributes": None}, "attributes must be a sequence of names, not None"),
        ({"progress": 5}, "progress must be callable, not 5"),
    ],
)
def test_queries(scene, arguments, message):
    with pytest.raises(ValueError, match=message):
        scene.cast_rays(RAYS, **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"geometry_ids": [-1]}, r"geometry_ids must be 0 to 0xFFFFFFFF; it holds -1\.\.-1"),
        ({"geometry_ids": [2**32]}, "geometry_ids must be 0 to 0xFFFFFFFF; it holds 4294967296"),
        ({"primitive_ids": [0.5]}, "primitive_ids must hold integers, not float64"),
        ({"sub_quads": [None]}, "sub_quads must hold integers, not object"),
        ({"name": 5}, 'primvar "5": no mesh has it'),
    ],
)
def test_places_of_primvars(scene, arguments, message):
    with pytest.raises(ValueError, match=message):
        scene.evaluate_primvar(**{"name": "st", **PLACE, **arguments})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": np.array(CORNERS, object)}, "points must hold real numbers, not object"),
        ({"points": np.ma.masked_array(CORNERS, mask=np.eye(4, 3))}, "points must not be masked"),
        ({"face_vertex_counts": [2**63]}, "face_vertex_counts must fit 32-bit integers"),
        ({"face_vertex_counts": [10**30]}, "face_vertex_counts must hold integers, not object"),
        ({"interpolate_boundary": b"none"}, "interpolate_boundary must be a str, not b'none'"),
        ({"orientation": None}, "orientation must be a str, not None"),
        ({"creasing_method": "x"}, 'creasing_method must be one of .*not "x"'),
        ({"primvars": [1]}, r"primvars must map names to primvars, not \[1\]"),
        ({"primvars": {1: lr.Primvar([1.0], "constant")}}, "primvars must have names, not 1"),
    ],
)
def test_meshes(arguments, message):
    plain = {"points": CORNERS, "face_vertex_counts": [4], "face_vertex_indices": [0, 1, 2, 3]}
    with pytest.raises(ValueError, match=message):
        lr.Mesh(**{**plain, **arguments})


def test_a_sharpness_beyond_floats_is_infinite():
    mesh = lr.Mesh(CORNERS, [4], [0, 1, 2, 3], corner_indices=[0], corner_sharpnesses=[1e300])
    assert np.isinf(mesh.corners[1]).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"base_color": (1, 0)}, r"base_color must have shape \(3,\), not \(2,\)"),
        ({"base_color": (np.nan, 0, 0)}, "base_color must be finite"),
        ({"base_color": "red"}, "base_color must hold real numbers"),
        ({"texture": "x.png"}, "texture must be a limitray.Texture, not 'x.png'"),
        ({"roughness": "x"}, "roughness must be 0.05 to 1, not x"),
        ({"metallic": None}, "metallic must be 0 to 1, not None"),
    ],
)
def test_materials(arguments, message):
    with pytest.raises(ValueError, match=message):
        lr.Material(**arguments)


def test_materials_of_meshes():
    scene = scene_of(square())
    with pytest.raises(ValueError, match=r"material must hold limitray\.Material, not 'r'"):
        scene.set_material(0, "red")
    with pytest.raises(ValueError, match="faces must have one index for each of the 1 faces, not"):
        scene.set_material(0, [lr.Material()], [0, 0])
    assert not scene.has_materials


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scene": None}, r"scene must be a limitray\.Scene, not None"),
        ({"camera": "x"}, r"camera must be a limitray\.Camera, not 'x'"),
        ({"integrator": "path", "lights": [3]}, "lights must hold Sun and RectangleLight, not 3"),
        ({"integrator": "path", "sky": 3}, "sky must be a ConstantSky, GradientSky or ImageSky"),
        ({"aovs": "depth"}, "aovs must be a sequence of names"),
    ],
)
def test_render(scene, arguments, message):
    with pytest.raises(ValueError, match=message):
        lr.render(**{"scene": scene, "width": 4, "height": 3, "spp": 1, **arguments})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"purposes": "render"}, "purposes must be a sequence of names"),
        ({"purposes": ["foo"]}, "purposes must be one of default, render, proxy, guide, not 'foo'"),
        ({"time": "x"}, "time must be finite, not x"),
    ],
)
def test_stages(arguments, message):
    pytest.importorskip("pxr", reason="needs usd-core (the extra limitray[usd])")
    with pytest.raises(ValueError, match=message):
        lr.load_scene(REPOSITORY / "tests/cages/usd/tags.usda", **arguments)


def test_too_many_triangles():
    with pytest.raises(ValueError, match="rate 100000 makes 20,000,000,000 triangles, more than"):
        square().to_triangles(100_000)
