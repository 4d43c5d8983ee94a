"""A large organic closed cage: the skin of a smooth body made of voxels, pulled towards it."""

import math

from obj_writer import Cage

# Faces of a voxel: the four corners seen from outside counter-clockwise, and the step outward.
SIDES = [
    ((1, 0, 0), ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1))),
    ((-1, 0, 0), ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0))),
    ((0, 1, 0), ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0))),
    ((0, -1, 0), ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1))),
    ((0, 0, 1), ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))),
    ((0, 0, -1), ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0))),
]


def body(x, y, z):
    """Positive inside: a ball with bumps and dents, about 1 in size."""
    waves = math.sin(5 * x + 1) * math.sin(4 * y + 2) * math.sin(6 * z)
    fine = math.sin(11 * x) * math.sin(12 * y + 1) * math.sin(10 * z + 2)
    return 0.9 - math.sqrt(x * x + y * y + z * z) + 0.18 * waves + 0.05 * fine


def add(p, q):
    """Sum of two integer triples."""
    return (p[0] + q[0], p[1] + q[1], p[2] + q[2])


def is_manifold_block(filled):
    """Whether the skin is manifold at the point amid 2x2x2 voxels, `filled` of them solid.

    Solid and empty voxels must each hang together by faces.
    """
    for wanted in (True, False):
        cells = [c for c in range(8) if (c in filled) == wanted]
        reached = cells[:1]
        for c in reached:
            reached += [d for d in (c ^ 1, c ^ 2, c ^ 4) if d in cells and d not in reached]
        if len(reached) < len(cells):
            return False
    return True


def repair(solid, corners):
    """Fill voxels until the skin is manifold at every corner."""
    while corners:
        changed = set()
        for corner in sorted(corners):
            block = [add(corner, (-(c & 1), -(c >> 1 & 1), -(c >> 2))) for c in range(8)]
            if not is_manifold_block({c for c in range(8) if block[c] in solid}):
                solid.update(block)
                changed.update(block)
        corners = {add(voxel, (c & 1, c >> 1 & 1, c >> 2)) for voxel in changed for c in range(8)}


def skin(solid):
    """Faces between solid and empty voxels, as corners of the lattice."""
    return [
        [add(voxel, corner) for corner in corners]
        for voxel in sorted(solid)
        for step, corners in SIDES
        if add(voxel, step) not in solid
    ]


def voxels(cells):
    """Solid voxels of the body in a lattice of `cells` a unit."""
    reach = math.ceil(1.3 * cells)
    span = range(-reach, reach)
    return {
        (x, y, z)
        for x in span
        for y in span
        for z in span
        if body((x + 0.5) / cells, (y + 0.5) / cells, (z + 0.5) / cells) > 0
    }


def smoothed(points, faces, rounds):
    """Each point moved towards the middle of its faces, `rounds` times."""
    for _ in range(rounds):
        sums = [[0.0, 0.0, 0.0, 0] for _ in points]
        for face in faces:
            middle = [sum(points[v][i] for v in face) / 4 for i in range(3)]
            for v in face:
                for i in range(3):
                    sums[v][i] += middle[i]
                sums[v][3] += 1
        points = [tuple(s[i] / s[3] for i in range(3)) for s in sums]
    return points


def crease_sharpness(a, b):
    """Sharpness of the edge between two points: creases run where two waves change sign."""
    x, y, z = ((p + q) / 2 for p, q in zip(a, b))
    return round(0.4 + 2 * (1 + math.sin(7 * x + 3 * y - 5 * z)), 2)


def region(p):
    """Which side of the crease lines a point lies on."""
    x, y, z = p
    return (math.sin(9 * x + 4 * z) > 0, math.sin(8 * y - 5 * x) > 0)


def large(count):
    """A closed manifold cage of about `count` quads (within a tenth from 1000 on)."""
    cells = max(3, round(math.sqrt(count / 18)))
    solid = voxels(cells)
    lattice = skin(solid)
    repair(solid, {corner for face in lattice for corner in face})
    lattice = skin(solid)
    index = {p: i for i, p in enumerate(sorted({p for face in lattice for p in face}))}
    faces = [[index[p] for p in face] for face in lattice]
    cage = Cage()
    cage.faces = faces
    cage.points = smoothed([tuple(c / cells for c in p) for p in index], faces, 3)
    middles = [[sum(cage.points[v][i] for v in face) / 4 for i in range(3)] for face in faces]
    sides = {}
    for face, middle in zip(faces, middles):
        for a, b in zip(face, face[1:] + face[:1]):
            sides.setdefault((min(a, b), max(a, b)), []).append(region(middle))
    for (a, b), regions in sorted(sides.items()):
        if regions[0] != regions[1]:
            cage.crease(crease_sharpness(cage.points[a], cage.points[b]), a, b)
    return cage
