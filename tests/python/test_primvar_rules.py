"""Linear interpolation rules against the limit surface of the texture map itself.

The map of a face-varying primvar is a cage of its own: its values are the points, a seam is a
boundary, and what the linear interpolation rule holds fast is a sharp corner. `Mesh.limit` of that
cage is the truth; it shares no code with the patches.
"""

import numpy as np
import pytest
from primvar_meshes import evaluate, places, prism_with_map, torn_sheet, with_rule
from shapes import MODELS_FOLDER, cage

import limitray as lr

RULES = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries")


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
    assert_on_map(cage("cube_seams"), rule, 6, 1e-5)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("number", range(5))
def test_rules_on_opensubdiv_shapes(rule, number):
    path = MODELS_FOLDER / "opensubdiv" / f"catmark_fvar_bound{number}.obj"
    if not path.exists():
        pytest.skip("needs the shared models")
    assert_on_map(lr.Mesh.from_file(path), rule, 6, 1e-4)


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
