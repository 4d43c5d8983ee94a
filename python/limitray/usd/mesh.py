"""UsdGeomMesh prims as control cages.

subdivisionScheme `catmullClark` is the surface as it is. `bilinear` is the Catmull-Clark surface of
the same cage with every edge and vertex infinitely sharp: vertices stay, edges are cut in the
middle, faces at the mean of their vertices, and quads end as bilinear patches. `none`, a mesh of
plain polygons, is shown as that surface, too: exactly so for triangles and for flat convex faces;
USD does not say what lies inside others. `loop` is refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limitray.mesh import FaceVarying, Mesh, Primvar
from limitray.usd.faces import Faces

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

INFINITELY_SHARP = 10.0
_PLACES = {"constant", "uniform", "varying", "vertex", "faceVarying"}


def read_mesh(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[Mesh, Faces, list[str]]:
    """The cage of a UsdGeomMesh prim at `time`, its faces, and what was left out or repaired.

    Raises
    ------
    ValueError
        "/path: what is wrong": the scheme is `loop`, or the topology is not valid.
    """
    from pxr import UsdGeom

    mesh = UsdGeom.Mesh(prim)
    scheme = str(mesh.GetSubdivisionSchemeAttr().Get())
    if scheme not in ("catmullClark", "bilinear", "none"):
        raise ValueError(
            f"{prim.GetPath()}: subdivisionScheme {scheme} is not supported: limitray traces "
            "Catmull-Clark surfaces (and bilinear and none)"
        )
    counts = _array(mesh.GetFaceVertexCountsAttr().Get(time), np.int32)
    indices = _array(mesh.GetFaceVertexIndicesAttr().Get(time), np.int32)
    points = _array(mesh.GetPointsAttr().Get(time), np.float64).reshape(-1, 3)
    if not len(counts) or not len(points):
        when = "" if time.IsEarliestTime() else f" at time {time.GetValue():g}"
        raise ValueError(f"{prim.GetPath()}: has no faces or no points{when}")
    notes: list[str] = []
    faces = Faces.repaired(counts, indices, notes)
    counts, indices = faces.counts, faces.indices
    if not len(counts):
        raise ValueError(f"{prim.GetPath()}: {notes[0]}")
    holes = faces.renumbered(_unique_holes(mesh, time).astype(np.int64))
    arguments: dict[str, Any] = {
        "orientation": str(mesh.GetOrientationAttr().Get(time)),
        "hole_indices": holes.astype(np.int32),
        "primvars": {},
    }
    if scheme == "catmullClark":
        arguments |= _subdivision_rules(mesh, time) | _creases_and_corners(mesh, time)
        _drop_loose_creases(arguments, counts, indices, notes)
        _drop_repeated_corners(arguments, notes)
    else:
        arguments |= _all_sharp(counts, indices, len(points))
        if scheme == "none":
            notes += _concave_faces(points, counts, indices)
    for name, primvar in _primvars(prim, time, faces, len(points), notes):
        arguments["primvars"][name] = primvar
    if "SkelBindingAPI" in prim.GetAppliedSchemas():
        notes.append("shown as it is bound: skinning is not applied")
    try:
        cage = Mesh(points, counts, indices, **arguments)
        return cage, faces, [f"{prim.GetPath()}: {note}" for note in notes]
    except ValueError as error:
        raise ValueError(f"{prim.GetPath()}: {error}") from None


def _array(values: Any, dtype: Any) -> NDArray[Any]:
    return np.zeros(0, dtype) if values is None else np.array(values, dtype)


def _unique_holes(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> NDArray[np.int32]:
    """Holes once each, as they come; an index beyond the faces stays, to be refused."""
    holes = _array(mesh.GetHoleIndicesAttr().Get(time), np.int32)
    return holes[np.sort(np.unique(holes, return_index=True)[1])]


def _subdivision_rules(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> dict[str, Any]:
    attributes = {
        "interpolate_boundary": mesh.GetInterpolateBoundaryAttr(),
        "face_varying_linear_interpolation": mesh.GetFaceVaryingLinearInterpolationAttr(),
        "triangle_subdivision_rule": mesh.GetTriangleSubdivisionRuleAttr(),
    }
    return {name: str(attribute.Get(time)) for name, attribute in attributes.items()}


def _creases_and_corners(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> dict[str, Any]:
    return {
        "crease_indices": _array(mesh.GetCreaseIndicesAttr().Get(time), np.int32),
        "crease_lengths": _array(mesh.GetCreaseLengthsAttr().Get(time), np.int32),
        "crease_sharpnesses": _array(mesh.GetCreaseSharpnessesAttr().Get(time), np.float32),
        "corner_indices": _array(mesh.GetCornerIndicesAttr().Get(time), np.int32),
        "corner_sharpnesses": _array(mesh.GetCornerSharpnessesAttr().Get(time), np.float32),
    }


def _edges(counts: NDArray[Any], indices: NDArray[Any]) -> NDArray[np.int64]:
    """Vertex pairs (n, 2) of the faces' edges, lower vertex first; shared ones repeat."""
    following = np.arange(1, len(indices) + 1)
    last = np.cumsum(counts) - 1
    following[last] = last + 1 - counts
    return np.sort(np.stack([indices, indices[following]], axis=1).astype(np.int64), axis=1)


