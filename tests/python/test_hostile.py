"""Input that no one should give: refused by name, or answered with numbers in range."""

import os
import re
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from shapes import CUBE_INDICES, CUBE_POINTS, cage, cube, rays_towards, scene_of, square

import limitray as lr

DOWN = np.array([[0.5, 0.5, 2, 0, 0, -1]])
SLOW = [HealthCheck.too_slow]  # on a busy machine
DTYPES = ["f4", "f8", "f2", "i4", "i8", "u1", "?", "c16", "S3", "O", ">f8", ">f4", "M8[s]"]


def expect_numbers(hit, mesh):
    """No NaN, ids in range, unit normals (0 where there is none), misses as documented."""
    found = np.isfinite(hit["t_hit"])
    for name, array in hit.items():
        assert not np.isnan(array).any(), name
    assert (hit["t_hit"][~found] == np.inf).all()
    assert (hit["geometry_ids"][~found] == lr.INVALID_ID).all()
    assert (hit["primitive_ids"][found] < len(mesh.face_vertex_counts)).all()
    assert ((hit["primitive_uvs"] >= 0) & (hit["primitive_uvs"] <= 1)).all()
    lengths = np.linalg.norm(hit["primitive_normals"], axis=-1)
    assert (np.isclose(lengths, 1, atol=1e-4) | (lengths == 0)).all()
    assert (lengths[~found] == 0).all()


@settings(max_examples=150, deadline=None, suppress_health_check=SLOW)
@given(
    hnp.arrays(
        st.sampled_from(DTYPES),
        hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=7),
        fill=st.nothing(),
    )
)
def test_any_array_is_answered_or_refused_as_rays(rays):
    scene = scene_of(square(), isolation_level=2)
    for call in (scene.cast_rays, scene.test_occlusions, scene.count_intersections):
        native = rays.dtype.newbyteorder("=")
        if native in (np.float32, np.float64) and rays.ndim and rays.shape[-1] == 6:
            answer = call(rays)
            shape = answer["t_hit"].shape if isinstance(answer, dict) else answer.shape
            assert shape == rays.shape[:-1]
        else:
            with pytest.raises(ValueError, match=r"^rays must"):
                call(rays)


@settings(max_examples=150, deadline=None, suppress_health_check=SLOW)
@given(
    st.sampled_from(["points", "face_vertex_counts", "face_vertex_indices", "crease_indices",
                     "crease_lengths", "crease_sharpnesses", "corner_indices",
                     "corner_sharpnesses", "hole_indices"]),
    hnp.arrays(
        st.sampled_from(DTYPES),
        hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=9),
        fill=st.nothing(),
    ),
)  # fmt: skip
def test_any_array_is_taken_or_refused_by_a_mesh(name, values):
    arguments = {
        "points": CUBE_POINTS,
        "face_vertex_counts": [4] * 6,
        "face_vertex_indices": CUBE_INDICES,
        name: values,
    }
    scene, refused = lr.Scene(), ""
    try:
        mesh = lr.Mesh(**arguments)
        scene.add_mesh(mesh, isolation_level=2)
    except ValueError as error:
        refused = str(error)
    if refused:
        assert re.match(name.split("_")[0] + r"|face_vertex_", refused)
        return
    rays = rays_towards(scene_of(cube()), 20, dtype=np.float32)
    expect_numbers(scene.cast_rays(rays), mesh)


@settings(max_examples=100, deadline=None, suppress_health_check=SLOW)
@given(hnp.arrays(np.float64, (5, 6), elements=st.floats(width=64)), st.booleans())
@example(np.zeros((5, 6)), True)
@example(np.full((5, 6), np.nan), True)
@example(np.full((5, 6), np.inf), False)
@example(np.tile([0, 0, 1e300, 0, 0, -1e-300], (5, 1)), True)
@example(np.full((5, 6), 1.4e-45), True)
def test_any_numbers_are_rays(rays, in_float):
    mesh = cage("cube_semi_2_5")
    scene = scene_of(mesh, isolation_level=2)
    with np.errstate(over="ignore"):
        rays = rays.astype(np.float32) if in_float else rays
    hit = scene.cast_rays(rays, attributes=("points", "dp_du", "dp_dv"))
    expect_numbers(hit, mesh)
    none = ~np.isfinite(rays).all(axis=1) | (rays[:, 3:] == 0).all(axis=1)
    assert (hit["t_hit"][none] == np.inf).all()
    np.testing.assert_array_equal(scene.test_occlusions(rays), np.isfinite(hit["t_hit"]))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_of_any_memory_layout_are_only_read(dtype):
    scene = scene_of(cube(), isolation_level=3)
    rays = rays_towards(scene, 120, dtype=dtype)
    expected = scene.cast_rays(rays)["t_hit"]
    locked = rays.copy()
    locked.flags.writeable = False
    wide = np.zeros((240, 12), dtype)
    wide[::2, ::2] = rays
    buffer = np.zeros(rays.nbytes + 1, np.uint8)[1:]
    unaligned = buffer.view(dtype).reshape(rays.shape)
    unaligned[:] = rays
    layouts = [locked, np.asfortranarray(rays), wide[::2, ::2], rays[::-1][::-1], unaligned]
    for layout in layouts:
        before = layout.copy()
        np.testing.assert_array_equal(scene.cast_rays(layout)["t_hit"], expected)
        np.testing.assert_array_equal(layout, before)


