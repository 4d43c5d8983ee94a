"""Renders the pictures of docs/gallery.

usage: gallery.py [--scale S] [--spp N] [--output FOLDER] [NAME ...]

Without names all pictures are made. --scale 0.25 --spp 4 gives a quick look.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from models import gear, rounded_cube
from numpy.typing import NDArray
from octopus import octopus

import limitray as lr

REPOSITORY = Path(__file__).parents[1]
Pixels = NDArray[np.float64]


@dataclass(frozen=True)
class Quality:
    """Factor on the sizes of pictures, and samples a pixel."""

    scale: float
    spp: int

    def size(self, width: int, height: int) -> tuple[int, int]:
        """A picture's size in pixels."""
        return max(8, round(width * self.scale)), max(8, round(height * self.scale))


def scene_of(mesh: lr.Mesh, isolation_level: int = 6) -> lr.Scene:
    """A scene of one mesh."""
    scene = lr.Scene()
    scene.add_mesh(mesh, isolation_level)
    return scene


def add_floor(scene: lr.Scene) -> None:
    """A wide floor under a scene whose y axis points up: one more subdivision surface."""
    low, high = scene.bounds()
    x, z = 40 * (high - low)[[0, 2]]
    points = [(-x, low[1], z), (x, low[1], z), (x, low[1], -z), (-x, low[1], -z)]
    scene.add_mesh(lr.Mesh(points, [4], [0, 1, 2, 3]))


def clay(scene: lr.Scene, camera: lr.Camera, size: tuple[int, int], spp: int) -> Pixels:
    """The picture as linear colours (h, w, 3)."""
    return lr.render(scene, camera, *size, spp=spp).linear().astype(float)


