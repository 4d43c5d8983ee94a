"""A polygon mesh with subdivision tags and its text as an OBJ file."""

import math


def circle(count, radius):
    """`count` points (x, y) around the origin, counter-clockwise from (radius, 0)."""
    return [
        (radius * math.cos(2 * math.pi * i / count), radius * math.sin(2 * math.pi * i / count))
        for i in range(count)
    ]


def number(value):
    """Text of a number: six decimals at most, no trailing zeros, no negative zero."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


class Cage:
    """Points, faces (counted from zero), texture corners and tags under construction."""

    def __init__(self):
        self.points, self.faces, self.tags = [], [], []
        self.texture, self.texture_faces = [], []

    def point(self, x, y, z):
        """Add a point; returns its index."""
        self.points.append((x, y, z))
        return len(self.points) - 1

    def tube(self, rings, size, closed=False):
        """Quads between consecutive rings of `size` points, ring r at points r size and on."""
        rings = list(rings)
        ends = rings[1:] + (rings[:1] if closed else [])
        for low, high in zip(rings, ends):
            for i in range(size):
                j = (i + 1) % size
                self.faces.append(
                    [low * size + i, low * size + j, high * size + j, high * size + i]
                )

    def faces_outward(self, a, b, c):
        """Whether the triangle a b c turns away from the origin."""
        p, q, r = (self.points[i] for i in (a, b, c))
        u = [q[i] - p[i] for i in range(3)]
        v = [r[i] - p[i] for i in range(3)]
        normal = [
            u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3] for i in range(3)
        ]
        return sum(n * x for n, x in zip(normal, p)) > 0

    def texture_corners(self, corners):
        """Texture coordinates of the next face, one (s, t) a corner."""
        self.texture_faces.append([len(self.texture) + i for i in range(len(corners))])
        self.texture += corners

    def crease(self, sharpness, *chain):
        """Crease the edges along a chain of vertices."""
        self.tag("crease", chain, [sharpness])

    def tag(self, name, ints=(), floats=(), words=()):
        """Add a tag line."""
        values = [str(i) for i in ints] + [number(f) for f in floats] + list(words)
        sizes = f"{len(ints)}/{len(floats)}/{len(words)}"
        self.tags.append(" ".join(["t", name, sizes, *values]))

    def to_obj(self, title):
        """The file's text."""
        lines = [f"# {title}"]
        lines += ["v " + " ".join(number(c) for c in p) for p in self.points]
        lines += ["vt " + " ".join(number(c) for c in p) for p in self.texture]
        for i, face in enumerate(self.faces):
            corners = [str(v + 1) for v in face]
            if self.texture_faces:
                corners = [f"{c}/{t + 1}" for c, t in zip(corners, self.texture_faces[i])]
            lines.append("f " + " ".join(corners))
        return "\n".join(lines + self.tags) + "\n"
