"""Builds the cages of the gallery: shapes made by extruding faces, with creases.

Comes in: nothing. Goes out: `gear()`, `octopus()` and `rounded_cube()` as `limitray.Mesh`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import limitray as lr

INFINITE = 10.0
Vector = NDArray[np.float64]


class Builder:
    """A polygon mesh under construction: points, faces, and the sharpness of edges."""

    def __init__(self) -> None:
        self.points: list[Vector] = []
        self.faces: list[list[int]] = []
        self.sharpness: dict[tuple[int, int], float] = {}

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

    def extrude(self, faces: list[int], linear: Vector, offset: Vector) -> None:
        """Moves a region out of the surface, walls following.

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
        for a, b in border:
            self.faces.append([a, b, moved[b], moved[a]])

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
        )


def rotation(axis: Vector, angle: float) -> Vector:
    """The matrix (3, 3) of a rotation by `angle` (radians) around a unit axis."""
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew


def rounded_cube(sharpness: float) -> lr.Mesh:
    """A cube of side 1.5 whose four upper edges are creased. Axis y."""
    points = [(0.75 * x, 0.75 * y, 0.75 * z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    return lr.Mesh(
        points,
        [4] * 6,
        [v for face in faces for v in face],
        crease_indices=[2, 3, 7, 6, 2],
        crease_lengths=[5],
        crease_sharpnesses=[sharpness],
    )


def gear(teeth: int = 18) -> lr.Mesh:
    """A gear with a hub, a bore and six oval openings; sharp and semi-sharp creases.

    Axis y. Profile loops run around the axis, four segments a tooth.
    """
    segments = 4 * teeth
    # Radius, height, sharpness of the loop, and whether it follows the teeth.
    half = [
        (0.30, 0.30, 6.0, False),
        (0.36, 0.36, 6.0, False),
        (0.58, 0.36, 3.0, False),
        (0.62, 0.14, 1.5, False),
        (0.76, 0.12, 0.0, False),
        (1.22, 0.12, 0.0, False),
        (1.34, 0.14, 1.5, False),
        (1.40, 0.26, 3.0, False),
        (1.58, 0.26, 0.0, True),
        (1.62, 0.23, 4.0, True),
    ]
    profile = half + [(r, -y, s, toothed) for r, y, s, toothed in reversed(half)]
    b = Builder()
    for radius, height, _, toothed in profile:
        for k in range(segments):
            tip = toothed and k % 4 in (1, 2)
            spread = (0.15, -0.22, 0.22, -0.15)[k % 4] if toothed else 0.0
            angle = 2 * math.pi * (k + 0.5 + spread) / segments
            r = radius + (0.30 if tip else 0.0)
            b.point(r * math.cos(angle), height, r * math.sin(angle))

    def vertex(loop: int, k: int) -> int:
        return (loop % len(profile)) * segments + k % segments

    openings = {k for k in range(segments) if k % (segments // 6) < segments // 6 - 3}
    upper, lower = 4, len(profile) - 6  # loops where the openings begin, above and below
    for loop in range(len(profile)):
        for k in range(segments):
            if loop not in (upper, lower) or k not in openings:
                corners = [(loop, k), (loop, k + 1), (loop + 1, k + 1), (loop + 1, k)]
                b.faces.append([vertex(*corner) for corner in corners])
    for loop, (_, _, sharpness, toothed) in enumerate(profile):
        if sharpness > 0:
            b.crease(sharpness, *[vertex(loop, k) for k in range(segments + 1)])
        for k in range(segments if toothed else 0):
            b.crease(2.5, vertex(loop, k), vertex(loop + (1 if loop < len(half) else -1), k))
    for k in sorted(openings):
        _line_opening(b, k, openings, upper, vertex, len(profile) - 1)
    return b.mesh()


def _line_opening(
    b: Builder,
    k: int,
    openings: set[int],
    loop: int,
    vertex: Callable[[int, int], int],
    mirror: int,
) -> None:
    """Walls around segment `k` of an opening; loop l above stands over loop `mirror` - l below."""
    sides = [((loop, k), (loop, k + 1)), ((loop + 1, k + 1), (loop + 1, k))]
    if k - 1 not in openings:
        sides.append(((loop + 1, k), (loop, k)))
    if k + 1 not in openings:
        sides.append(((loop, k + 1), (loop + 1, k + 1)))
    for start, end in sides:
        above = vertex(*start), vertex(*end)
        below = vertex(mirror - start[0], start[1]), vertex(mirror - end[0], end[1])
        b.faces.append([above[0], above[1], below[1], below[0]])
        b.crease(3.0, *above)
        b.crease(3.0, *below)


def octopus() -> lr.Mesh:
    """An octopus with eight curling arms and two eye sockets. Axis y; it looks along z."""
    segments = 16
    profile = [
        (0.30, 2.02), (0.66, 1.90), (0.92, 1.60), (1.00, 1.22), (0.90, 0.84),
        (0.70, 0.54), (0.66, 0.34), (0.80, 0.18), (0.80, -0.12), (0.50, -0.20), (0.22, -0.14),
    ]  # fmt: skip
    b = Builder()
    for radius, height in profile:
        for k in range(segments):
            angle = 2 * math.pi * (k + 0.5) / segments
            lean = -0.28 * max(0.0, height - 0.5)  # the head hangs back a little
            b.point(radius * math.cos(angle), height, radius * math.sin(angle) + lean)
    ring = [list(range(i * segments, (i + 1) * segments)) for i in range(len(profile))]
    for upper, lower in pairwise(ring):
        for k in range(segments):
            m = (k + 1) % segments
            b.faces.append([upper[k], upper[m], lower[m], lower[k]])
    b.faces += [ring[0][::-1], ring[-1]]

    for k in (1, 5):
        _socket(b, 3 * segments + k)
    for k in range(0, segments, 2):
        _arm(b, 7 * segments + k, k // 2)
    return b.mesh()


def _socket(b: Builder, face: int) -> None:
    """A rimmed hollow in one face of the head."""
    corners = [b.points[v] for v in b.faces[face]]
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    normal /= np.linalg.norm(normal)
    b.extrude([face], 0.92 * np.eye(3), 0.09 * normal)
    b.extrude([face], 0.72 * np.eye(3), 0.02 * normal)
    rim = b.faces[face]
    b.crease(1.5, *rim, rim[0])
    b.extrude([face], 0.80 * np.eye(3), -0.14 * normal)
    b.extrude([face], 0.80 * np.eye(3), 0.02 * normal)
    b.extrude([face], 1.10 * np.eye(3), 0.15 * normal)


def _arm(b: Builder, face: int, number: int) -> None:
    """An arm from one face: it falls to the ground, winds along it and curls up at its end."""
    centre = np.mean([b.points[v] for v in b.faces[face]], axis=0)
    heading = np.array([centre[0], 0.0, centre[2]]) / math.hypot(centre[0], centre[2])
    upward = np.array([0.0, 1.0, 0.0])
    steps = 15
    for i in range(steps):
        way = i / (steps - 1)
        pitch = -0.55 if i == 0 else 0.22 if 2 <= i <= 4 else 0.0
        pitch += 0.42 * max(0.0, way - 0.45) / 0.55
        yaw = 0.33 * math.sin(2.6 * math.pi * way + 2.1 * number)
        side = np.cross(heading, upward)
        side /= np.linalg.norm(side)
        turn = rotation(side, pitch) @ rotation(upward, yaw)
        heading = turn @ heading
        b.extrude([face], (0.90 if i else 1.1) * turn, 0.31 * 0.965**i * heading)