def patches(scene: lr.Scene, camera: lr.Camera, size: tuple[int, int], spp: int) -> Pixels:
    """The same, each patch in a colour of its own, three by three rays a pixel."""
    width, height = 3 * size[0], 3 * size[1]
    image = lr.render(scene, camera, width, height, spp=max(1, spp // 9), aovs=("patch",))
    ids = image.aovs["patch"].astype(np.uint64)
    hue = (ids * np.uint64(2654435761) % np.uint64(1 << 32)).astype(float) / 2**32
    wheel = 0.5 + 0.5 * np.cos(2 * np.pi * (hue[..., np.newaxis] + (0.0, 0.33, 0.67)))
    tint = np.where((image.aovs["patch"] == lr.INVALID_ID)[..., np.newaxis], 1, 0.56 + 0.52 * wheel)
    coloured = image.linear() * tint
    return coloured.reshape(size[1], 3, size[0], 3, 3).mean(axis=(1, 3))


def save(pixels: Pixels, path: Path) -> None:
    """Writes linear colours (h, w, 3) as a picture."""
    opaque = np.insert(pixels, 3, 1, axis=2).astype(np.float32)
    lr.Image(opaque, np.zeros_like(opaque[..., :3])).save(path)


def pair(
    scene: lr.Scene, camera: lr.Camera, quality: Quality, width: int = 480, height: int = 480
) -> Pixels:
    """Clay at the left, patches at the right."""
    size = quality.size(width, height)
    return np.concatenate(
        [clay(scene, camera, size, quality.spp), patches(scene, camera, size, quality.spp)], axis=1
    )


def demo_picture(quality: Quality) -> Pixels:
    """The cage that scripts/demo renders."""
    scene = scene_of(lr.Mesh.from_file(REPOSITORY / "tests/cages/demo.obj"))
    camera = lr.Camera.frame(scene, 4 / 3, azimuth_deg=7, elevation_deg=20)
    return clay(scene, camera, quality.size(800, 600), quality.spp)


def gear_picture(quality: Quality) -> Pixels:
    """A machined shape: 1,464 semi-sharp crease edges."""
    scene = scene_of(gear())
    camera = lr.Camera.frame(scene, 4 / 3, azimuth_deg=12, elevation_deg=38)
    add_floor(scene)
    return clay(scene, camera, quality.size(800, 600), quality.spp)


def octopus_picture(quality: Quality) -> Pixels:
    """A grown shape: 856 points."""
    scene = scene_of(octopus())
    camera = lr.Camera.frame(scene, 5 / 3, azimuth_deg=-24, elevation_deg=20)
    add_floor(scene)
    return clay(scene, camera, quality.size(800, 480), quality.spp)


def extraordinary_picture(quality: Quality) -> Pixels:
    """Vertices of valence 3, 5, 8 and 12: the patches shrink towards them."""
    strips = []
    for name, vertex, width in (("cube", 7, 0.75), ("pole_5", 21, 1.0), ("pole_8", 33, 0.8),
                                ("pole_12", 49, 0.6)):  # fmt: skip
        mesh = lr.Mesh.from_file(REPOSITORY / f"tests/cages/{name}.obj")
        point, normal = limit_of_vertex(mesh, vertex)
        side = np.cross(normal, (0.3, 1, 0))
        eye = point + 6 * (normal + 0.55 * side / np.linalg.norm(side))
        fov = float(np.degrees(2 * np.arctan(width / 2 / np.linalg.norm(eye - point))))
        camera = lr.Camera(tuple(eye), tuple(point), (0, 0, 1), fov)
        strips.append(patches(scene_of(mesh, 7), camera, quality.size(300, 300), quality.spp))
    return np.concatenate(strips, axis=1)


def limit_of_vertex(mesh: lr.Mesh, vertex: int) -> tuple[Pixels, Pixels]:
    """Position and unit normal of the surface at a vertex of a mesh of quads."""
    face, corner = divmod(int(np.flatnonzero(mesh.face_vertex_indices == vertex)[0]), 4)
    limit = mesh.limit(face, [(0, 0), (1, 0), (1, 1), (0, 1)][corner])
    return limit["points"], limit["normals"]


def crease_picture(quality: Quality) -> Pixels:
    """A tooth of the gear: semi-sharp creases are three pieces, cut where the sharpness ends."""
    scene = scene_of(gear())
    camera = lr.Camera(eye=(3.4, 1.9, 2.4), center=(1.66, 0.10, 0.35), fov_deg=13)
    return pair(scene, camera, quality)


def sharpness_picture(quality: Quality) -> Pixels:
    """Cubes whose upper edges have sharpness 0, 0.5, 1, 2, 3 and infinity."""
    scene = lr.Scene()
    for i, sharpness in enumerate((0.0, 0.5, 1.0, 2.0, 3.0, 10.0)):
        turn = np.eye(4)
        turn[:3, 3] = 1.9 * i, 0, 0
        scene.add_mesh(rounded_cube(sharpness), 6, turn)
    camera = lr.Camera.frame(scene, 4, azimuth_deg=0, elevation_deg=32, fov_deg=30, margin=0.03)
    return clay(scene, camera, quality.size(960, 240), quality.spp)


def terminator_picture(quality: Quality) -> Pixels:
    """Low light on a ball: 192 triangles with smooth normals at the left, the surface at the right.

    Both are lit by the same formula. The triangles are a subdivision surface too, one whose edges
    are all infinitely sharp.
    """
    ball = lr.Mesh.from_file(REPOSITORY / "tests/cages/cube.obj")
    triangles = ball.to_triangles(4)
    edges = np.sort(triangles.indices[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges = np.unique(edges, axis=0)
    normals = triangles.normals.reshape(-1, 3)
    facets = lr.Mesh(
        triangles.points,
        [3] * len(triangles.indices),
        triangles.indices.ravel(),
        crease_indices=edges.ravel(),
        crease_lengths=[2] * len(edges),
        crease_sharpnesses=[10.0] * len(edges),
        face_varying_linear_interpolation="all",
        primvars={"normals": lr.FaceVarying(normals, np.arange(len(normals)))},
    )
    size = quality.size(400, 400)
    return np.concatenate([low_light(scene_of(mesh), size) for mesh in (facets, ball)], axis=1)


def low_light(scene: lr.Scene, size: tuple[int, int], samples: int = 3) -> Pixels:
    """A ball under one distant light: cosine of the smooth normal, and a shadow ray."""
    width, height = samples * size[0], samples * size[1]
    smooth = "primvars:normals" if scene.primvar_names() else "primitive_normals"
    rays = lr.create_rays_pinhole(22, (0, 0, 0), (2.2, 1.0, 5.2), (0, 1, 0), width, height)
    hit = scene.cast_rays(rays, attributes=("points", "t_error", smooth))
    found = np.isfinite(hit["t_hit"])
    normals = hit[smooth] / np.maximum(np.linalg.norm(hit[smooth], axis=-1, keepdims=True), 1e-9)
    light = np.array((-0.85, 0.45, 0.25)) / np.linalg.norm((-0.85, 0.45, 0.25))
    starts = hit["points"] + 2 * hit["t_error"][..., np.newaxis] * hit["primitive_normals"]
    shadow = np.concatenate([starts, np.broadcast_to(light, starts.shape)], axis=-1)
    free = ~scene.test_occlusions(shadow.astype(np.float32), hit["t_error"])
    bright = 0.05 + 0.8 * np.maximum(normals @ light, 0) * free
    grey = np.where(found, bright, 0.75)
    grey = grey.reshape(size[1], samples, size[0], samples).mean(axis=(1, 3))
    return np.repeat(grey[..., np.newaxis], 3, axis=2)


PICTURES: dict[str, Callable[[Quality], Pixels]] = {
    "demo": demo_picture,
    "gear": gear_picture,
    "octopus": octopus_picture,
    "extraordinary": extraordinary_picture,
    "crease": crease_picture,
    "sharpness": sharpness_picture,
    "terminator": terminator_picture,
}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PICTURES))
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the sizes")
    parser.add_argument("--spp", type=int, default=36, help="samples a pixel")
    parser.add_argument("--output", type=Path, default=REPOSITORY / "docs/gallery")
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in PICTURES:
            parser.error(f'"{name}" is not one of {", ".join(PICTURES)}')
    arguments.output.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or PICTURES:
        path = arguments.output / f"{name}.png"
        save(PICTURES[name](Quality(arguments.scale, arguments.spp)), path)
        print(path)


if __name__ == "__main__":
    main()
