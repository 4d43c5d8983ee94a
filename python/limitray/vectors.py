"""Vectors of the renderer: arrays (3, n) of float32, one row a component.

Whole rows are what numpy is quick at; the tracer's (n, 3) arrays are turned at its border.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float32]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]


def rows(array: NDArray[Any]) -> Array:
    """An (n, k) array as (k, n) float32."""
    return np.ascontiguousarray(array.T, np.float32)


def column(vector: ArrayLike) -> Array:
    """A (3,) vector as (3, 1) float32, to be combined with (3, n) arrays."""
    return np.asarray(vector, np.float32).reshape(3, 1)


def pick(array: Array, chosen: Rows) -> Array:
    """The vectors `chosen` (k,) of an array (3, n): (3, k); quicker than indexing."""
    return np.take(array, chosen, axis=1, mode="clip")


def dot(a: Array, b: Array) -> Array:
    """Scalar products (n,)."""
    products: Array = a[0] * b[0]
    products += a[1] * b[1]
    products += a[2] * b[2]
    return products


def normalized(v: Array) -> Array:
    """Unit vectors; 0 stays 0."""
    length = np.sqrt(dot(v, v))
    return np.asarray(v / np.maximum(length, np.finfo(np.float32).tiny), np.float32)


def tangent_frames(normals: Array) -> tuple[Array, Array]:
    """Two unit vectors orthogonal to each other and to unit `normals`.

    Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    """
    x, y, z = normals
    sign = np.copysign(np.float32(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    tangents = np.stack([1 + sign * x * x * a, sign * b, -sign * x])
    return tangents, np.stack([b, sign + y * y * a, -y])


class Frames:
    """Right-handed frames (n) whose z axes are unit `normals` (3, n)."""

    def __init__(self, normals: Array) -> None:
        self.normals = normals
        self.tangents, self.bitangents = tangent_frames(normals)

    def to_world(self, local: Array) -> Array:
        """Vectors given in the frames, in the world."""
        x, y, z = local
        world: Array = x * self.tangents
        world += y * self.bitangents
        world += z * self.normals
        return world

    def to_local(self, world: Array) -> Array:
        """Vectors of the world, in the frames."""
        return np.stack(
            [dot(world, axis) for axis in (self.tangents, self.bitangents, self.normals)]
        )
