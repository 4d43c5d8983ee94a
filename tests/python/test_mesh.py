"""Meshes: what is accepted, what is refused and in which words, and the true limit."""

import re
import sys

import numpy as np
import pytest
from shapes import CUBE_INDICES, CUBE_POINTS, cage, cube, square

import limitray as lr


def test_arrays_come_back_read_only():
    mesh = cube(hole_indices=[1], corner_indices=[7], corner_sharpnesses=[2.5])
    assert mesh.points.dtype == np.float64
    np.testing.assert_array_equal(mesh.points, CUBE_POINTS)
    np.testing.assert_array_equal(mesh.face_vertex_counts, [4] * 6)
    np.testing.assert_array_equal(mesh.face_vertex_indices, CUBE_INDICES)
    np.testing.assert_array_equal(mesh.hole_indices, [1])
    assert [array.tolist() for array in mesh.corners] == [[7], [2.5]]
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0] = 0


def test_views_keep_the_mesh_alive():
    points = cube().points
    np.testing.assert_array_equal(points, CUBE_POINTS)


@pytest.mark.parametrize("sharpnesses", [[2.5, 2.5, 2.5], [2.5]], ids=["an edge", "a chain"])
def test_creases_are_one_value_a_chain_or_an_edge(sharpnesses):
    mesh = cube(crease_indices=[4, 5, 7, 6], crease_lengths=[4], crease_sharpnesses=sharpnesses)
    edges, values = mesh.crease_edges
    assert edges.tolist() == [[4, 5], [5, 7], [7, 6]]
    assert values.tolist() == [2.5, 2.5, 2.5]


def test_primvars_come_back():
    values = np.arange(8, dtype=np.float32).reshape(4, 2)
    mesh = lr.Mesh(
        square().points,
        [4],
        [0, 1, 2, 3],
        primvars={"st": lr.FaceVarying(values, [3, 2, 1, 0]), "w": lr.FaceVarying([1, 2, 3, 4])},
    )
    np.testing.assert_array_equal(mesh.primvars["st"].values, values)
    np.testing.assert_array_equal(mesh.primvars["st"].indices, [3, 2, 1, 0])
    np.testing.assert_array_equal(mesh.primvars["w"].values, [[1], [2], [3], [4]])
    np.testing.assert_array_equal(mesh.primvars["w"].indices, [0, 1, 2, 3])


