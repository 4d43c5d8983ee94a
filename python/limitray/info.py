"""What a cage is made of: counts of faces, vertices, edges, creases and patches."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray.mesh import Mesh
from limitray.scene import Scene

INFINITE_SHARPNESS = 10.0
"""Sharpness from which a crease or corner counts as infinitely sharp."""


@dataclass(frozen=True)
class _Edges:
    """Undirected edges of a cage: vertices (n, 2), lower one first, and faces at each (n,)."""

    vertices: NDArray[np.int64]
    faces: NDArray[np.int64]

    @classmethod
    def of(cls, mesh: Mesh) -> _Edges:
        counts = mesh.face_vertex_counts.astype(np.int64)
        indices = mesh.face_vertex_indices.astype(np.int64)
        following = np.arange(1, len(indices) + 1)
        last = np.cumsum(counts) - 1
        following[last] = last + 1 - counts
        pairs = np.sort(np.stack([indices, indices[following]], axis=1), axis=1)
        vertices, faces = np.unique(pairs, axis=0, return_counts=True)
        return cls(vertices.reshape(-1, 2), faces)


def mesh_info(
    mesh: Mesh, isolation_level: int | None = None, tolerance: float | None = None
) -> dict[str, Any]:
    """Facts about a cage and its patches, as `limitray info --json` prints them.

    Parameters
    ----------
    mesh : Mesh
        The cage.
    isolation_level, tolerance : int, float, optional
        How deep irregular features are isolated; see `Scene.add_mesh`.

    Returns
    -------
    dict
        Numbers, strings, lists and dicts only. Vertices are counted where a face uses them.
        "extraordinary" counts vertices whose valence is not regular: 4 edges inside, 3 on a
        boundary. "limit_error" is the estimated bound on the distance from the true limit at
        "isolation_level", in units of the longest side of the box around the cage. "extent" is the
        lower and upper corner of the surface, None if it is empty.
    """
    edges = _Edges.of(mesh)
    valence = np.bincount(edges.vertices.ravel(), minlength=len(mesh.points))
    boundary = np.zeros(len(mesh.points), bool)
    boundary[edges.vertices[edges.faces == 1].ravel()] = True
    used = valence > 0
    extraordinary = used & np.where(boundary, valence > 3, valence != 4)
    return {
        "faces": len(mesh.face_vertex_counts),
        "faces_by_size": _histogram(mesh.face_vertex_counts),
        "holes": len(mesh.hole_indices),
        "vertices": int(used.sum()),
        "unused_points": int((~used).sum()),
        "vertices_by_valence": _histogram(valence[used]),
        "extraordinary_vertices": int(extraordinary.sum()),
        "edges": len(edges.vertices),
        "boundary_edges": int((edges.faces == 1).sum()),
        "boundary_vertices": int(boundary.sum()),
        "non_manifold_edges": int((edges.faces > 2).sum()),
        "creases_by_sharpness": _sharpness_histogram(mesh.crease_edges[1]),
        "corners_by_sharpness": _sharpness_histogram(mesh.corners[1]),
        "interpolate_boundary": mesh.interpolate_boundary,
        "orientation": mesh.orientation,
        "creasing_method": mesh.creasing_method,
        "triangle_subdivision_rule": mesh.triangle_subdivision_rule,
        "primvars": sorted(mesh.primvars),
        **_patch_info(mesh, isolation_level, tolerance),
        "warnings": list(mesh.warnings),
    }


def _patch_info(mesh: Mesh, isolation_level: int | None, tolerance: float | None) -> dict[str, Any]:
    scene = Scene()
    counted = scene.mesh_statistics(scene.add_mesh(mesh, isolation_level, tolerance=tolerance))
    by_level = {str(level): n for level, n in enumerate(counted["patches_by_level"]) if n}
    return {
        "isolation_level": counted["isolation_level"],
        "limit_error": counted["limit_error"],
        "patches": counted["patches"],
        "patches_by_type": {
            "bezier": counted["patches"] - counted["gregory_patches"],
            "gregory": counted["gregory_patches"],
        },
        "patches_by_level": by_level,
        "patch_bytes": counted["patch_bytes"],
        "bvh_bytes": counted["bvh_bytes"],
        "build_seconds": counted["build_seconds"],
        "extent": scene.bounds().tolist() if counted["patches"] else None,
    }


def _histogram(values: NDArray[Any]) -> dict[str, int]:
    """How often each integer occurs, in rising order; keys are strings, as in JSON."""
    found, counts = np.unique(values, return_counts=True)
    return {str(value): int(count) for value, count in zip(found, counts, strict=True)}


def _sharpness_histogram(sharpnesses: NDArray[np.float32]) -> dict[str, int]:
    """How often each sharpness above 0 occurs, in rising order; "infinite" from 10 on."""
    finite = sharpnesses[(sharpnesses > 0) & (sharpnesses < INFINITE_SHARPNESS)]
    counts = Counter(f"{sharpness:g}" for sharpness in np.sort(finite))
    infinite = int((sharpnesses >= INFINITE_SHARPNESS).sum())
    return {**counts, **({"infinite": infinite} if infinite else {})}
