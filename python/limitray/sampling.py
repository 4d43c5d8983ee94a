"""Sample points and directions of the renderer: deterministic, and evenly spread over samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Sampler:
    """Low-discrepancy samples for the pixels of one tile.

    Sample number i of a pixel is a point of Roberts' R sequence (Martin Roberts 2018, "The
    Unreasonable Effectiveness of Quasirandom Sequences") moved by a random offset of the pixel
    (Cranley-Patterson rotation). It depends on seed, tile, pixel and i alone.

    Parameters
    ----------
    seed, tile : int
        Choose the random offsets.
    pixels : int
        Number of pixels in the tile.
    dimensions : int
        Numbers drawn for each sample.
    """

    def __init__(self, seed: int, tile: int, pixels: int, dimensions: int) -> None:
        self._offsets = np.random.default_rng((seed, tile)).random((pixels, dimensions))
        ratio = _generalised_golden_ratio(dimensions)
        self._steps = ratio ** -np.arange(1.0, dimensions + 1)

    def draw(self, index: int) -> Array:
        """Sample `index` of all pixels: (pixels, dimensions) in [0, 1)."""
        values: Array = self._offsets + index * self._steps
        return np.asarray(values - np.floor(values))


def _generalised_golden_ratio(dimensions: int) -> float:
    """The root of x^(d+1) = x + 1, by fixed-point iteration."""
    x = 1.5
    for _ in range(64):
        x = (1 + x) ** (1 / (dimensions + 1))
    return x


def disk(square: Array) -> Array:
    """Points (n, 2) of the unit disk, uniform if `square` (n, 2) is uniform in [0, 1)^2."""
    radius, angle = np.sqrt(square[:, 0]), 2 * np.pi * square[:, 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def cosine_hemisphere(square: Array, normals: Array) -> Array:
    """Unit directions (n, 3) around unit `normals` (n, 3), with density cos / pi."""
    xy = disk(square)
    z = np.sqrt(np.maximum(0, 1 - (xy**2).sum(axis=1)))
    tangents, bitangents = tangent_frames(normals)
    directions: Array = xy[:, :1] * tangents + xy[:, 1:] * bitangents + z[:, np.newaxis] * normals
    return directions


def tangent_frames(normals: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) orthogonal to each other and to unit `normals` (n, 3).

    Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    """
    x, y, z = normals.T
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    tangents = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    return tangents, np.stack([b, sign + y * y * a, -y], axis=1)
