"""Primvars against the limit surface of the texture map itself.

The map of a face-varying primvar is a cage of its own: its values are the points, a seam is a
boundary, and what the linear interpolation rule holds fast is a sharp corner. `Mesh.limit` of that
cage is the truth; it shares no code with the patches.
"""

import os
from pathlib import Path

import numpy as np
import pytest

import limitray as lr

CAGES = Path(__file__).parents[1] / "cages"
MODELS = Path(os.environ.get("LIMITRAY_MODELS", Path(__file__).parents[3] / "shared" / "models"))
RULES = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries")


def sheet(size, st, **arguments):
    """A flat sheet of size x size quads with texture coordinates of its corners."""
    y, x = np.divmod(np.arange((size + 1) ** 2), size + 1)
    j, i = np.divmod(np.arange(size * size), size)
    first = j * (size + 1) + i
    faces = np.stack([first, first + 1, first + size + 2, first + size + 1], axis=1)
    points = np.stack([x, y, 0 * x], axis=1)
    return lr.Mesh(
        points, np.full(len(faces), 4), faces.ravel(), primvars={"st": st}, **arguments
    ), faces


def torn_sheet(rule="cornersPlus1"):
    """Regions that meet in threes, a tear that ends inside, and values at random."""
    faces = sheet(6, lr.FaceVarying(np.zeros((36 * 4, 2))))[1]
    centres = np.stack([np.arange(36) % 6, np.arange(36) // 6], axis=1)
    region = np.where(centres[:, 0] < 3, 0, np.where(centres[:, 1] < 3, 1, 2))
    keys = np.stack([faces, np.repeat(region[:, np.newaxis], 4, axis=1)], axis=2).reshape(-1, 2)
    _, indices = np.unique(keys, axis=0, return_inverse=True)
    indices = indices.reshape(36, 4)
    for y in (4, 5):  # a tear from the upper border along x = 1, which ends at (1, 4)
        left = y * 6
        top = indices.max() + 1
        indices[left, 2] = top
        if y == 5:
            indices[left, 1] = indices[left - 6, 2]
    rng = np.random.default_rng(5)
    values = rng.random((indices.max() + 1, 2))
    mesh, _ = sheet(
        6, lr.FaceVarying(values, indices.ravel()), face_varying_linear_interpolation=rule
    )
    return mesh


def sharp_values(mesh, rule):
    """The values of "st" that the rule holds fast, from the charts around each vertex."""
    st = mesh.primvars["st"]
    indices, vertices = np.asarray(st.indices), mesh.face_vertex_indices
    if rule == "none":
        return np.zeros(0, int)
    if rule == "boundaries":
        return boundary_values(mesh)
    corners = {}
    for vertex, value in zip(vertices.tolist(), indices.tolist()):
        corners.setdefault(vertex, []).append(value)
    border, sharp = set(boundary_values(mesh).tolist()), set()
    for around in corners.values():
        values, counts = np.unique(around, return_counts=True)
        single = values[counts == 1]
        sharp |= set(single.tolist())
        if rule != "cornersOnly" and len(values) > 2:
            sharp |= set(values.tolist())
        if rule == "cornersPlus2" and len(values) == 2 and len(single):
            sharp |= set(values.tolist())
    if rule == "cornersPlus2":
        sharp |= darts(mesh, border)
    return np.array(sorted(sharp), int)


def map_edges(mesh):
    """Edges of the map as pairs of values, and how many faces have each."""
    indices = np.asarray(mesh.primvars["st"].indices)
    ends = np.cumsum(mesh.face_vertex_counts)
    following = np.arange(1, len(indices) + 1)
    following[ends - 1] = ends - mesh.face_vertex_counts
    pairs = np.sort(np.stack([indices, indices[following]], axis=1), axis=1)
    return np.unique(pairs, axis=0, return_counts=True)


def boundary_values(mesh):
    edges, uses = map_edges(mesh)
    return np.unique(edges[uses == 1])


def darts(mesh, border):
    """Values on a seam that are the only one at a vertex inside the cage."""
    vertices = mesh.face_vertex_indices
    values = np.asarray(mesh.primvars["st"].indices)
    inside = set(range(len(mesh.points))) - open_vertices(mesh)
    return {
        int(values[vertices == vertex][0])
        for vertex in inside
        if len(set(values[vertices == vertex].tolist())) == 1
        and int(values[vertices == vertex][0]) in border
    }


def open_vertices(mesh):
    ends = np.cumsum(mesh.face_vertex_counts)
    following = np.arange(1, len(mesh.face_vertex_indices) + 1)
    following[ends - 1] = ends - mesh.face_vertex_counts
    vertices = mesh.face_vertex_indices
    pairs = np.sort(np.stack([vertices, vertices[following]], axis=1), axis=1)
    edges, uses = np.unique(pairs, axis=0, return_counts=True)
    return set(edges[uses == 1].ravel().tolist())


def map_of(mesh, rule):
    """The texture map as a cage in the plane z = 0."""
    st = mesh.primvars["st"]
    values = np.asarray(st.values, np.float64)
    corners = sharp_values(mesh, rule)
    return lr.Mesh(
        np.concatenate([values, np.zeros((len(values), 1))], axis=1),
        mesh.face_vertex_counts,
        st.indices,
        "edgeOnly",
        triangle_subdivision_rule=mesh.triangle_subdivision_rule,
        corner_indices=corners,
        corner_sharpnesses=np.full(len(corners), 10.0),
    )


def with_rule(mesh, rule):
    """The same mesh, smooth at its own corners, so that only the rule tells which stay sharp."""
    return lr.Mesh(
        mesh.points,
        mesh.face_vertex_counts,
        mesh.face_vertex_indices,
        "edgeOnly",
        face_varying_linear_interpolation=rule,
        triangle_subdivision_rule=mesh.triangle_subdivision_rule,
        primvars=mesh.primvars,
    )


def places(mesh, count, seed=0):
    """Random faces, sub-quads and parameters."""
    rng = np.random.default_rng(seed)
    faces = rng.integers(0, len(mesh.face_vertex_counts), count)
    n = mesh.face_vertex_counts[faces]
    sub_quads = np.where(n == 4, 0, (rng.random(count) * n).astype(int))
    return faces, sub_quads, rng.random((count, 2))


def evaluate(mesh, name, faces, sub_quads, uv, level=None):
    scene = lr.Scene()
    scene.add_mesh(mesh, level)
    return scene.evaluate_primvar(name, np.zeros(len(faces)), faces, sub_quads, uv)


def assert_on_map(mesh, rule, level, tolerance, exact=0.5):
    """Values within `tolerance` of the map's limit; at least the share `exact` to rounding."""
    mesh = with_rule(mesh, rule)
    faces, sub_quads, uv = places(mesh, 2000)
    values = evaluate(mesh, "st", faces, sub_quads, uv, level)[0]
    truth = map_of(mesh, rule).limit(faces, uv, sub_quads)["points"][:, :2]
    size = np.abs(truth).max()
    errors = np.abs(values - truth).max(axis=1) / size
    assert errors.max() < tolerance
    assert np.mean(errors < 1e-14) >= exact


@pytest.mark.parametrize("rule", RULES)
def test_rules_on_a_torn_sheet(rule):
    assert_on_map(torn_sheet(), rule, 2, 0.03, exact=0.1)
    # Two faces at a sharp corner of a border: a Gregory patch is off by a fixed share of its size.
    assert_on_map(torn_sheet(), rule, 6, 1e-3 if rule == "boundaries" else 2e-5, exact=0.9)


@pytest.mark.parametrize("rule", RULES)
def test_rules_on_cages(rule):
    assert_on_map(lr.Mesh.from_file(CAGES / "cube_seams.obj"), rule, 6, 1e-5)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("number", range(5))
def test_rules_on_opensubdiv_shapes(rule, number):
    path = MODELS / "opensubdiv" / f"catmark_fvar_bound{number}.obj"
    if not path.exists():
        pytest.skip("needs the shared models")
    assert_on_map(lr.Mesh.from_file(path), rule, 6, 1e-4)


def prism_with_map(rule="cornersPlus1"):
    """A prism over a pentagon with a value of its own at each face corner of the lids."""
    prism = lr.Mesh.from_file(CAGES / "prism_5.obj")
    values = np.random.default_rng(2).random((len(prism.face_vertex_indices), 2))
    return with_rule(
        lr.Mesh(
            prism.points,
            prism.face_vertex_counts,
            prism.face_vertex_indices,
            primvars={"st": lr.FaceVarying(values)},
        ),
        rule,
    )


@pytest.mark.parametrize("rule", RULES)
def test_faces_that_are_no_quads(rule):
    assert_on_map(prism_with_map(), rule, 7, 1e-4, exact=0.3)


def test_rule_all_is_bilinear():
    for mesh in (torn_sheet("all"), prism_with_map("all")):
        faces, sub_quads, uv = places(mesh, 500)
        values, d_du, d_dv = evaluate(mesh, "st", faces, sub_quads, uv)
        st = mesh.primvars["st"]
        rows = np.asarray(st.values, np.float64)[np.asarray(st.indices)]
        first = np.cumsum(mesh.face_vertex_counts) - mesh.face_vertex_counts
        for row in range(500):
            n = mesh.face_vertex_counts[faces[row]]
            c = rows[first[faces[row]] : first[faces[row]] + n]
            if n != 4:
                k = sub_quads[row]
                after, before = c[(k + 1) % n], c[k - 1]
                c = [c[k], (c[k] + after) / 2, c.mean(axis=0), (c[k] + before) / 2]
            u, v = uv[row]
            below, above = (1 - u) * c[0] + u * c[1], (1 - u) * c[3] + u * c[2]
            np.testing.assert_allclose(values[row], (1 - v) * below + v * above, atol=1e-14)
            np.testing.assert_allclose(d_dv[row], above - below, atol=1e-14)
            across = (1 - v) * (c[1] - c[0]) + v * (c[2] - c[3])
            np.testing.assert_allclose(d_du[row], across, atol=1e-14)


@pytest.mark.parametrize(
    "name", ["torus_creases", "cube_semi_2_5", "prism_5", "icosahedron_smooth"]
)
def test_vertex_primvar_is_like_the_points(name):
    cage = lr.Mesh.from_file(CAGES / f"{name}.obj")
    edges, sharpnesses = cage.crease_edges
    mesh = lr.Mesh(
        cage.points,
        cage.face_vertex_counts,
        cage.face_vertex_indices,
        crease_indices=edges.ravel(),
        crease_lengths=np.full(len(edges), 2),
        crease_sharpnesses=sharpnesses,
        triangle_subdivision_rule=cage.triangle_subdivision_rule,
        primvars={"rest": lr.Primvar(np.tile(cage.points, 2)[:, :5], "vertex")},
    )
    scene = lr.Scene()
    scene.add_mesh(mesh)
    rng = np.random.default_rng(3)
    origins = rng.normal(size=(2000, 3)) * 4
    rays = np.concatenate([origins, 0.3 * rng.normal(size=(2000, 3)) - origins], axis=1)
    hit = scene.cast_rays(rays, attributes=("points", "dp_du", "dp_dv", "primvars:rest"))
    found = np.isfinite(hit["t_hit"])
    assert found.mean() > 0.5
    for key, name in (("points", ""), ("dp_du", ":du"), ("dp_dv", ":dv")):
        values = hit["primvars:rest" + name]
        scale = np.abs(hit[key]).max()
        assert np.abs(values[found, :3] - hit[key][found]).max() < 1e-6 * scale
        np.testing.assert_array_equal(values[found, 3:], values[found, :2])
        assert not values[~found].any()


@pytest.mark.parametrize("name", ["torus_creases", "cube_semi_2_5", "cube_semi_3_7", "dart_semi"])
def test_creases_shape_primvars_too(name):
    """Without seams a face-varying primvar that starts as the points ends as the surface."""
    cage = lr.Mesh.from_file(CAGES / f"{name}.obj")
    edges, sharpnesses = cage.crease_edges
    mesh = lr.Mesh(
        cage.points,
        cage.face_vertex_counts,
        cage.face_vertex_indices,
        cage.interpolate_boundary,
        crease_indices=edges.ravel(),
        crease_lengths=np.full(len(edges), 2),
        crease_sharpnesses=sharpnesses,
        primvars={"rest": lr.FaceVarying(cage.points, cage.face_vertex_indices)},
    )
    faces, sub_quads, uv = places(mesh, 2000)
    values = evaluate(mesh, "rest", faces, sub_quads, uv, 6)[0]
    errors = np.abs(values - mesh.limit(faces, uv, sub_quads)["points"]).max(axis=1)
    assert np.quantile(errors, 0.9) < 1e-6
    assert errors.max() < 2e-3


def test_other_interpolations():
    prism = lr.Mesh.from_file(CAGES / "prism_5.obj")
    n = len(prism.points)
    uniform = np.arange(len(prism.face_vertex_counts), dtype=float)
    mesh = lr.Mesh(
        prism.points,
        prism.face_vertex_counts,
        prism.face_vertex_indices,
        primvars={
            "constant": lr.Primvar([[1, 2, 3, 4]], "constant"),
            "uniform": lr.Primvar(uniform, "uniform"),
            "varying": lr.Primvar(prism.points, "varying"),
            "swapped": lr.Primvar(prism.points[::-1], "varying", np.arange(n)[::-1]),
        },
    )
    faces, sub_quads, uv = places(mesh, 200)
    values, d_du, _ = evaluate(mesh, "constant", faces, sub_quads, uv)
    assert (values == [1, 2, 3, 4]).all()
    assert not d_du.any()
    np.testing.assert_array_equal(
        evaluate(mesh, "uniform", faces, sub_quads, uv)[0][:, 0], uniform[faces]
    )
    linear = evaluate(mesh, "varying", faces, sub_quads, uv)
    swapped = evaluate(mesh, "swapped", faces, sub_quads, uv)
    np.testing.assert_array_equal(linear[0], swapped[0])
    at_corner = np.zeros((len(faces), 2))
    first = (np.cumsum(mesh.face_vertex_counts) - mesh.face_vertex_counts)[faces]
    corners = mesh.points[mesh.face_vertex_indices[first + sub_quads]]
    np.testing.assert_allclose(
        evaluate(mesh, "varying", faces, sub_quads, at_corner)[0], corners, atol=1e-7
    )


def test_seams_do_not_bleed():
    region = np.repeat(np.arange(36) % 6 < 3, 4).astype(float)
    mesh, _ = sheet(6, lr.FaceVarying(np.stack([region, region], axis=1)))
    faces, sub_quads, uv = places(mesh, 4000)
    values = evaluate(mesh, "st", faces, sub_quads, uv)[0]
    np.testing.assert_allclose(values[:, 0], region[::4][faces], atol=1e-15)
    on_seam = evaluate(mesh, "st", np.array([2, 3]), np.zeros(2), np.array([[1, 0.3], [0, 0.3]]))[0]
    np.testing.assert_allclose(on_seam[:, 0], [1, 0], atol=1e-15)


def test_linear_map_is_reproduced():
    y, x = np.divmod(np.arange(49), 7)
    faces = sheet(6, lr.FaceVarying(np.zeros((144, 2))))[1]
    st = lr.FaceVarying(np.stack([x / 6, y / 6], axis=1), faces.ravel())
    mesh, _ = sheet(6, st, face_varying_linear_interpolation="boundaries")
    _, sub_quads, uv = places(mesh, 500)
    inner = np.full(500, 14)
    values, d_du, d_dv = evaluate(mesh, "st", inner, sub_quads, uv)
    np.testing.assert_allclose(values * 6, np.add(uv, 2), atol=3e-7)
    np.testing.assert_allclose(d_du * 6, np.tile([1, 0], (500, 1)), atol=1e-6)
    np.testing.assert_allclose(d_dv * 6, np.tile([0, 1], (500, 1)), atol=1e-6)


@pytest.mark.parametrize("make", [torn_sheet, prism_with_map])
def test_derivatives_by_moving(make):
    mesh = make()
    faces, sub_quads, uv = places(mesh, 2000)
    uv = 0.01 + 0.98 * uv
    step = 1e-6
    d_du, d_dv = evaluate(mesh, "st", faces, sub_quads, uv)[1:]
    for axis, derivative in enumerate((d_du, d_dv)):
        moved = [
            evaluate(mesh, "st", faces, sub_quads, uv + sign * step * np.eye(2)[axis])[0]
            for sign in (1, -1)
        ]
        error = np.abs((moved[0] - moved[1]) / (2 * step) - derivative).max(axis=1)
        # Second derivatives jump between patches: a step across a border is off by their jump.
        assert np.quantile(error, 0.99) < 1e-7
        assert error.max() < 1e-3


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_cast_rays_gives_primvars(dtype):
    mesh = torn_sheet()
    bare = lr.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3])
    scene = lr.Scene()
    scene.add_mesh(bare, transform=[[1, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    scene.add_mesh(mesh)
    rays = np.zeros((3, 1, 6), dtype)
    rays[:, 0, :3] = [(2.3, 2.8, 1), (10.5, 0.5, 1), (-5, 0, 1)]
    rays[..., 5] = -1
    hit = scene.cast_rays(rays, attributes=("primvars:st",))
    assert set(hit) == {
        *("t_hit", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals"),
        *("primvars:st", "primvars:st:du", "primvars:st:dv"),
    }
    assert hit["primvars:st"].shape == (3, 1, 2)
    assert hit["primvars:st"].dtype == dtype
    expected = scene.evaluate_primvar("st", [1], [14], [0], hit["primitive_uvs"][0])
    for key, value in zip(("", ":du", ":dv"), expected):
        np.testing.assert_allclose(hit["primvars:st" + key][0], value, rtol=1e-6)
        assert np.isnan(hit["primvars:st" + key][1]).all()
        assert not hit["primvars:st" + key][2].any()


def test_errors():
    mesh = torn_sheet()
    scene = lr.Scene()
    scene.add_mesh(mesh)
    with pytest.raises(ValueError, match='no mesh has the primvar of "primvars:uv"'):
        scene.cast_rays(np.zeros((1, 6)), attributes=("primvars:uv",))
    with pytest.raises(ValueError, match="face: must be below 36, got 36"):
        scene.evaluate_primvar("st", [0], [36], [0], [(0, 0)])
    with pytest.raises(ValueError, match="sub_quad: must be below 1, got 1"):
        scene.evaluate_primvar("st", [0], [0], [1], [(0, 0)])
    with pytest.raises(ValueError, match="geometry_id: must be below 1, got 7"):
        scene.evaluate_primvar("st", [7], [0], [0], [(0, 0)])
    wide = sheet(1, lr.FaceVarying(np.zeros((4, 3))))[0]
    scene.add_mesh(wide)
    with pytest.raises(ValueError, match="2 components in one mesh and 3 in another"):
        scene.cast_rays(np.zeros((1, 6)), attributes=("primvars:st",))
    with pytest.raises(ValueError, match=r'primvars\["c"\].indices: .*one index a face'):
        lr.Mesh(
            mesh.points,
            mesh.face_vertex_counts,
            mesh.face_vertex_indices,
            primvars={"c": lr.Primvar([1.0], "uniform")},
        )


def test_holes_have_no_values():
    square = sheet(2, lr.FaceVarying(np.zeros((16, 2))), hole_indices=[1])[0]
    with pytest.raises(ValueError, match="face: 1 has no surface"):
        evaluate(square, "st", [1], [0], [(0.5, 0.5)])
