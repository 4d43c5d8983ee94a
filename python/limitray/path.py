"""The integrator "path": light on all its ways over surfaces, by path tracing in batches.

All paths of a tile go on together: one call of the tracer for their next hits, and one for each
light for what shadows them. Light is found in two ways, by aiming at it and by following what the
surface reflects; the power heuristic weighs them (Veach 1997, "Robust Monte Carlo Methods for Light
Transport Simulation"). Positions and normals both are those of the limit surface, so no correction
for shading normals is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from limitray.bsdf import Bsdf
from limitray.hits import Hits, Rays, cast, occluded
from limitray.light import Light, Lighting
from limitray.sampling import Sampler
from limitray.scene import Scene
from limitray.vectors import Array, Mask, Rows, pick

ROULETTE_BOUNCE = 3
"""The first bounce at which dark paths are ended at random."""
PURPOSES = 32
"""Most kinds of random numbers a bounce: 30 lights, the way on, and one for its choice."""


@dataclass(frozen=True)
class First:
    """What the camera rays (n) met: whether anything, its base colour and its normal (3, n)."""

    found: Mask
    colors: Array
    normals: Array


@dataclass(frozen=True)
class _Load:
    """What paths carry: the rows of their camera rays, and the factors (3, n) on what they find."""

    rows: Rows
    weights: Array

    def add(self, light: Array, chosen: Rows, found: Array) -> None:
        """Adds what the paths `chosen` (k,) find, (3, k), to the light of the camera rays."""
        rows = self.rows[chosen]
        for component, weight, value in zip(light, pick(self.weights, chosen), found):
            component[rows] += weight * value


@dataclass(frozen=True)
class _Paths:
    """Paths (n) on their way: their rays, and the densities (n,) with which these were drawn."""

    rays: Rays
    load: _Load
    density: Array


class PathIntegrator:
    """Follows camera rays over up to `max_depth` surfaces.

    `check` is called between batches; it raises to end the work.
    """

    def __init__(
        self,
        scene: Scene,
        lighting: Lighting,
        max_depth: int,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self._scene, self._lighting, self._max_depth = scene, lighting, max_depth
        self._check = check

    def trace(self, rays: Rays, sampler: Sampler) -> tuple[Array, First]:
        """Light (3, n) that reaches the camera from surfaces and rectangles, and what was met."""
        count = len(rays.pixels)
        light = np.zeros((3, count), np.float32)
        first = First(np.zeros(count, bool), np.zeros_like(light), np.zeros_like(light))
        load = _Load(np.arange(count), np.ones_like(light))
        paths = _Paths(rays, load, np.full(count, np.inf, np.float32))
        for depth in range(self._max_depth + 1):
            self._check()
            hits = self._advance(paths, light, first if depth == 0 else None)
            if depth == self._max_depth or len(hits.found) == 0:
                break
            bsdf = Bsdf(hits.surface, hits.directions)
            kept = _Load(paths.load.rows[hits.found], pick(paths.load.weights, hits.found))
            for number, source in enumerate(self._lighting.sampled):
                self._check()
                square = sampler.square(1 + PURPOSES * depth + number, hits.pixels)
                self._aim(source, hits, bsdf, kept, square, light)
            paths = self._scatter(hits, bsdf, kept, sampler, depth)
        return light, first

    def _advance(self, paths: _Paths, light: Array, first: First | None) -> Hits:
        """Casts the rays, adds the light that they run into, and returns their hits.

        Camera rays that leave the scene bring nothing: the sky behind it is no part of the picture.
        """
        rays = paths.rays
        nearest, radiance, density = self._lighting.nearest(rays.origins, rays.directions)
        hits = cast(self._scene, rays, nearest)
        left = np.isinf(nearest)
        blocked = ~left
        left[hits.found], blocked[hits.found] = False, False
        met, away = np.flatnonzero(blocked), np.flatnonzero(left)
        weight = _heuristic(paths.density[met], density[met])
        paths.load.add(light, met, pick(radiance, met) * weight)
        if first is not None:
            first.found[hits.found] = first.found[met] = True
            first.colors[:, hits.found] = hits.surface.colors
            first.colors[:, met] = np.minimum(radiance[:, met], 1)
            first.normals[:, hits.found] = hits.surface.normals
            return hits
        seen = self._lighting.distant(pick(rays.origins, away), pick(rays.directions, away))
        for radiance, density in seen:
            paths.load.add(light, away, radiance * _heuristic(paths.density[away], density))
        return hits

    def _aim(
        self, source: Light, hits: Hits, bsdf: Bsdf, load: _Load, square: Array, light: Array
    ) -> None:
        """Adds what comes straight from a light."""
        way = source.sample(hits.points, square)
        reflected, density = bsdf.evaluate(way.directions)
        usable = (density > 0) & (way.density > 0)
        usable &= self._lighting.is_free(hits.points, way.directions, way.distances, source)
        lit = np.flatnonzero(usable)
        shadow = hits.leaving(lit, pick(way.directions, lit))
        lit = lit[~occluded(self._scene, shadow, way.distances[lit])]
        weight = _heuristic(way.density[lit], density[lit]) / way.density[lit]
        load.add(light, lit, pick(reflected, lit) * pick(way.radiance, lit) * weight)

    def _scatter(self, hits: Hits, bsdf: Bsdf, load: _Load, sampler: Sampler, depth: int) -> _Paths:
        """The next rays of the paths that go on."""
        purpose = 1 + PURPOSES * depth + PURPOSES - 2
        choice, chance = sampler.square(purpose + 1, hits.pixels)
        directions, factors, density = bsdf.sample(sampler.square(purpose, hits.pixels), choice)
        weights = load.weights * factors
        strength = weights.max(axis=0)
        survival = np.ones_like(strength)
        if depth >= ROULETTE_BOUNCE:
            survival = np.clip(strength, 0.05, 1)
        on = np.flatnonzero((density > 0) & (strength > 0) & (chance < survival))
        return _Paths(
            hits.leaving(on, pick(directions, on)),
            _Load(load.rows[on], pick(weights, on) / survival[on]),
            density[on],
        )


def _heuristic(own: Array, other: Array) -> Array:
    """Weight of a way that was drawn with density `own`; inf: it can be found in no other way."""
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isinf(own), 0, other / own)
    return np.asarray(1 / (1 + ratio * ratio), np.float32)
