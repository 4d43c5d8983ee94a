#!/usr/bin/env python3
"""Writes the cages of the tests: tagged OBJ files, one feature each, the same at each run.

    make_cages.py                    write all cages beside this script
    make_cages.py --large N [FILE]   write an organic closed cage of about N faces (not committed)

Tags count vertices and faces from zero, as in OpenSubdiv's OBJ files.
"""

import math
import sys
from pathlib import Path

from demo_cage import demo
from large_cage import large
from obj_writer import Cage, circle

INFINITE = 10


def cube(half=1.0):
    """Eight vertices of valence 3; vertex index = x + 2 y + 4 z."""
    cage = Cage()
    for z in (-half, half):
        for y in (-half, half):
            for x in (-half, half):
                cage.point(x, y, z)
    cage.faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [1, 3, 7, 5],
        [3, 2, 6, 7],
        [2, 0, 4, 6],
    ]
    return cage


def cube_creased(sharpness, edges=((4, 5), (5, 7), (7, 6), (6, 4))):
    """A cube with its top edges (or others) creased."""
    cage = cube()
    for a, b in edges:
        cage.crease(sharpness, a, b)
    return cage


def cube_corners():
    """A semi-sharp and an infinitely sharp corner."""
    cage = cube()
    cage.tag("corner", [7], [2.3])
    cage.tag("corner", [0], [INFINITE])
    return cage


def cube_chaikin():
    """Edges of different sharpness around a loop, averaged along it."""
    cage = cube()
    for sharpness, a, b in ((0.8, 4, 5), (2.0, 5, 7), (3.5, 7, 6), (1.2, 6, 4), (2.6, 0, 4)):
        cage.crease(sharpness, a, b)
    cage.tag("creasemethod", words=["chaikin"])
    return cage


def cube_seams():
    """Texture coordinates of an unfolded cube: seams, some corners with values of their own."""
    cage = cube()
    for face in range(6):
        column, row = face % 3, face // 3
        corners = ((0, 0), (1, 0), (1, 1), (0, 1))
        cage.texture_corners([((column + s) / 3, (row + t) / 2) for s, t in corners])
    return cage


def cube_hole():
    """The top face is a hole; its neighbours stay as they are."""
    cage = cube()
    cage.tag("hole", [1])
    return cage


def cube_isolated():
    """A cube and a vertex that belongs to no face."""
    cage = cube()
    cage.point(0, 0, 3)
    return cage


def tetrahedron():
    """All triangles, each meeting three extraordinary vertices."""
    cage = Cage()
    for p in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        cage.point(*p)
    cage.faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
    return cage


def icosahedron(smooth=False):
    """Twenty triangles, by Catmull-Clark's or by the smooth triangle weights."""
    cage = Cage()
    golden = (1 + math.sqrt(5)) / 2
    for s in (-1, 1):
        for t in (-golden, golden):
            cage.point(0, s, t)
            cage.point(s, t, 0)
            cage.point(t, 0, s)
    near = [
        [j for j in range(12) if abs(math.dist(cage.points[i], cage.points[j]) - 2) < 1e-6]
        for i in range(12)
    ]
    for a in range(12):
        for b in near[a]:
            for c in near[a]:
                if a < b and a < c and c in near[b] and cage.faces_outward(a, b, c):
                    cage.faces.append([a, b, c])
    if smooth:
        cage.tag("smoothtriangles", words=["smooth"])
    return cage


def torus(around=8, across=6):
    """All vertices regular."""
    cage = Cage()
    for i in range(around):
        for x, z in circle(across, 0.45):
            angle = 2 * math.pi * i / around
            cage.point((1.2 + x) * math.cos(angle), (1.2 + x) * math.sin(angle), -z)
    cage.tube(range(around), across, closed=True)
    return cage


def torus_creases():
    """An infinitely sharp ring and a semi-sharp meridian that cross at regular vertices."""
    cage = torus()
    ring = [6 * i for i in range(8)]
    for a, b in zip(ring, ring[1:] + ring[:1]):
        cage.crease(INFINITE, a, b)
    for a, b in zip(range(6), [1, 2, 3, 4, 5, 0]):
        cage.crease(1.7, a, b)
    return cage


def prism(sides, top=1.0):
    """Two caps that are one n-gon each."""
    cage = Cage()
    for z in (-1, 1):
        for x, y in circle(sides, top if z > 0 else 1.0):
            cage.point(x, y, z)
    cage.tube(range(2), sides)
    cage.faces.append(list(range(sides))[::-1])
    cage.faces.append([sides + i for i in range(sides)])
    return cage


