"""Large cages for the benchmarks: organic quad cages of any size, made here so that all have them.

Up to 60,000 faces they come from tests/cages/large_cage.py: the skin of a body made of voxels, with
extraordinary vertices everywhere. Beyond that such a cage is refined: each face into four by the
rules of Catmull and Clark, then points moved by a hundredth of an edge, so that no patch is flat.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests/cages"))
from large_cage import large

MOST_VOXEL_FACES = 60_000


def refined(points, quads, rng):
    """Points and faces of a closed quad cage after one step of Catmull-Clark, roughened."""
    count = len(points)
    following = np.roll(quads, -1, axis=1)
    corners = np.stack([quads, following], axis=2).reshape(-1, 2)
    edges, edge_of = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True)
    edge_of = edge_of.reshape(quads.shape)
    faces = points[quads].mean(axis=1)
    middles = points[edges].mean(axis=1)
    beside = np.zeros_like(middles)  # sum of the two faces at an edge
    np.add.at(beside, edge_of.ravel(), np.repeat(faces, 4, axis=0))
    edge_points = (2 * middles + beside) / 4

    valence = np.bincount(edges.ravel(), minlength=count)[:, None]
    face_sum, edge_sum = np.zeros_like(points), np.zeros_like(points)
    np.add.at(face_sum, quads.ravel(), np.repeat(faces, 4, axis=0))
    np.add.at(edge_sum, edges.ravel(), np.repeat(middles, 2, axis=0))
    moved = (face_sum / valence + 2 * edge_sum / valence + (valence - 3) * points) / valence

    new_points = np.concatenate([moved, faces, edge_points])
    face_vertex = count + np.arange(len(quads))
    edge_vertex = count + len(quads) + edge_of
    new_quads = np.stack(
        [quads, edge_vertex, np.tile(face_vertex[:, None], 4), np.roll(edge_vertex, 1, axis=1)],
        axis=2,
    ).reshape(-1, 4)
    length = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1).mean() / 2
    return new_points + rng.normal(scale=0.01 * length, size=new_points.shape), new_quads


def write_large_cage(count, path):
    """Writes a cage of about `count` faces as OBJ, unless the file is there."""
    if path.exists():
        return
    steps = 0
    while count / 4**steps > MOST_VOXEL_FACES:
        steps += 1
    cage = large(count // 4**steps)
    points, quads = np.array(cage.points), np.array(cage.faces)
    rng = np.random.default_rng(5)
    for _ in range(steps):
        points, quads = refined(points, quads, rng)
    with path.open("w") as file:
        np.savetxt(file, points, fmt="v %.9g %.9g %.9g")
        np.savetxt(file, quads + 1, fmt="f %d %d %d %d")
