"""How exact is a hit? Shoots rays at a torus and compares with the true limit surface.

usage: exact_hits.py
"""

import numpy as np

import limitray as lr


def torus(around: int = 12, across: int = 8) -> lr.Mesh:
    """A grid of quads, closed in both directions."""
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * i / around, 2 * np.pi * j / across
    radius = 1 + 0.4 * np.cos(b)
    points = np.stack([radius * np.cos(a), 0.4 * np.sin(b), radius * np.sin(a)], axis=-1)

    def index(di: int, dj: int) -> np.ndarray:
        return (i + di) % around * across + (j + dj) % across

    quads = np.stack([index(0, 0), index(0, 1), index(1, 1), index(1, 0)], axis=-1)
    return lr.Mesh(points.reshape(-1, 3), [4] * (around * across), quads.ravel())


mesh = torus()
scene = lr.Scene()
scene.add_mesh(mesh)
rays = lr.create_rays_pinhole(30, (0, 0, 0), (2, 3, 4), (0, 1, 0), 200, 150)

for dtype in (np.float32, np.float64):
    hit = scene.cast_rays(rays.astype(dtype), attributes=("points", "t_error"))
    found = np.isfinite(hit["t_hit"])
    limit = mesh.limit(hit["primitive_ids"][found], hit["primitive_uvs"][found])
    distance = np.linalg.norm(limit["points"] - hit["points"][found], axis=-1)
    print(
        f"{dtype.__name__}: {found.sum()} of {found.size} rays hit; "
        f"points are at most {distance.max():.1e} from the limit at their (u, v); "
        f"median bound on t {np.median(hit['t_error'][found]):.1e}"
    )
