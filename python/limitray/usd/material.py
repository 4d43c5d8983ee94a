"""The base colour of UsdPreviewSurface materials and of displayColor."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from limitray.material import Material
from limitray.mesh import Mesh, Primvar
from limitray.texture import Texture, Wrap

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdShade

DISPLAY_COLOR = "displayColor"


@dataclass
class MaterialReader:
    """Reads the materials of one stage, each file and each material once."""

    time: Usd.TimeCode
    notes: list[str] = field(default_factory=list)
    _materials: dict[str, Material | None] = field(default_factory=dict)
    _textures: dict[tuple[str, ...], Texture | None] = field(default_factory=dict)

    def read(
        self, prim: Usd.Prim, mesh: Mesh
    ) -> tuple[list[Material], NDArray[np.intp] | None] | None:
        """Materials of a mesh, and the one of each face where subsets have their own.

        None if nothing says what colour the mesh has.
        """
        from pxr import UsdShade

        binding = UsdShade.MaterialBindingAPI(prim)
        whole = self._bound(binding) or _display_color(mesh)
        materials = [whole or Material()]
        faces = np.zeros(len(mesh.face_vertex_counts), np.intp)
        for subset in binding.GetMaterialBindSubsets():
            material = self._bound(UsdShade.MaterialBindingAPI(subset.GetPrim()))
            indices = np.array(subset.GetIndicesAttr().Get(self.time) or [], np.int64)
            if material is None or not len(indices):
                continue
            if indices.min() < 0 or indices.max() >= len(faces):
                self._note(f"{subset.GetPath()}: ignored: it names faces that the mesh lacks")
                continue
            faces[indices] = len(materials)
            materials.append(material)
        if len(materials) > 1:
            return materials, faces
        return (materials, None) if whole else None

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def _bound(self, binding: UsdShade.MaterialBindingAPI) -> Material | None:
        """The material of a prim; None if it has none with a UsdPreviewSurface."""
        material = binding.ComputeBoundMaterial()[0]
        if not material:
            for target in binding.GetDirectBindingRel().GetTargets():
                self._note(f"{target}: ignored: there is no such material (is it MaterialX?)")
            return None
        path = str(material.GetPath())
        if path not in self._materials:
            self._materials[path] = self._preview_surface(material)
        return self._materials[path]

    def _preview_surface(self, material: UsdShade.Material) -> Material | None:
        shader = material.ComputeSurfaceSource()[0]
        if not shader or shader.GetShaderId() != "UsdPreviewSurface":
            self._note(f"{material.GetPath()}: ignored: no UsdPreviewSurface")
            return None
        color, source = _value_and_source(shader, "diffuseColor", self.time)
        base = (0.18, 0.18, 0.18) if color is None else tuple(float(x) for x in color)
        plain = Material(cast(tuple[float, float, float], base))
        if source is None:
            return plain
        kind = str(source.GetShaderId())
        if kind == "UsdUVTexture":
            texture = self._texture(source)
            st = self._primvar_of(source)
            return Material(plain.base_color, texture, st) if texture else plain
        if kind.startswith("UsdPrimvarReader_"):
            name = _value_and_source(source, "varname", self.time)[0]
            return Material(plain.base_color, color_primvar=str(name))
        self._note(f"{source.GetPath()}: ignored: a shader {kind} gives the base colour")
        return plain

    def _primvar_of(self, shader: UsdShade.Shader) -> str:
        """The primvar that a texture is looked up at."""
        source = _value_and_source(shader, "st", self.time)[1]
        if source is not None and source.GetShaderId() == "UsdTransform2d":
            self._note(f"{source.GetPath()}: ignored: texture coordinates are not transformed")
            source = _value_and_source(source, "in", self.time)[1]
        if source is None or source.GetShaderId() != "UsdPrimvarReader_float2":
            return "st"
        return str(_value_and_source(source, "varname", self.time)[0] or "st")

    def _texture(self, shader: UsdShade.Shader) -> Texture | None:
        attribute = _source_attribute(shader, "file")
        asset = attribute.Get(self.time) if attribute else None
        if asset is None:
            self._note(f"{shader.GetPath()}: ignored: has no file")
            return None
        options = {
            name: str(_value_and_source(shader, name, self.time)[0] or fallback)
            for name, fallback in (
                ("wrapS", "useMetadata"),
                ("wrapT", "useMetadata"),
                ("sourceColorSpace", "auto"),
            )
        }
        key = (str(asset.resolvedPath or asset.path), *options.values())
        if key not in self._textures:
            try:
                self._textures[key] = _load(asset, attribute, options)
            except (OSError, ValueError) as error:
                self._note(f"{shader.GetPath()}: texture ignored: {error}")
                self._textures[key] = None
        return self._textures[key]


def _display_color(mesh: Mesh) -> Material | None:
    """The material of a mesh with a primvar displayColor."""
    primvar = mesh.primvars.get(DISPLAY_COLOR)
    if primvar is None or np.shape(primvar.values)[-1] != 3:
        return None
    if isinstance(primvar, Primvar) and primvar.interpolation == "constant":
        red, green, blue = (float(x) for x in np.asarray(primvar.values)[0])
        return Material((red, green, blue))
    return Material(color_primvar=DISPLAY_COLOR)


def _source_attribute(shader: UsdShade.Shader, name: str) -> Usd.Attribute | None:
    """The attribute that an input of a shader has its value from, through material interfaces."""
    from pxr import UsdShade

    shader_input = shader.GetInput(name)
    if not shader_input:
        return None
    found = UsdShade.Utils.GetValueProducingAttributes(shader_input)
    return found[0] if found else None


def _value_and_source(
    shader: UsdShade.Shader, name: str, time: Usd.TimeCode
) -> tuple[Any, UsdShade.Shader | None]:
    """An input's value if it has one, or the shader whose output it is connected to."""
    from pxr import UsdShade

    attribute = _source_attribute(shader, name)
    if attribute is None:
        return None, None
    if UsdShade.Output.IsOutput(attribute):
        return None, UsdShade.Shader(attribute.GetPrim())
    return attribute.Get(time), None


def _load(asset: Sdf.AssetPath, attribute: Usd.Attribute, options: dict[str, str]) -> Texture:
    """The texture of an asset path, which may lie inside a .usdz file or name UDIM tiles."""
    from pxr import Ar, UsdShade

    spaces = {"sRGB": "sRGB", "raw": "raw"}
    space: Any = spaces.get(options["sourceColorSpace"], "auto")
    if "<UDIM>" in asset.path:
        layer = attribute.GetPropertyStack()[0].layer
        found = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layer)
        return Texture.from_tiles({int(n): Path(path) for path, n in found}, asset.path, space)
    resolved = str(asset.resolvedPath)
    opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
    if not opened:
        raise FileNotFoundError(2, "no such file", asset.path)
    name = resolved.rpartition("[")[2].rstrip("]")
    with opened:
        data = bytes(opened.GetBuffer())
    return Texture.from_bytes(data, name, _wrap(options["wrapS"]), _wrap(options["wrapT"]), space)


def _wrap(token: str) -> Wrap:
    """USD's wrap mode; without an opinion, in the file or the stage, it is black."""
    return cast(Wrap, token) if token in ("repeat", "mirror", "clamp") else "black"
