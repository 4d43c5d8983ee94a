"""Sample points and directions of the renderer: deterministic, and evenly spread over samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from limitray.vectors import Array

_BITS = 0xFFFFFFFF


class Sampler:
    """The random numbers of sample number `index` of every pixel.

    Each `purpose` (a bounce's direction, a light, ...) has two-dimensional Sobol points of its own,
    in an order of its own (Burley 2020, "Practical Hash-based Owen Scrambling"), and each pixel
    moves them by a random digital shift: among the first 2^k samples of a pixel one lies in each
    cell of every 2^a x 2^(k-a) grid, and pixels are independent. A number depends on seed, index,
    purpose and pixel alone: not on threads, and not on which pixels are asked for together.

    Parameters
    ----------
    seed, index : int
        At least 0; `index` below 2^32.
    """

    def __init__(self, seed: int, index: int) -> None:
        self._seed = seed
        self._index = index

    def square(self, purpose: int, pixels: NDArray[np.uint32]) -> Array:
        """Points (2, n) in [0, 1)^2 for the pixels (n,)."""
        key = _mix(_mix(self._seed & _BITS) ^ (self._seed >> 32 & _BITS) ^ _mix(purpose + 1))
        place = _owen(self._index, key)
        x, y = _reversed(place), _sobol(place)
        with np.errstate(over="ignore"):
            shift = _mix_array(pixels ^ np.uint32(_mix(key ^ 0x68BC21EB)))
            other = _mix_array(shift ^ np.uint32(0x02E5BE93))
        return np.stack([_unit(shift ^ np.uint32(x)), _unit(other ^ np.uint32(y))])


def _unit(bits: NDArray[np.uint32]) -> Array:
    """The leading 24 bits as a fraction in [0, 1)."""
    return (bits >> np.uint32(8)).astype(np.float32) * np.float32(2**-24)


def _mix(x: int) -> int:
    """A hash of 32 bits (Chris Wellons 2018, "Prospecting for Hash Functions": lowbias32)."""
    x &= _BITS
    x = (x ^ x >> 16) * 0x7FEB352D & _BITS
    x = (x ^ x >> 15) * 0x846CA68B & _BITS
    return x ^ x >> 16


def _mix_array(x: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """The same for an array."""
    x = (x ^ x >> np.uint32(16)) * np.uint32(0x7FEB352D)
    x = (x ^ x >> np.uint32(15)) * np.uint32(0x846CA68B)
    return np.asarray(x ^ x >> np.uint32(16))


def _reversed(x: int) -> int:
    """The 32 bits in the other order: the first Sobol dimension (van der Corput)."""
    return int(f"{x:032b}"[::-1], 2)


def _sobol(index: int) -> int:
    """The second Sobol dimension (Kollig and Keller 2002)."""
    value, direction = 0, 1 << 31
    while index:
        if index & 1:
            value ^= direction
        index >>= 1
        direction ^= direction >> 1
    return value


def _owen(index: int, key: int) -> int:
    """A permutation of the indices that keeps aligned blocks of 2^k together."""
    x = _reversed(index)
    x = (x + key) & _BITS
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        x ^= x * factor & _BITS
    return _reversed(x)


def disk(square: Array) -> Array:
    """Points (2, n) of the unit disk, uniform if `square` (2, n) is uniform in [0, 1)^2."""
    radius, angle = np.sqrt(square[0]), np.float32(2 * np.pi) * square[1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)])


def cosine_hemisphere(square: Array) -> Array:
    """Unit directions (3, n) around the z axis, with density cos / pi."""
    x, y = disk(square)
    return np.stack([x, y, np.sqrt(np.maximum(0, 1 - x * x - y * y))])


def cone(square: Array, depth: float) -> Array:
    """Unit directions (3, n), uniform in the cone around the z axis with cosines from 1 - depth."""
    height = 1 - square[0] * np.float32(depth)
    radius = np.sqrt(np.maximum(0, (1 - height) * (1 + height)))
    angle = np.float32(2 * np.pi) * square[1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height])
