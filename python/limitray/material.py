"""Materials: a base colour, from a constant, a primvar or an image texture, and a finish."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limitray.texture import Texture

if TYPE_CHECKING:
    from limitray.scene import Scene

Array = NDArray[np.float64]

CLAY = (0.70, 0.61, 0.535)
"""Linear base colour of surfaces without a material."""


@dataclass(frozen=True, eq=False)
class Material:
    """What a surface is made of.

    Without a roughness it is plain diffuse. With one it is a rough dielectric over a diffuse base,
    or a rough metal; the integrator "path" shows that.

    Parameters
    ----------
    base_color : (3,)
        Linear colour where neither of the following gives one.
    texture : Texture, optional
        An image, looked up at the primvar `texture_primvar`.
    texture_primvar : str
        Primvar with the texture coordinates (two components).
    color_primvar : str, optional
        Primvar with linear colours (three components); a texture goes before it.
    roughness : float, optional
        0.05 (nearly a mirror) to 1.
    metallic : float
        0 (dielectric) to 1 (metal, with the base colour as its reflectance).
    ior : float
        Index of refraction of the dielectric, 1 to 4.

    Raises
    ------
    ValueError
        A number is out of its range.
    """

    base_color: tuple[float, float, float] = CLAY
    texture: Texture | None = None
    texture_primvar: str = "st"
    color_primvar: str | None = None
    roughness: float | None = None
    metallic: float = 0.0
    ior: float = 1.5

    def __post_init__(self) -> None:
        for name, low, high in (("roughness", 0.05, 1), ("metallic", 0, 1), ("ior", 1, 4)):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name} must be {low} to {high}, not {value}")

    @property
    def is_plain(self) -> bool:
        """Whether the base colour is the same everywhere."""
        return self.texture is None and self.color_primvar is None


@dataclass(frozen=True, eq=False)
class MaterialSet:
    """The materials of one mesh: `faces` names one for each face; None: the first for all."""

    materials: tuple[Material, ...] = (Material(),)
    faces: NDArray[np.intp] | None = None


@dataclass(frozen=True)
class Footprint:
    """How far apart the rays of neighbouring pixels hit: differences of the points (n, 3)."""

    d_dx: Array
    d_dy: Array

    @classmethod
    def of_rays(
        cls, hits: dict[str, NDArray[Any]], directions: Array, d_dx: Array, d_dy: Array
    ) -> Footprint:
        """Where rays from one eye hit the tangent planes of the hits of `directions` (n, 3).

        `d_dx` and `d_dy` (3,) or (n, 3) are the differences of the directions of neighbouring
        pixels (ray differentials: Igehy 1999, "Tracing Ray Differentials").
        """
        normals = hits["primitive_normals"].astype(np.float64)
        t = hits["t_hit"].astype(np.float64)[:, np.newaxis]
        facing = (directions * normals).sum(axis=1, keepdims=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = [
                t * (d - directions * ((d * normals).sum(axis=1, keepdims=True) / facing))
                for d in (d_dx, d_dy)
            ]
        return cls(*(np.nan_to_num(m, nan=0.0, posinf=0.0, neginf=0.0) for m in moved))

    def parameters(self, hits: dict[str, NDArray[Any]]) -> tuple[Array, Array]:
        """The same as differences of (u, v), each (n, 2): least squares on dp_du and dp_dv."""
        p_u, p_v = (hits[name].astype(np.float64) for name in ("dp_du", "dp_dv"))
        uu, uv, vv = ((a * b).sum(axis=1) for a, b in ((p_u, p_u), (p_u, p_v), (p_v, p_v)))
        determinant = uu * vv - uv * uv
        safe = np.where(determinant > 0, determinant, np.inf)
        found = []
        for moved in (self.d_dx, self.d_dy):
            a, b = (p_u * moved).sum(axis=1), (p_v * moved).sum(axis=1)
            found.append(np.stack([(vv * a - uv * b) / safe, (uu * b - uv * a) / safe], axis=1))
        return found[0], found[1]


BASE_COLOR_ATTRIBUTES = ("sub_quads", "dp_du", "dp_dv")
"""What `base_colors` wants of `Scene.cast_rays` besides the usual, unless materials are plain."""


def base_colors(
    scene: Scene, hits: dict[str, NDArray[Any]], footprint: Footprint | None = None
) -> Array:
    """Linear base colours (n, 3) at hits of the scene.

    `hits` are answers of `Scene.cast_rays` with BASE_COLOR_ATTRIBUTES, without misses, one row
    each. Without a footprint textures are not filtered.
    """
    colours = np.empty((len(hits["t_hit"]), 3))
    for material, here in _materials(scene, hits):
        if material.is_plain:
            colours[here] = material.base_color
            continue
        part = {name: values[here] for name, values in hits.items()}
        spread = footprint and Footprint(footprint.d_dx[here], footprint.d_dy[here])
        colours[here] = _colors(scene, material, part, spread)
    return colours


def rough_parameters(
    scene: Scene, hits: dict[str, NDArray[Any]]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Roughness (0: plain diffuse), metallic, and reflectance at normal incidence, each (n,)."""
    roughness, metallic, reflectance = np.zeros((3, len(hits["t_hit"])), np.float32)
    for material, here in _materials(scene, hits):
        if material.roughness is not None:
            roughness[here], metallic[here] = material.roughness, material.metallic
            reflectance[here] = ((material.ior - 1) / (material.ior + 1)) ** 2
    return roughness, metallic, reflectance


def _materials(
    scene: Scene, hits: dict[str, NDArray[Any]]
) -> Iterator[tuple[Material, NDArray[np.intp]]]:
    """Each material that was hit, and the rows that have it."""
    for material_set, rows in scene.material_sets(hits["geometry_ids"]):
        if material_set.faces is None:
            yield material_set.materials[0], rows
            continue
        of_face = material_set.faces[hits["primitive_ids"][rows]]
        for index in np.unique(of_face):
            yield material_set.materials[index], rows[of_face == index]


def _colors(
    scene: Scene, material: Material, hits: dict[str, NDArray[Any]], footprint: Footprint | None
) -> Array:
    colours = np.broadcast_to(material.base_color, (len(hits["t_hit"]), 3))
    if material.texture is not None:
        st, d_du, d_dv = _primvar(scene, material.texture_primvar, hits, 2)
        spread: list[Any] = [0.0, 0.0]
        if footprint is not None:
            spread = [d_du * d[:, :1] + d_dv * d[:, 1:] for d in footprint.parameters(hits)]
        found = material.texture.sample(np.nan_to_num(st), *np.nan_to_num(spread))
        return np.where(np.isfinite(st).all(axis=1, keepdims=True), found, colours)
    if material.color_primvar is not None:
        values = _primvar(scene, material.color_primvar, hits, 3)[0]
        return np.where(np.isfinite(values), values, colours)
    return np.asarray(colours)


def _primvar(
    scene: Scene, name: str, hits: dict[str, NDArray[Any]], width: int
) -> tuple[Array, Array, Array]:
    """Values and derivatives (n, width) of a primvar; NaN where there is none such."""
    names = ("geometry_ids", "primitive_ids", "sub_quads", "primitive_uvs")
    if scene.primvar_width(name) != width:
        nothing = np.full((len(hits["t_hit"]), width), np.nan)
        return nothing, nothing, nothing
    return scene.evaluate_primvar(name, *(hits[key] for key in names))
