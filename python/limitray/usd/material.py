"""Which material each mesh of a stage, each subset of its faces and each instance has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limitray.material import Material
from limitray.mesh import Mesh, Primvar
from limitray.usd.faces import Faces
from limitray.usd.shader import Color, SurfaceReader
from limitray.usd.walk import DISPLAY_COLOR

if TYPE_CHECKING:
    from pxr import Usd, UsdShade

Bound = tuple[list[Material], NDArray[np.intp] | None]


@dataclass
class MaterialReader:
    """Reads the materials of one stage, each file and each material once.

    A mesh may have one material to preview and another one to render: of those whose surface is a
    UsdPreviewSurface the first is taken.
    """

    time: Usd.TimeCode
    notes: list[str] = field(default_factory=list)
    _materials: dict[str, Material | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._surfaces = SurfaceReader(self.time, self._note)

    def read(
        self, prim: Usd.Prim, mesh: Mesh, kept: Faces, color: Color | None = None
    ) -> Bound | None:
        """Materials of a mesh, and the one of each face where subsets have their own.

        `color` is the displayColor of its instances, for meshes that have none of their own. None
        if nothing says what colour the mesh has.
        """
        from pxr import UsdShade

        whole = self._bound(prim) or self._display_color(prim, mesh, color)
        materials = [whole or Material()]
        faces = np.zeros(len(mesh.face_vertex_counts), np.intp)
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            material = self._bound(subset.GetPrim())
            indices = np.array(subset.GetIndicesAttr().Get(self.time) or [], np.int64)
            if material is None or not len(indices):
                continue
            indices = kept.renumbered(indices)
            if len(indices) and (indices.min() < 0 or indices.max() >= len(faces)):
                self._note(f"{subset.GetPath()}: ignored: it names faces that the mesh lacks")
                continue
            faces[indices] = len(materials)
            materials.append(material)
        if len(materials) > 1:
            return materials, faces
        return (materials, None) if whole else None

    def groups(self, prims: Sequence[Usd.Prim], colors: Sequence[Color | None]) -> list[int]:
        """For each instance of one mesh the first one that surely has the same materials.

        Native instances share a mesh, but not what they inherit from the prims above them, and
        those of an instancer have its `colors`.
        """
        from pxr import UsdShade

        if len(prims) == 1:
            return [0]
        bound = [
            UsdShade.MaterialBindingAPI.ComputeBoundMaterials(list(prims), purpose)[0]
            for purpose in _purposes()
        ]
        firsts: dict[Any, int] = {}
        found = []
        for k, prim in enumerate(prims):
            paths = [_shared_path(material[k]) if material[k] else None for material in bound]
            key = (*paths, self._constant_color(prim), colors[k])
            found.append(firsts.setdefault(key, k))
        return found

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def _bound(self, prim: Usd.Prim) -> Material | None:
        """The material of a prim; None if it has none with a UsdPreviewSurface."""
        from pxr import UsdShade

        binding = UsdShade.MaterialBindingAPI(prim)
        materials = [binding.ComputeBoundMaterial(purpose)[0] for purpose in _purposes()]
        materials = [material for material in materials if material]
        for material in materials:
            path = _shared_path(material)
            if path not in self._materials:
                self._materials[path] = self._preview_surface(material)
            found = self._materials[path]
            if found is not None:
                return found
        if materials:
            kinds = ", ".join(_surface_kinds(materials[0])) or "no surface"
            self._note(
                f"{materials[0].GetPath()}: not shown: it has no UsdPreviewSurface ({kinds}); "
                "meshes with it show their displayColor, or else clay"
            )
        else:
            self._note_missing(prim)
        return None

    def _note_missing(self, prim: Usd.Prim) -> None:
        """Says which material the nearest binding of `prim` or a prim above it names in vain."""
        from pxr import UsdShade

        while prim and not prim.IsPseudoRoot():
            for target in UsdShade.MaterialBindingAPI(prim).GetDirectBindingRel().GetTargets():
                self._note(
                    f"{target}: not shown: there is no such material on the stage (usd-core does "
                    "not read .mtlx files); meshes with it show their displayColor, or else clay"
                )
                return
            prim = prim.GetParent()

    def _preview_surface(self, material: UsdShade.Material) -> Material | None:
        shader = material.ComputeSurfaceSource()[0]
        if not shader or shader.GetShaderId() != "UsdPreviewSurface":
            return None
        return self._surfaces.read(shader)

    def _display_color(self, prim: Usd.Prim, mesh: Mesh, instance: Color | None) -> Material | None:
        """The material of a displayColor: a mesh's own, its instance's, or one from above."""
        from pxr import UsdGeom

        if instance is not None:
            own = UsdGeom.PrimvarsAPI(prim).GetPrimvar(DISPLAY_COLOR)
            if not own.HasValue():
                return Material(instance)
        primvar = mesh.primvars.get(DISPLAY_COLOR)
        varies = not isinstance(primvar, Primvar) or primvar.interpolation != "constant"
        if primvar is not None and varies:
            three = np.shape(primvar.values)[1] == 3
            return Material(color_primvar=DISPLAY_COLOR) if three else None
        color = self._constant_color(prim)
        return None if color is None else Material(color)

    def _constant_color(self, prim: Usd.Prim) -> Color | None:
        """The displayColor of a prim or of those above it, if it is one colour for all."""
        from pxr import UsdGeom

        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(DISPLAY_COLOR)
        if not primvar or primvar.GetInterpolation() != UsdGeom.Tokens.constant:
            return None
        values = primvar.ComputeFlattened(self.time)
        if not values:
            return None
        red, green, blue = (float(x) for x in values[0])
        return red, green, blue


def _shared_path(material: UsdShade.Material) -> str:
    """The path of a material; the same one for all instances of a prototype that has it."""
    prim = material.GetPrim()
    return str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())


def _purposes() -> tuple[str, str]:
    """Purposes of materials, in the order in which they are tried; both fall back to "all"."""
    from pxr import UsdShade

    return UsdShade.Tokens.preview, UsdShade.Tokens.full


def _surface_kinds(material: UsdShade.Material) -> list[str]:
    """The shaders of a material's surface outputs, such as ND_standard_surface_surfaceshader."""
    from pxr import UsdShade

    attributes = [
        attribute
        for output in material.GetSurfaceOutputs()
        for attribute in UsdShade.Utils.GetValueProducingAttributes(output)
    ]
    return [str(UsdShade.Shader(a.GetPrim()).GetShaderId() or "unknown") for a in attributes]
