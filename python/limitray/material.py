"""Materials: a base colour, from a constant, a primvar or an image texture, and a finish."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limitray._arrays import finite_vector
from limitray.texture import Texture

if TYPE_CHECKING:
    from limitray.scene import Scene

Array = NDArray[np.float64]

CLAY = (0.70, 0.61, 0.535)
"""Linear base colour of surfaces without a material."""

RANGES = {"roughness": (0.05, 1.0), "metallic": (0.0, 1.0), "ior": (1.0, 4.0)}
"""Lowest and highest value of a material's numbers."""


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
    roughness_texture, metallic_texture : Texture, optional
        Images whose red channel gives the number in place of the constant, brought into its range;
        `Texture.adjusted` takes another channel. Looked up at `texture_primvar`; where a mesh lacks
        it, the constants count.

    Raises
    ------
    ValueError
        An argument has a wrong type, a number is out of its range, or there is a texture of the
        finish and no roughness.
    """

    base_color: tuple[float, float, float] = CLAY
    texture: Texture | None = None
    texture_primvar: str = "st"
    color_primvar: str | None = None
    roughness: float | None = None
    metallic: float = 0.0
    ior: float = 1.5
    roughness_texture: Texture | None = None
    metallic_texture: Texture | None = None

    def __post_init__(self) -> None:
        finite_vector("base_color", self.base_color)
        for name in ("texture", "roughness_texture", "metallic_texture"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, Texture):
                raise ValueError(f"{name} must be a limitray.Texture, not {value!r}")
        for name, (low, high) in RANGES.items():
            value = getattr(self, name)
            if value is None and name == "roughness":
                continue
            if not isinstance(value, int | float | np.number) or not low <= value <= high:
                raise ValueError(f"{name} must be {low:g} to {high:g}, not {value}")
        for name in ("roughness_texture", "metallic_texture"):
            if getattr(self, name) is not None and self.roughness is None:
                raise ValueError(f"{name} needs a roughness, got none")

    @property
    def is_plain(self) -> bool:
        """Whether the material is the same everywhere."""
        varying = (self.texture, self.color_primvar, self.roughness_texture, self.metallic_texture)
        return all(source is None for source in varying)


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
        facing = _dot(directions, normals)
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = [
                t * (d - directions * (_dot(d, normals) / facing)[:, np.newaxis])
                for d in (np.broadcast_to(d, normals.shape) for d in (d_dx, d_dy))
            ]
        return cls(*(np.nan_to_num(m, nan=0.0, posinf=0.0, neginf=0.0) for m in moved))

    def parameters(self, hits: dict[str, NDArray[Any]]) -> tuple[Array, Array]:
        """The same as differences of (u, v), each (n, 2): least squares on dp_du and dp_dv."""
        p_u, p_v = (hits[name].astype(np.float64) for name in ("dp_du", "dp_dv"))
        uu, uv, vv = _dot(p_u, p_u), _dot(p_u, p_v), _dot(p_v, p_v)
        determinant = uu * vv - uv * uv
        safe = np.where(determinant > 0, determinant, np.inf)
        found = []
        for moved in (self.d_dx, self.d_dy):
            a, b = _dot(p_u, moved), _dot(p_v, moved)
            found.append(np.stack([(vv * a - uv * b) / safe, (uu * b - uv * a) / safe], axis=1))
        return found[0], found[1]


def _dot(a: Array, b: Array) -> Array:
    """Scalar products (n,) of vectors (n, 3)."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


PLACE_ATTRIBUTES, FOOTPRINT_ATTRIBUTES = ("sub_quads",), ("dp_du", "dp_dv")
"""What colours want of `Scene.cast_rays` unless they are plain; more where they are filtered."""


@dataclass(frozen=True)
class Finish:
    """What surfaces are made of at n places.

    `colors` (n, 3) are linear; `roughness` (n,) is 0 for plain diffuse ones; `reflectance` (n,) is
    that of a dielectric at normal incidence.
    """

    colors: Array
    roughness: NDArray[np.float32]
    metallic: NDArray[np.float32]
    reflectance: NDArray[np.float32]


def base_colors(scene: Scene, hits: dict[str, NDArray[Any]]) -> Array:
    """Linear base colours (n, 3) at hits of the scene, textures not filtered; see `finish`."""
    return finish(scene, hits).colors


