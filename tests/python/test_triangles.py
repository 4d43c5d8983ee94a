"""Triangles of the limit surface: on it, wound like the cage, and without cracks."""

from collections import Counter

import numpy as np
import pytest
from shapes import CAGES, cage

import limitray as lr

CLOSED = ["cube", "torus", "torus_creases", "cube_semi_2_5", "prism_5", "icosahedron_smooth"]


def edge_uses(indices):
    """How often each directed edge of the triangles occurs."""
    return Counter(tuple(e) for a in indices for e in zip(a.tolist(), np.roll(a, -1).tolist()))


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("rate", [2, 6])
def test_closed_cages_give_closed_triangles(name, rate):
    mesh = cage(name)
    found = mesh.to_triangles(rate)
    uses = edge_uses(found.indices)
    assert set(uses.values()) == {1}
    assert all((b, a) in uses for a, b in uses)
    euler = len(found.points) - len(uses) // 2 + len(found.indices)
    edges = {tuple(sorted(e)) for e in edges_of(mesh)}
    assert euler == len(mesh.points) - len(edges) + len(mesh.face_vertex_counts)
    n = mesh.face_vertex_counts
    cells = np.where(n == 4, rate**2, n * (rate // 2) ** 2)
    assert len(found.indices) == 2 * cells.sum()


def edges_of(mesh):
    ends = np.cumsum(mesh.face_vertex_counts)
    for first, end in zip(ends - mesh.face_vertex_counts, ends):
        face = mesh.face_vertex_indices[first:end].tolist()
        yield from zip(face, [*face[1:], face[0]])


@pytest.mark.parametrize("path", CAGES, ids=lambda p: p.stem)
def test_points_and_normals_are_those_of_the_limit(path):
    mesh = lr.Mesh.from_file(path)
    if len(mesh.face_vertex_counts) > 400:
        pytest.skip("slow, and like the others")
    found = mesh.to_triangles(2)
    corners = found.points[found.indices]
    truth = mesh.limit(found.faces[:, np.newaxis], found.uvs, found.sub_quads[:, np.newaxis])
    size = np.ptp(mesh.points, axis=0).max()
    np.testing.assert_allclose(corners, truth["points"], atol=1e-12 * size)
    np.testing.assert_array_equal(found.normals, truth["normals"])


def test_winding_is_that_of_the_cage():
    found = cage("cube").to_triangles(4)
    a, b, c = (found.points[found.indices[:, k]] for k in range(3))
    facets = np.cross(b - a, c - a)
    assert ((facets * (a + b + c)).sum(axis=1) > 0).all()
    assert ((facets[:, np.newaxis] * found.normals).sum(axis=2) > 0).all()


def test_area_converges_to_that_of_the_surface():
    areas = []
    for rate in (4, 8, 16):
        found = cage("torus").to_triangles(rate)
        a, b, c = (found.points[found.indices[:, k]] for k in range(3))
        areas.append(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    assert 3.5 < (areas[1] - areas[0]) / (areas[2] - areas[1]) < 4.5


def test_holes_and_dropped_borders_are_absent():
    hole = cage("cube_hole")
    found = hole.to_triangles(2)
    assert not np.isin(found.faces, hole.hole_indices).any()
    border = cage("sheet_none")
    assert len(np.unique(border.to_triangles(1).faces)) < len(border.face_vertex_counts)


def test_errors():
    with pytest.raises(ValueError, match="rate must be an integer >= 1"):
        cage("cube").to_triangles(0)
    with pytest.raises(ValueError, match="rate must be even for faces that are no quads, not 3"):
        cage("prism_5").to_triangles(3)
    square = lr.Mesh(
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3], hole_indices=[0]
    )
    with pytest.raises(ValueError, match="has no surface"):
        square.to_triangles(2)