def star_prism():
    """Concave caps of ten sides and concave corners between the sides."""
    cage = Cage()
    for z in (-0.6, 0.6):
        for i, (x, y) in enumerate(circle(10, 1.0)):
            r = 0.45 if i % 2 else 1.2
            cage.point(r * x, r * y, z)
    cage.tube(range(2), 10)
    cage.faces.append(list(range(10))[::-1])
    cage.faces.append([10 + i for i in range(10)])
    return cage


def pole(valence):
    """A lantern of quads, two vertices of the given valence at its ends."""
    cage = Cage()
    cage.point(0, 0, -1)
    for z, r in ((-0.5, 0.9), (0.5, 0.9)):
        for i, (x, y) in enumerate(circle(2 * valence, r)):
            lift = 0.25 * (1 if z > 0 else -1) * (1 if i % 2 == 0 else -1)
            cage.point(x, y, z + lift)
    cage.point(0, 0, 1)
    n = 2 * valence
    for i in range(0, n, 2):
        low, high = 1, 1 + n
        cage.faces.append([0, low + i, low + (i - 1) % n, low + (i - 2) % n])
        cage.faces.append([2 * n + 1, high + i, high + (i + 1) % n, high + (i + 2) % n])
    for i in range(n):
        j = (i + 1) % n
        cage.faces.append([1 + i, 1 + j, 1 + n + j, 1 + n + i])
    return cage


def pole_creased():
    """An infinitely sharp crease through a vertex of valence 5, and a semi-sharp one into it."""
    cage = pole(5)
    top, high = 21, 11
    cage.crease(INFINITE, top, high)
    cage.crease(INFINITE, top, high + 4)
    cage.crease(2.2, top, high + 6)
    return cage


def dart(sharpness):
    """A crease that ends in the smooth surface: at a regular and at an extraordinary vertex."""
    cage = grid_torus_cap()
    cage.crease(sharpness, 0, 1)
    cage.crease(sharpness, 1, 2)
    return cage


def grid_torus_cap():
    """A box of 3 x 3 faces a side: regular vertices between the eight of valence 3."""
    cage = Cage()
    index = {}

    def vertex(x, y, z):
        key = (x, y, z)
        if key not in index:
            index[key] = cage.point(*(c / 1.5 - 1 for c in key))
        return index[key]

    for x in range(4):
        vertex(x, 0, 0)
    for axis in range(3):
        for side in (0, 3):
            for i in range(3):
                for j in range(3):
                    face = []
                    for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                        p = [0, 0, 0]
                        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, a, b
                        face.append(vertex(*p))
                    cage.faces.append(face if side else face[::-1])
    return cage


def back_to_back():
    """Two quads on the same four vertices: every vertex has valence 2."""
    cage = Cage()
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        cage.point(x, y, 0.3 * x * y)
    cage.faces = [[0, 1, 2, 3], [3, 2, 1, 0]]
    return cage


def sheet(columns, rows, rule=None):
    """An open sheet of quads; rule 0, 1, 2: boundary none, edge and corner, edge only."""
    cage = Cage()
    for j in range(rows + 1):
        for i in range(columns + 1):
            x, y = 2 * i / columns - 1, 2 * j / rows - 1
            cage.point(x, y, 0.4 * math.sin(2 * x) * math.cos(1.5 * y))
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i
            cage.faces.append([a, a + 1, a + columns + 2, a + columns + 1])
    if rule is not None:
        cage.tag("interpolateboundary", [rule])
    return cage


def sheet_creased():
    """Creases of three kinds from the boundary inwards, ending in darts."""
    cage = sheet(4, 4, 1)
    cage.crease(INFINITE, 2, 7, 12)
    cage.crease(2.4, 10, 11)
    cage.crease(0.6, 14, 13)
    return cage


def open_fan():
    """Boundary vertices with 1, 2, 3 and 5 faces, one of them a triangle."""
    cage = Cage()
    cage.point(0, 0, 0.2)
    for i in range(11):
        angle = 1.6 * math.pi * i / 10
        r = 1.0 if i % 2 == 0 else 1.3
        cage.point(r * math.cos(angle), r * math.sin(angle), 0.15 * math.sin(3 * angle))
    for i in range(1, 11, 2):
        cage.faces.append([0, i, i + 1, i + 2])
    cage.faces.append([3, 2, cage.point(1.4, 1.0, 0.3)])
    cage.tag("interpolateboundary", [2])
    return cage


