"""Private C++ core of limitray; use the package limitray."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any, overload

import numpy
from numpy.typing import NDArray


class ControlCage:
    """
    Polygon mesh with subdivision tags (UsdGeomMesh's names). Arrays are copied in and viewed, read-only, on the way out.
    """

    def __init__(self) -> None: ...

    @property
    def points(self) -> Annotated[NDArray[numpy.float64], dict(writable=False)]: ...

    @points.setter
    def points(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def face_vertex_counts(self) -> Annotated[NDArray[numpy.int32], dict(writable=False)]: ...

    @face_vertex_counts.setter
    def face_vertex_counts(self, values: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def face_vertex_indices(self) -> Annotated[NDArray[numpy.int32], dict(writable=False)]: ...

    @face_vertex_indices.setter
    def face_vertex_indices(self, values: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def crease_indices(self) -> Annotated[NDArray[numpy.int32], dict(writable=False)]: ...

    @crease_indices.setter
    def crease_indices(self, values: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def crease_lengths(self) -> Annotated[NDArray[numpy.int32], dict(writable=False)]: ...

    @crease_lengths.setter
    def crease_lengths(self, values: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def crease_sharpnesses(self) -> Annotated[NDArray[numpy.float32], dict(writable=False)]: ...

    @crease_sharpnesses.setter
    def crease_sharpnesses(self, values: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def corner_indices(self) -> Annotated[NDArray[numpy.int32], dict(writable=False)]: ...

    @corner_indices.setter
    def corner_indices(self, values: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def corner_sharpnesses(self) -> Annotated[NDArray[numpy.float32], dict(writable=False)]: ...

    @corner_sharpnesses.setter
    def corner_sharpnesses(self, values: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def hole_indices(self) -> Annotated[NDArray[numpy.int32], dict(writable=False)]: ...

    @hole_indices.setter
    def hole_indices(self, values: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def interpolate_boundary(self) -> str: ...

    @interpolate_boundary.setter
    def interpolate_boundary(self, arg: str, /) -> None: ...

    @property
    def face_varying_linear_interpolation(self) -> str: ...

    @face_varying_linear_interpolation.setter
    def face_varying_linear_interpolation(self, arg: str, /) -> None: ...

    @property
    def triangle_subdivision_rule(self) -> str: ...

    @triangle_subdivision_rule.setter
    def triangle_subdivision_rule(self, arg: str, /) -> None: ...

    @property
    def creasing_method(self) -> str: ...

    @creasing_method.setter
    def creasing_method(self, arg: str, /) -> None: ...

    @property
    def orientation(self) -> str: ...

    @orientation.setter
    def orientation(self, arg: str, /) -> None: ...

    def add_primvar(self, name: str, interpolation: str, values: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], indices: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None:
        """Adds a primvar: values (n, width), indices into its rows."""

    def primvars(self) -> dict[str, tuple[str, Annotated[NDArray[numpy.float32], dict(writable=False)], Annotated[NDArray[numpy.int32], dict(writable=False)]]]:
        """
        Primvars: name to (interpolation, values (n, width) float32, indices int32).
        """

def validate(cage: ControlCage) -> list[str]:
    """Checks all arrays; raises ValueError. Returns warnings."""

def crease_edges(cage: ControlCage) -> tuple[NDArray[numpy.int32], NDArray[numpy.float32]]:
    """All crease edges: vertices (n, 2) int32 and sharpnesses (n,) float32."""

def read_obj(path: str) -> ControlCage:
    """
    Reads a Wavefront OBJ file with OpenSubdiv's tags; raises ValueError 'file:line: what is wrong'.
    """

class LimitEvaluator:
    """The true limit surface in double; shares no code with the tracer."""

    def __init__(self, cage: ControlCage) -> None: ...

    def evaluate(self, faces: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], sub_quads: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], uv: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        Points, normals, dp_du and dp_dv, each (n, 3) float64, at faces (n,) int32, sub_quads (n,) int32 and uv (n, 2) float64.
        """

class MeshStatistics:
    """Size of one mesh of a scene."""

    @property
    def patches(self) -> int: ...

    @property
    def gregory_patches(self) -> int: ...

    @property
    def patches_by_level(self) -> list[int]: ...

    @property
    def patch_bytes(self) -> int: ...

    @property
    def bvh_bytes(self) -> int: ...

    @property
    def build_seconds(self) -> float: ...

    @property
    def isolation_level(self) -> int: ...

    @property
    def limit_error(self) -> float: ...

class Scene:
    """Meshes, instances and the queries on them."""

    def __init__(self, threads: int = 0) -> None: ...

    def add_mesh(self, cage: ControlCage, isolation_level: int, transform: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)], tolerance: float = 1e-05, memory_limit: int = 0) -> int: ...

    def add_instance(self, geometry_id: int, transform: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)]) -> int: ...

    def truncate(self, count: int) -> None: ...

    def update_points(self, geometry_id: int, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> None: ...

    def geometry_count(self) -> int: ...

    def mesh_statistics(self, geometry_id: int) -> MeshStatistics: ...

    def bounds(self) -> NDArray[numpy.float64]:
        """Lower and upper corner (2, 3)."""

    def statistics(self) -> dict[str, int]: ...

    def reset_statistics(self) -> None: ...

    def set_newton(self, on: bool) -> None: ...

    @overload
    def cast_rays(self, rays: Annotated[NDArray[numpy.float32], dict(shape=(None, 6), order='C', device='cpu', writable=False)], tnear: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], tfar: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], attributes: Sequence[str], progress: Callable[[int], None] | None = None) -> dict[str, Any]: ...

    @overload
    def cast_rays(self, rays: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order='C', device='cpu', writable=False)], tnear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tfar: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], attributes: Sequence[str], progress: Callable[[int], None] | None = None) -> dict[str, Any]:
        """Closest hits of rays (n, 6): a dict of the named arrays."""

    @overload
    def test_occlusions(self, rays: Annotated[NDArray[numpy.float32], dict(shape=(None, 6), order='C', device='cpu', writable=False)], tnear: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], tfar: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], progress: Callable[[int], None] | None = None) -> NDArray[numpy.bool_]: ...

    @overload
    def test_occlusions(self, rays: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order='C', device='cpu', writable=False)], tnear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tfar: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], progress: Callable[[int], None] | None = None) -> NDArray[numpy.bool_]:
        """Whether anything is hit by each of rays (n, 6)."""

    def primvar_width(self, name: str) -> int:
        """Components; 0 if no mesh has it."""

    def evaluate_primvar(self, name: str, geometry_ids: Annotated[NDArray[numpy.uint32], dict(shape=(None,), order='C', device='cpu', writable=False)], faces: Annotated[NDArray[numpy.uint32], dict(shape=(None,), order='C', device='cpu', writable=False)], sub_quads: Annotated[NDArray[numpy.uint32], dict(shape=(None,), order='C', device='cpu', writable=False)], uv: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        A primvar and its derivatives by u and v, each (n, width) float64, at ids (n,) uint32 and uv (n, 2) float64.
        """

    def count_intersections(self, rays: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order='C', device='cpu', writable=False)], tnear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tfar: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], progress: Callable[[int], None] | None = None) -> NDArray[numpy.uint32]:
        """Number of intersections along each of rays (n, 6)."""

    def list_intersections(self, rays: Annotated[NDArray[numpy.float64], dict(shape=(None, 6), order='C', device='cpu', writable=False)], tnear: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], tfar: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], progress: Callable[[int], None] | None = None) -> dict[str, Any]:
        """All intersections along rays (n, 6), by ray and then by t."""

    def mesh_count(self) -> int: ...

    def mesh_data(self, mesh: int) -> dict[str, Any]:
        """Patches and tree of a mesh, as 32-bit words of the C++ records."""

    def instance_data(self, geometry_id: int) -> dict[str, Any]: ...

    def top_data(self) -> dict[str, Any]:
        """The tree over the instances."""

    @staticmethod
    def gpu_layout() -> dict[str, dict[str, int]]:
        """Bytes of each record that these hold, and the offsets of its members."""

def isa() -> str:
    """Instruction set in use."""

class MipMap:
    """An image and its smaller levels."""

    def __init__(self, texels: Annotated[NDArray[numpy.float32], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)]) -> None:
        """Linear colours (h, w, 3); row 0 is the bottom."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    def sample(self, st: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], d_dx: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], d_dy: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], wrap_s: str, wrap_t: str) -> NDArray[numpy.float64]:
        """Colours (n, 3) at st (n, 2); d_dx and d_dy are (n, 2) or (1, 2)."""