def test_ten_million_rays_at_once():
    scene = scene_of(square(), isolation_level=2)
    rays = np.broadcast_to(DOWN.astype(np.float32), (10_000_000, 6))
    assert scene.test_occlusions(rays).all()


def test_no_rays():
    scene = scene_of(square())
    for shape in ((0, 6), (3, 0, 6)):
        assert scene.cast_rays(np.zeros(shape))["primitive_uvs"].shape == (*shape[:-1], 2)
    assert len(scene.list_intersections(np.zeros((0, 6)))["t_hit"]) == 0


@pytest.mark.parametrize("points", [[], [(0, 0, 0)], [(1e300, 0, 0), (np.pi, 2, 3)]])
def test_meshes_without_faces_have_no_surface(points):
    scene = scene_of(lr.Mesh(points, [], []))
    assert scene.mesh_statistics(0)["patches"] == 0
    assert scene.cast_rays(DOWN)["t_hit"][0] == np.inf
    assert not scene.test_occlusions(DOWN)[0]


def polygon(sides):
    """One face."""
    angles = 2 * np.pi * np.arange(sides) / sides
    points = np.stack([np.cos(angles), np.sin(angles), 0.1 * (np.arange(sides) % 3)], axis=1)
    return lr.Mesh(points, [sides], np.arange(sides))


def pole(sides):
    """Quads around one vertex."""
    angles = np.pi * np.arange(2 * sides) / sides
    ring = np.stack([np.cos(angles), np.sin(angles), np.arange(2 * sides) % 2 - 0.5], axis=1)
    first = 2 * np.arange(sides)
    faces = np.stack(
        [np.zeros(sides, int), first + 1, first + 2, (first + 2) % (2 * sides) + 1], axis=1
    )
    return lr.Mesh(np.concatenate([[(0, 0, 1)], ring]), [4] * sides, faces.ravel())


def flattened(scale):
    """A cube with its points on a plane, a line or a point."""
    return lr.Mesh(np.array(CUBE_POINTS) * scale + (1, 2, 3), [4] * 6, CUBE_INDICES)


def sharp_cube(sharpness):
    """A cube with a corner and a crease."""
    return cube(
        corner_indices=[0],
        corner_sharpnesses=[sharpness],
        crease_indices=[4, 5, 7],
        crease_lengths=[3],
        crease_sharpnesses=[sharpness],
    )


ODD_MESHES = [
    *[(polygon, sides) for sides in (3, 4, 5, 16, 63, 64)],
    *[(pole, sides) for sides in (2, 3, 50, 360)],
    *[(flattened, scale) for scale in ((0, 0, 0), (1, 0, 0), (1, 1, 0))],
    *[(cage, f"non_manifold_{part}") for part in ("edge", "vertex", "winding")],
    *[(cage, name) for name in ("cube_isolated", "back_to_back")],
    *[(sharp_cube, sharpness) for sharpness in (0, 1e-30, 9.999, 1e30, np.inf)],
]


@pytest.mark.parametrize(("make", "argument"), ODD_MESHES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_odd_meshes_are_traced(make, argument, dtype):
    mesh = make(argument)
    scene = scene_of(mesh, isolation_level=2)
    rays = np.concatenate([rays_towards(scene, 200, dtype=dtype), DOWN.astype(dtype)])
    hit = scene.cast_rays(rays, attributes=("points", "dp_du", "dp_dv", "t_error"))
    expect_numbers(hit, mesh)


@pytest.mark.parametrize("size", [1e-12, 1e12])
def test_sizes_within_the_limits_are_traced(size):
    scene = scene_of(lr.Mesh(size * np.array(CUBE_POINTS), [4] * 6, CUBE_INDICES))
    hit = scene.cast_rays(np.array([[0, 0, 5 * size, 0, 0, -1]], np.float32))
    np.testing.assert_allclose(hit["t_hit"], 5 * size, rtol=0.2)
    np.testing.assert_allclose(hit["primitive_normals"], [[0, 0, 1]], atol=1e-4)


@pytest.mark.parametrize(
    ("size", "message"), [(1e17, "must be within 1e\\+15 of 0"), (1e-20, "at least 1e-15")]
)
def test_sizes_beyond_the_limits_are_refused(size, message):
    mesh = lr.Mesh(size * np.array(CUBE_POINTS), [4] * 6, CUBE_INDICES)
    scene = scene_of(square())
    with pytest.raises(ValueError, match=message):
        scene.add_mesh(mesh)
    assert scene.geometry_count() == 1
    assert scene.cast_rays(DOWN)["t_hit"][0] == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"isolation_level": 11}, "isolation_level must be 1 to 10"),
        ({"isolation_level": 0}, "isolation_level must be an integer >= 1"),
        ({"tolerance": 0}, "tolerance must be a number above 0"),
        ({"tolerance": np.nan}, "tolerance must be a number above 0"),
        ({"tolerance": "1e-3"}, "tolerance must be a number above 0"),
        ({"memory_limit": 0}, "memory_limit must be an integer >= 1"),
        ({"transform": np.diag([0, 1, 1, 1])}, "transform must be invertible"),
    ],
)
def test_wrong_options_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        lr.Scene().add_mesh(cube(), **arguments)


