"""Light sources of the integrator "path", and what is in the way between two points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from limitray._arrays import finite_vector
from limitray.camera import Camera
from limitray.sampling import cone
from limitray.sky import ConstantSky, GradientSky, ImageSky, radiance_vector
from limitray.vectors import Array, Frames, Mask, column, dot

Sky = ConstantSky | GradientSky | ImageSky


@dataclass(frozen=True)
class LightSample:
    """Ways (n) to a light: unit directions, distances, colours, and densities per steradian."""

    directions: Array
    distances: Array
    radiance: Array
    density: Array


class Light(Protocol):
    """What the integrator wants of a light."""

    def sample(self, points: Array, square: Array) -> LightSample:
        """Ways from `points` (3, n), drawn by `square` (2, n). A density of 0 is no way."""
        ...

    def meet(self, points: Array, directions: Array) -> tuple[Array, Array, Array]:
        """What rays see of the light: distances (n,), inf for a miss; colours; densities (n,)."""
        ...


class Sun:
    """A distant round light.

    Parameters
    ----------
    direction : (3,)
        Towards the light; need not be unit.
    irradiance : (3,)
        Linear, at least 0. A white surface that faces the light has the colour irradiance / pi.
    angle_deg : float
        Diameter as seen from the scene, above 0 and up to 90 degrees: the softness of shadows.
    """

    def __init__(
        self, direction: ArrayLike, irradiance: ArrayLike = (3.0, 3.0, 3.0), angle_deg: float = 0.53
    ) -> None:
        towards = finite_vector("direction", direction)
        if not towards.any():
            raise ValueError("direction must not be 0")
        if not 0 < angle_deg <= 90:
            raise ValueError(f"angle_deg must be above 0 and up to 90, not {angle_deg}")
        self._towards = column(towards / np.linalg.norm(towards))
        half = np.radians(angle_deg) / 2
        self._depth = float(2 * np.sin(half / 2) ** 2)
        self._density = 1 / (2 * np.pi * self._depth)
        self._radiance = radiance_vector("irradiance", irradiance) / np.float32(
            np.pi * np.sin(half) ** 2
        )

    def sample(self, points: Array, square: Array) -> LightSample:
        """See `Light`."""
        count = points.shape[1]
        axes = Frames(np.broadcast_to(self._towards, (3, count)))
        return LightSample(
            axes.to_world(cone(square, self._depth)),
            np.full(count, np.inf, np.float32),
            np.broadcast_to(self._radiance, (3, count)),
            np.full(count, self._density, np.float32),
        )

    def meet(self, points: Array, directions: Array) -> tuple[Array, Array, Array]:
        """See `Light`; the distance is the largest finite number where the sun is seen."""
        apart = directions - self._towards
        seen = dot(apart, apart) < np.float32(2 * self._depth)
        far = np.where(seen, np.finfo(np.float32).max, np.inf).astype(np.float32)
        return far, seen * self._radiance, seen * np.float32(self._density)


class RectangleLight:
    """A rectangle that shines to one side or to both, and hides what is behind it.

    Parameters
    ----------
    center : (3,)
        Its middle.
    half_u, half_v : (3,)
        From the middle to the middles of two neighbouring sides; at right angles. It shines to the
        side of half_u x half_v.
    radiance : (3,)
        Linear colour as seen from that side, at least 0.
    two_sided : bool
        Whether the other side shines too.
    """

    def __init__(
        self,
        center: ArrayLike,
        half_u: ArrayLike,
        half_v: ArrayLike,
        radiance: ArrayLike = (1.0, 1.0, 1.0),
        two_sided: bool = False,
    ) -> None:
        u, v = finite_vector("half_u", half_u), finite_vector("half_v", half_v)
        lengths = np.linalg.norm(u), np.linalg.norm(v)
        if not (min(lengths) > 0 and abs(u @ v) <= 1e-5 * lengths[0] * lengths[1]):
            raise ValueError(
                f"half_u and half_v must not be 0 and be at right angles, not {u.tolist()} and "
                f"{v.tolist()}"
            )
        self._center = column(finite_vector("center", center))
        self._u, self._v = column(u), column(v)
        self._normal = column(np.cross(u, v) / (lengths[0] * lengths[1]))
        self._area = np.float32(4 * lengths[0] * lengths[1])
        self._scale = column(u / (u @ u)), column(v / (v @ v))
        self._radiance = radiance_vector("radiance", radiance)
        self._two_sided = two_sided

    def sample(self, points: Array, square: Array) -> LightSample:
        """See `Light`."""
        u, v = 2 * square - 1
        way = self._center + u * self._u + v * self._v - points
        distances = np.sqrt(dot(way, way))
        with np.errstate(divide="ignore", invalid="ignore"):
            directions = np.where(distances > 0, way / distances, 0)
        density = self._density(distances, directions)
        return LightSample(
            directions, distances, np.broadcast_to(self._radiance, directions.shape), density
        )

    def meet(self, points: Array, directions: Array) -> tuple[Array, Array, Array]:
        """See `Light`; distances count both sides, the dark one has the colour 0."""
        distances = self.distances(points, directions)
        density = self._density(distances, directions)
        return distances, (density > 0) * self._radiance, density

    def distances(self, points: Array, directions: Array) -> Array:
        """How far rays go until they meet the rectangle: (n,), inf for a miss."""
        offset = self._center - points
        with np.errstate(divide="ignore", invalid="ignore"):
            t = dot(offset, self._normal) / dot(directions, self._normal)
            place = t * directions - offset
            inside = (t > 0) & (np.abs(dot(place, self._scale[0])) <= 1)
            inside &= np.abs(dot(place, self._scale[1])) <= 1
        return np.where(inside, t, np.float32(np.inf)).astype(np.float32)

    def _density(self, distances: Array, directions: Array) -> Array:
        """Of the solid angle, for points of the rectangle; 0 on the dark side and for misses."""
        facing = -dot(directions, self._normal)
        facing = np.abs(facing) if self._two_sided else np.maximum(facing, 0)
        lit = (facing > 0) & np.isfinite(distances)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            density = distances * distances / (facing * self._area)
        return np.where(lit, density, 0).astype(np.float32)


class SkyLight:
    """An environment as a light: images are sampled, smooth skies are left to the surface."""

    def __init__(self, sky: Sky) -> None:
        self._sky = sky
        self.is_sampled = isinstance(sky, ImageSky)

    def sample(self, points: Array, square: Array) -> LightSample:
        """See `Light`; for images only."""
        assert isinstance(self._sky, ImageSky)
        directions, density = self._sky.sample(square)
        far = np.full(points.shape[1], np.inf, np.float32)
        return LightSample(directions, far, self._sky.radiance(directions), density)

    def meet(self, points: Array, directions: Array) -> tuple[Array, Array, Array]:
        """See `Light`; every ray that leaves the scene meets the sky."""
        count = directions.shape[1]
        far = np.full(count, np.finfo(np.float32).max, np.float32)
        if isinstance(self._sky, ImageSky):
            return far, self._sky.radiance(directions), self._sky.density(directions)
        return far, self._sky.radiance(directions), np.zeros(count, np.float32)


class Lighting:
    """All light of a scene: the sky (None: black), suns and rectangles."""

    def __init__(self, sky: Sky | None, lights: Sequence[Sun | RectangleLight]) -> None:
        self._sky = SkyLight(sky or ConstantSky((0, 0, 0)))
        self._suns = [light for light in lights if isinstance(light, Sun)]
        self._rectangles = [light for light in lights if isinstance(light, RectangleLight)]
        self.sampled: list[Light] = [*self._suns, *self._rectangles]
        if self._sky.is_sampled:
            self.sampled.append(self._sky)

    def distant(self, points: Array, directions: Array) -> list[tuple[Array, Array]]:
        """Colours and densities of each light that rays meet which leave the scene."""
        lights: list[Light] = [self._sky, *self._suns]
        return [light.meet(points, directions)[1:] for light in lights]

    def nearest(self, points: Array, directions: Array) -> tuple[Array, Array, Array]:
        """Distances, colours and densities of the rectangles that rays meet first."""
        count = directions.shape[1]
        nearest = np.full(count, np.inf, np.float32)
        colours, density = np.zeros((3, count), np.float32), np.zeros(count, np.float32)
        for light in self._rectangles:
            distances, radiance, found = light.meet(points, directions)
            closer = distances < nearest
            nearest[closer], density[closer] = distances[closer], found[closer]
            colours[:, closer] = radiance[:, closer]
        return nearest, colours, density

    def is_free(self, points: Array, directions: Array, distances: Array, light: Light) -> Mask:
        """Whether no rectangle but `light` itself is in the way."""
        free = np.ones(points.shape[1], bool)
        for other in self._rectangles:
            if other is not light:
                free &= other.distances(points, directions) >= distances
        return free


def studio(camera: Camera) -> tuple[Sky, list[Sun | RectangleLight]]:
    """The light of pictures that name none: a soft sky, a key light and a rim light.

    The key light is at the upper left of the camera; the cool rim light, from behind, draws the
    outline.
    """
    right, up = camera.axes()[0], np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    axes = np.stack([right, up, np.cross(up, right)])
    key = Sun(np.array(KEY_DIRECTION) @ axes, np.pi * np.array(KEY_COLOR), 16)
    rim = Sun(np.array(RIM_DIRECTION) @ axes, np.pi * np.array(RIM_COLOR), 28)
    return GradientSky(up=camera.up), [key, rim]


KEY_DIRECTION, KEY_COLOR = (-0.70, 0.75, -0.40), (1.06, 0.98, 0.87)
RIM_DIRECTION, RIM_COLOR = (0.80, 0.40, 0.75), (0.32, 0.38, 0.48)
"""Directions along the right, up and level forward axes of the camera."""
