"""Integrators: the light that camera rays bring back, for batches of hits."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray.camera import Camera
from limitray.image import srgb_to_linear
from limitray.material import BASE_COLOR_ATTRIBUTES, CLAY, Footprint, base_colors
from limitray.sampling import Array, cosine_hemisphere, disk, tangent_frames
from limitray.scene import Scene

INTEGRATORS = ("ao", "facing", "normal", "uv")
CHECKS = 8
"""Checks a side of a face in the integrator "uv"."""

AO_RAYS = 4
"""Rays to the sky for each camera sample of the integrator "ao"."""
GOLDEN = (np.sqrt(5) - 1) / 2

GLOSS, GLOSS_EXPONENT = 0.10, 28.0
SKY_ZENITH = np.array([0.44, 0.49, 0.57])
SKY_HORIZON = np.array([0.28, 0.28, 0.29])
SKY_GROUND = np.array([0.09, 0.08, 0.075])


@dataclass(frozen=True)
class Light:
    """A distant round light.

    `direction` points towards it, along the right, up and level forward axes of the camera;
    `radius` is its size seen from distance 1, which makes its shadows soft.
    """

    direction: tuple[float, float, float]
    colour: tuple[float, float, float]
    radius: float


LIGHTS = (
    Light((-0.70, 0.75, -0.40), (1.06, 0.98, 0.87), 0.14),
    Light((0.80, 0.40, 0.75), (0.32, 0.38, 0.48), 0.25),
)
"""The key light from the upper left, and a cool one from behind that draws the outline."""


@dataclass(frozen=True)
class Hits:
    """Hits of camera rays, misses left out; one row each.

    `normals` are turned towards the viewer, `error` bounds the distance of `points` from the
    surface, and `base_colors` are linear.
    """

    points: Array
    normals: Array
    outward: Array
    directions: Array
    uvs: Array
    error: Array
    base_colors: Array

    @classmethod
    def from_cast(
        cls,
        scene: Scene,
        rays: Array,
        hits: dict[str, NDArray[Any]],
        spread: tuple[Array, Array],
    ) -> Hits:
        """The hits among the answers of `cast_rays` for `hit_attributes`.

        `spread` are the differences (3,) of ray directions between neighbouring samples.
        """
        found = np.isfinite(hits["t_hit"])
        lengths = np.linalg.norm(rays[found, 3:], axis=1)
        directions = rays[found, 3:] / lengths[:, np.newaxis]
        outward = hits["primitive_normals"][found].astype(np.float64)
        away = (outward * directions).sum(axis=1) > 0
        return cls(
            points=hits["points"][found].astype(np.float64),
            normals=np.where(away[:, np.newaxis], -outward, outward),
            outward=outward,
            directions=directions,
            uvs=hits["primitive_uvs"][found].astype(np.float64),
            error=hits["t_error"][found] * lengths,
            base_colors=_base_colors(scene, rays[found], found, hits, spread),
        )

    def __getitem__(self, rows: NDArray[np.intp]) -> Hits:
        """The hits of the given rows."""
        return Hits(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})


def hit_attributes(scene: Scene) -> tuple[str, ...]:
    """What `Hits.from_cast` wants of `cast_rays`."""
    return ("points", "t_error", *(BASE_COLOR_ATTRIBUTES if scene.has_materials else ()))


def _base_colors(
    scene: Scene,
    rays: Array,
    found: NDArray[np.bool_],
    hits: dict[str, NDArray[Any]],
    spread: tuple[Array, Array],
) -> Array:
    if not scene.has_materials:
        return np.broadcast_to(CLAY, (len(rays), 3))
    part = {name: values[found] for name, values in hits.items()}
    return base_colors(scene, part, Footprint.of_rays(part, rays[:, 3:], *spread))


def sample_dimensions(integrator: str) -> int:
    """Random numbers each camera sample takes: two for the pixel, the rest for `shade`."""
    return 4 + 2 * len(LIGHTS) if integrator == "ao" else 2


def shade(integrator: str, scene: Scene, camera: Camera, hits: Hits, samples: Array) -> Array:
    """Linear colours (n, 3) of `hits`; `samples` (n, k) are the random numbers left to use."""
    if integrator == "facing":
        return _grey(-(hits.normals * hits.directions).sum(axis=1))
    if integrator == "normal":
        return srgb_to_linear(0.5 + 0.5 * hits.outward)
    if integrator == "uv":
        return _checks(hits)
    return _clay(scene, camera, hits, samples)


def _grey(values: Array) -> Array:
    return np.repeat(srgb_to_linear(np.clip(values, 0, 1))[:, np.newaxis], 3, axis=1)


def _checks(hits: Hits) -> Array:
    """A checker in (u, v): u adds red, v adds green; darker where the surface turns away."""
    u, v = hits.uvs.T
    odd = (np.floor(u * CHECKS) + np.floor(v * CHECKS)) % 2
    colours = np.stack([0.25 + 0.65 * u, 0.25 + 0.65 * v, 0.75 - 0.3 * (u + v) / 2], axis=1)
    facing = -(hits.normals * hits.directions).sum(axis=1)
    light = (0.55 + 0.45 * odd) * (0.35 + 0.65 * np.clip(facing, 0, 1))
    return srgb_to_linear(colours * light[:, np.newaxis])


def _clay(scene: Scene, camera: Camera, hits: Hits, samples: Array) -> Array:
    """Clay under a sky that is dark below, a soft key light and a rim light."""
    right, up = camera.axes()[0], np.asarray(camera.up) / np.linalg.norm(camera.up)
    colours = hits.base_colors * _skylight(scene, hits, samples[:, :2], up)
    for k, light in enumerate(LIGHTS):
        towards = np.asarray(light.direction) @ np.stack([right, up, np.cross(up, right)])
        directions = _towards(towards, light.radius, samples[:, 2 * k + 2 : 2 * k + 4])
        cosines = (directions * hits.normals).sum(axis=1)
        lit = np.flatnonzero(cosines > 0)
        lit = lit[~_occluded(scene, hits[lit], directions[lit])]
        halfway = directions[lit] - hits.directions[lit]
        halfway /= np.linalg.norm(halfway, axis=1)[:, np.newaxis]
        gloss = GLOSS * np.abs((halfway * hits.normals[lit]).sum(axis=1)) ** GLOSS_EXPONENT
        reflected = hits.base_colors[lit] * cosines[lit, np.newaxis] + gloss[:, np.newaxis]
        colours[lit] += reflected * light.colour
    return colours


def _skylight(scene: Scene, hits: Hits, samples: Array, up: Array) -> Array:
    """Mean radiance (n, 3) of the sky as far as it is seen from the hits, by cosine."""
    light = np.zeros_like(hits.points)
    for k in range(AO_RAYS):
        spread = (samples + np.array([k / AO_RAYS, k * GOLDEN])) % 1
        directions = cosine_hemisphere(spread, hits.normals)
        free = ~_occluded(scene, hits, directions)
        light += free[:, np.newaxis] * sky(directions @ up) / AO_RAYS
    return light


def _towards(middle: Array, radius: float, samples: Array) -> Array:
    """Unit directions (n, 3) around `middle` (3,), within a cone of slope `radius`."""
    axis = middle / np.linalg.norm(middle)
    tangent, bitangent = tangent_frames(axis[np.newaxis])
    xy = radius * disk(samples)
    directions = axis + xy[:, :1] * tangent + xy[:, 1:] * bitangent
    return np.asarray(directions / np.linalg.norm(directions, axis=1)[:, np.newaxis])


def sky(height: Array) -> Array:
    """Radiance (n, 3) of the sky, by the sine (n,) of the elevation."""
    above = np.sqrt(np.clip(height, 0, 1))[:, np.newaxis]
    below = np.sqrt(np.clip(-height, 0, 1))[:, np.newaxis]
    return np.asarray(
        SKY_HORIZON + above * (SKY_ZENITH - SKY_HORIZON) + below * (SKY_GROUND - SKY_HORIZON)
    )


def _occluded(scene: Scene, hits: Hits, directions: Array) -> NDArray[np.bool_]:
    """Whether anything lies in `directions` (n, 3) from the hits.

    The rays start on the viewer's side of the surface by twice the error bound of the hit, and
    count what lies further off than it.
    """
    starts = hits.points + (2 * hits.error)[:, np.newaxis] * hits.normals
    rays = np.concatenate([starts, directions], axis=1).astype(np.float32)
    return scene.test_occlusions(rays, tnear=hits.error)
