"""Random cages: no crash, no NaN, and hits that keep their promises."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import CUBE_INDICES, CUBE_POINTS, extent, rays_towards

import limitray as lr

coordinates = st.floats(-1, 1, width=32)
sharpnesses = st.one_of(st.just(0.0), st.just(10.0), st.floats(0, 10, width=32))


def grid(columns, rows):
    """Faces of an open sheet of quads."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    return [
        [(j + dj) * (columns + 1) + i + di for di, dj in corners]
        for j in range(rows)
        for i in range(columns)
    ]


def prism(sides):
    """Faces of a prism with two n-gons."""
    quads = [[i, (i + 1) % sides, sides + (i + 1) % sides, sides + i] for i in range(sides)]
    return [*quads, list(range(sides))[::-1], list(range(sides, 2 * sides))]


@st.composite
def cages(draw):
    """A mesh with random points, tags and rules on one of three topologies."""
    kind = draw(st.sampled_from(["cube", "grid", "prism"]))
    if kind == "cube":
        faces, points = np.reshape(CUBE_INDICES, (6, 4)).tolist(), np.array(CUBE_POINTS, float)
    elif kind == "grid":
        columns, rows = draw(st.integers(1, 3)), draw(st.integers(1, 3))
        faces = grid(columns, rows)
        points = np.array([(i, j, 0.0) for j in range(rows + 1) for i in range(columns + 1)])
    else:
        sides = draw(st.integers(3, 9))
        faces, angles = prism(sides), 2 * np.pi * np.arange(sides) / sides
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        points = np.concatenate([np.insert(ring, 2, z, axis=1) for z in (-1.0, 1.0)])
    moves = draw(
        st.lists(st.tuples(*[coordinates] * 3), min_size=len(points), max_size=len(points))
    )
    edges = sorted({(min(a, b), max(a, b)) for f in faces for a, b in zip(f, f[1:] + f[:1])})
    creases = draw(st.lists(st.sampled_from(edges), unique=True, max_size=6))
    corners = draw(st.lists(st.integers(0, len(points) - 1), unique=True, max_size=3))
    holes = draw(st.lists(st.integers(0, len(faces) - 1), unique=True, max_size=1))
    return lr.Mesh(
        points + draw(st.sampled_from([0.0, 0.3, 1.0])) * np.array(moves),
        [len(f) for f in faces],
        [v for f in faces for v in f],
        draw(st.sampled_from(["none", "edgeOnly", "edgeAndCorner"])),
        crease_indices=np.array(creases, int).ravel(),
        crease_lengths=[2] * len(creases),
        crease_sharpnesses=[draw(sharpnesses) for _ in creases],
        corner_indices=corners,
        corner_sharpnesses=[draw(sharpnesses) for _ in corners],
        hole_indices=holes,
        creasing_method=draw(st.sampled_from(["uniform", "chaikin"])),
    )


@settings(max_examples=60, deadline=None)
@given(cages(), st.integers(0, 1000), st.sampled_from([np.float32, np.float64]))
def test_hits_keep_their_promises(mesh, seed, dtype):
    scene = lr.Scene()
    scene.add_mesh(mesh, isolation_level=3)
    if not scene.mesh_statistics(0)["patches"]:
        return
    size, _ = extent(scene)
    if size == 0:
        return
    rays = rays_towards(scene, 200, seed, dtype)
    hit = scene.cast_rays(rays, attributes=("points", "dp_du", "dp_dv", "t_error", "sub_quads"))
    found = np.isfinite(hit["t_hit"])
    for name, array in hit.items():
        assert not np.isnan(array).any(), name
    on_ray = rays[:, :3] + np.where(found, hit["t_hit"], 0)[:, np.newaxis] * rays[:, 3:]
    residual = np.linalg.norm((hit["points"] - on_ray)[found], axis=1)
    bound = hit["t_error"][found] * np.linalg.norm(rays[found, 3:], axis=1)
    assert (residual <= bound + size * (2e-4 if dtype == np.float32 else 1e-12)).all()
    assert np.isin(hit["primitive_ids"][found], np.arange(len(mesh.face_vertex_counts))).all()
    assert not np.isin(hit["primitive_ids"][found], mesh.hole_indices).any()
    assert ((hit["primitive_uvs"] >= 0) & (hit["primitive_uvs"] <= 1)).all()
    lengths = np.linalg.norm(hit["primitive_normals"][found], axis=1)
    np.testing.assert_allclose(lengths, 1, atol=1e-5)
    np.testing.assert_array_equal(scene.test_occlusions(rays), found)
    limit = mesh.limit(
        hit["primitive_ids"][found], hit["primitive_uvs"][found], hit["sub_quads"][found]
    )
    for name, array in limit.items():
        assert np.isfinite(array).all(), name


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(width=32), min_size=6, max_size=6), st.floats(0, 10), st.floats(0, 10))
def test_any_ray_gets_an_answer(ray, tnear, tfar):
    scene = lr.Scene()
    scene.add_mesh(lr.Mesh(CUBE_POINTS, [4] * 6, CUBE_INDICES))
    for dtype in (np.float32, np.float64):
        hit = scene.cast_rays(np.array(ray, dtype), tnear, tfar)
        t = float(hit["t_hit"])
        assert t == np.inf or tnear <= t <= dtype(tfar)
        assert not np.isnan(hit["primitive_normals"]).any()
