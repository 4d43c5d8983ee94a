"""Pinhole cameras, their rays, and automatic framing."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from limitray._arrays import finite_vector, positive_int, positive_number
from limitray.scene import Scene

Vector = tuple[float, float, float]

FRAMING_RESOLUTION = 128
"""Rays a side of the coarse picture that automatic framing looks at."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Parameters
    ----------
    eye : (3,)
        Position.
    center : (3,)
        Point that appears in the middle of the picture.
    up : (3,)
        Direction that points up in the picture.
    fov_deg : float
        Horizontal field of view in degrees, above 0 and below 180.
    aspect : float, optional
        Width over height of the part that every picture shows, as that of a film gate: a picture
        of another shape shows more, above and below it or at its sides. Without it the field of
        view is as wide as the picture, whatever its shape.

    Raises
    ------
    ValueError
        A vector is not finite, eye and center coincide, up is parallel to the view, or a number is
        out of its range.
    """

    eye: Vector
    center: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov_deg: float = 40.0
    aspect: float | None = None

    def __post_init__(self) -> None:
        _check_fov(self.fov_deg)
        if self.aspect is not None:
            positive_number("aspect", self.aspect)
        self.axes()

    def half_width(self, width: int, height: int) -> float:
        """Half the width of a picture of this many pixels, at distance 1 along the view."""
        half = float(np.tan(np.radians(self.fov_deg) / 2))
        return half if self.aspect is None else half * max(1.0, width / height / self.aspect)

    def axes(self) -> NDArray[np.float64]:
        """Unit vectors (3, 3): right, up and forward."""
        eye, center = finite_vector("eye", self.eye), finite_vector("center", self.center)
        view = center - eye
        if not view.any():
            raise ValueError(f"eye and center must differ; both are {eye.tolist()}")
        return look_axes(view, self.up)

    def rays(
        self, x: NDArray[np.float64], y: NDArray[np.float64], width: int, height: int
    ) -> NDArray[np.float64]:
        """Rays (..., 6) through picture positions x, y (...) in pixels; (0, 0) is the top left.

        Directions have length 1 along the axis of view, so that t is the depth.
        """
        right, up, forward = self.axes()
        half = self.half_width(width, height)
        across = (2 * np.asarray(x) / width - 1) * half
        upward = (1 - 2 * np.asarray(y) / height) * half * height / width
        directions = forward + across[..., np.newaxis] * right + upward[..., np.newaxis] * up
        return np.concatenate([np.broadcast_to(self.eye, directions.shape), directions], axis=-1)

    def pixel_view(self, width: int, height: int) -> NDArray[np.float32]:
        """What makes rays of picture positions: (4, 3).

        The eye, the direction through (0, 0), and how that changes with a pixel to the right and
        with a pixel down.
        """
        corners = self.rays(np.array([0.0, 1, 0]), np.array([0.0, 0, 1]), width, height)[:, 3:]
        rows = [np.asarray(self.eye), corners[0], corners[1] - corners[0], corners[2] - corners[0]]
        return np.array(rows, np.float32)

    @classmethod
    def frame(
        cls,
        scene: Scene,
        aspect: float = 4 / 3,
        azimuth_deg: float = 30.0,
        elevation_deg: float = 22.0,
        up: Vector | None = None,
        fov_deg: float = 28.0,
        margin: float = 0.08,
    ) -> Camera:
        """A camera that shows the whole scene.

        Frames the bounds, looks through that camera, and frames what it sees.

        Parameters
        ----------
        scene : Scene
            Must not be empty.
        aspect : float
            Width over height of the picture.
        azimuth_deg : float
            How far the eye is turned to the right of the front, in degrees. The front is seen
            along -z if y is up, and along +y if z is up.
        elevation_deg : float
            How far the eye is above the horizon, in degrees, between -90 and 90.
        up : (3,), optional
            Direction that points up in the picture; the up axis of the scene's USD stage, or y,
            unless given.
        fov_deg : float
            Horizontal field of view in degrees.
        margin : float
            Free part of the picture on each side, 0 to below 0.5.

        Raises
        ------
        ValueError
            The scene is empty, or an argument is out of its range.
        """
        if up is None:
            up = scene.stage.up if scene.stage else (0.0, 1.0, 0.0)
        positive_number("aspect", aspect)
        _check_fov(fov_deg)
        if not 0 <= margin < 0.5:
            raise ValueError(f"margin must be at least 0 and below 0.5, not {margin}")
        if not finite_vector("up", up).any():
            raise ValueError("up must not be 0")
        direction = _view_direction(azimuth_deg, elevation_deg, up)
        corners = np.array(list(product(*scene.bounds().T)))
        camera = _fit(corners, aspect, direction, up, fov_deg, margin)
        size = FRAMING_RESOLUTION
        hits = scene.cast_camera_rays(
            camera, size, max(1, round(size / aspect)), attributes=("points",)
        )
        seen = hits["points"][np.isfinite(hits["t_hit"])].astype(np.float64)
        return _fit(seen, aspect, direction, up, fov_deg, margin) if len(seen) > 1 else camera


def _check_fov(fov_deg: float) -> None:
    if not 0 < fov_deg < 180:
        raise ValueError(f"fov_deg must be above 0 and below 180, not {fov_deg}")


def _view_direction(azimuth_deg: float, elevation_deg: float, up: Vector) -> NDArray[np.float64]:
    """Unit direction of view from an eye at the given angles (degrees) around the axis `up`."""
    if not np.isfinite(azimuth_deg):
        raise ValueError(f"azimuth_deg must be finite, not {azimuth_deg}")
    if not -90 < elevation_deg < 90:
        raise ValueError(f"elevation_deg must be between -90 and 90, not {elevation_deg}")
    side = (1, 0, 0) if np.any(np.cross(up, (1, 0, 0))) else (0, 1, 0)
    right, upward, front = look_axes(np.cross(up, side), up)
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    level = np.cos(azimuth) * front - np.sin(azimuth) * right
    return np.asarray(np.cos(elevation) * level - np.sin(elevation) * upward)


def look_axes(view: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors (3, 3) right, up and forward of a view along `view`.

    Raises ValueError if `up` is parallel to the view.
    """
    forward = np.asarray(view, np.float64) / np.linalg.norm(view)
    right = np.cross(forward, finite_vector("up", up))
    length = np.linalg.norm(right)
    if not length > 1e-9 * np.linalg.norm(up):
        raise ValueError(f"up must not be 0 or parallel to the view, got {np.asarray(up).tolist()}")
    right /= length
    return np.stack([right, np.cross(right, forward), forward])


