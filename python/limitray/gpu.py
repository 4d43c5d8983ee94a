"""Scenes whose rays are traced on a GPU.

`GpuScene` answers the calls that `Scene` makes to the C++ scene. The C++ scene still makes patches
and trees, and answers what is asked in double.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray import _core
from limitray.gpu_arrays import DeviceArray, device_array
from limitray.gpu_layout import HIT, MISS, STRIDES
from limitray.gpu_rays import BufferRays, CameraRays, Numbers, RaySource
from limitray.gpu_tracer import BACKENDS, open_tracer, slang_folder
from limitray.gpu_upload import SceneBuffers

__all__ = ["BACKENDS", "GpuScene", "slang_folder"]

RAYS_PER_BATCH = 1 << 18
"""Rays that are on the device at a time: about 130 bytes each."""

RAYS_PER_GROUP = 8
"""Most rays that one group of threads takes, one after the other."""

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
FOUND = "found"

Progress = Callable[[int], None]


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
        self._on_device = SceneBuffers(self._tracer, self._core)
        self._counts = dict.fromkeys(("rays", *COUNTERS), 0)
        self._newton = True
        self.rays_per_group = RAYS_PER_GROUP

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)

    @property
    def adapter(self) -> str:
        """Name of the GPU."""
        return str(self._tracer.device.info.adapter_name)

    @property
    def device(self) -> Any:
        """The slangpy.Device."""
        return self._tracer.device

    def slang_view(self, device: Any = None) -> dict[str, Any]:
        """The Slang struct SceneView, on the tracer's device or on another one."""
        self._on_device.synchronise()
        view = self._on_device.view(self._newton)
        if device is None or device is self.device:
            return view
        return {
            name: self._tracer.buffer(self._tracer.words(buffer), STRIDES[name], device)
            for name, buffer in view.items()
        }

    def device_array(self, name: str, values: Any) -> DeviceArray:
        """`values`, which lie on a GPU, for the queries below; see `gpu_arrays.device_array`."""
        return device_array(name, values, self._tracer)

    def add_mesh(self, *arguments: Any) -> int:
        """As `_core.Scene.add_mesh`."""
        self._on_device.changed = None
        return self._core.add_mesh(*arguments)

    def add_instance(self, geometry_id: int, transform: NDArray[np.float64]) -> int:
        """As `_core.Scene.add_instance`."""
        self._on_device.changed = None
        return self._core.add_instance(geometry_id, transform)

    def update_points(self, geometry_id: int, points: NDArray[np.float64]) -> None:
        """As `_core.Scene.update_points`; only this mesh is uploaded again."""
        self._core.update_points(geometry_id, points)
        if self._on_device.changed is not None:
            self._on_device.changed.add(self._core.instance_data(geometry_id)["mesh"])

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
        rays: Numbers,
        tnear: Numbers,
        tfar: Numbers,
        names: list[str],
        progress: Progress | None = None,
        to_host: bool = True,
    ) -> dict[str, Any]:
        """As `_core.Scene.cast_rays`, for float32; unless `to_host`, slangpy tensors."""
        self._check(rays)
        return self._cast(BufferRays(rays, tnear, tfar), names, progress, to_host)

    def cast_camera_rays(
        self, rays: CameraRays, names: list[str], progress: Progress | None, to_host: bool
    ) -> dict[str, Any]:
        """The same for primary rays, which are made on the device."""
        return self._cast(rays, names, progress, to_host)

    def test_occlusions(
        self,
        rays: Numbers,
        tnear: Numbers,
        tfar: Numbers,
        progress: Progress | None = None,
        to_host: bool = True,
    ) -> Any:
        """As `_core.Scene.test_occlusions`, for float32; unless `to_host`, a tensor of 0 and 1."""
        self._check(rays)
        source = BufferRays(rays, tnear, tfar)
        answers = self._empty_answers([FOUND], len(source), to_host)
        for rows, batch in self._batches(source, progress):
            found = self._tracer.empty_buffer(4 * batch["batch"]["count"], 4)
            self._trace("any_hits", batch, {"found": found})
            self._collect(answers, rows, found, {FOUND: 0})
        return answers[FOUND].astype(np.bool_) if to_host else answers[FOUND]

    def _cast(
        self, source: RaySource, names: list[str], progress: Progress | None, to_host: bool
    ) -> dict[str, Any]:
        answers = self._empty_answers(names, len(source), to_host)
        for rows, batch in self._batches(source, progress):
            hits = self._tracer.empty_buffer(batch["batch"]["count"] * HIT.itemsize, HIT.itemsize)
            self._trace(source.hit_kernels, batch, {"hits": hits})
            self._write_attributes(source, batch, hits, rows, answers)
        return answers

    def _check(self, rays: Numbers) -> None:
        if rays.dtype != np.float32:
            raise ValueError(
                f'rays must have dtype float32 on device "{self._name}", not {rays.dtype}; '
                'device "cpu" answers float64 rays in double'
            )

    def _batches(
        self, source: RaySource, progress: Progress | None
    ) -> Iterator[tuple[slice, dict[str, Any]]]:
        """The rays, bit by bit: rows, and the parameters that all kernels have."""
        self._on_device.synchronise()
        scene = self._on_device.view(self._newton)
        for start in range(0, len(source), RAYS_PER_BATCH):
            rows = slice(start, min(start + RAYS_PER_BATCH, len(source)))
            size = {"count": rows.stop - rows.start, "per_group": self.rays_per_group}
            yield rows, {"scene": scene, "rays": source.batch(self._tracer, rows), "batch": size}
            if progress is not None:
                progress(rows.stop)

    def _trace(self, file: str, batch: dict[str, Any], results: dict[str, Any]) -> None:
        work = self._tracer.buffer(np.zeros(1 + len(COUNTERS), np.uint32))
        count = batch["batch"]["count"]
        groups = -(-count // self.rays_per_group)
        # Whatever the wave width, 4 threads hold at least one group of three lanes.
        threads = groups * (4 if self._group == "three_lanes" else 1)
        self._tracer.run(file, self._group, threads, {**batch, **results, "work": work})
        self._counts["rays"] += count
        for name, n in zip(COUNTERS, self._tracer.words(work)[1:], strict=True):
            self._counts[name] += int(n)

    def _write_attributes(
        self,
        source: RaySource,
        batch: dict[str, Any],
        hits: Any,
        rows: slice,
        answers: dict[str, Any],
    ) -> None:
        count = batch["batch"]["count"]
        places, size = dict.fromkeys(ANSWERS, MISS), 0
        for name in answers:
            places[name] = size
            size += count * WIDTHS.get(name, 1)
        found = self._tracer.empty_buffer(max(size, 1) * 4, 4)
        self._tracer.run(
            source.attribute_kernels,
            "attributes",
            count,
            {**batch, "hits": hits, "at": places, "answers": found},
        )
        self._collect(answers, rows, found, places)

    def _empty_answers(self, names: list[str], count: int, to_host: bool) -> dict[str, Any]:
        if to_host:
            return {name: np.empty(_shape(name, count), _dtype(name)) for name in names}
        return {n: self._tracer.empty_tensor(_shape(n, count), _dtype(n)) for n in names}

    def _collect(
        self, answers: dict[str, Any], rows: slice, found: Any, places: dict[str, int]
    ) -> None:
        """Takes rows of all answers out of a buffer, where they begin at the words `places`."""
        count = rows.stop - rows.start
        on_host = next((isinstance(array, np.ndarray) for array in answers.values()), False)
        words = self._tracer.words(found) if on_host else None
        for name, array in answers.items():
            place, width = places[name], WIDTHS.get(name, 1)
            if words is not None:
                part: Any = words[place : place + count * width].view(_dtype(name))
                array[rows] = part.reshape(_shape(name, count))
            else:
                self._tracer.copy(
                    array.storage, 4 * width * rows.start, found, 4 * place, 4 * width * count
                )


def _dtype(name: str) -> type:
    return np.uint32 if name in (*ID_NAMES, FOUND) else np.float32


def _shape(name: str, count: int) -> tuple[int, ...]:
    return (count, WIDTHS[name]) if name in WIDTHS else (count,)
