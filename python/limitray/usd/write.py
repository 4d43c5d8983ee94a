"""Control cages as UsdGeomMesh prims."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from limitray.mesh import USD_SUFFIXES, Mesh, Primvar

WRITABLE = tuple(suffix for suffix in USD_SUFFIXES if suffix != ".usdz")
_TYPES = {1: "FloatArray", 2: "Float2Array", 3: "Float3Array", 4: "Float4Array"}


def write_usd(mesh: Mesh, path: str | os.PathLike[str], prim: str = "/mesh") -> None:
    """Writes a cage as the default prim of a new .usd, .usda or .usdc file.

    All tags and primvars are kept, so that `Mesh.from_file` reads an equal cage; points are float32
    in USD. Chaikin creases have no place in UsdGeomMesh.

    Parameters
    ----------
    mesh : Mesh
        The cage.
    path : path
        The file; an existing one is replaced.
    prim : str
        Path of the mesh in it.

    Raises
    ------
    ValueError
        The suffix is another, usd-core is not installed, `prim` is no path, or the cage has
        Chaikin creases.
    OSError
        The file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITABLE:
        raise ValueError(f'{path}: must end in {", ".join(WRITABLE)}, not "{path.suffix}"')
    if mesh.creasing_method == "chaikin":
        raise ValueError(f"{path}: USD cannot hold Chaikin creases; write an .obj file")
    try:
        from pxr import Sdf, Usd, UsdGeom
    except ImportError:
        raise ValueError(
            f"{path}: USD files need usd-core: install limitray[usd] (pip install usd-core)"
        ) from None
    if not Sdf.Path.IsValidPathString(prim) or not Sdf.Path(prim).IsPrimPath():
        raise ValueError(f'prim must be a path such as "/mesh", not {prim!r}')
    with path.open("wb"):
        pass
    path.unlink()
    stage = Usd.Stage.CreateNew(str(path))
    target = UsdGeom.Mesh.Define(stage, prim)
    stage.SetDefaultPrim(stage.GetPrimAtPath(Sdf.Path(prim).GetPrefixes()[0]))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    _write_cage(target, mesh)
    for name, primvar in mesh.primvars.items():
        _write_primvar(target, name, primvar)
    stage.GetRootLayer().Save()


def _write_cage(target: Any, mesh: Mesh) -> None:
    from pxr import Vt

    def integers(values: Any) -> Any:
        return Vt.IntArray.FromNumpy(np.ascontiguousarray(values, np.int32))

    def reals(values: Any) -> Any:
        return Vt.FloatArray.FromNumpy(np.ascontiguousarray(values, np.float32))

    edges, sharpnesses = mesh.crease_edges
    corners, corner_sharpnesses = mesh.corners
    points = np.ascontiguousarray(mesh.points, np.float32)
    target.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    if len(points):
        corners_of_box = np.stack([points.min(axis=0), points.max(axis=0)])
        target.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(corners_of_box))
    target.CreateFaceVertexCountsAttr(integers(mesh.face_vertex_counts))
    target.CreateFaceVertexIndicesAttr(integers(mesh.face_vertex_indices))
    target.CreateSubdivisionSchemeAttr("catmullClark")
    target.CreateInterpolateBoundaryAttr(mesh.interpolate_boundary)
    target.CreateFaceVaryingLinearInterpolationAttr(mesh.face_varying_linear_interpolation)
    target.CreateTriangleSubdivisionRuleAttr(mesh.triangle_subdivision_rule)
    target.CreateOrientationAttr(mesh.orientation)
    target.CreateCreaseIndicesAttr(integers(edges.ravel()))
    target.CreateCreaseLengthsAttr(integers(np.full(len(edges), 2)))
    target.CreateCreaseSharpnessesAttr(reals(sharpnesses))
    target.CreateCornerIndicesAttr(integers(corners))
    target.CreateCornerSharpnessesAttr(reals(corner_sharpnesses))
    target.CreateHoleIndicesAttr(integers(mesh.hole_indices))


def _write_primvar(target: Any, name: str, primvar: Any) -> None:
    from pxr import Sdf, UsdGeom, Vt

    values = np.asarray(primvar.values, np.float32)
    width = values.shape[1]
    interpolation = primvar.interpolation if isinstance(primvar, Primvar) else "faceVarying"
    kind = "TexCoord2fArray" if name == "st" and width == 2 else _TYPES.get(width, "FloatArray")
    api = UsdGeom.PrimvarsAPI(target)
    usd = api.CreatePrimvar(name, getattr(Sdf.ValueTypeNames, kind), interpolation)
    if kind == "FloatArray":
        usd.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(values.ravel())))
        if width > 1:
            usd.SetElementSize(width)
    else:
        vectors = getattr(Vt, f"Vec{width}fArray")
        usd.Set(vectors.FromNumpy(np.ascontiguousarray(values)))
    usd.SetIndices(Vt.IntArray.FromNumpy(np.ascontiguousarray(primvar.indices, np.int32)))