def create_rays_pinhole(
    fov_deg: float,
    center: ArrayLike,
    eye: ArrayLike,
    up: ArrayLike,
    width_px: int,
    height_px: int,
) -> NDArray[np.float32]:
    """Rays through the pixel centres of a pinhole camera, as Open3D makes them.

    Parameters
    ----------
    fov_deg : float
        Horizontal field of view in degrees.
    center, eye, up : (3,)
        Point looked at, position, and the direction that points up.
    width_px, height_px : int
        Size of the picture.

    Returns
    -------
    array (height_px, width_px, 6) of float32
        Origin and direction; row 0 is the top of the picture. Directions have length 1 along the
        axis of view, so that t is the depth.
    """
    width, height = positive_int("width_px", width_px), positive_int("height_px", height_px)
    camera = Camera(_vector("eye", eye), _vector("center", center), _vector("up", up), fov_deg)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return camera.rays(x, y, width, height).astype(np.float32)


def _vector(name: str, values: ArrayLike) -> Vector:
    x, y, z = finite_vector(name, values).tolist()
    return x, y, z


def _fit(
    points: NDArray[np.float64],
    aspect: float,
    direction: ArrayLike,
    up: Vector,
    fov_deg: float,
    margin: float,
) -> Camera:
    """The nearest camera that looks along `direction` and sees all `points`.

    For one axis of the picture, |x - a| <= s (z - e) for all points bounds the lateral position a
    and the depth e of the eye, with s the slope of the field of view.
    """
    axes = look_axes(direction, up)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, z = axes @ (points - middle).T
    slope = (1 - 2 * margin) * np.tan(np.radians(fov_deg) / 2)
    depths, lateral = [], []
    for values, s in ((x, slope), (y, slope / aspect)):
        low, high = np.max(values - s * z), np.min(values + s * z)
        lateral.append((low + high) / 2)
        depths.append((high - low) / (2 * s))
    eye = middle + np.array([*lateral, min(depths)]) @ axes
    distance = np.linalg.norm(points - eye, axis=1).mean() or 1.0
    return Camera(_vector("eye", eye), _vector("center", eye + distance * axes[2]), up, fov_deg)
