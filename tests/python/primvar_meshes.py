"""Meshes with texture coordinates, and the places where their primvars are looked at."""

import numpy as np
from shapes import cage

import limitray as lr


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


def prism_with_map(rule="cornersPlus1"):
    """A prism over a pentagon with a value of its own at each face corner of the lids."""
    prism = cage("prism_5")
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
    return scene.evaluate_primvar(name, np.zeros(len(faces), int), faces, sub_quads, uv)
