"""How surfaces reflect: Lambert, and one rough dielectric or metal (GGX), for batches of hits.

The rough material is a layer over a diffuse base. Its microfacets follow GGX with height-correlated
masking (Heitz 2014, "Understanding the Masking-Shadowing Function"), drawn as seen from the viewer
(Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps"), with Schlick's
Fresnel term. What single scattering loses is given back by a factor (Turquin 2019, "Practical
multiple scattering compensation for microfacet models"), and the base gets what the layer lets
through: under a uniform sky a white material of any roughness is white.

Local vectors have the normal as their z axis.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from limitray.hits import Surface
from limitray.sampling import cosine_hemisphere
from limitray.vectors import Array, Frames, Rows, dot, normalized, pick

TABLE_SIZE = 32
_TABLE_SAMPLES = (8, 128)
_INVERSE_PI = np.float32(1 / np.pi)


class Bsdf:
    """Reflection at hits (n), seen along `directions` (3, n) that run from the viewer to them."""

    def __init__(self, surface: Surface, directions: Array) -> None:
        self._frames = Frames(surface.normals)
        self._colors = surface.colors
        self._rough = np.flatnonzero(surface.roughness > 0)
        if len(self._rough):
            viewer = -self._frames.to_local(directions)
            self._layer = _Layer(surface, self._rough, pick(viewer, self._rough))

    def evaluate(self, towards: Array) -> tuple[Array, Array]:
        """For unit vectors (3, n) to a light: reflectance times cosine (3, n), density of `sample`.

        Both are 0 below the surface.
        """
        local = self._frames.to_local(towards)
        cosines = np.maximum(local[2], 0)
        density = cosines * _INVERSE_PI
        reflected = self._colors * density
        if len(self._rough):
            rows = self._rough
            reflected[:, rows], density[rows] = self._layer.evaluate(pick(local, rows))
        return reflected, density

    def sample(self, square: Array, choice: Array) -> tuple[Array, Array, Array]:
        """Draws a way to go on: directions (3, n), reflectance x cosine / density, density.

        `square` (2, n) and `choice` (n,) are uniform in [0, 1). A density of 0 is no way.
        """
        local = cosine_hemisphere(square)
        density = local[2] * _INVERSE_PI
        weights = self._colors.copy()
        if len(self._rough):
            rows = self._rough
            drawn = self._layer.sample(pick(square, rows), choice[rows], pick(local, rows))
            reflected, found = self._layer.evaluate(drawn)
            local[:, rows], density[rows] = drawn, found
            weights[:, rows] = np.where(found > 0, reflected / np.maximum(found, 1e-20), 0)
        return self._frames.to_world(local), weights, density


class _Layer:
    """The rough material at some hits, in local vectors; `viewer` (3, n) points to the viewer."""

    def __init__(self, surface: Surface, rows: Rows, viewer: Array) -> None:
        roughness, metallic = surface.roughness[rows], surface.metallic[rows]
        colors = pick(surface.colors, rows)
        self._alpha = roughness * roughness
        self._viewer = viewer
        self._viewer[2] = np.maximum(self._viewer[2], np.float32(1e-4))
        self._coat = surface.reflectance[rows]
        self._metal = colors
        scale, offset = _albedo_parts(self._viewer[2], roughness)
        lost = 1 / (scale + offset) - 1
        self._coat_share = (1 - metallic) * (1 + self._coat * lost)
        self._metal_share = metallic * (1 + self._metal * lost)
        coat = self._coat_share * (self._coat * scale + offset)
        metal = self._metal_share * (self._metal * scale + offset)
        self._base = colors * (1 - metallic - coat)
        layer = coat + metal.mean(axis=0)
        share = layer / (layer + self._base.mean(axis=0))
        self._layer_share = np.clip(share, 0.1, 1).astype(np.float32)

    def evaluate(self, local: Array) -> tuple[Array, Array]:
        """See `Bsdf.evaluate`."""
        half = normalized(local + self._viewer)
        cosine = np.maximum(local[2], 0)
        distribution = _ggx(half, self._alpha)
        seen, lit = self._masked(self._viewer[2]), self._masked(cosine)
        masking = 0.5 / (cosine * seen + self._viewer[2] * lit)
        rise = _fifth(1 - dot(half, local))
        fresnel = self._metal_share * (self._metal + (1 - self._metal) * rise)
        fresnel += self._coat_share * (self._coat + (1 - self._coat) * rise)
        mirrored = fresnel * (distribution * masking)
        density = self._layer_share * distribution / (2 * (self._viewer[2] + seen))
        density += (1 - self._layer_share) * cosine * _INVERSE_PI
        reflected = (mirrored + self._base * _INVERSE_PI) * cosine
        return reflected, np.where(local[2] > 0, density, 0).astype(np.float32)

    def sample(self, square: Array, choice: Array, diffuse: Array) -> Array:
        """Directions (3, n): mirrored at a visible facet, or those of `diffuse` for the base."""
        mirrored = _mirrored(self._viewer, _visible_facets(square, self._viewer, self._alpha))
        return np.where(choice < self._layer_share, mirrored, diffuse)

    def _masked(self, cosine: Array) -> Array:
        """sqrt(alpha^2 + (1 - alpha^2) cosine^2), Smith's masking of GGX but for a factor."""
        square = self._alpha * self._alpha
        return np.asarray(np.sqrt(square + (1 - square) * cosine * cosine))


