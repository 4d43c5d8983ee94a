"""Cages of the gallery and of the figure: machined and folded shapes, with creases.

Comes in: nothing. Goes out: `rounded_cube()`, `gear()`, `sponge()`, `knot()` as `limitray.Mesh`;
`octopus.py` has the one that is grown.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from builder import Builder

import limitray as lr


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


def sponge(level: int = 2, sharpness: float = 1.5) -> lr.Mesh:
    """A Menger sponge of side 2, all its ridges and grooves semi-sharp creases.

    `level` 1 has 72 faces, 2 has 1,056; the sharpness may be any above 0.
    """
    size = 3**level
    cells = np.ones((1, 1, 1), bool)
    cross = np.ones((3, 3, 3), bool)
    cross[1, 1, :] = cross[1, :, 1] = cross[:, 1, 1] = False
    for _ in range(level):
        cells = np.kron(cells, cross)
    solid = np.pad(cells, 1)
    b = Builder()
    index: dict[tuple[int, ...], int] = {}
    normals: dict[tuple[int, int], list[tuple[int, int]]] = {}

    def vertex(*place: int) -> int:
        if place not in index:
            index[place] = b.point(*(2 * np.array(place) / size - 1))
        return index[place]

    for cell in np.argwhere(solid):
        for axis in range(3):
            for side in (-1, 1):
                beside = cell.copy()
                beside[axis] += side
                if solid[tuple(beside)]:
                    continue
                corner = cell - 1
                corner[axis] += side > 0
                u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
                places = [corner, corner + u, corner + u + v, corner + v]
                face = [vertex(*place.tolist()) for place in places[::side]]
                b.faces.append(face)
                for a, c in zip(face, face[1:] + face[:1], strict=True):
                    normals.setdefault((min(a, c), max(a, c)), []).append((axis, side))
    for (a, c), both in normals.items():
        if both[0] != both[1]:
            b.crease(sharpness, a, c)
    return b.mesh()


def knot(turns: int = 3, loops: int = 2, segments: int = 300, sharpness: float = 2.2) -> lr.Mesh:
    """A torus knot with a fluted, twisted cross-section; its ridges are semi-sharp creases.

    It winds `turns` times through the hole while it goes `loops` times around. Axis y.
    """
    flutes, twist = 8, 5
    corners = 2 * flutes
    way = 2 * math.pi * np.arange(segments) / segments
    ring = 1.0 + 0.42 * np.cos(turns * way)
    centre = np.stack(
        [ring * np.cos(loops * way), 0.42 * np.sin(turns * way), ring * np.sin(loops * way)], axis=1
    )
    tangent = np.roll(centre, -1, axis=0) - np.roll(centre, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    axis = np.stack([np.cos(loops * way), 0 * way, np.sin(loops * way)], axis=1)
    side = axis - (axis * tangent).sum(axis=1, keepdims=True) * tangent
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(tangent, side)
    b = Builder()
    for i in range(segments):
        for k in range(corners):
            angle = 2 * math.pi * (k / corners + twist * i / segments)
            radius = 0.235 if k % 2 == 0 else 0.165
            b.point(*(centre[i] + radius * (math.cos(angle) * side[i] + math.sin(angle) * up[i])))

    def vertex(i: int, k: int) -> int:
        return i % segments * corners + k % corners

    for i in range(segments):
        for k in range(corners):
            face = [vertex(i, k), vertex(i, k + 1), vertex(i + 1, k + 1), vertex(i + 1, k)]
            b.faces.append(face[::-1])
    for k in range(0, corners, 2):
        b.crease(sharpness, *[vertex(i, k) for i in range(segments + 1)])
    return b.mesh()
