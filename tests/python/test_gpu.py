"""GPU scenes: the same hits as the CPU, at any wave width."""

from itertools import pairwise

import numpy as np
import pytest
from gpu_devices import ALL, FLOATS, IDS, disagreements, on_both, require_gpu, same_patch
from shapes import CAGES, CLOSED, cage, cube, extent, rays_towards, square

import limitray as lr
from limitray.gpu import GpuScene

require_gpu()

GEOMETRIC = ("nets", "bumps", "models", "nodes")
DOWN = [0.25, 0.75, 3, 0, 0, -2]
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


def float_rays(scene, count, seed=0):
    return rays_towards(scene, count, seed, np.float32)


def primary_rays(scene, side):
    return lr.Camera.frame(scene, aspect=1).rays(
        *np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5), side, side
    )


@pytest.mark.parametrize("path", CAGES, ids=lambda path: path.stem)
def test_hits_are_those_of_the_cpu(path):
    mesh = lr.Mesh.from_file(path)
    cpu, gpu = on_both(mesh)
    if mesh.points.shape[0] == 0:
        pytest.skip("no points")
    rays = np.concatenate([float_rays(cpu, 400), primary_rays(cpu, 20).reshape(-1, 6)])
    rays = rays.astype(np.float32)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    # A ray may run along a border within the bounds of one and outside those of the other.
    assert len(disagreements(a, b)) <= 1
    same = same_patch(a, b)
    # Of two surfaces at the same place any may be hit.
    share = 0.05 if path.stem == "back_to_back" else 0.98
    assert same.sum() >= share * np.isfinite(a["t_hit"]).sum()
    for name in IDS:
        np.testing.assert_array_equal(a[name][same], b[name][same])
    assert (cpu.test_occlusions(rays) != gpu.test_occlusions(rays)).sum() <= 1


@pytest.mark.parametrize("name", ["cube", "prism_5", "cube_semi_2_5", "torus_creases"])
def test_attributes_are_those_of_the_cpu(name):
    cpu, gpu = on_both(cage(name))
    rays = float_rays(cpu, 3000)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    same = same_patch(a, b)
    size, _ = extent(cpu)
    error = a["t_error"] + b["t_error"]
    speed = np.linalg.norm(rays[:, 3:], axis=1)
    # Hits at different t within the bounds have different (u,v): compare what is well seen.
    facing = np.abs((a["primitive_normals"] * rays[:, 3:]).sum(axis=1)) > 0.2 * speed
    clear = same & facing & (error * speed < 1e-4 * size)
    assert clear.sum() > 900
    for name in FLOATS:
        scale = size if name in ("points", "dp_du", "dp_dv") else 1
        assert np.abs(a[name] - b[name])[clear].max() < 1e-4 * scale, name
        assert np.median(np.abs(a[name] - b[name])[clear]) < 2e-6 * scale, name
    # Boxes of grazing hits differ: the CPU splits the longer direction, the GPU u and v in turn.
    assert (b["t_error"] <= 2 * a["t_error"])[same].mean() > 0.97
    assert np.median(b["t_error"][same] / a["t_error"][same]) < 1.25


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 6, 17, 63, 64, 65, 1000])
def test_any_number_of_rays(count):
    cpu, gpu = on_both(cube())
    rays = float_rays(cpu, 1000)[:count]
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    assert disagreements(a, b).size == 0
    assert gpu.statistics()["rays"] == count


def test_shapes_and_dtypes():
    _, gpu = on_both(square())
    hits = gpu.cast_rays(np.broadcast_to(np.array(DOWN, np.float32), (2, 3, 6)), attributes=ALL)
    assert (hits["t_hit"] == 1.5).all()
    assert hits["primitive_uvs"].shape == (2, 3, 2)
    np.testing.assert_allclose(hits["primitive_uvs"][0, 0], (0.25, 0.75), atol=1e-6)
    for name, array in hits.items():
        assert array.dtype == (np.uint32 if name in IDS else np.float32)


def test_misses_have_their_values():
    cpu, gpu = on_both(square())
    rays = np.array(NOWHERE, np.float32)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    for name in ALL:
        np.testing.assert_array_equal(a[name], b[name])
    assert not gpu.test_occlusions(rays).any()


def test_tnear_is_exclusive_and_tfar_inclusive():
    _, gpu = on_both(square())
    ray = np.array(DOWN, np.float32)
    cast = lambda **limits: np.isfinite(gpu.cast_rays(ray, **limits)["t_hit"])  # noqa: E731
    assert cast(tnear=1.499)
    assert not cast(tnear=1.5)
    assert cast(tfar=1.5)
    assert not cast(tfar=1.499)
    limits = np.array([1.0, 2.0], np.float32)
    hits = gpu.cast_rays(np.stack([ray, ray]), tnear=limits)
    np.testing.assert_array_equal(np.isfinite(hits["t_hit"]), [True, False])


