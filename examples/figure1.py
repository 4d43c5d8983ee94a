"""The figure of the README: a textured model, four without texture, and how fast rays are traced.

It follows Figure 1 of Binder and Keller 2015: a textured subdivision surface at the left, close-ups
at the right, and under each the millions of primary / diffuse rays a second that this machine
traces on it. All models are made by models.py and octopus.py.

usage: figure1.py [--scale S] [--spp N] [--rays N] [--denoise] [--output FILE.png]

--scale 0.3 --spp 4 --rays 20000 gives a quick look.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from models import gear, knot, sponge
from numpy.typing import NDArray
from octopus import materials, octopus
from PIL import Image, ImageDraw, ImageFont

import limitray as lr

REPOSITORY = Path(__file__).parents[1]
LARGE, SMALL, GAP, LABEL = (580, 560), (280, 264), 8, 24
"""Sizes in pixels: the textured picture, the others, the space between, and the lines of text."""
ROUNDS = 7

SKY = lr.GradientSky((0.30, 0.38, 0.52), (0.42, 0.45, 0.50), (0.20, 0.20, 0.20))
SUN = lr.Sun((-0.9, 0.9, 0.5), (3.6, 3.2, 2.7), 7)
FLOOR = lr.Material((0.52, 0.53, 0.55))
CLAY = lr.Material((0.62, 0.56, 0.49), roughness=0.5)


@dataclass(frozen=True)
class View:
    """One picture of the figure."""

    name: str
    scene: lr.Scene
    camera: lr.Camera
    size: tuple[int, int]


def textured_octopus() -> View:
    """The large picture."""
    scene, shape = on_floor(octopus())
    scene.set_material(0, *materials())
    camera = replace(framed(shape, LARGE, -22, 22, 0.0), fov_deg=26.5)
    return View("textured octopus", scene, camera, LARGE)


def octopus_eye() -> View:
    """The same without texture, from near by."""
    scene, _ = on_floor(octopus())
    camera = lr.Camera((-2.2, 2.0, 5.4), (-1.78, -0.12, 1.46), fov_deg=19)
    return View("octopus, close-up", scene, camera, SMALL)


def knot_view() -> View:
    """2,400 semi-sharp crease edges along the ridges of a torus knot."""
    scene, shape = on_floor(knot())
    return View("fluted knot", scene, framed(shape, SMALL, 20, 48, 0.05), SMALL)


def sponge_view() -> View:
    """1,296 semi-sharp crease edges, and extraordinary vertices of valence 3, 5 and 6."""
    scene, _ = on_floor(sponge())
    camera = lr.Camera((3.3, 3.0, 4.6), (0.42, 0.30, 0.6), fov_deg=17)
    return View("sponge, close-up", scene, camera, SMALL)


def gear_view() -> View:
    """Sharp and semi-sharp creases of a machined shape."""
    scene, _ = on_floor(gear())
    camera = lr.Camera((2.0, 2.6, 4.1), (0.62, 0.05, 0.72), fov_deg=21)
    return View("gear, close-up", scene, camera, SMALL)


VIEWS: tuple[Callable[[], View], ...] = (
    textured_octopus,
    octopus_eye,
    knot_view,
    sponge_view,
    gear_view,
)


def on_floor(mesh: lr.Mesh) -> tuple[lr.Scene, lr.Scene]:
    """A clay mesh on a wide floor; and a scene of the mesh alone, to frame it."""
    alone = lr.Scene()
    alone.add_mesh(mesh)
    scene = lr.Scene()
    scene.set_material(scene.add_mesh(mesh), CLAY)
    (_, low, _), _ = alone.bounds()
    points = [(-90, low, 90), (90, low, 90), (90, low, -90), (-90, low, -90)]
    scene.set_material(scene.add_mesh(lr.Mesh(points, [4], [0, 1, 2, 3])), FLOOR)
    return scene, alone


def framed(
    scene: lr.Scene, size: tuple[int, int], azimuth: float, elevation: float, margin: float
) -> lr.Camera:
    """A camera that shows all of the scene, from the given angles in degrees."""
    return lr.Camera.frame(scene, size[0] / size[1], azimuth, elevation, margin=margin)


def rates(view: View, rays: int) -> tuple[float, float]:
    """Millions of rays a second: primary (camera) rays, and diffuse rays from what they hit.

    Primary rays go through random places of the picture, diffuse ones are cosine-distributed around
    the normals and shuffled. What counts is the tracing of closest hits with their parameters and
    normals, the best of some rounds.
    """
    rng = np.random.default_rng(0)
    width, height = view.size
    x, y = rng.uniform((0, 0), (width, height), (rays, 2)).T
    primary = view.camera.rays(x, y, width, height).astype(np.float32)
    hits = view.scene.cast_rays(primary, attributes=("points", "t_error"))
    rows = rng.permutation(np.flatnonzero(np.isfinite(hits["t_hit"])))
    normals = hits["primitive_normals"][rows]
    normals *= -np.sign((normals * primary[rows, 3:]).sum(axis=1, keepdims=True))
    around = rng.normal(size=normals.shape)
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    error = 2 * hits["t_error"][rows]
    starts = hits["points"][rows] + error[:, np.newaxis] * normals
    diffuse = np.concatenate([starts, normals + around], axis=1).astype(np.float32)
    return mrays(view.scene, primary, 0), mrays(view.scene, diffuse, error)


def mrays(scene: lr.Scene, rays: NDArray[np.float32], tnear: NDArray[np.float32] | int) -> float:
    """Millions of rays that are traced a second, when the process has the processors for itself.

    The processor time of all threads is divided by their number: other programs do not count.
    """
    seconds = []
    for _ in range(ROUNDS):
        start = time.process_time()
        scene.cast_rays(rays, tnear)
        seconds.append((time.process_time() - start) / (os.cpu_count() or 1))
    return len(rays) / min(seconds) / 1e6


def picture(view: View, scale: float, spp: int, denoise: bool) -> Image.Image:
    """The view, path traced."""
    width, height = (max(8, round(length * scale)) for length in view.size)
    image = lr.render(
        view.scene, view.camera, width, height, spp, "path",
        sky=SKY, lights=[SUN], max_depth=4, denoise=denoise,
    )  # fmt: skip
    return Image.fromarray(image.srgb()).resize(view.size, Image.Resampling.LANCZOS)


def processor() -> str:
    """Name and number of the processors, as far as the system tells."""
    names = [platform.processor() or platform.machine()]
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text().splitlines()
        names = [line.partition(":")[2].strip() for line in lines if "model name" in line] or names
    return f"{names[0]}, {os.cpu_count()} threads, {lr.Scene.isa()}"


def compose(pictures: list[Image.Image], labels: list[str], footer: str) -> Image.Image:
    """The large picture at the left, the others two by two at the right, texts below."""
    width = LARGE[0] + 2 * (GAP + SMALL[0])
    row = SMALL[1] + LABEL
    sheet = Image.new("RGB", (width, 2 * row + LABEL), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(14)
    places = [(0, 0, 2 * row - LABEL)]
    places += [
        (LARGE[0] + GAP + i * (SMALL[0] + GAP), j * row, SMALL[1]) for j in (0, 1) for i in (0, 1)
    ]
    for image, label, (x, y, height) in zip(pictures, labels, places, strict=True):
        sheet.paste(image.crop((0, 0, image.width, height)), (x, y))
        draw.text((x + image.width / 2, y + height + 12), label, "black", font, anchor="mm")
    draw.text((width / 2, sheet.height - 11), footer, "#555555", font, anchor="mm")
    return sheet


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scale", type=float, default=1.0, help="factor on what is rendered")
    parser.add_argument("--spp", type=int, default=128, help="samples a pixel")
    parser.add_argument("--rays", type=int, default=1_000_000, help="rays of each kind to time")
    parser.add_argument("--denoise", action="store_true", help="needs limitray[denoise]")
    parser.add_argument("--output", type=Path, default=REPOSITORY / "docs/figure1.png")
    arguments = parser.parse_args()
    pictures, labels = [], []
    for make in VIEWS:
        view = make()
        primary, diffuse = rates(view, arguments.rays)
        labels.append(f"{view.name}: {primary:.1f} / {diffuse:.1f}")
        print(labels[-1], flush=True)
        pictures.append(picture(view, arguments.scale, arguments.spp, arguments.denoise))
    footer = f"millions of primary / diffuse rays a second, unsorted; {processor()}"
    sheet = compose(pictures, labels, footer)
    sheet.save(arguments.output, optimize=True)
    print(arguments.output)


if __name__ == "__main__":
    main()
