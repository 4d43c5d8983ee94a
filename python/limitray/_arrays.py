"""Checks of array arguments. Each error names the argument, the rule and what was given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.floating[Any]]
Shape = tuple[int | None, ...]


def to_array(name: str, values: ArrayLike) -> NDArray[Any]:
    """`values` as an array in this machine's byte order.

    By DLPack if numpy does not know them otherwise.
    Ragged or masked input, and such that is no array, raises ValueError naming `name`.
    """
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ValueError(f"{name} must not be masked: fill the {values.mask.sum()} masked values")
    by_dlpack = hasattr(values, "__dlpack__") and not hasattr(values, "__array__")
    try:
        array = np.from_dlpack(cast(Any, values)) if by_dlpack else np.asarray(values)
    except (ValueError, TypeError, RuntimeError, BufferError) as error:
        raise ValueError(f"{name} must be an array of numbers: {error}") from None
    return array if array.dtype.isnative else array.astype(array.dtype.newbyteorder("="))


def check_shape(name: str, array: NDArray[Any], shape: Shape) -> None:
    """Raises ValueError unless `array` has `shape`, where None stands for any length."""
    fits = array.ndim == len(shape) and all(
        want is None or want == got for want, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("n" if length is None else str(length) for length in shape)
        wanted += "," if len(shape) == 1 else ""
        raise ValueError(f"{name} must have shape ({wanted}), not {array.shape}")


def real_array(name: str, values: ArrayLike, shape: Shape, dtype: type = np.float64) -> Any:
    """`values` as a C-contiguous array of `dtype`; raises ValueError for a wrong shape or kind."""
    array = to_array(name, values)
    if array.size == 0 and array.ndim == 1 and shape[0] is None:
        array = array.reshape([0 if length is None else length for length in shape])
    elif array.dtype.kind not in "fiu":
        raise ValueError(f"{name} must hold real numbers, not {array.dtype}")
    check_shape(name, array, shape)
    with np.errstate(over="ignore"):  # beyond the range of a float is infinite
        return np.ascontiguousarray(array, dtype)


def index_array(name: str, values: ArrayLike) -> NDArray[np.int32]:
    """`values` as a C-contiguous (n,) int32 array; raises ValueError for anything but integers."""
    array = to_array(name, values)
    check_shape(name, array, (None,))
    return to_int32(name, array)


def to_int32(name: str, array: NDArray[Any]) -> NDArray[np.int32]:
    """`array` as int32; raises ValueError if its values are no integers or do not fit."""
    if array.size == 0:
        return np.zeros(array.shape, np.int32)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} must hold integers, not {array.dtype}")
    limits = np.iinfo(np.int32)
    if array.min() < limits.min or array.max() > limits.max:
        raise ValueError(f"{name} must fit 32-bit integers; it holds {array.min()}..{array.max()}")
    return array.astype(np.int32, order="C", copy=False)


def id_array(name: str, values: ArrayLike) -> NDArray[np.uint32]:
    """`values` as an array of uint32, as `cast_rays` returns ids; raises ValueError otherwise."""
    array = to_array(name, values)
    if array.dtype.kind not in "iu" and array.size:
        raise ValueError(f"{name} must hold integers, not {array.dtype}")
    if array.dtype != np.uint32 and array.size:
        low, high = array.min(), array.max()
        if low < 0 or high > 0xFFFFFFFF:
            raise ValueError(f"{name} must be 0 to 0xFFFFFFFF; it holds {low}..{high}")
    return np.ascontiguousarray(array, np.uint32)


def finite_vector(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """`values` as a (3,) float64 array of finite numbers; raises ValueError otherwise."""
    vector: NDArray[np.float64] = real_array(name, values, (3,))
    if not np.isfinite(vector).all():
        raise ValueError(f"{name} must be finite, not {vector.tolist()}")
    return vector


def transform_matrix(values: ArrayLike | None) -> NDArray[np.float64]:
    """A (4, 4) affine matrix that acts on column vectors; None is the identity."""
    if values is None:
        return np.eye(4)
    matrix: NDArray[np.float64] = real_array("transform", values, (4, 4))
    if not np.isfinite(matrix).all():
        raise ValueError("transform must be finite")
    if not np.array_equal(matrix[3], (0, 0, 0, 1)):
        raise ValueError(f"transform must end with the row 0 0 0 1, not {matrix[3].tolist()}")
    if np.linalg.matrix_rank(matrix[:3, :3]) < 3:
        raise ValueError("transform must be invertible")
    return matrix


def positive_int(name: str, value: int, minimum: int = 1) -> int:
    """`value` if it is an integer of at least `minimum`; raises ValueError otherwise."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < minimum:
        raise ValueError(f"{name} must be an integer >= {minimum}, not {value!r}")
    return int(value)


def positive_number(name: str, value: float) -> float:
    """`value` if it is a finite real number above 0; raises ValueError otherwise."""
    kinds = (int, float, np.integer, np.floating)
    if isinstance(value, bool) or not isinstance(value, kinds) or not 0 < value < np.inf:
        raise ValueError(f"{name} must be a number above 0, not {value!r}")
    return float(value)


def one_of(name: str, value: str, choices: tuple[str, ...]) -> str:
    """`value` if it is among `choices`; raises ValueError that lists them otherwise."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(choices)}, not {value!r}")
    return value


def name_list(name: str, values: Sequence[str]) -> list[str]:
    """`values` as a list if they are a sequence of names; raises ValueError otherwise."""
    if isinstance(values, str):
        raise ValueError(f'{name} must be a sequence of names, such as ("{values}",)')
    try:
        names = list(values)
    except TypeError:
        raise ValueError(f"{name} must be a sequence of names, not {values!r}") from None
    for value in names:
        if not isinstance(value, str):
            raise ValueError(f"{name} must hold names, not {value!r}")
    return names