def test_edge_on_patches():
    # Rays in the plane of a flat square, and just above it.
    cpu, gpu = on_both(square())
    rays = np.array([[-1, y, z, 1, 0, 0] for y in (0.1, 0.5) for z in (0, 1e-3)], np.float32)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    np.testing.assert_array_equal(np.isfinite(a["t_hit"]), np.isfinite(b["t_hit"]))


def test_a_start_between_two_grazing_hits_finds_the_second():
    cpu, gpu = on_both(cage("torus"))
    seen = cpu.cast_rays(rays_towards(cpu, 2000, 5, np.float64), attributes=("points", "dp_du"))
    hit = np.isfinite(seen["t_hit"])
    along = seen["dp_du"][hit]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    depth = 10 ** np.random.default_rng(6).uniform(-8, -5, (len(along), 1))
    inside = seen["points"][hit] - depth * seen["primitive_normals"][hit]
    rays = np.concatenate([inside - 2 * along, 2 * along], axis=1).astype(np.float32)
    crossings = cpu.list_intersections(rays)
    start, end = np.zeros(len(rays), np.float32), np.full(len(rays), np.inf)
    for i, (low, high) in enumerate(pairwise(crossings["ray_splits"])):
        t = crossings["t_hit"][low:high]
        for near, far in pairwise(t):
            middle = np.float32((near + far) / 2)
            if near < middle < far < near + 0.02:
                start[i], end[i] = middle, far
    between = np.isfinite(end)
    assert between.sum() > 500
    for scene in (cpu, gpu):
        found = scene.cast_rays(rays[between], start[between], attributes=("t_error",))
        assert np.all(found["t_hit"] - found["t_error"] <= end[between] + 1e-6)


@pytest.mark.parametrize("name", ["square", "torus"])
def test_rays_that_start_on_the_surface_and_run_along_it(name):
    # A terminal box before the ray's start is no hit, and opens no cluster that swallows the hit.
    cpu, gpu = on_both(square() if name == "square" else cage(name))
    seeds = float_rays(cpu, 1000, 1)
    if name == "square":
        seeds = np.array([[0.1 + 0.1 * i, 0.35, 1, 0, 0, -1] for i in range(9)], np.float32)
    hits = cpu.cast_rays(seeds, attributes=("points", "dp_du"))
    found = np.isfinite(hits["t_hit"])
    rays = np.concatenate([hits["points"], hits["dp_du"]], axis=1)[found]
    assert len(rays) == (9 if name == "square" else found.sum())
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    assert np.isfinite(a["t_hit"]).mean() > 0.99
    assert disagreements(a, b).size == 0


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("away", [0.0, 1e3])
def test_size_and_distance(scale, away):
    mesh = lr.Mesh.from_file(next(path for path in CAGES if path.stem == "torus"))
    moved = lr.Mesh(
        mesh.points * scale + away * scale, mesh.face_vertex_counts, mesh.face_vertex_indices
    )
    cpu, gpu = on_both(moved)
    rays = float_rays(cpu, 500)
    rays[:, :3] -= 300 * rays[:, 3:]
    rays[:, 3:] *= 1e-3
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    assert len(disagreements(a, b)) <= 1


@pytest.mark.parametrize("name", [name for name in CLOSED if name != "icosahedron"])
def test_no_ray_slips_through_a_seam(name):
    # Towards points on the borders of base faces, where patches meet.
    mesh = cage(name)
    cpu, gpu = on_both(mesh)
    rng = np.random.default_rng(1)
    _, middle = extent(cpu)
    seeds = cpu.cast_rays(rays_towards(cpu, 3000, 2), attributes=("sub_quads",))
    seen = np.isfinite(seeds["t_hit"])
    faces, uv = seeds["primitive_ids"][seen], np.round(seeds["primitive_uvs"][seen])
    uv[:, rng.integers(2)] = rng.uniform(size=len(uv))
    quads = mesh.face_vertex_counts[faces] == 4
    target = mesh.limit(faces[quads], uv[quads])["points"]
    direction = target - middle
    origin = target + 3 * direction
    rays = np.concatenate([origin, -direction], axis=1).astype(np.float32)
    expected = np.isfinite(cpu.cast_rays(rays.astype(np.float64))["t_hit"])
    assert expected.sum() > 100
    assert not (expected & ~np.isfinite(gpu.cast_rays(rays)["t_hit"])).any()


def affine(seed):
    matrix = np.eye(4)
    matrix[:3, :3] += 0.5 * np.random.default_rng(seed).normal(size=(3, 3))
    matrix[:3, 3] = 3 * np.random.default_rng(seed + 1).normal(size=3)
    return matrix


def test_several_meshes_and_instances():
    cpu, gpu = on_both(cube(), cage("torus"), cage("prism_5"))
    for scene in (cpu, gpu):
        for seed in range(12):
            scene.add_instance(seed % 3, affine(seed))
    rays = float_rays(cpu, 2000)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    assert len(disagreements(a, b)) <= 2
    same = same_patch(a, b) & (a["geometry_ids"] == b["geometry_ids"])
    assert same.sum() >= 0.98 * np.isfinite(a["t_hit"]).sum()
    assert len(np.unique(b["geometry_ids"][same])) > 8
    clear = np.flatnonzero(same)[np.abs(a["t_hit"][same] - b["t_hit"][same]) < 1e-4]
    assert np.median(np.abs(a["primitive_normals"] - b["primitive_normals"])[clear]) < 1e-5
    assert (cpu.test_occlusions(rays) != gpu.test_occlusions(rays)).sum() <= 2


