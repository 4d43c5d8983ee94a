"""USD stages as scenes: which meshes there are, where they stand, and how often."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from limitray._arrays import name_list, one_of
from limitray.camera import Camera, Vector
from limitray.material import Material
from limitray.mesh import USD_SUFFIXES, Mesh
from limitray.scene import Scene, precision
from limitray.usd.faces import Faces
from limitray.usd.material import MaterialReader
from limitray.usd.mesh import read_mesh
from limitray.usd.walk import PlacedMesh, Walk

if TYPE_CHECKING:
    from pxr import Usd

PURPOSES = ("default", "render")
ALL_PURPOSES = (*PURPOSES, "proxy", "guide")


@dataclass(frozen=True, eq=False)
class Stage:
    """What a USD stage says besides its surfaces.

    Parameters
    ----------
    path : Path
        The file.
    time : float or None
        The time code it was read at; None: the earliest of each value, where the stage names none.
    meters_per_unit : float
        Length of a unit. Points are as in the file.
    up : (3,)
        The up axis.
    cameras : dict of str to Camera
        The cameras by path, in the order of the stage.
    paths : tuple of str
        The path of each geometry id's mesh.
    notes : tuple of str
        What was left out or repaired.
    """

    path: Path
    time: float | None
    meters_per_unit: float
    up: Vector
    cameras: dict[str, Camera]
    paths: tuple[str, ...]
    notes: tuple[str, ...]


def load_scene(
    path: str | os.PathLike[str],
    time: float | None = None,
    *,
    isolation_level: int | None = None,
    tolerance: float | None = None,
    purposes: Sequence[str] = PURPOSES,
    device: str = "cpu",
    threads: int = 0,
) -> Scene:
    """Reads all meshes of a USD stage, with their transforms, materials and instances.

    Parameters
    ----------
    path : path
        A .usd, .usda, .usdc or .usdz file.
    time : float, optional
        Time code of points and transforms; the stage's start unless given.
    isolation_level, tolerance : int, float, optional
        As in `Scene.add_mesh`.
    purposes : sequence of str
        Purposes to take: "default", "render", "proxy", "guide".
    device, threads
        As in `Scene`.

    Returns
    -------
    Scene
        Its attribute `stage` (a `Stage`) has the cameras, the up axis, the unit, the path of each
        geometry id, and notes on what was left out. Point instancers and native instances are
        instances: their patches exist once.

    Raises
    ------
    OSError
        The file cannot be opened.
    ValueError
        It is no USD file, usd-core is not installed, or it has meshes and none can be traced.
    """
    precision(isolation_level, tolerance)  # before meshes with errors are left out
    for name in name_list("purposes", purposes):
        one_of("purposes", name, ALL_PURPOSES)
    usd_stage = open_stage(path)
    code = _time_code(usd_stage, time)
    walk = Walk(usd_stage, code, tuple(purposes))
    scene = Scene(device, threads)
    materials = MaterialReader(code)
    notes: list[str] = []
    paths: list[str] = []
    for placed in walk.meshes():
        try:
            mesh, faces, found = read_mesh(placed.prims[0], code)
            notes += found
            paths += _add(scene, mesh, faces, placed, (isolation_level, tolerance), materials)
        except ValueError as error:
            notes.append(f"left out: {error}")
    notes = [*_unresolved(usd_stage), *notes]
    if notes and not paths:
        raise ValueError(f"{path}: no mesh can be traced: {notes[0]}")
    from pxr import UsdGeom

    scene.stage = Stage(
        path=Path(path),
        time=None if code.IsEarliestTime() else float(code.GetValue()),
        meters_per_unit=float(UsdGeom.GetStageMetersPerUnit(usd_stage)),
        up=(0.0, 0.0, 1.0) if UsdGeom.GetStageUpAxis(usd_stage) == "Z" else (0.0, 1.0, 0.0),
        cameras=walk.cameras(),
        paths=tuple(paths),
        notes=tuple(dict.fromkeys((*notes, *materials.notes, *walk.notes))),
    )
    return scene


def mesh_from_usd(
    path: str | os.PathLike[str], prim: str | None = None, time: float | None = None
) -> Mesh:
    """The cage of one mesh of a USD file, without its transform.

    Parameters
    ----------
    path : path
        A .usd, .usda, .usdc or .usdz file.
    prim : str, optional
        Path of the mesh; may be left out if there is only one.
    time : float, optional
        Time code of the points; the stage's start unless given.

    Raises
    ------
    OSError
        The file cannot be opened.
    ValueError
        There is no such mesh, or several and none was chosen; or the mesh is not valid.
    """
    stage = open_stage(path)
    from pxr import Sdf, Usd, UsdGeom

    if prim is None:
        meshes = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Mesh)]
        if len(meshes) != 1:
            names = ", ".join(str(p.GetPath()) for p in meshes[:8]) + (", ..." * (len(meshes) > 8))
            raise ValueError(f"{path}: prim must name one of {len(meshes)} meshes: {names or '-'}")
        found = meshes[0]
    else:
        valid = prim.startswith("/") and Sdf.Path.IsValidPathString(prim)
        found = stage.GetPrimAtPath(prim) if valid else Usd.Prim()
        if not found or not found.IsA(UsdGeom.Mesh):
            raise ValueError(f"{path}: prim {prim} is no mesh of this file")
    try:
        return read_mesh(found, _time_code(stage, time))[0]
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def open_stage(path: str | os.PathLike[str]) -> Usd.Stage:
    """Opens a file as a stage; raises OSError or ValueError."""
    path = Path(path)
    if path.suffix.lower() not in USD_SUFFIXES:
        raise ValueError(
            f'{path}: a USD file ends in {", ".join(USD_SUFFIXES)}, not "{path.suffix}"'
        )
    with path.open("rb"):
        pass
    try:
        from pxr import Tf, Usd, UsdUtils
    except ImportError:
        raise ValueError(
            f"{path}: USD files need usd-core: install limitray[usd] (pip install usd-core)"
        ) from None
    quiet = UsdUtils.CoalescingDiagnosticDelegate()  # keeps USD's warnings off stderr
    try:
        return Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        reason = " ".join(error.args[0].commentary.split())
        raise ValueError(f"{path}: cannot be read as USD: {reason}") from None
    finally:
        del quiet


def _unresolved(stage: Usd.Stage) -> list[str]:
    """What the stage refers to and has not: files, and prims in files."""
    return sorted(" ".join(str(error).split()) for error in stage.GetCompositionErrors())


def _time_code(stage: Usd.Stage, time: float | None) -> Usd.TimeCode:
    """`time`; without it the start of the stage, or its earliest sample."""
    from pxr import Usd

    if time is not None:
        if not isinstance(time, int | float | np.number) or not np.isfinite(time):
            raise ValueError(f"time must be finite, not {time}")
        return Usd.TimeCode(float(time))
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def _add(
    scene: Scene,
    mesh: Mesh,
    faces: Faces,
    placed: PlacedMesh,
    precision: tuple[int | None, float | None],
    materials: MaterialReader,
) -> list[str]:
    """Adds a mesh with all its placements; returns a path for each geometry id.

    Instances whose materials are others than the first one's are given theirs once, and the
    following ones are made of that one.
    """
    first_of_group = materials.groups(placed.prims, placed.colors)
    group = np.repeat(first_of_group, [len(m) for m in placed.matrices])
    matrices = np.concatenate(placed.matrices)
    invertible = np.abs(np.linalg.det(matrices[:, :3, :3])) > 0
    paths = [path for path, keep in zip(placed.paths, invertible) if keep]
    if len(paths) < len(matrices):
        lost = len(matrices) - len(paths)
        materials.notes.append(
            f"{placed.prims[0].GetPath()}: left out {lost} of {len(matrices)} times: "
            "scaled to nothing"
        )
    sources: dict[int, int] = {}
    for transform, first in zip(matrices[invertible], group[invertible].tolist()):
        if first in sources:
            scene.add_instance(sources[first], transform)
            continue
        if not sources:
            added = scene.add_mesh(mesh, precision[0], transform, tolerance=precision[1])
        else:
            added = scene.add_instance(next(iter(sources.values())), transform)
        bound = materials.read(placed.prims[first], mesh, faces, placed.colors[first])
        if bound is not None or sources:
            scene.set_material(added, *(bound or ([Material()], None)))
        sources[first] = added
    return paths
