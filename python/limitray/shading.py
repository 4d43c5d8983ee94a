"""Integrators: the light that camera rays bring back, for batches of hits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray.camera import Camera
from limitray.image import srgb_to_linear
from limitray.sampling import Array, cosine_hemisphere, disk, tangent_frames
from limitray.scene import Scene

INTEGRATORS = ("ao", "facing", "normal", "uv")
AO_RAYS = 4
"""Rays to the sky for each camera sample of the integrator "ao"."""

CLAY = np.array([0.80, 0.77, 0.74])
SKY_ZENITH = np.array([0.95, 1.00, 1.08])
SKY_HORIZON = np.array([0.72, 0.70, 0.68])
SKY_GROUND = np.array([0.30, 0.27, 0.25])
KEY_LIGHT = np.array([1.05, 1.00, 0.92])
KEY_DIRECTION = (-0.55, 0.75, -0.45)
"""Towards the key light, along the right, up and forward axes of the camera."""
KEY_SPREAD = 0.16
"""Radius of the key light seen from distance 1: how soft its shadows are."""
CHECKS = 8
"""Checks a side of a face in the integrator "uv"."""


@dataclass(frozen=True)
class Hits:
    """Hits of camera rays, misses left out; one row each.

    `normals` are turned towards the viewer, `error` bounds the distance of `points` from the
    surface, and `sample` is the number of the sample of each pixel.
    """

    points: Array
    normals: Array
    outward: Array
    directions: Array
    uvs: Array
    error: Array

    @classmethod
    def from_cast(cls, rays: Array, hits: dict[str, NDArray[Any]]) -> Hits:
        """The hits among the answers of `cast_rays` (with "points" and "t_error")."""
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
        )


def sample_dimensions(integrator: str) -> int:
    """Random numbers each camera sample takes: two for the pixel, the rest for `shade`."""
    return 2 + (2 * AO_RAYS + 2 if integrator == "ao" else 0)


def rays_per_sample(integrator: str) -> int:
    """Rays traced for each camera sample that hits something."""
    return 1 + (AO_RAYS + 1 if integrator == "ao" else 0)


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
    """A clay-like diffuse surface under a sky that is dark below, and one soft key light."""
    axes = camera.axes()
    light = np.zeros_like(hits.points)
    for k in range(AO_RAYS):
        directions = cosine_hemisphere(samples[:, 2 * k : 2 * k + 2], hits.normals)
        free = ~_occluded(scene, hits, directions)
        light += free[:, np.newaxis] * sky(directions @ axes[1]) / AO_RAYS

    towards = np.asarray(KEY_DIRECTION) @ axes
    towards /= np.linalg.norm(towards)
    tangent, bitangent = tangent_frames(towards[np.newaxis])
    xy = KEY_SPREAD * disk(samples[:, -2:])
    directions = towards + xy[:, :1] * tangent + xy[:, 1:] * bitangent
    directions /= np.linalg.norm(directions, axis=1)[:, np.newaxis]
    cosines = np.maximum(0, (directions * hits.normals).sum(axis=1))
    lit = cosines * ~_occluded(scene, hits, directions)
    colours: Array = CLAY * (0.62 * light + 0.62 * lit[:, np.newaxis] * KEY_LIGHT)
    return colours


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