def _ggx(half: Array, alpha: Array) -> Array:
    """Density of facets with normals `half` (3, n)."""
    x, y, z = half
    square = alpha * alpha
    spread = square * z * z + x * x + y * y
    found: Array = square * _INVERSE_PI / np.maximum(spread * spread, 1e-20)
    return found


def _fifth(x: Array) -> Array:
    square = x * x
    return square * square * x


def _mirrored(viewer: Array, half: Array) -> Array:
    return 2 * dot(viewer, half) * half - viewer


def _visible_facets(square: Array, viewer: Array, alpha: Array) -> Array:
    """Normals of facets, as often as the viewer sees them (Dupuy and Benyoub 2023)."""
    stretched = normalized(np.stack([alpha * viewer[0], alpha * viewer[1], viewer[2]]))
    angle = np.float32(2 * np.pi) * square[0]
    z = (1 - square[1]) * (1 + stretched[2]) - stretched[2]
    radius = np.sqrt(np.clip(1 - z * z, 0, 1))
    x, y, z = np.stack([radius * np.cos(angle), radius * np.sin(angle), z]) + stretched
    return normalized(np.stack([alpha * x, alpha * y, np.maximum(z, 1e-6)]))


def _albedo_parts(cosine: Array, roughness: Array) -> tuple[Array, Array]:
    """Scale and offset, each (n,), of single scattering: its albedo is f0 * scale + offset."""
    table = _albedo_table()
    x, y = np.sqrt(cosine) * (TABLE_SIZE - 1), roughness * (TABLE_SIZE - 1)
    i = np.minimum(x.astype(np.int32), TABLE_SIZE - 2)
    j = np.minimum(y.astype(np.int32), TABLE_SIZE - 2)
    s, t = x - i, y - j
    lower = table[:, i, j] + s * (table[:, i + 1, j] - table[:, i, j])
    upper = table[:, i, j + 1] + s * (table[:, i + 1, j + 1] - table[:, i, j + 1])
    scale, offset = lower + t * (upper - lower)
    return scale, offset


@cache
def _albedo_table() -> NDArray[np.float32]:
    """Scale and offset (2, k, k) by the root of the cosine of the viewer, and by roughness."""
    steps = np.linspace(0, 1, TABLE_SIZE, dtype=np.float32)
    columns = [_albedo_column(np.maximum(steps, 0.02), max(r, 0.01) ** 2) for r in steps.tolist()]
    return np.stack(columns, axis=2)


def _albedo_column(roots: Array, alpha: float) -> Array:
    """Scale and offset (2, k) for one alpha, by the roots (k,) of the viewer's cosine.

    The mean over visible facets of masking times Fresnel, by a regular grid of points; half a turn
    is enough, and the rare steep facets want the finer steps.
    """
    turns, heights = ((np.arange(n, dtype=np.float32) + 0.5) / n for n in _TABLE_SAMPLES)
    root, u, v = (a.ravel() for a in np.meshgrid(roots, turns / 2, heights, indexing="ij"))
    cosine = root * root
    viewer = np.stack([np.sqrt(1 - cosine * cosine), np.zeros_like(cosine), cosine])
    half = _visible_facets(np.stack([u, v]), viewer, np.full_like(cosine, alpha))
    light = np.maximum(_mirrored(viewer, half)[2], 0)
    square = np.float32(alpha * alpha)
    seen, lit = (np.sqrt(square + (1 - square) * c * c) for c in (cosine, light))
    masking = light * (cosine + seen) / np.maximum(light * seen + cosine * lit, 1e-20)
    fifth = _fifth(1 - dot(half, viewer))
    parts = np.stack([masking * (1 - fifth), masking * fifth])
    return np.asarray(parts.reshape(2, len(roots), -1).mean(axis=2))
