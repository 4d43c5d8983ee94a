"""Hits of a batch of rays, as the integrators see them: rows of vectors, misses left out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray.camera import Camera
from limitray.material import CLAY, FOOTPRINT_ATTRIBUTES, PLACE_ATTRIBUTES, finish
from limitray.scene import Scene
from limitray.vectors import Array, Mask, Rows, column, dot, pick, rows


@dataclass(frozen=True)
class Shot:
    """Camera rays through `positions` (n, 2) of a picture, in pixels.

    `lengths` (n,) are those of the directions as `Camera.rays` makes them.
    """

    camera: Camera
    width: int
    height: int
    positions: NDArray[np.float32]
    lengths: NDArray[np.float32]


@dataclass(frozen=True)
class Rays:
    """Unit rays (n): `origins` and `directions` (3, n); hits count beyond `tnear` (n,).

    `pixels` (n,) are the pixels that they work for; random numbers depend on them. Camera rays also
    have `spread`, the two differences (3, n) of directions between neighbouring samples, and
    `shot`, from which a GPU makes them itself.
    """

    origins: Array
    directions: Array
    tnear: Array
    pixels: NDArray[np.uint32]
    spread: tuple[Array, Array] | None = None
    shot: Shot | None = None

    def packed(self) -> NDArray[np.float32]:
        """As the tracer wants them: (n, 6)."""
        packed = np.empty((self.origins.shape[1], 6), np.float32)
        packed[:, :3], packed[:, 3:] = self.origins.T, self.directions.T
        return packed


@dataclass(frozen=True)
class Surface:
    """What surfaces are like at n places.

    `normals` (3, n) are unit and turned towards the viewer, `colors` (3, n) are linear base
    colours; `roughness` (n,) is 0 for a plain diffuse surface, else above 0 and up to 1, with
    `metallic` and `reflectance` (at normal incidence, of a dielectric) beside it.
    """

    normals: Array
    colors: Array
    roughness: Array
    metallic: Array
    reflectance: Array


@dataclass(frozen=True)
class Hits:
    """The hits among n rays: k of them, in the order of the rays.

    `found` (k,) are their rows, `distances` (k,) how far they are; `error` (k,) bounds the distance
    of `points` (3, k) from the surface; `outward` are its normals by the winding of the faces.
    """

    rays: Rays
    found: Rows
    distances: Array
    points: Array
    outward: Array
    uvs: Array
    error: Array
    surface: Surface

    @cached_property
    def directions(self) -> Array:
        """Directions (3, k) of the rays that hit."""
        return pick(self.rays.directions, self.found)

    @cached_property
    def pixels(self) -> NDArray[np.uint32]:
        """Pixels (k,) of the rays that hit."""
        return self.rays.pixels[self.found]

    def leaving(self, chosen: Rows, directions: Array) -> Rays:
        """Rays from the hits `chosen` (m,) along unit `directions` (3, m).

        They start on the viewer's side of the surface by twice the error bound of the hit, and
        count what lies further off than it.
        """
        error = self.error[chosen]
        starts = pick(self.points, chosen) + 2 * error * pick(self.surface.normals, chosen)
        return Rays(starts, directions, error, self.pixels[chosen])


def cast(scene: Scene, rays: Rays, beyond: Array | None = None) -> Hits:
    """The closest hits; with `beyond` (n,), only those nearer than that."""
    tfar = np.inf if beyond is None else beyond
    names: tuple[str, ...] = ("points", "t_error")
    if not scene.is_plain:
        names += PLACE_ATTRIBUTES + (() if rays.spread is None else FOOTPRINT_ATTRIBUTES)
    answers = _answers(scene, rays, tfar, names)
    found = np.flatnonzero(np.isfinite(answers["t_hit"]))
    if len(found) < len(rays.pixels):
        answers = {name: np.take(values, found, axis=0) for name, values in answers.items()}
    outward = rows(answers["primitive_normals"])
    return Hits(
        rays=rays,
        found=found,
        distances=answers["t_hit"],
        points=rows(answers["points"]),
        outward=outward,
        uvs=rows(answers["primitive_uvs"]),
        error=answers["t_error"],
        surface=_surface(scene, rays, found, outward, answers),
    )


def _answers(
    scene: Scene, rays: Rays, tfar: Array | float, names: tuple[str, ...]
) -> dict[str, NDArray[Any]]:
    shot = rays.shot
    if shot is None or scene.gpu_device is None:
        return scene.cast_rays(rays.packed(), rays.tnear, tfar, names)
    # Depths, as the GPU's own rays count them, and back to distances.
    answers = scene.cast_camera_rays(
        shot.camera,
        shot.width,
        shot.height,
        shot.positions,
        rays.tnear / shot.lengths,
        tfar / shot.lengths,
        names,
    )
    return answers | {key: answers[key] * shot.lengths for key in ("t_hit", "t_error")}


def occluded(scene: Scene, rays: Rays, tfar: Array | float = np.inf) -> Mask:
    """Whether anything is in the way of each ray, up to `tfar`."""
    return scene.test_occlusions(rays.packed(), rays.tnear, tfar)


def _surface(
    scene: Scene, rays: Rays, found: Rows, outward: Array, answers: dict[str, NDArray[Any]]
) -> Surface:
    directions = pick(rays.directions, found)
    normals = outward * -np.copysign(np.float32(1), dot(outward, directions))
    count = outward.shape[1]
    zeros = np.zeros(count, np.float32)
    if not scene.has_materials:
        clay = np.broadcast_to(column(CLAY), (3, count))
        return Surface(normals, clay, zeros, zeros, zeros)
    differentials = None
    if rays.spread is not None and not scene.is_plain:
        across, down = (pick(d, found).T.astype(np.float64) for d in rays.spread)
        differentials = directions.T.astype(np.float64), across, down
    found_finish = finish(scene, answers, differentials)
    return Surface(
        normals,
        rows(found_finish.colors),
        found_finish.roughness,
        found_finish.metallic,
        found_finish.reflectance,
    )
