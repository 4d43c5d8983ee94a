"""Arguments of queries, on the host or on the scene's GPU, and the shape of the answers.

`gpu` is None for a scene on the CPU.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import Any

import numpy as np

from limitray._arrays import name_list, one_of, to_array
from limitray._rays import flat_rays, limit_numbers
from limitray.gpu import GpuScene
from limitray.gpu_arrays import DeviceArray, is_buffer, is_on_device
from limitray.gpu_rays import Numbers

HIT_KEYS = (
    "t_hit",
    "geometry_ids",
    "primitive_ids",
    "primitive_uvs",
    "primitive_normals",
)
ATTRIBUTES = ("points", "dp_du", "dp_dv", "t_error", "patch_ids", "sub_quads")
PRIMVAR_PREFIX = "primvars:"
PRIMVAR_PLACES = ("geometry_ids", "primitive_ids", "sub_quads", "primitive_uvs")
OUTPUTS = ("host", "device")
Shape = tuple[int, ...]


def rays_for(gpu: GpuScene | None, rays: Any) -> tuple[Any, Shape]:
    """Rays (n, 6), and the shape of the answers."""
    if not is_on_device(rays):
        return flat_rays(rays)
    return _rows("rays", _on(gpu, "rays").device_array("rays", rays), is_buffer(rays), 6)


def limits_for(
    gpu: GpuScene | None, tnear: Any, tfar: Any, shape: Shape, dtype: np.dtype[Any]
) -> tuple[Any, Any]:
    """tnear and tfar: 1 value, or one a ray. On the GPU their values are not checked."""
    return _limit(gpu, "tnear", tnear, shape, dtype), _limit(gpu, "tfar", tfar, shape, dtype)


def _limit(
    gpu: GpuScene | None, name: str, value: Any, shape: Shape, dtype: np.dtype[Any]
) -> Numbers:
    if not is_on_device(value):
        return limit_numbers(name, value, shape, dtype)
    array = _on(gpu, name).device_array(name, value)
    fits = len(array) == prod(shape) if is_buffer(value) else array.shape == shape
    if not fits:
        raise ValueError(f"{name} must be a number or have shape {shape}, not {array.shape}")
    return array.flat()


def positions_for(
    gpu: GpuScene | None, positions: Any, width: int, height: int
) -> tuple[Any, Shape]:
    """Picture positions (n, 2), or None for all pixel centres; and the shape of the answers."""
    if positions is None:
        return None, (height, width)
    if is_on_device(positions):
        array = _on(gpu, "positions").device_array("positions", positions)
        return _rows("positions", array, is_buffer(positions), 2)
    given = to_array("positions", positions)
    if given.dtype.kind not in "fiu" or given.ndim == 0 or given.shape[-1] != 2:
        raise ValueError(
            f"positions must be numbers of shape (..., 2), not {given.dtype} {given.shape}"
        )
    return given.reshape(-1, 2).astype(np.float32), given.shape[:-1]


def check_output(gpu: GpuScene | None, output: str, primvars: Sequence[str] = ()) -> None:
    """Raises ValueError unless the answers can be where `output` says."""
    if one_of("output", output, OUTPUTS) == "device":
        if gpu is None:
            raise ValueError('output must be "host" for a scene on the CPU, not "device"')
        if primvars:
            raise ValueError(f'output must be "host" for {", ".join(primvars)}, not "device"')


def _on(gpu: GpuScene | None, name: str) -> GpuScene:
    if gpu is None:
        raise ValueError(f'{name} lies on a GPU, the scene on the CPU; make it Scene(device="gpu")')
    return gpu


def _rows(name: str, array: DeviceArray, is_plain: bool, width: int) -> tuple[DeviceArray, Shape]:
    """An array (n, width), and the shape of its rows; a plain buffer has no shape of its own."""
    shape = array.shape
    if is_plain and shape[0] % width == 0:
        shape = (shape[0] // width, width)
    if not shape or shape[-1] != width:
        raise ValueError(f"{name} must have shape (..., {width}), not {shape}")
    return array.flat(width), shape[:-1]


def attribute_names(
    attributes: Sequence[str], primvar_width: Callable[[str], int]
) -> tuple[list[str], list[str]]:
    """What is asked for beside HIT_KEYS: names that the tracer knows, and primvars."""
    names = name_list("attributes", attributes)
    primvars = [name for name in names if name.startswith(PRIMVAR_PREFIX)]
    plain = [name for name in names if not name.startswith(PRIMVAR_PREFIX)]
    for name in plain:
        one_of("attributes", name, HIT_KEYS + ATTRIBUTES)
    for name in primvars:
        if primvar_width(name.removeprefix(PRIMVAR_PREFIX)) == 0:
            raise ValueError(f'attributes: no mesh has the primvar of "{name}"')
    return list(dict.fromkeys((*HIT_KEYS, *plain))), primvars


def answers_of(
    cast: dict[str, Any],
    names: Sequence[str],
    primvars: Sequence[str],
    shape: Shape,
    evaluate_primvar: Callable[..., tuple[Any, Any, Any]],
) -> dict[str, Any]:
    """What was cast, and its primvars, in the shape of the rays."""
    hits = {name: cast[name] for name in names}
    for name in primvars:
        values = evaluate_primvar(
            name.removeprefix(PRIMVAR_PREFIX), *(cast[key] for key in PRIMVAR_PLACES)
        )
        for suffix, array in zip(("", ":du", ":dv"), values):
            hits[name + suffix] = array.astype(cast["t_hit"].dtype, copy=False)
    return {name: in_shape(array, shape) for name, array in hits.items()}


def in_shape(array: Any, shape: Shape) -> Any:
    """An array (n, ...) of numpy or slangpy as (*shape, ...)."""
    full = shape + tuple(array.shape)[1:]
    return array.reshape(full) if isinstance(array, np.ndarray) else array.view(full)
