"""Scenes: shapes, dtypes, miss values and errors of the queries."""

import numpy as np
import pytest
from shapes import cage, cube, scene_of, square

import limitray as lr

ALL = (
    "t_hit",
    "geometry_ids",
    "primitive_ids",
    "primitive_uvs",
    "primitive_normals",
    "points",
    "dp_du",
    "dp_dv",
    "t_error",
    "patch_ids",
    "sub_quads",
)
WIDTH = {"primitive_uvs": (2,), "primitive_normals": (3,), "points": (3,)}
WIDTH |= {"dp_du": (3,), "dp_dv": (3,)}
DOWN = [0.25, 0.75, 3, 0, 0, -2]
FLOATS = pytest.mark.parametrize("dtype", [np.float32, np.float64])


@FLOATS
@pytest.mark.parametrize("shape", [(), (1,), (0,), (5,), (4, 3), (2, 0, 3)])
def test_answers_have_the_shape_and_dtype_of_the_rays(dtype, shape):
    rays = np.broadcast_to(np.array(DOWN, dtype), (*shape, 6))
    hits = scene_of(square()).cast_rays(rays, attributes=ALL)
    assert tuple(hits) == ALL
    for name, array in hits.items():
        assert array.shape == shape + WIDTH.get(name, ())
        assert array.dtype == (np.uint32 if name.endswith(("ids", "quads")) else dtype)


@FLOATS
def test_a_ray_at_the_unit_square(dtype):
    hit = scene_of(square()).cast_rays(np.array(DOWN, dtype), attributes=ALL)
    tolerance = {"rtol": 0, "atol": 1e-6 if dtype == np.float32 else 1e-13}
    assert hit["t_hit"] == pytest.approx(1.5, abs=tolerance["atol"])
    assert [hit[name] for name in ("geometry_ids", "primitive_ids", "sub_quads")] == [0, 0, 0]
    np.testing.assert_allclose(hit["primitive_uvs"], (0.25, 0.75), **tolerance)
    np.testing.assert_allclose(hit["primitive_normals"], (0, 0, 1), **tolerance)
    np.testing.assert_allclose(hit["points"], (0.25, 0.75, 0), **tolerance)
    np.testing.assert_allclose(hit["dp_du"], (1, 0, 0), **tolerance)
    np.testing.assert_allclose(hit["dp_dv"], (0, 1, 0), **tolerance)
    assert 0 <= hit["t_error"] <= 1e-5
    assert abs(hit["t_hit"] - 1.5) <= hit["t_error"]


def assert_misses(hits):
    assert np.isposinf(hits["t_hit"]).all()
    for name, array in hits.items():
        if name.endswith("_ids") or name == "sub_quads":
            assert (array == lr.INVALID_ID).all(), name
        elif name != "t_hit":
            assert (array == 0).all(), name


NOWHERE = [
    [2, 0.5, 3, 0, 0, -1],
    [0.5, 0.5, 3, 0, 0, 1],
    [0.5, 0.5, 3, 0, 0, 0],
    [np.nan, 0.5, 3, 0, 0, -1],
    [0.5, 0.5, 3, 0, np.nan, -1],
    [0.5, np.inf, 3, 0, 0, -1],
    [0.5, 0.5, 3, 0, 0, -np.inf],
    [np.nan] * 6,
]


@FLOATS
def test_misses_have_their_values(dtype):
    rays = np.array(NOWHERE, dtype)
    scene = scene_of(square())
    assert_misses(scene.cast_rays(rays, attributes=ALL))
    assert not scene.test_occlusions(rays).any()
    assert not scene.count_intersections(rays).any()
    assert len(scene.list_intersections(rays)["t_hit"]) == 0


def test_an_empty_scene_is_missed():
    scene = lr.Scene()
    assert_misses(scene.cast_rays(np.array([DOWN]), attributes=ALL))
    assert not scene.test_occlusions(np.array([DOWN])).any()
    with pytest.raises(ValueError, match="no surface"):
        scene.bounds()


@FLOATS
def test_any_strides_are_the_same_rays(dtype):
    scene = scene_of(cube())
    rays = np.random.default_rng(3).uniform(-1, 1, (40, 6)).astype(dtype)
    expected = scene.cast_rays(rays)
    wide = np.zeros((80, 12), dtype)
    wide[::2, ::2] = rays
    frozen = rays.copy()
    frozen.flags.writeable = False
    for other in (np.asfortranarray(rays), wide[::2, ::2], rays[::-1][::-1], frozen):
        for name, array in scene.cast_rays(other).items():
            np.testing.assert_array_equal(array, expected[name])


