"""Faces of a UsdGeomMesh that no surface has, left out: what remains, and of which faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Faces:
    """Faces of a mesh as `counts` and `indices`, and which ones of the file they are.

    `faces` (f,) and `corners` (c,) of bool tell for each face and each corner of the file whether
    it is kept.
    """

    counts: NDArray[np.int32]
    indices: NDArray[np.int32]
    faces: NDArray[np.bool_]
    corners: NDArray[np.bool_]

    @classmethod
    def repaired(
        cls, counts: NDArray[np.int32], indices: NDArray[np.int32], notes: list[str]
    ) -> Faces:
        """Corners that repeat the one before are left out, then faces that are still none.

        Such are those with fewer than three different vertices, or one in two places. Counts that
        don't add up stay, to be refused.
        """
        every = cls(counts, indices, np.ones(len(counts), bool), np.ones(len(indices), bool))
        if not len(counts) or counts.min() < 1 or int(counts.sum()) != len(indices):
            return every
        face = np.repeat(np.arange(len(counts)), counts)
        ends = np.cumsum(counts)
        before = np.arange(-1, len(indices) - 1)
        before[ends - counts] = ends - 1
        corners = indices != indices[before]
        order = np.lexsort((indices[corners], face[corners]))
        pairs = np.stack([face[corners], indices[corners]], axis=1)[order]
        twice = pairs[1:][(pairs[1:] == pairs[:-1]).all(axis=1), 0]
        faces = np.bincount(face[corners], minlength=len(counts)) >= 3
        faces[twice] = False
        corners &= faces[face]
        if corners.all():
            return every
        kept = np.bincount(face[corners], minlength=len(counts))
        repaired = int((faces & (kept < counts)).sum())
        if repaired:
            notes.append(f"{repaired} faces repeat a vertex beside itself, which is taken once")
        if not faces.all():
            notes.append(
                f"{int((~faces).sum())} faces left out: fewer than 3 vertices, or one of them twice"
            )
        return cls(kept[faces].astype(np.int32), indices[corners], faces, corners)

    def renumbered(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """Faces of the file as faces of the mesh, without those left out.

        Ids out of range stay so.
        """
        inside = (ids >= 0) & (ids < len(self.faces))
        new = np.cumsum(self.faces) - 1
        kept = ~inside | self.faces[np.where(inside, ids, 0)]
        beyond = ids - len(self.faces) + int(self.faces.sum())
        return np.where(inside, new[np.where(inside, ids, 0)], np.where(ids < 0, ids, beyond))[kept]
