"""Triangles of the limit surface, for tools that know nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limitray._arrays import positive_int
from limitray.mesh import Mesh

MOST_TRIANGLES = 2**31 - 1


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of a surface.

    Parameters
    ----------
    points : array (n, 3) of float64
        Points of the limit surface. Faces share those on their common edges: there are no cracks.
    indices : array (m, 3) of int32
        The triangles, wound as the cage's faces are.
    normals : array (m, 3, 3) of float64
        Unit normal at each corner of each triangle; they differ across creases.
    faces : array (m,) of int32
        Base face of each triangle.
    uvs : array (m, 3, 2) of float64
        Parameters of each corner in the base face, or in its sub-quad.
    sub_quads : array (m,) of int32
        Corner of a face that is no quad; 0 for quads.
    """

    points: NDArray[np.float64]
    indices: NDArray[np.int32]
    normals: NDArray[np.float64]
    faces: NDArray[np.int32]
    uvs: NDArray[np.float64]
    sub_quads: NDArray[np.int32]


def to_triangles(mesh: Mesh, rate: int) -> Triangles:
    """Triangles of the limit surface with `rate` of them along each edge of the cage.

    Quads become grids of rate x rate cells of two triangles, a face with n other corners n grids of
    half that. Points are exact; between them triangles are flat.

    Parameters
    ----------
    mesh : Mesh
        The cage.
    rate : int
        At least 1; even if a face is no quad.

    Raises
    ------
    ValueError
        `rate` is not such a number, or makes more than 2^31 - 1 triangles, or the surface is empty.
    """
    positive_int("rate", rate)
    faces = np.flatnonzero(~_absent(mesh))
    counts = mesh.face_vertex_counts[faces]
    if rate % 2 and (counts != 4).any():
        raise ValueError(f"rate must be even for faces that are no quads, not {rate}")
    total = int(np.where(counts == 4, 4, counts).sum()) * int(rate) ** 2 // 2
    if total > MOST_TRIANGLES:
        raise ValueError(f"rate {rate} makes {total:,} triangles, more than {MOST_TRIANGLES:,}")
    if not len(faces):
        raise ValueError("the mesh has no surface, so it has no triangles")
    grids = [_Grids.of(mesh, faces[counts == 4], 1, rate)]
    for n in np.unique(counts[counts != 4]):
        grids.append(_Grids.of(mesh, faces[counts == n], int(n), rate // 2))
    return _join(mesh, [grid for grid in grids if len(grid.faces)])


@dataclass(frozen=True)
class _Grids:
    """Sub-quads that are cut alike: one row each."""

    faces: NDArray[np.int32]
    sub_quads: NDArray[np.int32]
    rate: int
    keys: NDArray[np.int64]
    """For each grid point (q, (rate + 1)^2, 4) what it is: points with equal keys are one."""

    @classmethod
    def of(cls, mesh: Mesh, faces: NDArray[np.intp], quads: int, rate: int) -> _Grids:
        ids = np.repeat(faces, quads).astype(np.int32)
        sub_quads = np.tile(np.arange(quads, dtype=np.int32), len(faces))
        keys = _point_keys(mesh, ids, sub_quads, quads > 1, rate)
        return cls(ids, sub_quads, rate, keys)

    def uvs(self) -> NDArray[np.float64]:
        """Parameters ((rate + 1)^2, 2) of the points of a grid; u runs fastest."""
        steps = np.arange(self.rate + 1) / self.rate
        v, u = np.meshgrid(steps, steps, indexing="ij")
        return np.stack([u.ravel(), v.ravel()], axis=1)

    def triangles(self) -> NDArray[np.int64]:
        """Corners (2 rate^2, 3) as points of the grid."""
        row = self.rate + 1
        j, i = np.divmod(np.arange(self.rate * self.rate), self.rate)
        a = j * row + i
        cells = np.stack([a, a + 1, a + row + 1, a, a + row + 1, a + row], axis=1)
        return cells.reshape(-1, 3)


def _absent(mesh: Mesh) -> NDArray[np.bool_]:
    """Faces without a surface: holes, and at the boundary under the rule `none`."""
    absent = np.zeros(len(mesh.face_vertex_counts), bool)
    absent[mesh.hole_indices] = True
    if mesh.interpolate_boundary == "none":
        vertices, face_of = mesh.face_vertex_indices, _face_of_corner(mesh)
        pairs = np.sort(np.stack([vertices, vertices[_next_corner(mesh)]], axis=1), axis=1)
        edges, uses = np.unique(pairs, axis=0, return_counts=True)
        boundary = np.zeros(len(mesh.points), bool)
        boundary[edges[uses == 1].ravel()] = True
        absent[face_of[boundary[vertices]]] = True
    return absent


def _face_of_corner(mesh: Mesh) -> NDArray[np.intp]:
    return np.repeat(np.arange(len(mesh.face_vertex_counts)), mesh.face_vertex_counts)


def _next_corner(mesh: Mesh) -> NDArray[np.int64]:
    """The corner after each corner, around its face."""
    following = np.arange(1, len(mesh.face_vertex_indices) + 1)
    last = np.cumsum(mesh.face_vertex_counts) - 1
    following[last] = last + 1 - mesh.face_vertex_counts
    return following


def _point_keys(
    mesh: Mesh,
    faces: NDArray[np.int32],
    sub_quads: NDArray[np.int32],
    is_sub_quad: bool,
    rate: int,
) -> NDArray[np.int64]:
    """What each grid point is: a vertex, a place on an edge of the cage, or inside a face.

    A key is (kind, a, b, place): vertex (0, vertex, 0, 0); edge (1, lower vertex, higher vertex,
    steps from the lower one); inside a face between two of its sub-quads (2, face, corner before
    which, steps from the centre); else (3, face, sub-quad, point of the grid).
    """
    counts = mesh.face_vertex_counts
    first = (np.cumsum(counts) - counts)[faces]
    n = counts[faces]
    row = rate + 1
    keys = np.zeros((len(faces), row * row, 4), np.int64)
    keys[:, :, 0], keys[:, :, 1], keys[:, :, 2] = 3, faces[:, np.newaxis], sub_quads[:, np.newaxis]
    keys[:, :, 3] = np.arange(row * row)
    steps = np.arange(row)

    def corner(k: NDArray[np.int32] | int) -> NDArray[np.int32]:
        found: NDArray[np.int32] = mesh.face_vertex_indices[first + (sub_quads + k) % n]
        return found

    def along(points: NDArray[np.intp], start: int, end: int, length: int) -> None:
        """Grid points on an edge from corner `start` on; the edge has `length` steps."""
        a, b = corner(start)[:, np.newaxis], corner(end)[:, np.newaxis]
        place = np.where(a < b, steps, length - steps)
        keys[:, points] = np.stack(
            np.broadcast_arrays(1, np.minimum(a, b), np.maximum(a, b), place), axis=2
        )

    if is_sub_quad:
        whole, centre = 2 * rate, 2
        for points, offset in ((steps * row + rate, 1), ((row - 1) * row + steps, 0)):
            inner = np.stack(
                np.broadcast_arrays(
                    centre,
                    faces[:, np.newaxis],
                    ((sub_quads + offset) % n)[:, np.newaxis],
                    rate - steps,
                ),
                axis=2,
            )
            inner[:, -1, 2] = 0
            keys[:, points] = inner
        along(steps, 0, 1, whole)
        along(steps * row, 0, -1, whole)
        vertices = {0: 0}
    else:
        along(steps, 0, 1, rate)
        along(steps * row, 0, 3, rate)
        along(steps * row + rate, 1, 2, rate)
        along((row - 1) * row + steps, 3, 2, rate)
        vertices = {0: 0, rate: 1, row * row - 1: 2, (row - 1) * row: 3}
    for point, k in vertices.items():
        found = corner(k)
        zero = np.zeros_like(found)
        keys[:, point] = np.stack([zero, found, zero, zero], axis=1)
    return keys


def _join(mesh: Mesh, grids: list[_Grids]) -> Triangles:
    """Evaluates all grid points and joins those that are one."""
    points, normals, keys, corners, faces, uvs, sub_quads = [], [], [], [], [], [], []
    first = 0
    for grid in grids:
        uv, cells = grid.uvs(), grid.triangles()
        limit = mesh.limit(grid.faces[:, np.newaxis], uv, grid.sub_quads[:, np.newaxis])
        points.append(limit["points"].reshape(-1, 3))
        normals.append(limit["normals"].reshape(-1, 3))
        keys.append(grid.keys.reshape(-1, 4))
        starts = first + np.arange(len(grid.faces)) * len(uv)
        corners.append((starts[:, np.newaxis, np.newaxis] + cells).reshape(-1, 3))
        faces.append(np.repeat(grid.faces, len(cells)))
        sub_quads.append(np.repeat(grid.sub_quads, len(cells)))
        uvs.append(np.tile(uv[cells], (len(grid.faces), 1, 1)))
        first += len(grid.faces) * len(uv)
    all_corners = np.concatenate(corners)
    unique, joined = np.unique(
        np.concatenate(keys), axis=0, return_index=True, return_inverse=True
    )[1:]
    return Triangles(
        points=np.concatenate(points)[unique],
        indices=joined.ravel()[all_corners].astype(np.int32),
        normals=np.concatenate(normals)[all_corners],
        faces=np.concatenate(faces),
        uvs=np.concatenate(uvs),
        sub_quads=np.concatenate(sub_quads),
    )
