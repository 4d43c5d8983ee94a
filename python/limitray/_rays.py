"""Checks of rays and of their limits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray._arrays import FloatArray, to_array


def flat_rays(rays: ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    """Rays as a contiguous (n, 6) array, and the shape of the answers."""
    array = to_array("rays", rays)
    if array.dtype not in (np.float32, np.float64):
        raise ValueError(f"rays must have dtype float32 or float64, not {array.dtype}")
    if array.ndim == 0 or array.shape[-1] != 6:
        raise ValueError(f"rays must have shape (..., 6), not {array.shape}")
    return np.ascontiguousarray(array.reshape(-1, 6)), array.shape[:-1]


def ray_limits(
    tnear: ArrayLike, tfar: ArrayLike, shape: tuple[int, ...], dtype: np.dtype[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """tnear and tfar as arrays of 1 value, or of one a ray."""
    return limit_numbers("tnear", tnear, shape, dtype), limit_numbers("tfar", tfar, shape, dtype)


def limit_numbers(
    name: str, value: ArrayLike, shape: tuple[int, ...], dtype: np.dtype[Any]
) -> NDArray[Any]:
    """One limit as an array of 1 value, or of one a ray."""
    array = to_array(name, value)
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} must be a real number or an array, not {array.dtype}")
    if array.shape not in ((), shape):
        raise ValueError(f"{name} must be a number or have shape {shape}, not {array.shape}")
    wrong = array[~(array >= 0)]
    if wrong.size:
        raise ValueError(f"{name} must be at least 0 and not NaN, got {wrong[0]}")
    return np.ascontiguousarray(array.reshape(-1), dtype)
