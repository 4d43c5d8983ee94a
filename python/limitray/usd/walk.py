"""Which meshes of a USD stage are seen, and all the places where they stand."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from limitray.camera import Camera
from limitray.usd.shader import Color

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

DISPLAY_COLOR = "displayColor"
Matrices = NDArray[np.float64]

MOST_COLORS = 256
"""Different colours that the instances of an instancer may have."""


@dataclass
class PlacedMesh:
    """One mesh of the file and where it stands.

    `prims` are the prims that stand for it, one where it is no native instance; `matrices` has an
    array (n, 4, 4) for each of them, `paths` one path for each matrix. `colors` has for each prim
    the displayColor that an instancer gives, or None.
    """

    prims: list[Usd.Prim] = field(default_factory=list)
    colors: list[Color | None] = field(default_factory=list)
    matrices: list[Matrices] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)


class Walk:
    """A walk over a stage at one time.

    Meshes are counted by what defines them: the instances of a prototype are one mesh. Only meshes
    and instancers are taken; `notes` tells how many other shapes there are.
    """

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode, purposes: tuple[str, ...]) -> None:
        from pxr import UsdGeom

        self._stage = stage
        self._time = time
        self._purposes = purposes
        self._transforms = UsdGeom.XformCache(time)
        self._placed: dict[str, PlacedMesh] = {}
        self._others: Counter[str] = Counter()
        self._lights: set[str] = set()
        self.notes: list[str] = []

    def meshes(self) -> list[PlacedMesh]:
        """Each mesh with its placements, at least one."""
        self._visit(self._stage.GetPseudoRoot(), np.eye(4)[np.newaxis], prototype=False)
        self.notes += [
            f"{count} {kind} prims left out: they are no meshes"
            for kind, count in sorted(self._others.items())
        ]
        if self._lights:
            self.notes.append(f"{len(self._lights)} lights left out: light is given to `render`")
        return list(self._placed.values())

    def cameras(self) -> dict[str, Camera]:
        """Perspective cameras by path."""
        from pxr import Usd, UsdGeom

        found = {}
        for prim in self._stage.Traverse(Usd.TraverseInstanceProxies()):
            if prim.IsA(UsdGeom.Camera):
                camera = _camera(UsdGeom.Camera(prim), self._time)
                if camera is None:
                    self.notes.append(f"{prim.GetPath()}: left out: not a perspective camera")
                    continue
                found[str(prim.GetPath())] = camera
                if any(
                    attribute.Get(self._time)
                    for attribute in (
                        UsdGeom.Camera(prim).GetHorizontalApertureOffsetAttr(),
                        UsdGeom.Camera(prim).GetVerticalApertureOffsetAttr(),
                    )
                ):
                    self.notes.append(f"{prim.GetPath()}: shown without its aperture offset")
        return found

    def _visit(
        self, root: Usd.Prim, parents: Matrices, prototype: bool, color: Color | None = None
    ) -> None:
        """Collects what lies under `root`; `parents` (n, 4, 4) place its space in the world.

        `color` is what an instancer gives its instances. A prototype of an instancer may be a mere
        `over`, and is seen whatever its parents say.
        """
        from pxr import Usd, UsdGeom, UsdLux

        active = Usd.PrimIsActive & Usd.PrimIsLoaded
        predicate = active if prototype else active & Usd.PrimIsDefined & ~Usd.PrimIsAbstract
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(predicate)))
        for prim in walk:
            imageable = UsdGeom.Imageable(prim)
            if prim.HasAPI(UsdLux.LightAPI):
                self._lights.add(str(prim.GetPath()))
            if not imageable:
                continue
            if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
                walk.PruneChildren()
            elif prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
                if imageable.ComputePurpose() in self._purposes:
                    self._instancer(UsdGeom.PointInstancer(prim), root, parents, prototype, color)
            elif prim.IsA(UsdGeom.Gprim) and imageable.ComputePurpose() in self._purposes:
                if prim.IsA(UsdGeom.Mesh):
                    self._place(prim, parents @ self._matrix(prim, root, prototype), color)
                else:
                    self._others[str(prim.GetTypeName())] += 1

    def _matrix(self, prim: Usd.Prim, root: Usd.Prim, prototype: bool) -> Matrices:
        """From the space of `prim` to the world, or to that of the prototype `root`."""
        if not prototype:
            return _column_matrix(self._transforms.GetLocalToWorldTransform(prim))
        if prim == root:
            return np.eye(4)
        return _column_matrix(self._transforms.ComputeRelativeTransform(prim, root)[0])

    def _place(self, prim: Usd.Prim, matrices: Matrices, color: Color | None) -> None:
        shared = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        placed = self._placed.setdefault(str(shared.GetPath()), PlacedMesh())
        placed.prims.append(prim)
        placed.colors.append(color)
        placed.matrices.append(matrices)
        placed.paths += [str(prim.GetPath())] * len(matrices)

    def _instancer(
        self,
        instancer: UsdGeom.PointInstancer,
        root: Usd.Prim,
        parents: Matrices,
        prototype: bool,
        inherited: Color | None,
    ) -> None:
        """Visits each prototype once a colour, with the matrices of all instances that have it."""
        from pxr import UsdGeom

        prim = instancer.GetPrim()
        kinds = np.array(instancer.GetProtoIndicesAttr().Get(self._time) or [], np.int64)
        roots = [self._stage.GetPrimAtPath(p) for p in _prototypes(prim, instancer)]
        if not len(kinds) or kinds.min() < 0 or kinds.max() >= len(roots):
            self.notes.append(f"{prim.GetPath()}: left out: its protoIndices fit no prototypes")
            return
        found = instancer.ComputeInstanceTransformsAtTime(
            self._time,
            self._time,
            UsdGeom.PointInstancer.IncludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )
        if len(found) != len(kinds):
            self.notes.append(f"{prim.GetPath()}: left out: not one position an instance")
            return
        self._note_instance_primvars(prim)
        mask = np.array(instancer.ComputeMaskAtTime(self._time) or [True] * len(kinds), bool)
        local = self._matrix(prim, root, prototype) @ np.array(found).transpose(0, 2, 1)
        colors = self._instance_colors(prim, len(kinds)) or [(inherited, np.ones(len(kinds), bool))]
        for kind, prototype_root in enumerate(roots):
            for color, has_color in colors:
                matrices = local[(kinds == kind) & mask & has_color]
                if prototype_root and len(matrices):
                    world = (parents[:, np.newaxis] @ matrices).reshape(-1, 4, 4)
                    self._visit(prototype_root, world, prototype=True, color=color)

    def _instance_colors(
        self, instancer: Usd.Prim, count: int
    ) -> list[tuple[Color | None, NDArray[np.bool_]]]:
        """Each displayColor that an instancer gives, and which instances have it; often none."""
        from pxr import UsdGeom

        primvar = UsdGeom.PrimvarsAPI(instancer).GetPrimvar(DISPLAY_COLOR)
        if not primvar.HasValue() or primvar.GetInterpolation() == UsdGeom.Tokens.constant:
            return []
        values = np.array(primvar.ComputeFlattened(self._time) or [], np.float64).reshape(-1, 3)
        found, rows = np.unique(values, axis=0, return_inverse=True)
        if len(values) != count or len(found) > MOST_COLORS:
            self.notes.append(
                f"{instancer.GetPath()}: {DISPLAY_COLOR} of instances ignored: {len(found)} "
                f"colours of {len(values)} values for {count} instances, at most {MOST_COLORS}"
            )
            return []
        tuples = [(float(r), float(g), float(b)) for r, g, b in found]
        return [(color, rows.ravel() == k) for k, color in enumerate(tuples)]

    def _note_instance_primvars(self, instancer: Usd.Prim) -> None:
        from pxr import UsdGeom

        varying = [
            str(primvar.GetPrimvarName())
            for primvar in UsdGeom.PrimvarsAPI(instancer).GetPrimvarsWithValues()
            if primvar.GetInterpolation() != UsdGeom.Tokens.constant
            and primvar.GetPrimvarName() != DISPLAY_COLOR
        ]
        if varying:
            names = ", ".join(varying)
            self.notes.append(f"{instancer.GetPath()}: primvars of instances ignored: {names}")


def _prototypes(prim: Usd.Prim, instancer: UsdGeom.PointInstancer) -> list[Any]:
    """Paths of an instancer's prototypes; those of an instance proxy lie beside it."""
    paths = list(instancer.GetPrototypesRel().GetForwardedTargets())
    if not prim.IsInstanceProxy():
        return paths
    shared = prim.GetPrimInPrototype().GetPath()
    return [path.ReplacePrefix(shared, prim.GetPath()) for path in paths]


def _column_matrix(matrix: Any) -> Matrices:
    """USD's row-vector matrix as one that acts on column vectors."""
    return np.array(matrix).T


def _camera(camera: UsdGeom.Camera, time: Usd.TimeCode) -> Camera | None:
    """A pinhole camera that shows the film gate; None unless it is a perspective one."""
    from pxr import Gf

    lens = camera.GetCamera(time)
    fov = lens.GetFieldOfView(Gf.Camera.FOVHorizontal)
    if lens.projection != Gf.Camera.Perspective or not 0 < fov < 180:
        return None
    rows = np.array(lens.transform)
    eye, up, backward = rows[3, :3], rows[1, :3], rows[2, :3]
    distance = lens.focusDistance if lens.focusDistance > 0 else 1.0
    center = eye - distance * backward / np.linalg.norm(backward)
    ex, ey, ez = eye.tolist()
    cx, cy, cz = center.tolist()
    ux, uy, uz = up.tolist()
    aspect = lens.horizontalAperture / lens.verticalAperture if lens.verticalAperture > 0 else None
    return Camera((ex, ey, ez), (cx, cy, cz), (ux, uy, uz), float(fov), aspect)
