"""Model files as scenes, as the command line takes them."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from limitray.camera import Camera
from limitray.material import Material
from limitray.mesh import USD_SUFFIXES, Mesh
from limitray.scene import Scene
from limitray.texture import Texture
from limitray.usd import load_scene


def load_model(
    path: Path,
    prim: str | None = None,
    time: float | None = None,
    isolation_level: int | None = None,
    tolerance: float | None = None,
    threads: int = 0,
    device: str = "cpu",
) -> Scene:
    """The scene of an OBJ file, of a whole USD stage, or of one mesh (`prim`) of it.

    What a stage has that is not shown is told on stderr. Raises OSError or ValueError.
    """
    is_usd = path.suffix.lower() in USD_SUFFIXES
    if time is not None and not (is_usd and prim is None):
        raise ValueError("--time is for whole USD stages")
    if is_usd and prim is None:
        scene = load_scene(
            path,
            time,
            isolation_level=isolation_level,
            tolerance=tolerance,
            device=device,
            threads=threads,
        )
        for note in scene.stage.notes if scene.stage else ():
            print(f"limitray: {note}", file=sys.stderr)
        return scene
    scene = Scene(device, threads)
    scene.add_mesh(Mesh.from_file(path, prim), isolation_level, tolerance=tolerance)
    return scene


def set_texture(scene: Scene, texture: Texture) -> None:
    """Gives all meshes the texture, on the primvar "st" or else their only one of two components.

    Raises ValueError if there is no such primvar.
    """
    names = scene.primvar_names()
    pairs = [name for name in names if scene.primvar_width(name) == 2]
    if "st" not in pairs and len(pairs) != 1:
        found = ", ".join(pairs) or "none"
        raise ValueError(f'--texture needs texture coordinates: the primvar "st"; found: {found}')
    name = "st" if "st" in pairs else pairs[0]
    for geometry_id in range(scene.geometry_count()):
        scene.set_material(geometry_id, Material(texture=texture, texture_primvar=name))


def set_finish(scene: Scene, roughness: float | None, metallic: float) -> None:
    """Gives all materials a roughness; raises ValueError if a number is out of its range."""
    if roughness is None:
        raise ValueError("--metallic needs --roughness")
    for geometry_id in range(scene.geometry_count()):
        ((group, _),) = scene.material_sets([geometry_id])
        materials = [
            replace(
                material,
                roughness=roughness,
                metallic=metallic,
                roughness_texture=None,
                metallic_texture=None,
            )
            for material in group.materials
        ]
        scene.set_material(geometry_id, materials, group.faces)


def stage_camera(scene: Scene, path: str | None) -> Camera | None:
    """The camera at `path` of the scene's stage; None if `path` is.

    Raises ValueError if there is none.
    """
    if path is None:
        return None
    if scene.stage is None:
        raise ValueError("--camera is for whole USD stages")
    cameras = scene.stage.cameras
    if path not in cameras:
        raise ValueError(f"--camera: there is no camera {path}; found: {', '.join(cameras) or '-'}")
    return cameras[path]