def _drop_loose_creases(
    arguments: dict[str, Any], counts: NDArray[Any], indices: NDArray[Any], notes: list[str]
) -> None:
    """Leaves out crease edges that no face has or that come again, and says so."""
    lengths, chain = arguments["crease_lengths"], arguments["crease_indices"]
    sharpnesses = arguments["crease_sharpnesses"]
    edges = int(np.sum(lengths - 1)) if len(lengths) else 0
    if (
        not edges
        or lengths.min() < 2
        or int(lengths.sum()) != len(chain)
        or len(sharpnesses) not in (len(lengths), edges)
        or int(counts.sum()) != len(indices)
    ):
        return
    start = np.delete(np.arange(len(chain)), np.cumsum(lengths) - 1)
    pairs = np.sort(np.stack([chain[start], chain[start + 1]], axis=1).astype(np.int64), axis=1)
    size = max(int(indices.max()), int(chain.max())) + 1
    keys = pairs @ [size, 1]
    known = np.isin(keys, _edges(counts, indices) @ [size, 1])
    last = _last_of_each(keys)
    if known.all() and last.all():
        return
    each = sharpnesses if len(sharpnesses) == edges else np.repeat(sharpnesses, lengths - 1)
    arguments["crease_indices"] = pairs[known & last].ravel().astype(np.int32)
    arguments["crease_lengths"] = np.full(int((known & last).sum()), 2, np.int32)
    arguments["crease_sharpnesses"] = each[known & last]
    if not known.all():
        notes.append(f"{int((~known).sum())} crease edges ignored: no face has them")
    if not last.all():
        notes.append(f"{int((~last).sum())} crease edges ignored: they come again later")


def _drop_repeated_corners(arguments: dict[str, Any], notes: list[str]) -> None:
    """Leaves out corners that come again later, as OpenSubdiv does, and says so."""
    vertices, sharpnesses = arguments["corner_indices"], arguments["corner_sharpnesses"]
    last = _last_of_each(vertices)
    if len(vertices) == len(sharpnesses) and not last.all():
        arguments["corner_indices"] = vertices[last]
        arguments["corner_sharpnesses"] = sharpnesses[last]
        notes.append(f"{int((~last).sum())} corners ignored: they come again later")