def non_manifold_edge():
    """Three fins of two faces at one edge."""
    cage = Cage()
    cage.point(0, 0, -1)
    cage.point(0, 0, 1)
    for x, y in circle(3, 1.0):
        inner = [cage.point(x, y, z) for z in (-1, 1)]
        outer = [cage.point(2 * x, 2 * y + 0.3, 1.2 * z) for z in (-1, 1)]
        cage.faces.append([0, inner[0], inner[1], 1])
        cage.faces.append([inner[0], outer[0], outer[1], inner[1]])
    return cage


def non_manifold_vertex():
    """Two closed cones that share their tip."""
    cage = Cage()
    cage.point(0, 0, 0)
    for side in (-1, 1):
        ring = [cage.point(x, y, side) for x, y in circle(4, 0.8)]
        ring = ring if side > 0 else ring[::-1]
        for a, b in zip(ring, ring[1:] + ring[:1]):
            cage.faces.append([0, a, b][::-1])
        cage.faces.append(ring)
    return cage


def non_manifold_winding():
    """Two sheets whose faces wind in opposite directions along the edge where they meet."""
    cage = sheet(2, 2, 1)
    cage.faces[1] = cage.faces[1][::-1]
    cage.faces[3] = cage.faces[3][::-1]
    return cage


CAGES = {
    "cube": cube,
    "cube_semi_0_3": lambda: cube_creased(0.3),
    "cube_semi_1": lambda: cube_creased(1),
    "cube_semi_2_5": lambda: cube_creased(2.5),
    "cube_semi_3_7": lambda: cube_creased(3.7),
    "cube_semi_9": lambda: cube_creased(9),
    "cube_inf_loop": lambda: cube_creased(INFINITE),
    "cube_inf_chain": lambda: cube_creased(INFINITE, ((4, 5), (5, 7))),
    "cube_corners": cube_corners,
    "cube_chaikin": cube_chaikin,
    "cube_seams": cube_seams,
    "cube_hole": cube_hole,
    "cube_isolated": cube_isolated,
    "tetrahedron": tetrahedron,
    "icosahedron": icosahedron,
    "icosahedron_smooth": lambda: icosahedron(smooth=True),
    "torus": torus,
    "torus_creases": torus_creases,
    "prism_5": lambda: prism(5, 0.7),
    "prism_6": lambda: prism(6),
    "prism_64": lambda: prism(64),
    "star_prism": star_prism,
    "pole_5": lambda: pole(5),
    "pole_8": lambda: pole(8),
    "pole_12": lambda: pole(12),
    "pole_20": lambda: pole(20),
    "pole_48": lambda: pole(48),
    "pole_creased": pole_creased,
    "box": grid_torus_cap,
    "dart_semi": lambda: dart(2.5),
    "dart_infinite": lambda: dart(INFINITE),
    "back_to_back": back_to_back,
    "sheet_none": lambda: sheet(4, 3, 0),
    "sheet_edge_and_corner": lambda: sheet(4, 3, 1),
    "sheet_edge_only": lambda: sheet(4, 3, 2),
    "strip": lambda: sheet(3, 1),
    "sheet_creased": sheet_creased,
    "open_fan": open_fan,
    "non_manifold_edge": non_manifold_edge,
    "non_manifold_vertex": non_manifold_vertex,
    "non_manifold_winding": non_manifold_winding,
    "demo": demo,
}


def write_all(folder):
    """Write every cage into `folder`; returns the paths."""
    paths = []
    for name, make in CAGES.items():
        cage = make()
        title = (make.__doc__ or "").splitlines()[0] if make.__doc__ else name.replace("_", " ")
        path = Path(folder) / f"{name}.obj"
        path.write_text(cage.to_obj(title), encoding="utf-8")
        paths.append(path)
    return paths


def main(arguments):
    """Command line; returns the exit code."""
    if not arguments:
        write_all(Path(__file__).parent)
        return 0
    if arguments[0] == "--large" and len(arguments) in (2, 3) and arguments[1].isdigit():
        text = large(int(arguments[1])).to_obj(f"large organic cage, --large {arguments[1]}")
        if len(arguments) == 3:
            Path(arguments[2]).write_text(text, encoding="utf-8")
        else:
            sys.stdout.write(text)
        return 0
    sys.stderr.write(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