def test_tnear_is_exclusive_and_tfar_inclusive():
    scene = scene_of(square())
    rays = np.tile(np.array([0.5, 0.5, 2, 0, 0, -1.0]), (4, 1))
    hit = scene.cast_rays(rays, tnear=[0, 1.9, 2.1, 0], tfar=[np.inf, 2.1, np.inf, 1.9])
    assert np.isfinite(hit["t_hit"]).tolist() == [True, True, False, False]
    free = scene.test_occlusions(rays, tnear=[0, 1.9, 2.1, 0], tfar=[np.inf, 2.1, np.inf, 1.9])
    assert free.tolist() == [True, True, False, False]
    assert free.dtype == np.bool_
    assert scene.count_intersections(rays, tfar=1.0).tolist() == [0] * 4
    assert np.isposinf(scene.cast_rays(rays[0], tnear=5, tfar=1)["t_hit"])


def test_directions_need_not_be_unit():
    scene = scene_of(cube())
    for length in (1e-3, 1.0, 1e3):
        hit = scene.cast_rays(np.array([0, 0, 5, 0, 0, -length]))
        assert hit["t_hit"] * length == pytest.approx(5 - 68 / 81, abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rays": np.zeros((2, 6), int)}, "rays must have dtype float32 or float64, not int64"),
        ({"rays": np.zeros((2, 6), np.float16)}, "rays must have dtype float32 or float64"),
        ({"rays": [["x"] * 6]}, "rays must have dtype"),
        ({"rays": np.zeros((2, 5))}, r"rays must have shape \(..., 6\), not \(2, 5\)"),
        ({"rays": np.float64(1)}, r"rays must have shape \(..., 6\), not \(\)"),
        ({"tnear": -1}, "tnear must be at least 0 and not NaN"),
        ({"tfar": np.nan}, "tfar must be at least 0 and not NaN"),
        ({"tnear": [0, 0, 0]}, r"tnear must be a number or have shape \(2,\), not \(3,\)"),
        ({"tfar": "far"}, "tfar must be a real number"),
        ({"attributes": ("pointz",)}, "attributes must be one of .*points.*, not 'pointz'"),
        ({"attributes": "points"}, "attributes must be a sequence of names"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        scene_of(square()).cast_rays(**{"rays": np.zeros((2, 6)), **arguments})


def test_construction_is_checked():
    with pytest.raises(ValueError, match=r"device must be one of cpu, .*, not 'tpu'"):
        lr.Scene(device="tpu")
    with pytest.raises(ValueError, match="threads must be an integer >= 0, not -1"):
        lr.Scene(threads=-1)
    with pytest.raises(ValueError, match="threads must be 0 to 4096, not 4097"):
        lr.Scene(threads=4097)
    scene = lr.Scene()
    with pytest.raises(ValueError, match=r"mesh must be a limitray\.Mesh, not str"):
        scene.add_mesh("cube.obj")
    for level in (0, 11, 2.5):
        with pytest.raises(ValueError, match="isolation_level must be"):
            scene.add_mesh(square(), isolation_level=level)
    for transform, message in (
        (np.eye(3), r"transform must have shape \(4, 4\)"),
        (np.zeros((4, 4)), "transform must end with the row 0 0 0 1"),
        (np.diag([1, 1, 0, 1]), "transform must be invertible"),
        (np.full((4, 4), np.nan), "transform must be finite"),
    ):
        with pytest.raises(ValueError, match=message):
            scene.add_mesh(square(), transform=transform)
    with pytest.raises(ValueError, match="geometry_id must be below 0, not 0"):
        scene.add_instance(0, np.eye(4))


def translation(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def test_meshes_and_instances_have_ids_of_their_own():
    scene = lr.Scene()
    assert scene.add_mesh(square()) == 0
    assert scene.add_mesh(square(), transform=translation(2, 0, 1)) == 1
    assert scene.add_instance(0, translation(4, 0, 2)) == 2
    assert scene.geometry_count() == 3
    rays = np.array([[x + 0.5, 0.5, 5, 0, 0, -1] for x in (0, 2, 4, 6)])
    hit = scene.cast_rays(rays)
    np.testing.assert_allclose(hit["t_hit"], [5, 4, 3, np.inf], atol=1e-12)
    assert hit["geometry_ids"].tolist() == [0, 1, 2, lr.INVALID_ID]
    np.testing.assert_allclose(scene.bounds(), [(0, 0, 0), (5, 1, 2)], atol=1e-5)


def test_normals_and_derivatives_follow_the_transform():
    turned = np.array([[0, 0, 3, 0], [0, 2, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    scene = scene_of(square(), transform=turned)
    hit = scene.cast_rays(np.array([4, 1.5, -0.5, -1, 0, 0]), attributes=("dp_du", "dp_dv"))
    np.testing.assert_allclose(hit["primitive_uvs"], (0.5, 0.75), atol=1e-12)
    np.testing.assert_allclose(hit["primitive_normals"], (1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(hit["dp_du"], (0, 0, -1), atol=1e-12)
    np.testing.assert_allclose(hit["dp_dv"], (0, 2, 0), atol=1e-12)


def test_points_move():
    scene = scene_of(cube())
    ray = np.array([0, 0, 5, 0, 0, -1.0])
    scene.update_points(0, 2 * cube().points)
    assert scene.cast_rays(ray)["t_hit"] == pytest.approx(5 - 2 * 68 / 81, abs=1e-12)
    with pytest.raises(ValueError, match=r"points must have shape \(n, 3\)"):
        scene.update_points(0, np.zeros(3))
    with pytest.raises(ValueError, match="points"):
        scene.update_points(0, np.zeros((7, 3)))


def test_all_intersections_are_sorted_and_counted():
    scene = scene_of(cage("torus"))
    rays = np.array([[[-5, 0.1, 0.05, 1, 0, 0], [0, 0, 5, 0, 0, -1], [-5, 0, 3, 1, 0, 0.0]]])
    found = scene.list_intersections(rays)
    assert found["ray_splits"].tolist() == [0, 4, 4, 4]
    assert found["ray_ids"].tolist() == [0] * 4
    assert (np.diff(found["t_hit"]) > 0).all()
    assert scene.count_intersections(rays).tolist() == [[4, 0, 0]]
    assert found["primitive_uvs"].shape == (4, 2)
    closest = scene.cast_rays(rays)
    assert found["t_hit"][0] == pytest.approx(closest["t_hit"][0, 0], abs=1e-9)
    outward = np.sign(found["primitive_normals"] @ (1, 0, 0))
    np.testing.assert_array_equal(outward[1:], -outward[:-1])  # in and out in turn


def test_statistics_count_and_reset():
    scene = scene_of(cube())
    scene.cast_rays(np.tile(np.array([0, 0, 5, 0, 0, -1], np.float32), (100, 1)))
    counted = scene.statistics()
    assert counted["rays"] == 100
    assert counted["patch_tests"] >= 100
    assert counted["unresolved"] == 0
    scene.reset_statistics()
    assert set(scene.statistics().values()) == {0}


def test_mesh_statistics_add_up():
    scene = scene_of(cube(), isolation_level=3)
    size = scene.mesh_statistics(0)
    assert size["patches"] == sum(size["patches_by_level"])
    assert 0 < size["gregory_patches"] < size["patches"]
    assert size["patch_bytes"] > 192 * size["patches"]
    assert size["bvh_bytes"] > 0
    assert size["build_seconds"] > 0


def test_progress_counts_the_rays():
    scene, seen = scene_of(cage("demo")), []
    rays = np.tile(np.array([0, 0, 8, 0, 0.1, -1], np.float32), (400_000, 1))
    scene.cast_rays(rays, progress=seen.append)
    assert seen == sorted(seen)
    assert all(0 <= done <= len(rays) for done in seen)


def test_an_error_in_the_progress_callback_stops_the_call():
    def stop(done):
        raise RuntimeError("enough")

    scene = scene_of(cage("demo"))
    rays = np.tile(np.array([0, 0, 8, 0, 0.1, -1]), (1_000_000, 1))
    with pytest.raises(RuntimeError, match="enough"):
        scene.cast_rays(rays, progress=stop)
    assert np.isfinite(scene.cast_rays(rays[:2], progress=stop)["t_hit"]).all()


def test_the_instruction_set_is_known():
    assert lr.Scene.isa() in ("avx512", "avx2", "portable")


class Late:
    """A scene whose calls are interrupted just after they are done."""

    def __init__(self, core):
        self.core = core

    def __getattr__(self, name):
        return getattr(self.core, name)

    def add_mesh(self, *arguments):
        self.core.add_mesh(*arguments)
        raise KeyboardInterrupt

    def add_instance(self, *arguments):
        self.core.add_instance(*arguments)
        raise KeyboardInterrupt


@pytest.mark.parametrize("call", ["add_mesh(other)", "add_instance(0, np.diag([2.0, 2, 2, 1]))"])
def test_an_interrupt_at_the_end_of_a_change_takes_it_back(call):
    scene = scene_of(cube())
    rays = np.array([DOWN, [0.25, 0.75, 3, 0.3, 0, -2]])
    before = scene.cast_rays(rays)
    other = lr.Mesh(
        np.array([[0, 0, 2], [1, 0, 2], [1, 1, 2], [0, 1, 2.0]]),
        [4],
        [0, 1, 2, 3],
        primvars={"st": lr.Primvar(np.zeros((4, 2)), "vertex")},
    )
    core, scene._scene = scene._scene, Late(scene._scene)
    with pytest.raises(KeyboardInterrupt):
        eval(f"scene.{call}", {"scene": scene, "other": other, "np": np})
    scene._scene = core
    assert scene.geometry_count() == 1
    assert scene.primvar_names() == ()
    after = scene.cast_rays(rays)
    for key, values in before.items():
        np.testing.assert_array_equal(after[key], values)
    assert scene.add_mesh(other) == 1
    scene.set_material(1, lr.Material((1, 0, 0)))
    assert scene.cast_rays(rays)["geometry_ids"].tolist() == [1, 1]
