"""Environment light: what rays see that leave the scene."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray._arrays import real_array
from limitray.camera import Vector, look_axes
from limitray.texture import read_image
from limitray.vectors import Array, column, dot

IMPORTANCE_SIZE = 256
"""Most rows of the table by which directions of an image are drawn."""


def radiance_vector(name: str, values: ArrayLike) -> Array:
    """`values` as a colour (3, 1); raises ValueError unless it is finite and at least 0."""
    colour = real_array(name, values, (3,))
    if not (np.isfinite(colour) & (colour >= 0)).all():
        raise ValueError(f"{name} must be finite and at least 0, not {colour.tolist()}")
    return column(colour)


class ConstantSky:
    """The same light from everywhere.

    Parameters
    ----------
    radiance : (3,)
        Linear colour, at least 0.
    """

    def __init__(self, radiance: ArrayLike = (1.0, 1.0, 1.0)) -> None:
        self._radiance = radiance_vector("radiance", radiance)

    def radiance(self, directions: Array) -> Array:
        """What comes from unit `directions` (3, n): linear colours (3, n)."""
        return np.broadcast_to(self._radiance, directions.shape)


class GradientSky:
    """A sky that changes with the height above the horizon.

    Parameters
    ----------
    zenith, horizon, ground : (3,)
        Linear colours straight up, level and straight down, at least 0; between them it goes by the
        square root of the sine of the elevation.
    up : (3,)
        Direction of the zenith.
    """

    def __init__(
        self,
        zenith: ArrayLike = (0.44, 0.49, 0.57),
        horizon: ArrayLike = (0.28, 0.28, 0.29),
        ground: ArrayLike = (0.09, 0.08, 0.075),
        up: Vector = (0.0, 1.0, 0.0),
    ) -> None:
        self._horizon = radiance_vector("horizon", horizon)
        self._to_zenith = radiance_vector("zenith", zenith) - self._horizon
        self._to_ground = radiance_vector("ground", ground) - self._horizon
        self._up = _unit("up", up)

    def radiance(self, directions: Array) -> Array:
        """What comes from unit `directions` (3, n): linear colours (3, n)."""
        height = dot(directions, self._up)
        above, below = np.sqrt(np.clip(height, 0, 1)), np.sqrt(np.clip(-height, 0, 1))
        return np.asarray(self._horizon + above * self._to_zenith + below * self._to_ground)


class ImageSky:
    """An image of the whole sphere, by longitude and latitude (equirectangular).

    Its bright parts are looked for: directions are drawn with a density that follows the image.

    Parameters
    ----------
    image : array (h, w, 3) of float
        Linear colours, at least 0; row 0 is straight up, and the middle column straight ahead,
        along -z if y is up and along +y if z is up.
    up : (3,)
        Direction of the upper border.
    rotation_deg : float
        How far the image is turned to the left around `up`, in degrees.
    scale : float
        Factor on the colours, above 0.
    """

    def __init__(
        self,
        image: ArrayLike,
        up: Vector = (0.0, 1.0, 0.0),
        rotation_deg: float = 0.0,
        scale: float = 1.0,
    ) -> None:
        values = real_array("image", image, (None, None, 3), np.float32)
        if values.size == 0 or not (np.isfinite(values) & (values >= 0)).all():
            raise ValueError("image must have pixels, all of them finite and at least 0")
        if not (np.isfinite(scale) and scale > 0):
            raise ValueError(f"scale must be finite and above 0, not {scale}")
        self._height, self._width = values.shape[:2]
        self._pixels = np.ascontiguousarray(values.reshape(-1, 3).T) * np.float32(scale)
        self._axes = _sphere_axes(up, rotation_deg)
        self._build_table()

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        up: Vector = (0.0, 1.0, 0.0),
        rotation_deg: float = 0.0,
        scale: float = 1.0,
    ) -> ImageSky:
        """Reads an .exr, .png or .jpg file (8-bit colours are sRGB).

        Raises OSError if it cannot be opened, ValueError if it is no image.
        """
        return cls(read_image(Path(path)), up, rotation_deg, scale)

    def _build_table(self) -> None:
        """Cells of the sphere and how likely each is: by its light, and a little for dark ones."""
        step = -(-self._height // IMPORTANCE_SIZE)
        self._rows, self._columns = -(-self._height // step), -(-self._width // step)
        light = np.zeros((self._rows * step, self._columns * step))
        grey = self._pixels.mean(axis=0, dtype=np.float64).reshape(self._height, self._width)
        light[: self._height, : self._width] = _spread(grey)
        cells = light.reshape(self._rows, step, self._columns, step).mean(axis=(1, 3))
        edges = np.cos(np.pi * np.arange(self._rows + 1) / self._rows)
        area = (edges[:-1] - edges[1:])[:, np.newaxis] * np.full(self._columns, 1 / self._columns)
        weights = (cells + 0.01 * cells.mean() + np.finfo(np.float32).tiny) * area
        shares = (weights / weights.sum()).ravel()
        self._cumulated = np.cumsum(shares)
        self._density = (shares / (2 * np.pi * area.ravel())).astype(np.float32)
        self._edges = edges.astype(np.float32)

    def radiance(self, directions: Array) -> Array:
        """What comes from unit `directions` (3, n): linear colours (3, n), bilinear."""
        across, down = self._place(directions)
        x, y = across * np.float32(self._width) - 0.5, down * np.float32(self._height) - 0.5
        i, j = np.floor(x), np.floor(y)
        s, t = x - i, y - j
        columns = [(i.astype(np.int32) + k) % self._width for k in (0, 1)]
        lines = [np.clip(j.astype(np.int32) + k, 0, self._height - 1) for k in (0, 1)]
        upper, lower = (
            sum(
                weight * np.take(self._pixels, line * self._width + column, axis=1)
                for weight, column in zip((1 - s, s), columns)
            )
            for line in lines
        )
        return np.asarray((1 - t) * upper + t * lower, np.float32)

    def sample(self, square: Array) -> tuple[Array, Array]:
        """Unit directions (3, n) for points (2, n) of the unit square, and their densities (n,)."""
        draw = square[0].astype(np.float64)
        cell = np.minimum(np.searchsorted(self._cumulated, draw, "right"), len(self._density) - 1)
        start = np.where(cell > 0, self._cumulated[cell - 1], 0)
        along = np.clip((draw - start) / (self._cumulated[cell] - start), 0, 1).astype(np.float32)
        line, column = np.divmod(cell, self._columns)
        height = self._edges[line] + square[1] * (self._edges[line + 1] - self._edges[line])
        angle = (column + along) * np.float32(2 * np.pi / self._columns)
        radius = np.sqrt(np.maximum(0, 1 - height * height))
        right, up, ahead = self._axes
        directions = radius * np.sin(angle) * -right - radius * np.cos(angle) * ahead + height * up
        return directions.astype(np.float32), self._density[cell]

    def density(self, directions: Array) -> Array:
        """The density (n,) with which `sample` draws unit `directions` (3, n), per steradian."""
        across, _ = self._place(directions)
        column = np.minimum((across * self._columns).astype(np.intp), self._columns - 1)
        height = dot(directions, self._axes[1])
        line = np.searchsorted(-self._edges[1:-1], -height, "right")
        return np.asarray(self._density[line * self._columns + column])

    def _place(self, directions: Array) -> tuple[Array, Array]:
        """Longitude and latitude of directions as places in the image: (n,), (n,) in [0, 1]."""
        right, up, ahead = self._axes
        angle = np.arctan2(dot(directions, -right), -dot(directions, ahead))
        across = angle * np.float32(0.5 / np.pi)
        down = np.arccos(np.clip(dot(directions, up), -1, 1)) * np.float32(1 / np.pi)
        return across - np.floor(across), down


def _spread(grey: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means over the pixels of what `radiance` shows: it is linear between their centres."""
    across = 0.75 * grey + 0.125 * (np.roll(grey, 1, axis=1) + np.roll(grey, -1, axis=1))
    padded = np.pad(across, ((1, 1), (0, 0)), mode="edge")
    return np.asarray(0.75 * across + 0.125 * (padded[:-2] + padded[2:]))


def _unit(name: str, vector: ArrayLike) -> Array:
    values = real_array(name, vector, (3,))
    length = np.linalg.norm(values)
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"{name} must be finite and not 0, not {values.tolist()}")
    return column(values / length)


def _sphere_axes(up: Vector, rotation_deg: float) -> tuple[Array, Array, Array]:
    """Right, up and ahead of an image of the sphere, each (3, 1)."""
    side = (1, 0, 0) if np.any(np.cross(up, (1, 0, 0))) else (0, 1, 0)
    right, upward, ahead = look_axes(np.cross(up, side), up)
    turn = np.radians(rotation_deg)
    turned = np.cos(turn) * ahead - np.sin(turn) * right
    return column(np.cross(turned, upward)), column(upward), column(turned)
