"""Primvars of all interpolations: values, derivatives, creases, seams and holes."""

import numpy as np
import pytest
from primvar_meshes import evaluate, places, prism_with_map, sheet, torn_sheet
from shapes import cage

import limitray as lr


def with_primvars(mesh, **primvars):
    """The same cage, with its creases and rules, and other primvars."""
    edges, sharpnesses = mesh.crease_edges
    return lr.Mesh(
        mesh.points,
        mesh.face_vertex_counts,
        mesh.face_vertex_indices,
        mesh.interpolate_boundary,
        crease_indices=edges.ravel(),
        crease_lengths=np.full(len(edges), 2),
        crease_sharpnesses=sharpnesses,
        triangle_subdivision_rule=mesh.triangle_subdivision_rule,
        primvars=primvars,
    )


@pytest.mark.parametrize(
    "name", ["torus_creases", "cube_semi_2_5", "prism_5", "icosahedron_smooth"]
)
def test_vertex_primvar_is_like_the_points(name):
    plain = cage(name)
    mesh = with_primvars(plain, rest=lr.Primvar(np.tile(plain.points, 2)[:, :5], "vertex"))
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
    plain = cage(name)
    mesh = with_primvars(plain, rest=lr.FaceVarying(plain.points, plain.face_vertex_indices))
    faces, sub_quads, uv = places(mesh, 2000)
    values = evaluate(mesh, "rest", faces, sub_quads, uv, 6)[0]
    errors = np.abs(values - mesh.limit(faces, uv, sub_quads)["points"]).max(axis=1)
    assert np.quantile(errors, 0.9) < 1e-6
    assert errors.max() < 2e-3


def test_other_interpolations():
    prism = cage("prism_5")
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
    on_seam = evaluate(mesh, "st", np.array([2, 3]), [0, 0], np.array([[1, 0.3], [0, 0.3]]))[0]
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