def finish(
    scene: Scene, hits: dict[str, NDArray[Any]], rays: tuple[Array, Array, Array] | None = None
) -> Finish:
    """The materials at hits of the scene.

    `hits` are answers of `Scene.cast_rays` with PLACE_ATTRIBUTES, without misses, one row each.
    Textures are filtered if `rays` (with FOOTPRINT_ATTRIBUTES) tell the directions (n, 3) and their
    differences to neighbouring pixels, as `Footprint.of_rays` wants them.
    """
    colors = np.empty((len(hits["t_hit"]), 3))
    roughness, metallic, reflectance = np.zeros((3, len(colors)), np.float32)
    for material, here in _materials(scene, hits):
        if material.roughness is not None:
            roughness[here], metallic[here] = material.roughness, material.metallic
            reflectance[here] = ((material.ior - 1) / (material.ior + 1)) ** 2
        colors[here] = material.base_color
        if material.is_plain:
            continue
        part = {name: np.take(values, here, axis=0) for name, values in hits.items()}
        turned = None if rays is None else tuple(values[here] for values in rays)
        lookup = _Lookup.of(scene, material, part, turned)
        if material.texture is not None:
            colors[here] = lookup.sample(material.texture, colors[here])
        elif material.color_primvar is not None:
            values = _primvar(scene, material.color_primvar, part, 3)[0]
            colors[here] = np.where(np.isfinite(values), values, colors[here])
        for texture, numbers, (low, high) in (
            (material.roughness_texture, roughness, RANGES["roughness"]),
            (material.metallic_texture, metallic, RANGES["metallic"]),
        ):
            if texture is not None:
                constant = numbers[here, np.newaxis].astype(np.float64)
                numbers[here] = np.clip(lookup.sample(texture, constant)[:, 0], low, high)
    return Finish(colors, roughness, metallic, reflectance)


@dataclass(frozen=True)
class _Lookup:
    """Texture coordinates (n, 2) of hits, NaN where there are none, and their two differences."""

    st: Array
    spread: tuple[Any, Any]

    @classmethod
    def of(
        cls,
        scene: Scene,
        material: Material,
        hits: dict[str, NDArray[Any]],
        rays: tuple[Array, ...] | None,
    ) -> _Lookup:
        """Where the textures of a material are looked up; `rays` as for `finish`."""
        st, d_du, d_dv = _primvar(scene, material.texture_primvar, hits, 2)
        if rays is None:
            return cls(st, (0.0, 0.0))
        footprint = Footprint.of_rays(hits, *rays)
        a, b = (d_du * d[:, :1] + d_dv * d[:, 1:] for d in footprint.parameters(hits))
        return cls(st, (np.nan_to_num(a), np.nan_to_num(b)))

    def sample(self, texture: Texture, otherwise: Array) -> Array:
        """Colours (n, 3) of a texture, and `otherwise` where there are no coordinates."""
        found = texture.sample(np.nan_to_num(self.st), *self.spread)
        return np.where(np.isfinite(self.st).all(axis=1, keepdims=True), found, otherwise)


def _materials(
    scene: Scene, hits: dict[str, NDArray[Any]]
) -> Iterator[tuple[Material, NDArray[np.intp]]]:
    """Each material that was hit, and the rows that have it."""
    for material_set, rows in scene.material_sets(hits["geometry_ids"]):
        if material_set.faces is None:
            yield material_set.materials[0], rows
            continue
        of_face = material_set.faces[hits["primitive_ids"][rows]]
        for index in np.flatnonzero(np.bincount(of_face)):
            yield material_set.materials[index], rows[of_face == index]


def _primvar(
    scene: Scene, name: str, hits: dict[str, NDArray[Any]], width: int
) -> tuple[Array, Array, Array]:
    """Values and derivatives (n, width) of a primvar; NaN where there is none such."""
    names = ("geometry_ids", "primitive_ids", "sub_quads", "primitive_uvs")
    if scene.primvar_width(name) != width:
        nothing = np.full((len(hits["t_hit"]), width), np.nan)
        return nothing, nothing, nothing
    return scene.evaluate_primvar(name, *(hits[key] for key in names))