def _last_of_each(keys: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether no later entry equals this one."""
    last = np.zeros(len(keys), bool)
    last[len(keys) - 1 - np.unique(keys[::-1], return_index=True)[1]] = True
    return last


def _all_sharp(
    counts: NDArray[np.int32], indices: NDArray[np.int32], points: int
) -> dict[str, Any]:
    """The rules and tags that make a Catmull-Clark surface bilinear."""
    fits = int(counts.sum()) == len(indices) and counts.min() > 0
    edges = np.unique(_edges(counts, indices), axis=0) if fits else np.zeros((0, 2))
    edges = edges[edges[:, 0] != edges[:, 1]]
    return {
        "interpolate_boundary": "edgeAndCorner",
        "face_varying_linear_interpolation": "all",
        "crease_indices": edges.ravel().astype(np.int32),
        "crease_lengths": np.full(len(edges), 2, np.int32),
        "crease_sharpnesses": np.full(len(edges), INFINITELY_SHARP, np.float32),
        "corner_indices": np.arange(points, dtype=np.int32),
        "corner_sharpnesses": np.full(points, INFINITELY_SHARP, np.float32),
    }


def _concave_faces(points: NDArray[Any], counts: NDArray[Any], indices: NDArray[Any]) -> list[str]:
    """A note if faces of more than three vertices have a corner that turns the wrong way."""
    if int(counts.sum()) != len(indices) or indices.min() < 0 or indices.max() >= len(points):
        return []
    concave, first = 0, np.cumsum(counts) - counts
    for n in np.unique(counts[counts > 3]):
        faces = points[indices[first[counts == n][:, np.newaxis] + np.arange(n)]]
        edges = np.roll(faces, -1, axis=1) - faces
        turns = np.cross(edges, np.roll(edges, -1, axis=1))
        normals = np.cross(faces, np.roll(faces, -1, axis=1)).sum(axis=1, keepdims=True)
        heights = (turns * normals).sum(axis=2)
        scale = np.abs(heights).max(axis=1, keepdims=True)
        concave += int((heights < -1e-6 * scale).any(axis=1).sum())
    if not concave:
        return []
    return [f"{concave} concave polygons of subdivisionScheme none are shown as bilinear surfaces"]


def _primvars(
    prim: Usd.Prim, time: Usd.TimeCode, faces: Faces, points: int, notes: list[str]
) -> Iterator[tuple[str, FaceVarying | Primvar]]:
    """The primvars of real numbers, with those a parent hands down."""
    from pxr import UsdGeom

    sizes = {
        "constant": 1,
        "uniform": len(faces.faces),
        "varying": points,
        "vertex": points,
        "faceVarying": len(faces.corners),
    }
    kept = {"uniform": faces.faces, "faceVarying": faces.corners}
    for usd in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name, interpolation = str(usd.GetPrimvarName()), str(usd.GetInterpolation())
        values = _real_rows(usd.Get(time), usd.GetElementSize())
        if values is None or interpolation not in _PLACES or not len(values):
            continue
        rows = usd.GetIndices(time) if usd.IsIndexed() else None
        indices = np.arange(len(values)) if rows is None else np.array(rows, np.int64)
        if len(indices) != sizes[interpolation]:
            notes.append(
                f"primvar {name} ignored: {len(indices)} {interpolation} values, "
                f"{sizes[interpolation]} expected"
            )
            continue
        indices = indices[kept[interpolation]] if interpolation in kept else indices
        if indices.min() < 0 or indices.max() >= len(values):
            notes.append(f"primvar {name} ignored: an index is out of range")
        elif not np.isfinite(values).all():
            notes.append(f"primvar {name} ignored: not finite")
        elif interpolation == "faceVarying":
            yield name, FaceVarying(values, indices)
        else:
            yield name, Primvar(values, interpolation, indices)  # type: ignore[arg-type]


def _real_rows(values: Any, element_size: int) -> NDArray[np.float32] | None:
    """Values as rows (n, width); None unless they are real numbers or vectors of them."""
    if values is None or isinstance(values, str):
        return None
    array = np.array(values)
    if array.dtype.kind != "f":
        return None
    rows = array.reshape(len(array) if _is_array(values) else 1, -1)
    if element_size > 1 and len(rows) % element_size == 0:
        rows = rows.reshape(len(rows) // element_size, -1)
    return rows.astype(np.float32)


def _is_array(values: Any) -> bool:
    return type(values).__name__.endswith("Array")