def test_updated_points():
    cpu, gpu = on_both(cube(), cage("pole_5"))
    for scene in (cpu, gpu):
        scene.add_instance(0, affine(3))
    rays = float_rays(cpu, 500)
    gpu.cast_rays(rays)
    points = cube().points * (1.5, 1, 0.5) + 0.1
    for scene in (cpu, gpu):
        scene.update_points(0, points)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    assert len(disagreements(a, b)) <= 1


def test_updated_points_upload_their_mesh_alone():
    gpu = lr.Scene(device="vulkan")
    small, large = gpu.add_mesh(cage("torus")), gpu.add_mesh(cube(), isolation_level=5)
    rays, tracer = float_rays(gpu, 20), gpu._scene._tracer
    sizes = {mesh: sum(a.nbytes for k, a in gpu._scene.mesh_data(mesh).items() if k in GEOMETRIC)
             for mesh in (small, large)}  # fmt: skip
    assert sizes[large] > 5 * sizes[small]

    def bytes_of_a_query():
        before = tracer.uploaded
        gpu.cast_rays(rays)
        return tracer.uploaded - before

    first, idle = bytes_of_a_query(), bytes_of_a_query()
    assert first > sizes[small] + sizes[large]
    assert idle < 20 * 24 + 200  # rays, limits, settings, counters
    gpu.update_points(small, cage("torus").points * 1.1)
    # Boxes lie with 192 of their 224 bytes; the tree over the two meshes and its records.
    assert 0.8 * sizes[small] < bytes_of_a_query() - idle < sizes[small] + 1000
    gpu.update_points(large, cube().points * 1.1)
    assert 0.8 * sizes[large] < bytes_of_a_query() - idle < sizes[large] + 1000
    assert bytes_of_a_query() == idle


def test_an_empty_scene():
    gpu = lr.Scene(device="vulkan")
    assert np.isposinf(gpu.cast_rays(np.array(DOWN, np.float32))["t_hit"])


def test_pure_bisection_finds_the_same():
    cpu, gpu = on_both(cage("icosahedron"))
    rays = float_rays(cpu, 300)
    a = cpu.cast_rays(rays, attributes=ALL)
    gpu._scene.set_newton(False)
    assert len(disagreements(a, gpu.cast_rays(rays, attributes=ALL))) <= 1
    counts = gpu.statistics()
    assert counts["newton_runs"] == 0
    assert counts["splits"] > 1000
    assert counts["unresolved"] == 0


def test_one_lane_does_what_three_do():
    cpu, gpu = on_both(cage("prism_5"))
    one = lr.Scene(device="vulkan")
    one._scene = GpuScene("vulkan", group="one_lane")
    one.add_mesh(cage("prism_5"))
    rays = float_rays(cpu, 1000)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (gpu, one))
    for name in ALL:
        np.testing.assert_array_equal(a[name], b[name])
    assert gpu.statistics() == one.statistics()


def test_hits_do_not_depend_on_who_takes_a_ray():
    _, gpu = on_both(cage("torus"))
    rays = float_rays(gpu, 500)
    many = gpu.cast_rays(rays, attributes=ALL)
    gpu._scene.rays_per_group = 1
    alone = gpu.cast_rays(rays, attributes=ALL)
    for name in ALL:
        np.testing.assert_array_equal(many[name], alone[name])


def test_batches(monkeypatch):
    cpu, gpu = on_both(cube())
    monkeypatch.setattr("limitray.gpu.RAYS_PER_BATCH", 64)
    rays, done = float_rays(cpu, 200), []
    hits = gpu.cast_rays(rays, tfar=np.full(200, 9, np.float32), progress=done.append)
    assert done == [64, 128, 192, 200]
    np.testing.assert_allclose(hits["t_hit"], cpu.cast_rays(rays)["t_hit"], rtol=1e-4)


def test_counts_and_lists_are_those_of_the_cpu():
    cpu, gpu = on_both(cage("torus"))
    rays = float_rays(cpu, 200)
    np.testing.assert_array_equal(cpu.count_intersections(rays), gpu.count_intersections(rays))
    np.testing.assert_array_equal(
        cpu.list_intersections(rays)["t_hit"], gpu.list_intersections(rays)["t_hit"]
    )


def test_double_rays_are_refused():
    _, gpu = on_both(square())
    for query in (gpu.cast_rays, gpu.test_occlusions):
        with pytest.raises(ValueError, match="rays must have dtype float32 on device"):
            query(np.array(DOWN))


def test_render():
    cpu, gpu = on_both(cube())
    a, b = (np.asarray(lr.render(s, width=24, height=18, spp=1).rgba) for s in (cpu, gpu))
    assert np.abs(a - b).max() < 2e-3
