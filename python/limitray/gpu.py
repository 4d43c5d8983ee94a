"""Scenes whose rays are traced on a GPU: the only file that imports slangpy.

`GpuScene` answers the calls that `Scene` makes to the C++ scene. The C++ scene still makes patches
and trees, and answers what is asked in double.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray import _core
from limitray.gpu_layout import (
    HIT,
    MISS,
    STRIDES,
    Words,
    geometry_record,
    instance_record,
    mesh_arrays,
    tree_arrays,
)

BACKENDS = ("vulkan", "cuda", "metal")
"""Devices by name; "gpu" takes the first of them that there is."""

RAYS_PER_BATCH = 1 << 18
"""Rays that are on the device at a time: about 130 bytes each."""

RAYS_PER_GROUP = 16
"""Most rays that one group of threads takes, one after the other."""

THREADS = 64
"""Threads of a workgroup, as the kernels declare it."""

CUDA_ARGUMENTS = ["--maxrregcount=96"]

COUNTERS = (
    "node_visits",
    "patch_tests",
    "early_outs",
    "splits",
    "backtracks",
    "newton_runs",
    "newton_steps",
    "unresolved",
)
WIDTHS = {"primitive_uvs": 2, "primitive_normals": 3, "points": 3, "dp_du": 3, "dp_dv": 3}
ID_NAMES = ("geometry_ids", "primitive_ids", "sub_quads", "patch_ids")
ANSWERS = ("t_hit", *ID_NAMES, *WIDTHS, "t_error")

Progress = Callable[[int], None]


def slang_folder() -> Path:
    """Folder of the Slang modules: the search path of a renderer that says `import limitray;`."""
    return Path(_core.__file__).parent / "slang"


def _import_slangpy() -> Any:
    try:
        import slangpy
    except ImportError as error:
        raise ImportError(
            f'tracing on a GPU needs slangpy: pip install "limitray[gpu]" ({error})'
        ) from None
    return slangpy


class Tracer:
    """A device and its kernels, shared by all scenes on it.

    `name` is "gpu", "vulkan", "cuda" or "metal"; `folder` holds the Slang modules. Raises
    ImportError without slangpy, and RuntimeError that lists what was found if no device can be
    used.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self._slangpy = _import_slangpy()
        self._folder = folder
        self.device = self._open(name)
        self._kernels: dict[str, Any] = {}

    def _open(self, name: str) -> Any:
        found = []
        for backend in BACKENDS if name == "gpu" else (name,):
            kind = self._slangpy.DeviceType[backend]
            try:
                if self._slangpy.Device.enumerate_adapters(kind):
                    # On CUDA, registers for a third of the threads of an SM (docs/gpu.md).
                    options = {
                        "include_paths": [str(self._folder)],
                        "downstream_args": CUDA_ARGUMENTS if backend == "cuda" else [],
                    }
                    return self._slangpy.Device(
                        type=kind, compiler_options=options, enable_hot_reload=False
                    )
                found.append(f"{backend}: no adapter")
            except RuntimeError as error:
                found.append(f"{backend}: {str(error).splitlines()[0]}")
        raise RuntimeError(f'device "{name}": no GPU can be used here ({"; ".join(found)})')

    def run(self, file: str, entry: str, threads: int, variables: dict[str, Any]) -> None:
        """Runs entry point `entry` of kernels/`file`.cs.slang."""
        if entry not in self._kernels:
            path = self._folder / "kernels" / f"{file}.cs.slang"
            program = self.device.load_program(str(path), [entry])
            self._kernels[entry] = self.device.create_compute_kernel(program)
        workgroups = -(-threads // THREADS)
        self._kernels[entry].dispatch([workgroups * THREADS, 1, 1], variables)

    def buffer(self, array: NDArray[Any], stride: int = 4) -> Any:
        """A buffer with the bytes of `array`, or one element if there are none."""
        data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        if data.size == 0:
            return self.empty_buffer(stride, stride)
        return self.device.create_buffer(
            size=data.size, struct_size=stride, usage=self._usage(), data=data
        )

    def empty_buffer(self, size: int, stride: int) -> Any:
        """A buffer of `size` bytes."""
        return self.device.create_buffer(size=size, struct_size=stride, usage=self._usage())

    def overwrite(self, buffer: Any, offset: int, array: NDArray[Any]) -> None:
        """Writes the bytes of `array` at `offset` of a buffer."""
        if array.size == 0:
            return
        encoder = self.device.create_command_encoder()
        data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        encoder.upload_buffer_data(buffer, offset, data)
        self.device.submit_command_buffer(encoder.finish())

    def _usage(self) -> Any:
        usage = self._slangpy.BufferUsage
        return usage.shader_resource | usage.unordered_access | usage.copy_source


@cache
def open_tracer(name: str, folder: Path) -> Tracer:
    """The Tracer of a device; the same one each time."""
    return Tracer(name, folder)


class GpuScene:
    """A scene as `_core.Scene`, whose float rays are traced on a GPU.

    Parameters
    ----------
    device : str
        "gpu", or one of BACKENDS.
    threads : int
        Threads of the C++ scene, which builds.
    group : {"three_lanes", "one_lane"}
        Threads that share a ray.
    folder : Path, optional
        Slang modules; those that are installed unless given.
    """

    def __init__(
        self, device: str, threads: int = 0, group: str = "three_lanes", folder: Path | None = None
    ) -> None:
        self._tracer = open_tracer(device, slang_folder() if folder is None else folder)
        self._name, self._group = device, group
        self._core = _core.Scene(threads)
        self._buffers: dict[str, Any] = {}
        self._first: list[tuple[int, int, int]] = []  # patch, bump and node of each mesh
        self._top_node = 0
        self._changed: set[int] | None = None  # meshes to upload again; None: everything
        self._counts = dict.fromkeys(("rays", *COUNTERS), 0)
        self._newton = True
        self.rays_per_group = RAYS_PER_GROUP

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)

    @property
    def adapter(self) -> str:
        """Name of the GPU."""
        return str(self._tracer.device.info.adapter_name)

    def add_mesh(self, *arguments: Any) -> int:
        """As `_core.Scene.add_mesh`."""
        self._changed = None
        return self._core.add_mesh(*arguments)

    def add_instance(self, geometry_id: int, transform: NDArray[np.float64]) -> int:
        """As `_core.Scene.add_instance`."""
        self._changed = None
        return self._core.add_instance(geometry_id, transform)

    def update_points(self, geometry_id: int, points: NDArray[np.float64]) -> None:
        """As `_core.Scene.update_points`; only this mesh is uploaded again."""
        self._core.update_points(geometry_id, points)
        if self._changed is not None:
            self._changed.add(self._core.instance_data(geometry_id)["mesh"])

    def set_newton(self, on: bool) -> None:
        """As `_core.Scene.set_newton`."""
        self._core.set_newton(on)
        self._newton = on

    def statistics(self) -> dict[str, int]:
        """As `_core.Scene.statistics`, GPU and CPU added up."""
        return {name: n + self._counts[name] for name, n in self._core.statistics().items()}

    def reset_statistics(self) -> None:
        """As `_core.Scene.reset_statistics`."""
        self._core.reset_statistics()
        self._counts = dict.fromkeys(self._counts, 0)

    def cast_rays(
        self,
        rays: NDArray[Any],
        tnear: NDArray[Any],
        tfar: NDArray[Any],
        names: list[str],
        progress: Progress | None = None,
    ) -> dict[str, NDArray[Any]]:
        """As `_core.Scene.cast_rays`, for float32."""
        self._check(rays)
        answers = {name: _empty(name, len(rays)) for name in names}
        for rows, batch in self._batches(rays, tnear, tfar, progress):
            self._trace(batch, ends_at_any=False)
            for name, array in self._attributes(batch, names).items():
                answers[name][rows] = array
        return answers

    def test_occlusions(
        self,
        rays: NDArray[Any],
        tnear: NDArray[Any],
        tfar: NDArray[Any],
        progress: Progress | None = None,
    ) -> NDArray[np.bool_]:
        """As `_core.Scene.test_occlusions`, for float32."""
        self._check(rays)
        occluded = np.zeros(len(rays), np.bool_)
        for rows, batch in self._batches(rays, tnear, tfar, progress):
            self._trace(batch, ends_at_any=True)
            hits = batch["hits"].to_numpy().view(np.uint8).view(HIT)
            occluded[rows] = hits["leaf"][: batch["count"]] != MISS
        return occluded

    def _check(self, rays: NDArray[Any]) -> None:
        if rays.dtype != np.float32:
            raise ValueError(
                f'rays must have dtype float32 on device "{self._name}", not {rays.dtype}; '
                'device "cpu" answers float64 rays in double'
            )

    def _batches(
        self, rays: NDArray[Any], tnear: NDArray[Any], tfar: NDArray[Any], progress: Progress | None
    ) -> Iterator[tuple[slice, dict[str, Any]]]:
        """The rays, bit by bit: rows, and the members of the Slang struct Rays."""
        self._synchronise()
        one = len(tnear) == len(tfar) == 1
        limits = np.stack(np.broadcast_arrays(tnear, tfar), axis=-1).astype(np.float32)
        for start in range(0, len(rays), RAYS_PER_BATCH):
            rows = slice(start, min(start + RAYS_PER_BATCH, len(rays)))
            count = rows.stop - rows.start
            yield (
                rows,
                {
                    "rays": self._tracer.buffer(rays[rows]),
                    "limits": self._tracer.buffer(limits if one else limits[rows]),
                    "hits": self._tracer.empty_buffer(count * HIT.itemsize, HIT.itemsize),
                    "count": count,
                    "limits_stride": 0 if one else 2,
                    "per_group": self.rays_per_group,
                },
            )
            if progress is not None:
                progress(rows.stop)

    def _trace(self, batch: dict[str, Any], ends_at_any: bool) -> None:
        batch["ends_at_any"] = int(ends_at_any)
        work = self._tracer.buffer(np.zeros(1 + len(COUNTERS), np.uint32))
        groups = -(-batch["count"] // self.rays_per_group)
        # Whatever the wave width, 4 threads hold at least one group of three lanes.
        self._run(
            "hits",
            self._group,
            groups * (4 if self._group == "three_lanes" else 1),
            {"rays": batch, "work": work},
        )
        self._counts["rays"] += batch["count"]
        for name, count in zip(COUNTERS, _words(work)[1:], strict=True):
            self._counts[name] += int(count)

    def _attributes(self, batch: dict[str, Any], names: list[str]) -> dict[str, NDArray[Any]]:
        count = batch["count"]
        places, size = dict.fromkeys(ANSWERS, MISS), 0
        for name in names:
            places[name] = size
            size += count * WIDTHS.get(name, 1)
        answers = self._tracer.empty_buffer(max(size, 1) * 4, 4)
        self._run(
            "attributes", "attributes", count, {"rays": batch, "at": places, "answers": answers}
        )
        words = _words(answers)
        found: dict[str, NDArray[Any]] = {}
        for name in names:
            array = words[places[name] : places[name] + count * WIDTHS.get(name, 1)]
            found[name] = array.view(_dtype(name)).reshape(_shape(name, count))
        return found

    def _run(self, file: str, entry: str, threads: int, variables: dict[str, Any]) -> None:
        settings = np.array([self._core.geometry_count(), self._newton], np.uint32)
        scene = {**self._buffers, "settings": self._tracer.buffer(settings)}
        self._tracer.run(file, entry, threads, {"scene": scene, **variables})

    def _synchronise(self) -> None:
        """Brings the buffers up to the scene."""
        if self._changed is None:
            self._upload_all()
        elif self._changed:
            for mesh in self._changed:
                patch, bump, node = self._first[mesh]
                arrays = mesh_arrays(self._core.mesh_data(mesh), patch, bump, node)
                # All that depends on the points.
                places = {"nets": patch, "models": patch, "bumps": bump, "nodes": node}
                for name, row in places.items():
                    self._overwrite(name, row, arrays[name])
            self._upload_top()
        self._changed = set()

    def _upload_all(self) -> None:
        self._first, parts = [], []
        patch = bump = node = 0
        for mesh in range(self._core.mesh_count()):
            data = self._core.mesh_data(mesh)
            self._first.append((patch, bump, node))
            parts.append(mesh_arrays(data, patch, bump, node))
            patch, bump = patch + len(data["nets"]), bump + len(data["bumps"])
            node += len(data["nodes"])
        self._top_node = node
        # Room for a tree over the instances: never more nodes than these.
        room = self._core.geometry_count() + 1
        empty = tree_arrays(np.zeros((room, 56), np.float32), 0, 0)
        parts.append({name: empty[name] for name in ("nodes", "children", "parents")})
        for name in ("nets", "bumps", "infos", "models", "patch_ids", *empty):
            arrays = [part[name] for part in parts if name in part]
            array = np.concatenate(arrays) if arrays else np.zeros(0, np.uint32)
            self._buffers[name] = self._tracer.buffer(array, STRIDES[name])
        instances = [self._core.instance_data(i) for i in range(self._core.geometry_count())]
        records = np.array([instance_record(data) for data in instances])
        self._buffers["instances"] = self._tracer.buffer(records, STRIDES["instances"])
        self._upload_top()

    def _overwrite(self, name: str, row: int, rows: Words) -> None:
        if len(rows) > 0:
            self._tracer.overwrite(self._buffers[name], row * rows[0].nbytes, rows)

    def _upload_top(self) -> None:
        top = self._core.top_data()
        if len(top["nodes"]) > 0:
            for name, array in tree_arrays(top["nodes"], self._top_node, 0).items():
                self._overwrite(name, self._top_node, array)
        records = [geometry_record(top, self._top_node)]
        for mesh, (_, _, node) in enumerate(self._first):
            records.append(geometry_record(self._core.mesh_data(mesh), node))
        self._buffers["geometries"] = self._tracer.buffer(np.array(records), STRIDES["geometries"])


def _words(buffer: Any) -> NDArray[np.uint32]:
    return np.asarray(buffer.to_numpy().view(np.uint8).view(np.uint32))


def _dtype(name: str) -> type:
    return np.uint32 if name in ID_NAMES else np.float32


def _shape(name: str, count: int) -> tuple[int, ...]:
    return (count, WIDTHS[name]) if name in WIDTHS else (count,)


def _empty(name: str, count: int) -> NDArray[Any]:
    return np.empty(_shape(name, count), _dtype(name))
