"""Control cages as Wavefront OBJ files with OpenSubdiv's `t` tags."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray.mesh import FaceVarying, Mesh

TEXTURE_PRIMVAR = "st"
_BOUNDARY = {"none": 0, "edgeAndCorner": 1, "edgeOnly": 2}
_FACE_VARYING = {
    name: number
    for number, name in enumerate(
        ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")
    )
}


def write_obj(mesh: Mesh, path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Writes a cage as an OBJ file that `Mesh.from_file` reads back equal.

    Faces of a left-handed cage are written the other way round, from the same first vertex, since
    OBJ has no orientation: the surface and its outer side are the same.

    Parameters
    ----------
    mesh : Mesh
        The cage.
    path : path
        A file that ends in .obj; an existing one is replaced.

    Returns
    -------
    tuple of str
        What OBJ cannot hold: primvars other than face-varying texture coordinates "st".

    Raises
    ------
    ValueError
        The file ends in something else.
    OSError
        The file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".obj":
        raise ValueError(f'{path}: must end in .obj, not "{path.suffix}"')
    path.write_text("".join(f"{line}\n" for line in _lines(mesh)))
    lost = [name for name in mesh.primvars if name != TEXTURE_PRIMVAR or not _texture(mesh)]
    return tuple(f"primvar {name} left out: OBJ cannot hold it" for name in lost)


def _texture(mesh: Mesh) -> FaceVarying | None:
    st = mesh.primvars.get(TEXTURE_PRIMVAR)
    return st if isinstance(st, FaceVarying) and np.shape(st.values)[1] == 2 else None


def _lines(mesh: Mesh) -> Iterator[str]:
    yield "# control cage of a Catmull-Clark surface, written by limitray"
    yield from (f"v {_reals(point)}" for point in mesh.points)
    st = _texture(mesh)
    if st is not None:
        yield from (f"vt {_reals(row)}" for row in np.asarray(st.values))
    yield from _faces(mesh, st)
    yield f"t interpolateboundary 1/0/0 {_BOUNDARY[mesh.interpolate_boundary]}"
    rule = _FACE_VARYING[mesh.face_varying_linear_interpolation]
    yield f"t facevaryinginterpolateboundary 1/0/0 {rule}"
    if mesh.creasing_method == "chaikin":
        yield "t creasemethod 0/0/1 chaikin"
    if mesh.triangle_subdivision_rule == "smooth":
        yield "t smoothtriangles 0/0/1 smooth"
    for (a, b), sharpness in zip(*mesh.crease_edges):
        yield f"t crease 2/1/0 {a} {b} {_reals([sharpness])}"
    for corner, sharpness in zip(*mesh.corners):
        yield f"t corner 1/1/0 {corner} {_reals([sharpness])}"
    if len(mesh.hole_indices):
        yield f"t hole {len(mesh.hole_indices)}/0/0 {' '.join(map(str, mesh.hole_indices))}"


def _faces(mesh: Mesh, st: FaceVarying | None) -> Iterator[str]:
    ends = np.cumsum(mesh.face_vertex_counts)
    turned = mesh.orientation == "leftHanded"
    for first, end in zip(ends - mesh.face_vertex_counts, ends):
        corners = np.arange(first, end)
        if turned:
            corners[1:] = corners[:0:-1].copy()
        vertices = mesh.face_vertex_indices[corners] + 1
        if st is None:
            yield f"f {' '.join(map(str, vertices))}"
        else:
            texture: NDArray[np.intp] = np.asarray(st.indices)[corners] + 1
            yield f"f {' '.join(f'{v}/{t}' for v, t in zip(vertices, texture))}"


def _reals(values: ArrayLike) -> str:
    """Numbers with as many digits as it takes to read them back."""
    return " ".join("10" if np.isposinf(x) else repr(x.item()) for x in np.asarray(values))
