"""Builds cages by extruding faces, with creases, texture coordinates and materials.

Comes in: points and faces, one by one. Goes out: `Builder.mesh()`, a `limitray.Mesh`.
"""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import limitray as lr

Vector = NDArray[np.float64]


class Builder:
    """A polygon mesh under construction: points, faces, and the sharpness of edges.

    `st` holds texture coordinates for each corner of the faces that have them, and `material` the
    number of a face's material where it is not 0.
    """

    def __init__(self) -> None:
        self.points: list[Vector] = []
        self.faces: list[list[int]] = []
        self.sharpness: dict[tuple[int, int], float] = {}
        self.st: dict[int, list[tuple[float, float]]] = {}
        self.material: dict[int, int] = {}

    def point(self, x: float, y: float, z: float) -> int:
        """Adds a point; returns its index."""
        self.points.append(np.array([x, y, z], float))
        return len(self.points) - 1

    def crease(self, sharpness: float, *chain: int) -> None:
        """Creases the edges along a chain of points."""
        for a, b in pairwise(chain):
            self.sharpness[min(a, b), max(a, b)] = sharpness

    def border(self, faces: list[int]) -> list[tuple[int, int]]:
        """Directed edges around a region of faces."""
        edges = [
            (a, b)
            for f in faces
            for a, b in zip(self.faces[f], self.faces[f][1:] + self.faces[f][:1], strict=True)
        ]
        count = Counter((min(e), max(e)) for e in edges)
        return [(a, b) for a, b in edges if count[min(a, b), max(a, b)] == 1]

    def extrude(self, faces: list[int], linear: Vector, offset: Vector) -> list[int]:
        """Moves a region out of the surface, walls following; returns the walls.

        Each point p of the region becomes centre + linear (p - centre) + offset.
        """
        border = self.border(faces)
        old = sorted({v for f in faces for v in self.faces[f]})
        centre = np.mean([self.points[v] for v in old], axis=0)
        moved = {
            v: self.point(*(centre + linear @ (self.points[v] - centre) + offset)) for v in old
        }
        for f in faces:
            self.faces[f] = [moved[v] for v in self.faces[f]]
        first = len(self.faces)
        for a, b in border:
            self.faces.append([a, b, moved[b], moved[a]])
        return list(range(first, len(self.faces)))

    def mesh(self) -> lr.Mesh:
        """The finished cage; points that no face uses are left out."""
        used = sorted({v for face in self.faces for v in face})
        index = {v: i for i, v in enumerate(used)}
        creases = {e: s for e, s in self.sharpness.items() if e[0] in index and e[1] in index}
        return lr.Mesh(
            [self.points[v] for v in used],
            [len(face) for face in self.faces],
            [index[v] for face in self.faces for v in face],
            crease_indices=[index[v] for edge in creases for v in edge],
            crease_lengths=[2] * len(creases),
            crease_sharpnesses=list(creases.values()),
            primvars={"st": self._texture_coordinates()} if self.st else None,
        )

    def _texture_coordinates(self) -> lr.FaceVarying:
        """Corners with equal coordinates share them; faces without have (0, 0)."""
        index: dict[tuple[float, float], int] = {}
        corners = [
            index.setdefault(place, len(index))
            for number, face in enumerate(self.faces)
            for place in self.st.get(number, [(0.0, 0.0)] * len(face))
        ]
        return lr.FaceVarying(list(index), corners)

    def material_numbers(self) -> list[int]:
        """The material of each face."""
        return [self.material.get(number, 0) for number in range(len(self.faces))]


def rotation(axis: Vector, angle: float) -> Vector:
    """The matrix (3, 3) of a rotation by `angle` (radians) around a unit axis."""
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew
