"""The demo: a fluted cup with three handles, part machined, part grown."""

import math
from itertools import pairwise

from obj_writer import Cage

SEGMENTS = 18
INFINITE = 10

# Rings from the inside of the foot up to the lip: radius, height, sharpness of the ring, depth of
# the flutes (fraction of the radius by which every second vertex moves inward).
PROFILE = [
    (0.42, 0.10, 0, 0),
    (0.86, 0.00, INFINITE, 0),
    (1.00, 0.00, INFINITE, 0),
    (1.00, 0.16, 2.5, 0),
    (0.66, 0.34, 0, 0),
    (0.36, 0.62, 0, 0),
    (0.30, 0.98, 1.0, 0),
    (0.48, 1.06, 3.0, 0),
    (0.48, 1.18, 3.0, 0),
    (0.32, 1.28, 1.0, 0),
    (0.72, 1.42, 0, 0.10),
    (1.08, 1.70, 0, 0.17),
    (1.24, 2.12, 0, 0.18),
    (1.14, 2.54, 0, 0.15),
    (0.88, 2.84, 2.0, 0.02),
    (0.95, 2.94, 4.0, 0),
    (0.95, 3.10, 4.0, 0),
    (1.02, 3.24, 0, 0),
    (1.26, 3.40, 0, 0),
]
FLUTED = range(10, 14)  # rings whose ridges are creased
HANDLE_RINGS = (11, 13)  # a handle joins the face above the first ring and the one above the second
# Middle of a handle's sections on the way: distance from the axis, height, half thickness, tilt.
HANDLE_PATH = [
    (1.46, 1.74, 0.12, -0.9),
    (1.78, 1.98, 0.11, -0.35),
    (1.90, 2.36, 0.11, 0.15),
    (1.76, 2.74, 0.11, 0.75),
    (1.38, 2.90, 0.11, 1.35),
]


def ring_vertex(ring, segment):
    """Index of a vertex of the cup's wall."""
    return ring * SEGMENTS + segment % SEGMENTS


def wall_face(ring, segment):
    """Vertices of the quad above `ring` and after `segment`, counter-clockwise from outside."""
    return [
        ring_vertex(ring, segment),
        ring_vertex(ring, segment + 1),
        ring_vertex(ring + 1, segment + 1),
        ring_vertex(ring + 1, segment),
    ]


def add_wall(cage, open_faces):
    """Rings, walls and the creases of both; faces in `open_faces` are left out for handles."""
    for ring, (radius, height, _, flute) in enumerate(PROFILE):
        for segment in range(SEGMENTS):
            angle = 2 * math.pi * (segment + 0.5) / SEGMENTS
            r = radius * (1 - flute * (segment % 2))
            is_lip = ring + 1 == len(PROFILE)
            wave = 0.05 * math.cos(3 * (angle - math.pi / SEGMENTS)) if is_lip else 0
            cage.point(r * math.cos(angle), r * math.sin(angle), height + wave)
    cage.faces.append([ring_vertex(0, s) for s in range(SEGMENTS)][::-1])
    for ring in range(len(PROFILE) - 1):
        for segment in range(SEGMENTS):
            if (ring, segment) not in open_faces:
                cage.faces.append(wall_face(ring, segment))
    for ring, (_, _, sharpness, _) in enumerate(PROFILE):
        if sharpness > 0:
            cage.crease(sharpness, *[ring_vertex(ring, s) for s in range(SEGMENTS + 1)])
    for segment in range(0, SEGMENTS, 2):
        cage.crease(2.6, *[ring_vertex(ring, segment) for ring in FLUTED])


def add_handle(cage, segment):
    """A square tube from one wall face to another; its outer edges are semi-sharp."""
    low, high = HANDLE_RINGS
    angle = 2 * math.pi * (segment + 1) / SEGMENTS
    out = (math.cos(angle), math.sin(angle))
    side = (-out[1], out[0])
    sections = [wall_face(low, segment)]
    for distance, height, half, tilt in HANDLE_PATH:
        # Across the tube: `away` points from the cup's side of the tube to the outer side.
        away = (math.cos(tilt), math.sin(tilt))
        section = []
        for s, a in ((-1, 1), (1, 1), (1, -1), (-1, -1)):
            r, z = distance + a * half * away[0], height + a * half * away[1]
            w = 0.15 * s
            section.append(cage.point(r * out[0] + w * side[0], r * out[1] + w * side[1], z))
        sections.append(section)
    upper = wall_face(high, segment)
    sections.append([upper[3], upper[2], upper[1], upper[0]])
    for a, b in pairwise(sections):
        for i in range(4):
            j = (i + 1) % 4
            cage.faces.append([a[i], a[j], b[j], b[i]])
    for i in (0, 1):
        cage.crease(2.2, *[section[i] for section in sections[1:-1]])


def demo():
    """A fluted cup: 18-gon, sharp foot, semi-sharp rings and ridges, handles, an open lip."""
    cage = Cage()
    handles = [1, 7, 13]
    add_wall(cage, {(ring, segment) for ring in HANDLE_RINGS for segment in handles})
    for segment in handles:
        add_handle(cage, segment)
    cage.tag("interpolateboundary", [1])
    # Modelled with z up; OBJ files have y up.
    cage.points = [(x, z, -y) for x, y, z in cage.points]
    return cage
