"""Control cages: polygon meshes with subdivision tags, under UsdGeomMesh's names."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray import _core
from limitray._arrays import index_array, real_array, to_array, to_int32

if TYPE_CHECKING:
    from limitray.triangles import Triangles

InterpolateBoundary = Literal["none", "edgeOnly", "edgeAndCorner"]
FaceVaryingLinearInterpolation = Literal[
    "none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all"
]
TriangleSubdivisionRule = Literal["catmullClark", "smooth"]
CreasingMethod = Literal["uniform", "chaikin"]
Orientation = Literal["rightHanded", "leftHanded"]
USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
Interpolation = Literal["constant", "uniform", "varying", "vertex", "faceVarying"]


@dataclass(frozen=True)
class FaceVarying:
    """A primvar with a value at each corner of each face.

    Parameters
    ----------
    values : array (n, width) or (n,)
        The values, stored as float32.
    indices : array of int, optional
        One index into `values` for each face corner, in the order of `face_vertex_indices`.
        Without it `values` holds one row for each face corner.
    """

    values: ArrayLike
    indices: ArrayLike | None = None


@dataclass(frozen=True)
class Primvar:
    """Values over the surface that spread in any of USD's ways.

    Parameters
    ----------
    values : array (n, width) or (n,)
        The values, stored as float32.
    interpolation : {"constant", "uniform", "varying", "vertex", "faceVarying"}
        One value for all, one a face, one a control point (spread linearly or like the points), or
        one a face corner.
    indices : array of int, optional
        Rows of `values`, one for each place. Without it `values` holds one row for each place.
    """

    values: ArrayLike
    interpolation: Interpolation
    indices: ArrayLike | None = None


class Mesh:
    """A control cage, validated and immutable.

    Parameters
    ----------
    points : array (n, 3) of float
        Control points.
    face_vertex_counts : array (f,) of int
        Vertices of each face, at least 3.
    face_vertex_indices : array (sum of counts,) of int
        Vertices of all faces, one face after the other.
    interpolate_boundary : {"edgeAndCorner", "edgeOnly", "none"}
        How the surface ends at the boundary of the cage.
    face_varying_linear_interpolation : str
        "none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries" or "all".
    triangle_subdivision_rule : {"catmullClark", "smooth"}
        Weights of triangles.
    crease_indices, crease_lengths : arrays of int
        Vertices of all crease chains, and the number of vertices of each chain (at least 2).
    crease_sharpnesses : array of float
        One value a chain, or one an edge; at least 0, and infinitely sharp from 10.
    corner_indices, corner_sharpnesses : arrays
        Sharp vertices.
    hole_indices : array of int
        Faces that are absent from the surface.
    orientation : {"rightHanded", "leftHanded"}
        Which winding faces outward: counter-clockwise, or clockwise.
    creasing_method : {"uniform", "chaikin"}
        How semi-sharp creases decay.
    primvars : mapping of str to FaceVarying or Primvar
        Values over the surface such as texture coordinates.

    Raises
    ------
    ValueError
        An argument has a wrong type, shape or value; the message names it.

    Examples
    --------
    >>> import limitray as lr
    >>> square = lr.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3])
    >>> square.limit(0, (0.5, 0.5))["points"].tolist()
    [0.5, 0.5, 0.0]
    """

    def __init__(
        self,
        points: ArrayLike,
        face_vertex_counts: ArrayLike,
        face_vertex_indices: ArrayLike,
        interpolate_boundary: InterpolateBoundary = "edgeAndCorner",
        face_varying_linear_interpolation: FaceVaryingLinearInterpolation = "cornersPlus1",
        triangle_subdivision_rule: TriangleSubdivisionRule = "catmullClark",
        *,
        crease_indices: ArrayLike = (),
        crease_lengths: ArrayLike = (),
        crease_sharpnesses: ArrayLike = (),
        corner_indices: ArrayLike = (),
        corner_sharpnesses: ArrayLike = (),
        hole_indices: ArrayLike = (),
        orientation: Orientation = "rightHanded",
        creasing_method: CreasingMethod = "uniform",
        primvars: Mapping[str, FaceVarying | Primvar] | None = None,
    ) -> None:
        cage = _core.ControlCage()
        cage.points = real_array("points", points, (None, 3))
        cage.face_vertex_counts = index_array("face_vertex_counts", face_vertex_counts)
        cage.face_vertex_indices = index_array("face_vertex_indices", face_vertex_indices)
        rules = {
            "interpolate_boundary": interpolate_boundary,
            "face_varying_linear_interpolation": face_varying_linear_interpolation,
            "triangle_subdivision_rule": triangle_subdivision_rule,
            "orientation": orientation,
            "creasing_method": creasing_method,
        }
        for name, rule in rules.items():
            if not isinstance(rule, str):
                raise ValueError(f"{name} must be a str, not {rule!r}")
            setattr(cage, name, rule)
        cage.crease_indices = index_array("crease_indices", crease_indices)
        cage.crease_lengths = index_array("crease_lengths", crease_lengths)
        cage.crease_sharpnesses = _sharpnesses("crease_sharpnesses", crease_sharpnesses)
        cage.corner_indices = index_array("corner_indices", corner_indices)
        cage.corner_sharpnesses = _sharpnesses("corner_sharpnesses", corner_sharpnesses)
        cage.hole_indices = index_array("hole_indices", hole_indices)
        if primvars is not None and not isinstance(primvars, Mapping):
            raise ValueError(f"primvars must map names to primvars, not {primvars!r}")
        for name, primvar in (primvars or {}).items():
            if not isinstance(name, str):
                raise ValueError(f"primvars must have names, not {name!r}")
            _add_primvar(cage, name, primvar)
        self._adopt(cage)

    def _adopt(self, cage: _core.ControlCage) -> None:
        self._cage = cage
        self._warnings = tuple(_core.validate(cage))
        self._limit: _core.LimitEvaluator | None = None

    @classmethod
    def from_file(cls, path: str | os.PathLike[str], prim: str | None = None) -> Mesh:
        """Reads a cage from a Wavefront OBJ file with OpenSubdiv's `t` tags, or from a USD file.

        Parameters
        ----------
        path : path
            The file: .obj, or .usd, .usda, .usdc, .usdz (needs the extra limitray[usd]).
        prim : str, optional
            Path of the mesh in a USD file; may be left out if it has only one. Its transform is
            not applied: see `load_scene`.

        Raises
        ------
        OSError
            The file cannot be opened.
        ValueError
            The file cannot be read ("file:line: what is wrong"), or its format is not supported.
        """
        path = Path(path)
        suffix = path.suffix.lower()
        if suffix in USD_SUFFIXES:
            from limitray.usd import mesh_from_usd

            return mesh_from_usd(path, prim)
        if suffix != ".obj":
            raise ValueError(
                f'{path}: unknown mesh format "{suffix}"; .obj and {", ".join(USD_SUFFIXES)} work'
            )
        if prim is not None:
            raise ValueError(f"prim must be None for an OBJ file, not {prim!r}")
        with path.open("rb"):
            pass
        mesh = cls.__new__(cls)
        mesh._adopt(_core.read_obj(str(path)))
        return mesh

    @property
    def points(self) -> NDArray[np.float64]:
        """Control points (n, 3), read-only."""
        return self._cage.points

    @property
    def face_vertex_counts(self) -> NDArray[np.int32]:
        """Vertices of each face (f,), read-only."""
        return self._cage.face_vertex_counts

    @property
    def face_vertex_indices(self) -> NDArray[np.int32]:
        """Vertices of all faces, one face after the other, read-only."""
        return self._cage.face_vertex_indices

    @property
    def hole_indices(self) -> NDArray[np.int32]:
        """Faces that are absent from the surface, read-only."""
        return self._cage.hole_indices

    @property
    def corners(self) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Sharp vertices (n,) and their sharpnesses (n,), read-only."""
        return self._cage.corner_indices, self._cage.corner_sharpnesses

    @property
    def crease_edges(self) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Vertex pairs (n, 2) of all crease edges and their sharpnesses (n,)."""
        return _core.crease_edges(self._cage)

    @property
    def interpolate_boundary(self) -> str:
        """How the surface ends at the boundary of the cage."""
        return self._cage.interpolate_boundary

    @property
    def orientation(self) -> str:
        """Winding that faces outward."""
        return self._cage.orientation

    @property
    def creasing_method(self) -> str:
        """How semi-sharp creases decay."""
        return self._cage.creasing_method

    @property
    def face_varying_linear_interpolation(self) -> str:
        """Where face-varying primvars are linear."""
        return self._cage.face_varying_linear_interpolation

    @property
    def triangle_subdivision_rule(self) -> str:
        """Weights of triangles."""
        return self._cage.triangle_subdivision_rule

    @property
    def primvars(self) -> dict[str, FaceVarying | Primvar]:
        """Primvars by name; FaceVarying where they have a value at each face corner."""
        return {
            name: FaceVarying(values, indices)
            if interpolation == "faceVarying"
            else Primvar(values, cast(Interpolation, interpolation), indices)
            for name, (interpolation, values, indices) in self._cage.primvars().items()
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """What validation found that is allowed but worth knowing."""
        return self._warnings

    def limit(
        self, face: ArrayLike, uv: ArrayLike, sub_quad: ArrayLike = 0
    ) -> dict[str, NDArray[np.float64]]:
        """The true limit surface, in double, by an evaluation independent of the tracer.

        Parameters
        ----------
        face : int or array (...) of int
            Base faces.
        uv : array (..., 2) of float
            Parameters in [0, 1]^2 of the face, or of the sub-quad of a face that is no quad.
        sub_quad : int or array (...) of int
            Corner of a face that is no quad; 0 for quads.

        Returns
        -------
        dict
            "points", "normals" (unit, on the side given by the winding), "dp_du" and "dp_dv":
            arrays (..., 3) of float64. The arguments are broadcast against each other.

        Raises
        ------
        ValueError
            A face, sub-quad or parameter is out of range, or the face is a hole.
        """
        parameters = to_array("uv", uv)
        if parameters.ndim == 0 or parameters.shape[-1] != 2:
            raise ValueError(f"uv must have shape (..., 2), not {parameters.shape}")
        faces = to_int32("face", to_array("face", face))
        sub_quads = to_int32("sub_quad", to_array("sub_quad", sub_quad))
        try:
            shape = np.broadcast_shapes(faces.shape, sub_quads.shape, parameters.shape[:-1])
        except ValueError:
            raise ValueError(
                f"face {faces.shape}, sub_quad {sub_quads.shape} and uv {parameters.shape} "
                "do not broadcast"
            ) from None
        if self._limit is None:
            self._limit = _core.LimitEvaluator(self._cage)
        arrays = self._limit.evaluate(
            np.broadcast_to(faces, shape).flatten(),
            np.broadcast_to(sub_quads, shape).flatten(),
            real_array("uv", np.broadcast_to(parameters, (*shape, 2)).reshape(-1, 2), (None, 2)),
        )
        names = ("points", "normals", "dp_du", "dp_dv")
        return {name: array.reshape(*shape, 3) for name, array in zip(names, arrays, strict=True)}

    def to_triangles(self, rate: int) -> Triangles:
        """Triangles of the limit surface, `rate` along each edge of the cage.

        See `limitray.triangles.to_triangles`: points are exact, and there are no cracks.
        """
        from limitray.triangles import to_triangles

        return to_triangles(self, rate)

    def __repr__(self) -> str:
        return f"Mesh({len(self.points)} points, {len(self.face_vertex_counts)} faces)"


def _sharpnesses(name: str, values: ArrayLike) -> Any:
    return real_array(name, values, (None,), np.float32)


def _add_primvar(cage: _core.ControlCage, name: str, primvar: FaceVarying | Primvar) -> None:
    argument = f'primvars["{name}"]'
    if not isinstance(primvar, FaceVarying | Primvar):
        raise ValueError(
            f"{argument} must be a FaceVarying or Primvar, not {type(primvar).__name__}"
        )
    values = to_array(f"{argument}.values", primvar.values)
    if values.ndim == 1:
        values = values[:, np.newaxis]
    indices = np.arange(len(values)) if primvar.indices is None else primvar.indices
    cage.add_primvar(
        name,
        primvar.interpolation if isinstance(primvar, Primvar) else "faceVarying",
        real_array(f"{argument}.values", values, (None, None), np.float32),
        index_array(f"{argument}.indices", indices),
    )
