"""Integrators without bounces: what camera rays show, for batches of hits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from limitray.camera import Camera
from limitray.hits import Hits, occluded
from limitray.image import srgb_to_linear
from limitray.light import KEY_COLOR, KEY_DIRECTION, RIM_COLOR, RIM_DIRECTION
from limitray.sampling import Sampler, cosine_hemisphere, disk
from limitray.scene import Scene
from limitray.sky import GradientSky
from limitray.vectors import Array, Frames, column, dot, normalized

INTEGRATORS = ("ao", "facing", "normal", "uv", "path")
CHECKS = 8
"""Checks a side of a face in the integrator "uv"."""

AO_RAYS = 4
"""Rays to the sky for each camera sample of the integrator "ao"."""
GOLDEN = (np.sqrt(5) - 1) / 2

GLOSS, GLOSS_EXPONENT = 0.10, 28.0
JITTER, SKY, LIGHT = 0, 1, 2
"""Purposes of random numbers: the place in the pixel, the way to the sky, and to the lights."""


@dataclass(frozen=True)
class Lamp:
    """A distant round light of the integrator "ao".

    `direction` points towards it, along the right, up and level forward axes of the camera;
    `radius` is its size seen from distance 1, which makes its shadows soft.
    """

    direction: tuple[float, float, float]
    color: tuple[float, float, float]
    radius: float


LAMPS = (Lamp(KEY_DIRECTION, KEY_COLOR, 0.14), Lamp(RIM_DIRECTION, RIM_COLOR, 0.25))
"""The key light from the upper left, and a cool one from behind that draws the outline."""


def shade(integrator: str, scene: Scene, camera: Camera, hits: Hits, sampler: Sampler) -> Array:
    """Linear colours (3, n) of `hits` for any integrator but "path"."""
    facing = np.clip(-dot(hits.surface.normals, hits.directions), 0, 1)
    if integrator == "facing":
        return _linear(np.repeat(facing[np.newaxis], 3, axis=0))
    if integrator == "normal":
        return _linear(0.5 + 0.5 * hits.outward)
    if integrator == "uv":
        return _checks(hits, facing)
    return _clay(scene, camera, hits, sampler)


def _checks(hits: Hits, facing: Array) -> Array:
    """A checker in (u, v): u adds red, v adds green; darker where the surface turns away."""
    u, v = hits.uvs
    odd = (np.floor(u * CHECKS) + np.floor(v * CHECKS)) % 2
    colours = np.stack([0.25 + 0.65 * u, 0.25 + 0.65 * v, 0.75 - 0.3 * (u + v) / 2])
    return _linear(colours * ((0.55 + 0.45 * odd) * (0.35 + 0.65 * facing)))


def _linear(colours: Array) -> Array:
    return srgb_to_linear(colours).astype(np.float32)


def _clay(scene: Scene, camera: Camera, hits: Hits, sampler: Sampler) -> Array:
    """Clay under a sky that is dark below, a soft key light and a rim light."""
    normals, base = hits.surface.normals, hits.surface.colors
    colours = base * _skylight(scene, camera, hits, sampler.square(SKY, hits.pixels))
    right, up = camera.axes()[0], np.asarray(camera.up) / np.linalg.norm(camera.up)
    axes = np.stack([right, up, np.cross(up, right)])
    for k, lamp in enumerate(LAMPS):
        square = sampler.square(LIGHT + k, hits.pixels)
        towards = _towards(np.asarray(lamp.direction) @ axes, lamp.radius, square)
        cosines = dot(towards, normals)
        lit = np.flatnonzero(cosines > 0)
        lit = lit[~occluded(scene, hits.leaving(lit, towards[:, lit]))]
        halfway = normalized(towards[:, lit] - hits.directions[:, lit])
        gloss = GLOSS * np.abs(dot(halfway, normals[:, lit])) ** GLOSS_EXPONENT
        colours[:, lit] += (base[:, lit] * cosines[lit] + gloss) * column(lamp.color)
    return colours


def _skylight(scene: Scene, camera: Camera, hits: Hits, square: Array) -> Array:
    """Mean radiance (3, n) of the sky as far as it is seen from the hits, by cosine."""
    sky, frames = GradientSky(up=camera.up), Frames(hits.surface.normals)
    everywhere = np.arange(len(hits.found))
    light = np.zeros_like(hits.points)
    for k in range(AO_RAYS):
        spread = (square + np.array([[k / AO_RAYS], [k * GOLDEN]], np.float32)) % 1
        directions = frames.to_world(cosine_hemisphere(spread))
        free = ~occluded(scene, hits.leaving(everywhere, directions))
        light += free * sky.radiance(directions) / AO_RAYS
    return light


def _towards(middle: NDArray[np.float64], radius: float, square: Array) -> Array:
    """Unit directions (3, n) around `middle` (3,), within a cone of slope `radius`."""
    axis = column(middle / np.linalg.norm(middle))
    x, y = radius * disk(square)
    return normalized(Frames(axis).to_world(np.stack([x, y, np.ones_like(x)])))
