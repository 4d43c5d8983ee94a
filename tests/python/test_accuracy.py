"""Hits lie on the true limit surface, which is evaluated by code the tracer does not share."""

import os
import subprocess
import sys

import numpy as np
import pytest
from shapes import CAGES, CLOSED, MODELS, REPOSITORY, cage, extent, rays_towards, scene_of

import limitray as lr

RAYS = 400
# Distance from the true limit along its normal that Gregory patches leave at isolation level 6, as
# a fraction of the extent. The worst are vertices of high valence and non-manifold ones.
GREGORY = 1e-3
# Rounding of positions, as a fraction of the extent.
EXACT = {np.float32: 1e-6, np.float64: 1e-13}
# Largest distance of the reported surface point from the reported point of the ray, beyond the
# bound on t: reached where a patch is seen edge-on and (u, v) is known least.
EDGE_ON = {np.float32: 5e-5, np.float64: 1e-12}

ids = [path.stem for path in CAGES + MODELS]


@pytest.mark.parametrize("path", CAGES + MODELS, ids=ids)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_hits_lie_on_the_ray_and_on_the_limit(path, dtype):
    mesh = lr.Mesh.from_file(path)
    scene = scene_of(mesh, isolation_level=6)
    if not scene.mesh_statistics(0)["patches"]:
        pytest.skip("all faces of this cage are holes")
    size, _ = extent(scene)
    rays = rays_towards(scene, RAYS, seed=len(path.stem), dtype=dtype)
    hit = scene.cast_rays(rays, attributes=("points", "sub_quads", "t_error"))
    found = np.isfinite(hit["t_hit"])
    assert found.any()
    ray, t = rays[found].astype(np.float64), hit["t_hit"][found].astype(np.float64)
    on_ray = ray[:, :3] + t[:, np.newaxis] * ray[:, 3:]

    bound = hit["t_error"][found] * np.linalg.norm(ray[:, 3:], axis=1)
    off_ray = np.linalg.norm(hit["points"][found] - on_ray, axis=1)
    assert (off_ray <= bound + size * EDGE_ON[dtype]).all()
    assert np.median(off_ray) <= size * EXACT[dtype]
    assert np.median(bound) <= size * 4 * EDGE_ON[dtype]

    limit = mesh.limit(hit["primitive_ids"][found], hit["primitive_uvs"][found],
                       hit["sub_quads"][found])  # fmt: skip
    off_limit = np.abs(((limit["points"] - on_ray) * limit["normals"]).sum(axis=1))
    assert (off_limit <= size * GREGORY + bound).all()
    assert np.median(off_limit) <= size * (1e-6 if dtype == np.float32 else 1e-12)