WRONG = [
    ({"points": np.zeros((8, 2))}, "points must have shape (n, 3), not (8, 2)"),
    ({"points": [["a", "b", "c"]]}, "points must hold real numbers"),
    ({"points": [(0, 0, 0), (1, 0)]}, "points must be an array of numbers"),
    ({"points": np.zeros((8, 3), complex)}, "points must hold real numbers, not complex128"),
    ({"points": np.full((8, 3), np.nan)}, "points"),
    ({"face_vertex_counts": [4.0] * 6}, "face_vertex_counts must hold integers, not float64"),
    ({"face_vertex_counts": [4] * 5}, "face_vertex_counts"),
    ({"face_vertex_counts": [2, 4, 4, 4, 4, 4, 2]}, "face_vertex_counts"),
    ({"face_vertex_indices": [8, *CUBE_INDICES[1:]]}, "face_vertex_indices"),
    ({"face_vertex_indices": [-1, *CUBE_INDICES[1:]]}, "face_vertex_indices"),
    ({"face_vertex_indices": [2, *CUBE_INDICES[1:]]}, "face_vertex_indices"),
    ({"face_vertex_indices": [1 << 40, *CUBE_INDICES[1:]]}, "must fit 32-bit integers"),
    ({"face_vertex_indices": [CUBE_INDICES]}, "face_vertex_indices must have shape (n,)"),
    ({"interpolate_boundary": "edge"}, "interpolate_boundary must be one of"),
    ({"orientation": "left"}, 'must be one of "rightHanded", "leftHanded", not "left"'),
    ({"creasing_method": "normal"}, "creasing_method must be one of"),
    ({"triangle_subdivision_rule": "loop"}, "triangle_subdivision_rule must be one of"),
    ({"face_varying_linear_interpolation": "some"}, "face_varying_linear_interpolation must"),
    ({"crease_indices": [0, 1], "crease_lengths": [2]}, "crease_sharpnesses"),
    (
        {"crease_indices": [0, 1], "crease_lengths": [2], "crease_sharpnesses": [-1]},
        "crease_sharpnesses",
    ),
    (
        {"crease_indices": [0, 1], "crease_lengths": [2], "crease_sharpnesses": [np.nan]},
        "crease_sharpnesses",
    ),
    (
        {"crease_indices": [0, 7], "crease_lengths": [2], "crease_sharpnesses": [1]},
        "crease_indices",
    ),
    ({"crease_indices": [0, 1, 2], "crease_lengths": [2]}, "crease_lengths"),
    ({"corner_indices": [0], "corner_sharpnesses": []}, "corner_sharpnesses"),
    ({"corner_indices": [9], "corner_sharpnesses": [1]}, "corner_indices"),
    ({"hole_indices": [6]}, "hole_indices"),
    ({"primvars": {"st": [1, 2]}}, 'primvars["st"] must be a FaceVarying or Primvar, not list'),
    ({"primvars": {"st": lr.FaceVarying([1, 2], [0.5])}}, 'primvars["st"].indices must hold'),
    ({"primvars": {"st": lr.FaceVarying([1, 2], [0, 1])}}, "st"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG)
def test_wrong_arguments_are_named(arguments, message):
    right = {
        "points": CUBE_POINTS,
        "face_vertex_counts": [4] * 6,
        "face_vertex_indices": CUBE_INDICES,
    }
    with pytest.raises(ValueError, match=re.escape(message)):
        lr.Mesh(**{**right, **arguments})


def test_points_of_any_layout_are_the_same_mesh():
    points = np.array(CUBE_POINTS, np.float32)
    for other in (np.asfortranarray(points), points[::-1][::-1], points.tolist()):
        mesh = lr.Mesh(other, [4] * 6, CUBE_INDICES)
        np.testing.assert_array_equal(mesh.points, CUBE_POINTS)


def test_a_file_is_read_with_its_tags():
    mesh = cage("cube_semi_2_5")
    assert sorted(mesh.crease_edges[1].tolist()) == [2.5] * 4


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.obj"):
        lr.Mesh.from_file(tmp_path / "nothing.obj")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(IsADirectoryError):
        lr.Mesh.from_file(tmp_path / "folder.obj")
    with pytest.raises(ValueError, match=r'unknown mesh format ".ply"'):
        lr.Mesh.from_file(tmp_path / "model.ply")
    bad = tmp_path / "bad.obj"
    bad.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n")
    with pytest.raises(ValueError, match=r"bad\.obj:4: "):
        lr.Mesh.from_file(bad)
    with pytest.raises(ValueError, match="prim must be None"):
        lr.Mesh.from_file(bad, prim="/mesh")


def test_usd_files_need_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    (tmp_path / "model.usda").write_text("#usda 1.0\n")
    with pytest.raises(ValueError, match=r"limitray\[usd\]"):
        lr.Mesh.from_file(tmp_path / "model.usda")


def test_arguments_of_the_limit_broadcast():
    mesh = cube()
    for face, uv, sub_quad, shape in (
        (0, (0.5, 0.5), 0, ()),
        ([0], (0.5, 0.5), 0, (1,)),
        (np.arange(6), (0.5, 0.5), np.zeros((2, 1), int), (2, 6)),
        (0, np.zeros((0, 2)), 0, (0,)),
    ):
        assert {a.shape for a in mesh.limit(face, uv, sub_quad).values()} == {(*shape, 3)}


def test_the_limit_of_a_square_is_the_square():
    uv = np.random.default_rng(1).random((5, 7, 2))
    limit = square().limit(0, uv)
    np.testing.assert_allclose(limit["points"][..., :2], uv, atol=1e-14)
    np.testing.assert_allclose(limit["dp_du"], np.broadcast_to((1, 0, 0), (5, 7, 3)), atol=1e-13)
    np.testing.assert_allclose(limit["dp_dv"], np.broadcast_to((0, 1, 0), (5, 7, 3)), atol=1e-13)
    np.testing.assert_allclose(limit["normals"], np.broadcast_to((0, 0, 1), (5, 7, 3)), atol=1e-13)


def test_the_limit_of_a_cube_has_its_symmetry():
    limit = cube().limit(np.arange(6), (0.5, 0.5))
    expected = [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]
    np.testing.assert_allclose(limit["normals"], expected, atol=1e-14)
    # Middle of a face: the vertex of valence 4 after one step has its limit at 68/81.
    np.testing.assert_allclose(limit["points"], np.multiply(expected, 68 / 81), atol=1e-14)
    corner = cube().limit(0, [(0, 0)])["points"]  # the mask of valence 3: (9 + 4 - 1) / 24
    np.testing.assert_allclose(np.abs(corner), [[0.5] * 3], atol=1e-14)


def test_orientation_turns_the_normals():
    right = cube().limit(3, (0.3, 0.6))["normals"]
    left = cube(orientation="leftHanded").limit(3, (0.3, 0.6))["normals"]
    np.testing.assert_array_equal(left, -right)


def test_derivatives_of_the_limit_are_differences_of_positions():
    mesh, h = cage("prism_5"), 1e-6
    at = {"face": 6, "sub_quad": 2}
    limit = mesh.limit(uv=(0.3, 0.4), **at)
    for key, du, dv in (("dp_du", h, 0), ("dp_dv", 0, h)):
        ahead = mesh.limit(uv=(0.3 + du, 0.4 + dv), **at)["points"]
        behind = mesh.limit(uv=(0.3 - du, 0.4 - dv), **at)["points"]
        np.testing.assert_allclose((ahead - behind) / (2 * h), limit[key], atol=1e-8)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"face": 6, "uv": (0, 0)}, "face"),
        ({"face": -1, "uv": (0, 0)}, "face"),
        ({"face": 0, "uv": (0, 1.5)}, "out of|within|in \\[0"),
        ({"face": 0, "uv": (np.nan, 0)}, "out of|within|in \\[0"),
        ({"face": 0, "uv": (0, 0, 0)}, r"uv must have shape \(..., 2\), not \(3,\)"),
        ({"face": 0.5, "uv": (0, 0)}, "face must hold integers, not float64"),
        ({"face": [0, 1], "uv": np.zeros((3, 2))}, "do not broadcast"),
        ({"face": 0, "uv": (0, 0), "sub_quad": 4}, "sub"),
    ],
)
def test_the_limit_is_asked_for_where_it_exists(arguments, message):
    with pytest.raises(ValueError, match=message):
        cube().limit(**arguments)


def test_a_hole_has_no_limit():
    with pytest.raises(ValueError, match="hole"):
        cube(hole_indices=[1]).limit(1, (0.5, 0.5))