def test_a_tolerance_chooses_the_level_and_the_error_reached_is_told():
    scene = lr.Scene()
    for tolerance, level in [(None, 5), (1e-3, 2), (1e-7, 8)]:
        counted = scene.mesh_statistics(scene.add_mesh(cube(), tolerance=tolerance))
        assert counted["isolation_level"] == level
        assert counted["limit_error"] <= (tolerance or 1e-5)
    assert lr.mesh_info(cube(), tolerance=1e-3)["isolation_level"] == 2
    far = lr.mesh_info(cage("pole_48"))
    assert far["isolation_level"] == 6
    assert far["limit_error"] > 1e-4


def test_a_mesh_too_large_names_the_size_it_needs():
    scene = scene_of(square())
    with pytest.raises(MemoryError, match=r"needs about 0\.\d\d GB for \d+ patches at isolation"):
        scene.add_mesh(pole(50), isolation_level=10, memory_limit=1_000_000)
    assert scene.geometry_count() == 1
    assert scene.cast_rays(DOWN)["t_hit"][0] == 2


LARGE = """
import resource, sys
import numpy as np
import limitray as lr
n = 400
i, j = np.meshgrid(np.arange(n), np.arange(n))
first = (j * (n + 1) + i).ravel()
faces = np.stack([first, first + 1, first + n + 2, first + n + 1], axis=1).ravel()
x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
mesh = lr.Mesh(np.stack([x, y, np.sin(x) * np.cos(y)], axis=-1).reshape(-1, 3), [4] * n * n, faces)
scene = lr.Scene()
scene.add_mesh(lr.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3]))
"""
USABLE = """
print(scene.geometry_count(), scene.cast_rays(np.array([[0.5, 0.5, 2, 0, 0, -1]]))["t_hit"][0])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_AS limits memory on Linux only")
def test_too_little_memory_is_told_before_it_is_taken():
    used = "int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()"
    program = f"""{LARGE}
resource.setrlimit(resource.RLIMIT_AS, ({used} + 160_000_000, -1))
try:
    scene.add_mesh(mesh, isolation_level=4)
except MemoryError as error:
    print(error)
{USABLE}"""
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert printed[0].startswith("the cage needs about 0.")
    assert printed[1] == "1 2.0"
    assert resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY


def test_ctrl_c_ends_a_build_and_leaves_the_scene_usable():
    program = f"""{LARGE}
import time
print("ready", flush=True)
try:
    while True:
        scene.add_mesh(mesh, isolation_level=4)
        scene = lr.Scene()
        scene.add_mesh(lr.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3]))
except KeyboardInterrupt:
    print(time.time())
{USABLE}"""
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, env=os.environ
    ) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.1)  # in the first build, which takes three times as long or more
        sent = time.time()
        process.send_signal(signal.SIGINT)
        stopped = float(process.stdout.readline())
        usable = process.stdout.readline()
    assert stopped - sent < 1
    assert usable == "1 2.0\n"


def test_an_exception_loses_no_earlier_result():
    scene = scene_of(cube(), isolation_level=3)
    rays = rays_towards(scene, 3000, dtype=np.float32)
    first = scene.cast_rays(rays)
    kept = {name: array.copy() for name, array in first.items()}

    def stop(done):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        scene.cast_rays(np.tile(rays, (2000, 1)), progress=stop)
    with pytest.raises(ValueError, match="rays must"):
        scene.cast_rays(rays[:, :5])
    again = scene.cast_rays(rays)
    for name, array in first.items():
        np.testing.assert_array_equal(array, kept[name])
        np.testing.assert_array_equal(again[name], kept[name])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_threads_and_batch_order_change_nothing(dtype):
    mesh = cage("demo")
    rays = rays_towards(scene_of(mesh), 5000, dtype=dtype)
    order = np.random.default_rng(1).permutation(len(rays))
    attributes = ("points", "dp_du", "dp_dv", "t_error", "patch_ids", "sub_quads")
    answers = []
    for threads in (1, 2, 5):
        scene = lr.Scene(threads=threads)
        scene.add_mesh(mesh)
        scene.add_instance(0, np.diag([1, 2, 1, 1]))
        answers.append(scene.cast_rays(rays, attributes=attributes))
        shuffled = scene.cast_rays(rays[order], attributes=attributes)
        answers.append({name: array[np.argsort(order)] for name, array in shuffled.items()})
        single = [scene.cast_rays(ray, attributes=attributes) for ray in rays[:50]]
        for name in answers[0]:
            one_by_one = np.stack([hit[name] for hit in single])
            assert one_by_one.tobytes() == answers[0][name][:50].tobytes(), name
    for answer in answers[1:]:
        for name, array in answer.items():
            assert array.tobytes() == answers[0][name].tobytes(), name