@pytest.mark.parametrize("name", ["torus", "torus_creases", "sheet_edge_and_corner", "strip"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_surfaces_without_gregory_patches_are_exact(name, dtype):
    mesh = cage(name)
    scene = scene_of(mesh)
    assert scene.mesh_statistics(0)["gregory_patches"] == 0
    hit = scene.cast_rays(
        rays_towards(scene, 2000, dtype=dtype), attributes=("points", "dp_du", "dp_dv")
    )
    found = np.isfinite(hit["t_hit"])
    limit = mesh.limit(hit["primitive_ids"][found], hit["primitive_uvs"][found])
    tolerance = extent(scene)[0] * EXACT[dtype]
    for name_, expected, factor in (
        ("points", limit["points"], 1),
        ("dp_du", limit["dp_du"], 10),
        ("dp_dv", limit["dp_dv"], 10),
        ("primitive_normals", limit["normals"], 100),
    ):
        np.testing.assert_allclose(hit[name_][found], expected, rtol=0, atol=factor * tolerance)


@pytest.mark.parametrize("name", [path.stem for path in CAGES])
def test_rays_aimed_at_the_surface_hit_it(name):
    mesh = cage(name)
    scene = scene_of(mesh, isolation_level=6)
    size, _ = extent(scene)
    rng = np.random.default_rng(5)
    seen = scene.list_intersections(rays_towards(scene, 4000))["primitive_ids"]
    face = rng.choice(np.unique(seen), 200)
    corners = mesh.face_vertex_counts[face]
    sub_quad = np.where(corners == 4, 0, rng.integers(0, 64, 200) % corners)
    uv = rng.uniform(0.02, 0.98, (200, 2))
    limit = mesh.limit(face, uv, sub_quad)
    regular = np.linalg.norm(np.cross(limit["dp_du"], limit["dp_dv"]), axis=1) > 1e-3 * size**2
    target, normal = limit["points"][regular], limit["normals"][regular]
    distance = 0.02 * size
    rays = np.concatenate([target + distance * normal, -normal], axis=1)
    hit = scene.cast_rays(rays)
    assert np.isfinite(hit["t_hit"]).all()
    assert (hit["t_hit"] <= distance + GREGORY * size).all()


@pytest.mark.parametrize("name", CLOSED)
def test_lines_cross_closed_surfaces_an_even_number_of_times(name):
    scene = scene_of(cage(name))
    counts = scene.count_intersections(rays_towards(scene, 4000))
    assert counts.max() >= 2
    assert (counts % 2 == 0).all()


@pytest.mark.parametrize("name", CLOSED)
def test_rays_from_inside_never_escape(name):
    scene = scene_of(cage(name))
    outside = rays_towards(scene, 3000)
    found = scene.list_intersections(outside)
    enters = found["ray_splits"][:-1][np.diff(found["ray_splits"]) == 2]
    rays = outside[found["ray_ids"][enters]]
    middle = (found["t_hit"][enters] + found["t_hit"][enters + 1]) / 2
    starts = rays[:, :3] + middle[:, np.newaxis] * rays[:, 3:]
    directions = np.random.default_rng(2).normal(size=(len(starts), 3))
    inside = np.concatenate([starts, directions], axis=1)
    for dtype in (np.float32, np.float64):
        assert scene.test_occlusions(inside.astype(dtype)).all()


@pytest.mark.parametrize("name", ["demo", "cube_semi_3_7", "pole_8", "prism_5"])
def test_float_and_double_agree(name):
    scene = scene_of(cage(name))
    size, _ = extent(scene)
    rays = rays_towards(scene, 3000, dtype=np.float32)
    single, double = scene.cast_rays(rays), scene.cast_rays(rays.astype(np.float64))
    both = np.isfinite(single["t_hit"]) & np.isfinite(double["t_hit"])
    disagree = np.isfinite(single["t_hit"]) != np.isfinite(double["t_hit"])
    assert disagree.mean() < 2e-3  # rays that graze a silhouette
    lengths = np.linalg.norm(rays[both, 3:], axis=1)
    apart = np.abs(single["t_hit"][both] - double["t_hit"][both]) * lengths
    assert np.quantile(apart, 0.99) <= 1e-5 * size


@pytest.mark.parametrize("name", ["demo", "torus_creases", "prism_64"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_threads_and_batches_do_not_change_answers(name, dtype):
    rays = rays_towards(scene_of(cage(name)), 5000, dtype=dtype)
    everything = ("points", "dp_du", "dp_dv", "t_error", "patch_ids", "sub_quads")
    answers = []
    for threads in (1, 2, 5):
        scene = lr.Scene(threads=threads)
        scene.add_mesh(cage(name))
        answers.append(scene.cast_rays(rays, attributes=everything))
    backwards = scene.cast_rays(rays[::-1], attributes=everything)
    answers.append({key: array[::-1] for key, array in backwards.items()})
    single = [scene.cast_rays(ray, attributes=everything) for ray in rays[:100]]
    for key, expected in answers[0].items():
        for answer in answers[1:]:
            np.testing.assert_array_equal(answer[key], expected)
        np.testing.assert_array_equal([hit[key] for hit in single], expected[:100])


CAST = """
import sys
import numpy as np
import limitray as lr
scene = lr.Scene()
scene.add_mesh(lr.Mesh.from_file(sys.argv[1]))
hits = scene.cast_rays(np.load(sys.argv[2]), attributes=("t_error",))
np.savez(sys.argv[3], isa=lr.Scene.isa(), **hits)
"""


def cast_with(isa, name, rays, folder):
    """Hits computed in a process that is forced to an instruction set; None if it has none."""
    np.save(folder / "rays.npy", rays)
    model = REPOSITORY / "tests/cages" / f"{name}.obj"
    done = subprocess.run(
        [sys.executable, "-c", CAST, model, folder / "rays.npy", folder / f"{isa}.npz"],
        env={**os.environ, "LIMITRAY_ISA": isa},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode and isa != "portable":
        assert "LIMITRAY_ISA" in done.stderr
        return None
    assert done.returncode == 0, done.stderr
    return np.load(folder / f"{isa}.npz")


@pytest.mark.parametrize("name", ["demo", "pole_8", "torus_creases"])
def test_instruction_sets_agree(name, tmp_path):
    rays = rays_towards(scene_of(cage(name)), 4000, dtype=np.float32)
    lengths = np.linalg.norm(rays[:, 3:], axis=1)
    size, _ = extent(scene_of(cage(name)))
    portable = cast_with("portable", name, rays, tmp_path)
    assert portable["isa"] == "portable"
    for isa in ("avx2", "avx512"):
        other = cast_with(isa, name, rays, tmp_path)
        if other is None:
            continue
        assert other["isa"] == isa
        hit = np.isfinite(portable["t_hit"]) & np.isfinite(other["t_hit"])
        assert (np.isfinite(portable["t_hit"]) != np.isfinite(other["t_hit"])).mean() < 2e-3
        apart = np.abs(portable["t_hit"][hit] - other["t_hit"][hit]) * lengths[hit]
        assert np.quantile(apart, 0.999) <= 2e-4 * size
        assert np.median(apart) <= 1e-6 * size
        same = portable["primitive_ids"][hit] == other["primitive_ids"][hit]
        assert same.mean() > 0.998


def test_an_unknown_instruction_set_is_named():
    done = subprocess.run(
        [sys.executable, "-c", "import limitray; limitray.Scene()"],
        env={**os.environ, "LIMITRAY_ISA": "sse9"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "LIMITRAY_ISA" in done.stderr
    assert "sse9" in done.stderr
