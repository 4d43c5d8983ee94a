"""Where the time of a picture goes: tracing or shading, for the table of docs/rendering.md.

usage: render_profile.py [--size W H] [--spp N] [--write docs/rendering.md]

Runs on one thread and counts processor time, so that other programs do not matter. Needs limitray
installed.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable
from functools import wraps
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from models import gear
from octopus import materials, octopus

import limitray as lr

SUN = lr.Sun((-1, 1, 0.5), (3, 3, 3), 5)
Method = Callable[..., object]


class Stopwatch:
    """Processor seconds that some methods take."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, method: Method) -> Method:
        """The method, timed."""

        @wraps(method)
        def timed(*arguments: object, **options: object) -> object:
            start = time.process_time()
            try:
                return method(*arguments, **options)
            finally:
                self.seconds += time.process_time() - start

        return timed


def scene_on_floor(mesh: lr.Mesh) -> tuple[lr.Scene, lr.Camera]:
    """One thread's scene of a mesh on a floor, and a camera that shows the mesh."""
    scene = lr.Scene(threads=1)
    scene.add_mesh(mesh)
    camera = lr.Camera.frame(scene, 4 / 3)
    (_, low, _), _ = scene.bounds()
    corners = [(-90, low, 90), (90, low, 90), (90, low, -90), (-90, low, -90)]
    scene.add_mesh(lr.Mesh(corners, [4], [0, 1, 2, 3]))
    return scene, camera


def profile(size: tuple[int, int], spp: int) -> list[str]:
    """The lines of the table."""
    lines = ["| picture | rays | ns a ray | tracing | shading |", "|---|---|---|---|---|"]
    rough = lr.Material((0.8, 0.3, 0.1), roughness=0.3)
    for label, mesh, finish, options in (
        ("gear, ao", gear(), None, {"integrator": "ao"}),
        ("gear, path, diffuse", gear(), None, {"integrator": "path", "lights": [SUN]}),
        ("octopus, path, diffuse", octopus(), None, {"integrator": "path", "lights": [SUN]}),
        ("octopus, path, rough", octopus(), (rough,), {"integrator": "path", "lights": [SUN]}),
        (
            "octopus, path, textured",
            octopus(),
            materials(),
            {"integrator": "path", "lights": [SUN]},
        ),
    ):
        scene, camera = scene_on_floor(mesh)
        if finish is not None:
            scene.set_material(0, *finish)
        lr.render(scene, camera, 32, 24, 1, **options)  # tables that are made once
        watch = Stopwatch()
        scene.cast_rays = watch.around(scene.cast_rays)
        scene.test_occlusions = watch.around(scene.test_occlusions)
        scene.reset_statistics()
        start = time.process_time()
        lr.render(scene, camera, *size, spp, **options)
        total = time.process_time() - start
        rays, share = scene.statistics()["rays"], watch.seconds / total
        lines.append(
            f"| {label} | {rays / 1e6:.1f} million | {total / rays * 1e9:.0f} | {share:.0%} | "
            f"{1 - share:.0%} |"
        )
    return lines


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480), metavar=("W", "H"))
    parser.add_argument("--spp", type=int, default=4, help="samples a pixel")
    parser.add_argument(
        "--write", type=Path, metavar="FILE", help="put the table between its marks"
    )
    arguments = parser.parse_args()
    table = "\n".join(profile(tuple(arguments.size), arguments.spp))
    print(table)
    if arguments.write is not None:
        begin, end = "<!-- profile: begin -->", "<!-- profile: end -->"
        text = arguments.write.read_text()
        text = re.sub(f"(?s){begin}.*{end}", f"{begin}\n{table}\n{end}", text)
        arguments.write.write_text(text)


if __name__ == "__main__":
    main()
