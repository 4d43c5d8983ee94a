"""Scenes: meshes and instances, and the queries on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from math import prod
from threading import Lock
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray import _core, _queries
from limitray._arrays import (
    id_array,
    index_array,
    one_of,
    positive_int,
    positive_number,
    real_array,
    transform_matrix,
)
from limitray._device import OnDevice
from limitray._rays import flat_rays, ray_limits
from limitray.gpu import BACKENDS, GpuScene
from limitray.gpu_rays import CameraRays
from limitray.material import Material, MaterialSet
from limitray.mesh import Mesh

if TYPE_CHECKING:
    from limitray.camera import Camera
    from limitray.usd import Stage

INVALID_ID = 0xFFFFFFFF
"""Id reported for a miss."""

DEFAULT_TOLERANCE = 1e-5
MAX_THREADS = 4096
DEVICES = ("cpu", "gpu", *BACKENDS)

Progress = Callable[[int], None]


def precision(isolation_level: int | None, tolerance: float | None) -> tuple[int, float]:
    """Isolation level (0: chosen by the tolerance) and tolerance of `Scene.add_mesh`.

    Raises ValueError if one of them is out of its range.
    """
    if isolation_level is not None and positive_int("isolation_level", isolation_level) > 10:
        raise ValueError(f"isolation_level must be 1 to 10, not {isolation_level}")
    return (
        0 if isolation_level is None else int(isolation_level),
        DEFAULT_TOLERANCE if tolerance is None else positive_number("tolerance", tolerance),
    )


class Scene(OnDevice):
    """Subdivision surfaces and the rays shot at them.

    A scene may be queried from several threads at once, but not while it is changed.

    Parameters
    ----------
    device : {"cpu", "gpu", "vulkan", "cuda", "metal"}
        Where rays are traced. "gpu" takes the first backend that has a GPU; all but "cpu" need
        the extra `limitray[gpu]` and answer float32 rays only, of cast_rays and test_occlusions;
        what is answered in double (count_intersections, list_intersections) is traced on the CPU.
    threads : int
        Threads of the tracer, up to 4096; 0 takes all cores. The answers do not depend on it.

    Examples
    --------
    >>> import limitray as lr
    >>> import numpy as np
    >>> scene = lr.Scene()
    >>> scene.add_mesh(lr.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3]))
    0
    >>> hit = scene.cast_rays(np.array([[0.5, 0.5, 2, 0, 0, -1]]))
    >>> float(hit["t_hit"][0])
    2.0
    """

    def __init__(self, device: str = "cpu", threads: int = 0) -> None:
        one_of("device", device, DEVICES)
        self.threads = positive_int("threads", threads, minimum=0)
        if threads > MAX_THREADS:
            raise ValueError(f"threads must be 0 to {MAX_THREADS}, not {threads}")
        """Threads of the tracer; 0 stands for all cores."""
        if device == "cpu":
            self._scene = _core.Scene(threads)
        else:
            self._scene = GpuScene(device, threads)
        self._turn = nullcontext() if device == "cpu" else Lock()  # a GPU takes one call at a time
        self._material_sets: list[MaterialSet] = [MaterialSet()]
        self._material_set_of: list[int] = []
        self._face_counts: list[int] = []
        self._primvar_names: dict[str, None] = {}
        self.stage: Stage | None = None
        """What the USD stage says that the scene was loaded from."""

    def add_mesh(
        self,
        mesh: Mesh,
        isolation_level: int | None = None,
        transform: ArrayLike | None = None,
        *,
        tolerance: float | None = None,
        memory_limit: int | None = None,
    ) -> int:
        """Adds a mesh and returns its geometry id.

        After an exception, and after Ctrl-C, the scene is as it was.

        Parameters
        ----------
        mesh : Mesh
            The control cage.
        isolation_level : int, optional
            How deep irregular features are isolated, 1 to 10. Deeper levels bring the surface near
            extraordinary vertices closer to the true limit. Chosen by `tolerance` unless given;
            it wins where both are.
        transform : array (4, 4), optional
            Affine matrix that acts on column vectors; the identity unless given.
        tolerance : float, optional
            How far the surface may be from the true limit, in units of the longest side of the box
            around the cage; 1e-5 unless given. The lowest level from 2 to 6 (to 10 for a smaller
            tolerance) is taken whose estimated error is below it. `mesh_statistics` tells the
            error reached: high valences converge slowly.
        memory_limit : int, optional
            Bytes that the mesh may need while it is made; what the machine has free unless given.

        Raises
        ------
        ValueError
            An argument is wrong, or the cage cannot be refined, or it is larger than 1e15 or
            smaller than 1e-15.
        MemoryError
            The patches don't fit; the message names the size they need.
        """
        if not isinstance(mesh, Mesh):
            raise ValueError(f"mesh must be a limitray.Mesh, not {type(mesh).__name__}")
        level, tolerance = precision(isolation_level, tolerance)
        limit = (
            0 if memory_limit is None else min(positive_int("memory_limit", memory_limit), 2**63)
        )
        with self._all_or_nothing():
            added = self._scene.add_mesh(
                mesh._cage, level, transform_matrix(transform), tolerance, limit
            )
            self._material_set_of.append(0)
            self._face_counts.append(len(mesh.face_vertex_counts))
            self._primvar_names |= dict.fromkeys(mesh.primvars)
            return added

    def add_instance(self, geometry_id: int, transform: ArrayLike) -> int:
        """Adds geometry `geometry_id` again under another transform; returns a new geometry id.

        `transform` is a (4, 4) affine matrix that acts on column vectors and replaces the one of
        the geometry. Costs no patches. The instance has the materials of the geometry.
        """
        source = self._known(geometry_id)
        with self._all_or_nothing():
            added = self._scene.add_instance(source, transform_matrix(transform))
            self._material_set_of.append(self._material_set_of[source])
            self._face_counts.append(self._face_counts[source])
            return added

    @contextmanager
    def _all_or_nothing(self) -> Iterator[None]:
        """Takes back what was added if an exception comes, be it a Ctrl-C after the last step."""
        count = self._scene.geometry_count()
        names = self._primvar_names.copy()
        try:
            yield
        except BaseException:
            self._scene.truncate(count)
            del self._material_set_of[count:], self._face_counts[count:]
            self._primvar_names = names
            raise

    def set_material(
        self,
        geometry_id: int,
        material: Material | Sequence[Material],
        faces: ArrayLike | None = None,
    ) -> None:
        """Gives a mesh or instance its material, or several.

        Parameters
        ----------
        geometry_id : int
            As returned by add_mesh or add_instance. Instances made before keep what they have.
        material : Material, or sequence of them
            The materials.
        faces : array of int, optional
            One index into `material` for each base face.

        Raises
        ------
        ValueError
            The id is unknown, `material` holds something else, or `faces` has another length than
            the mesh has faces, or an index out of range.
        """
        target = self._known(geometry_id)
        materials = (material,) if isinstance(material, Material) else tuple(material)
        indices = None if faces is None else index_array("faces", faces).astype(np.intp)
        if not materials:
            raise ValueError("material must not be empty")
        for one in materials:
            if not isinstance(one, Material):
                raise ValueError(f"material must hold limitray.Material, not {one!r}")
        if indices is not None and len(indices) != self._face_counts[target]:
            raise ValueError(
                f"faces must have one index for each of the {self._face_counts[target]} faces, "
                f"not {len(indices)}"
            )
        if indices is not None and not ((indices >= 0) & (indices < len(materials))).all():
            raise ValueError(f"faces must be indices into the {len(materials)} materials")
        self._material_set_of[target] = len(self._material_sets)
        self._material_sets.append(MaterialSet(materials, indices))

    def material_sets(self, geometry_ids: ArrayLike) -> list[tuple[MaterialSet, NDArray[np.intp]]]:
        """The materials of geometry ids (n,): each set that occurs, and the rows that have it."""
        sets = np.array(self._material_set_of, np.intp)[np.asarray(geometry_ids, np.intp)]
        present = np.flatnonzero(np.bincount(sets))
        return [(self._material_sets[k], np.flatnonzero(sets == k)) for k in present]

    @property
    def has_materials(self) -> bool:
        """Whether any mesh has been given a material."""
        return len(self._material_sets) > 1

    @property
    def is_plain(self) -> bool:
        """Whether every mesh has one colour, without textures and colour primvars."""
        return all(m.is_plain for group in self._material_sets for m in group.materials)

    def primvar_names(self) -> tuple[str, ...]:
        """Names of the primvars that any mesh has."""
        return tuple(self._primvar_names)

    def primvar_width(self, name: str) -> int:
        """Components of a primvar; 0 if no mesh has it.

        Raises ValueError if two meshes have it with different widths.
        """
        return self._scene.primvar_width(name)

    def evaluate_primvar(
        self,
        name: str,
        geometry_ids: ArrayLike,
        primitive_ids: ArrayLike,
        sub_quads: ArrayLike,
        primitive_uvs: ArrayLike,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """A primvar at places of the surfaces, as `cast_rays` names them.

        Parameters
        ----------
        name : str
            Its name, without "primvars:".
        geometry_ids, primitive_ids, sub_quads : arrays (n,) of int
            Geometry, base face, and corner of a face that is no quad. INVALID_ID: nowhere.
        primitive_uvs : array (n, 2)
            Parameters in [0, 1]^2.

        Returns
        -------
        three arrays (n, width) of float64
            Values and derivatives by u and v: 0 nowhere, NaN where the mesh lacks the primvar.

        Raises
        ------
        ValueError
            No mesh has the primvar, or a place is out of range.
        """
        geometries, faces, quads = (
            id_array(key, values)
            for key, values in zip(
                _queries.PRIMVAR_PLACES, (geometry_ids, primitive_ids, sub_quads)
            )
        )
        uvs = real_array("primitive_uvs", primitive_uvs, (None, 2))
        if name not in self._primvar_names:
            raise ValueError(f'primvar "{name}": no mesh has it')
        return self._scene.evaluate_primvar(name, geometries, faces, quads, uvs)

    def update_points(self, geometry_id: int, points: ArrayLike) -> None:
        """Moves the control points (n, 3) of a mesh; their number and the topology stay.

        A ValueError (a wrong number of points, or a size out of range) leaves them where they were.
        This is short and can't be interrupted: a Ctrl-C meanwhile is raised when they have moved.
        """
        self._scene.update_points(self._known(geometry_id), real_array("points", points, (None, 3)))

    def cast_rays(
        self,
        rays: ArrayLike,
        tnear: ArrayLike = 0.0,
        tfar: ArrayLike = np.inf,
        attributes: Sequence[str] = (),
        progress: Progress | None = None,
        *,
        output: str = "host",
    ) -> dict[str, NDArray[Any]]:
        """The closest hit of each ray.

        float32 rays of a call are traced together: one call with 10,000 rays or more is almost
        twice as fast as many calls with a few hundred. Their order does not matter.

        Parameters
        ----------
        rays : array (..., 6) of float32 or float64, any strides
            Origin and direction. Directions need not be unit; t is in units of their length.
            float64 rays are answered in double arithmetic. Rays with a NaN, an infinity or a
            direction of length 0 are misses. A scene on a GPU also takes arrays that lie there
            (see `gpu_device`).
        tnear, tfar : float or array (...)
            Hits have tnear < t <= tfar. Both at least 0, not NaN.
        attributes : sequence of str
            What is wanted besides: "points", "dp_du", "dp_dv", "t_error", "patch_ids",
            "sub_quads", and primvars such as "primvars:st".
        progress : callable, optional
            Called about 20 times a second with the number of rays done.
        output : {"host", "device"}
            "device", for a scene on a GPU: the answers stay there, as `slangpy.Tensor` of the same
            shapes. Primvars are evaluated on the host.

        Returns
        -------
        dict of arrays, floating-point ones with the dtype of `rays`
            - "t_hit" (...): distance in units of the direction's length; inf for a miss.
            - "geometry_ids" (...) uint32: as returned by add_mesh and add_instance.
            - "primitive_ids" (...) uint32: base face of the cage.
            - "primitive_uvs" (..., 2): parameters in [0, 1]^2 of the base face, or of the sub-quad
              of a face that is no quad.
            - "primitive_normals" (..., 3): unit normal, on the side given by the winding.
            - "points" (..., 3): the surface at (u, v).
            - "dp_du", "dp_dv" (..., 3): derivatives of the position by u and v.
            - "t_error" (...): bound on the distance of "t_hit" from the surface.
            - "patch_ids" (...) uint32: patch of the geometry.
            - "sub_quads" (...) uint32: corner of a face that is no quad; 0 for quads.
            - "primvars:st" (..., width): the primvar "st"; "primvars:st:du" and "primvars:st:dv":
              its derivatives by u and v. NaN where the mesh hit has no such primvar.

            For a miss ids and sub-quads are INVALID_ID (0xFFFFFFFF) and all else is 0.

        Raises
        ------
        ValueError
            An argument has a wrong dtype, shape, name or value, or is a masked array.
        """
        progress = _callback(progress)
        names, primvars = _queries.attribute_names(attributes, self.primvar_width)
        flat, shape = _queries.rays_for(self._gpu, rays)
        limits = _queries.limits_for(self._gpu, tnear, tfar, shape, flat.dtype)
        _queries.check_output(self._gpu, output, primvars)
        wanted = names + [key for key in _queries.PRIMVAR_PLACES if primvars and key not in names]
        with self._turn:
            if self._gpu is not None:
                found = self._gpu.cast_rays(flat, *limits, wanted, progress, output == "host")
            else:
                found = self._scene.cast_rays(flat, *limits, wanted, progress)
        return _queries.answers_of(found, names, primvars, shape, self.evaluate_primvar)

    def cast_camera_rays(
        self,
        camera: Camera,
        width: int,
        height: int,
        positions: ArrayLike | None = None,
        tnear: ArrayLike = 0.0,
        tfar: ArrayLike = np.inf,
        attributes: Sequence[str] = (),
        progress: Progress | None = None,
        *,
        output: str = "host",
    ) -> dict[str, NDArray[Any]]:
        """The closest hits of a camera's rays, which a GPU makes itself.

        Parameters
        ----------
        camera : Camera
            Where the rays come from.
        width, height : int
            Size of the picture in pixels.
        positions : array (..., 2), optional
            Places in the picture, in pixels; (0, 0) is the top left corner. The centres of all
            pixels, (height, width), unless given.
        tnear, tfar, attributes, progress, output
            As in `cast_rays`. Directions have length 1 along the axis of view, so that t is the
            depth.

        Returns
        -------
        dict of arrays
            As `cast_rays` of float32 rays.
        """
        progress = _callback(progress)
        names, primvars = _queries.attribute_names(attributes, self.primvar_width)
        positive_int("width", width), positive_int("height", height)
        places, shape = _queries.positions_for(self._gpu, positions, width, height)
        _queries.check_output(self._gpu, output, primvars)
        if self._gpu is None:
            y, x = np.indices(shape) + 0.5 if places is None else (places[:, 1], places[:, 0])
            rays = camera.rays(x, y, width, height).astype(np.float32).reshape(*shape, 6)
            return self.cast_rays(rays, tnear, tfar, attributes, progress)
        limits = _queries.limits_for(self._gpu, tnear, tfar, shape, np.dtype(np.float32))
        wanted = names + [key for key in _queries.PRIMVAR_PLACES if primvars and key not in names]
        view = camera.pixel_view(width, height)
        source = CameraRays(view, width, prod(shape), places, *limits)
        with self._turn:
            found = self._gpu.cast_camera_rays(source, wanted, progress, output == "host")
        return _queries.answers_of(found, names, primvars, shape, self.evaluate_primvar)

    def test_occlusions(
        self,
        rays: ArrayLike,
        tnear: ArrayLike = 0.0,
        tfar: ArrayLike = np.inf,
        progress: Progress | None = None,
        *,
        output: str = "host",
    ) -> NDArray[np.bool_]:
        """Whether each ray hits anything: array (...) of bool. Arguments as in `cast_rays`.

        With output="device" a `slangpy.Tensor` (...) of uint: 1 or 0.
        """
        progress = _callback(progress)
        flat, shape = _queries.rays_for(self._gpu, rays)
        limits = _queries.limits_for(self._gpu, tnear, tfar, shape, flat.dtype)
        _queries.check_output(self._gpu, output)
        with self._turn:
            if self._gpu is not None:
                found = self._gpu.test_occlusions(flat, *limits, progress, output == "host")
            else:
                found = self._scene.test_occlusions(flat, *limits, progress)
        return cast(NDArray[np.bool_], _queries.in_shape(found, shape))

    def count_intersections(
        self,
        rays: ArrayLike,
        tnear: ArrayLike = 0.0,
        tfar: ArrayLike = np.inf,
        progress: Progress | None = None,
    ) -> NDArray[np.uint32]:
        """Number of intersections along each ray (...), in double. Arguments as in `cast_rays`."""
        flat, shape = flat_rays(rays)
        near, far = ray_limits(tnear, tfar, shape, np.dtype(np.float64))
        counts = self._scene.count_intersections(
            flat.astype(np.float64, copy=False), near, far, _callback(progress)
        )
        return counts.reshape(shape)

    def list_intersections(
        self,
        rays: ArrayLike,
        tnear: ArrayLike = 0.0,
        tfar: ArrayLike = np.inf,
        progress: Progress | None = None,
    ) -> dict[str, NDArray[Any]]:
        """All intersections along each ray, in double. Arguments as in `cast_rays`.

        Returns
        -------
        dict of arrays
            - "ray_splits" (n + 1,) int64: the intersections of ray i of the flattened rays are
              rows ray_splits[i] to ray_splits[i + 1], sorted by t.
            - "ray_ids" (k,) int64: the ray of each intersection.
            - "t_hit" (k,), "primitive_uvs" (k, 2), "primitive_normals" (k, 3) float64.
            - "geometry_ids", "primitive_ids", "sub_quads" (k,) uint32.
        """
        flat, shape = flat_rays(rays)
        near, far = ray_limits(tnear, tfar, shape, np.dtype(np.float64))
        found = self._scene.list_intersections(
            flat.astype(np.float64, copy=False), near, far, _callback(progress)
        )
        splits = found.pop("ray_splits").astype(np.int64)
        ids = np.repeat(np.arange(len(flat)), np.diff(splits))
        return {"ray_splits": splits, "ray_ids": ids, **found}

    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner (2, 3) of the surfaces; raises ValueError for an empty scene."""
        corners = self._scene.bounds()
        if not (corners[0] <= corners[1]).all():
            raise ValueError("the scene has no surface, so it has no bounds")
        return corners

    def statistics(self) -> dict[str, int]:
        """Work counted since the scene was made or `reset_statistics` was called.

        "rays", "node_visits", "patch_tests", "early_outs", "splits", "backtracks", "newton_runs",
        "newton_steps", and "unresolved": hits whose precision limit was not reached.
        """
        return dict(self._scene.statistics())

    def reset_statistics(self) -> None:
        """Sets all counters of `statistics` to 0."""
        self._scene.reset_statistics()

    def mesh_statistics(self, geometry_id: int) -> dict[str, Any]:
        """Size of one mesh after `add_mesh`.

        "patches", "gregory_patches", "patches_by_level" (a list), "patch_bytes", "bvh_bytes",
        "build_seconds", "isolation_level", and "limit_error": the estimated bound on the distance
        of the surface from the true limit, in units of the longest side of the box around the
        cage, as in `add_mesh`.
        """
        counted = self._scene.mesh_statistics(self._known(geometry_id))
        return {
            "patches": counted.patches,
            "gregory_patches": counted.gregory_patches,
            "patches_by_level": counted.patches_by_level,
            "patch_bytes": counted.patch_bytes,
            "bvh_bytes": counted.bvh_bytes,
            "build_seconds": counted.build_seconds,
            "isolation_level": counted.isolation_level,
            "limit_error": counted.limit_error,
        }

    def geometry_count(self) -> int:
        """Number of meshes and instances; geometry ids are 0 to this number less 1."""
        return self._scene.geometry_count()

    @staticmethod
    def isa() -> str:
        """Instruction set of the tracer: "avx512", "avx2" or "portable".

        The environment variable LIMITRAY_ISA forces one.
        """
        return _core.isa()

    def _known(self, geometry_id: int) -> int:
        if positive_int("geometry_id", geometry_id, minimum=0) >= self.geometry_count():
            raise ValueError(
                f"geometry_id must be below {self.geometry_count()}, not {geometry_id}"
            )
        return int(geometry_id)


def _callback(progress: Progress | None) -> Progress | None:
    if progress is not None and not callable(progress):
        raise ValueError(f"progress must be callable, not {progress!r}")
    return progress
