"""Pictures: camera rays in large batches, shaded, averaged and shown on a neutral background."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray._arrays import one_of, positive_int
from limitray.camera import Camera
from limitray.image import Image
from limitray.sampling import Sampler
from limitray.scene import Scene
from limitray.shading import INTEGRATORS, Hits, hit_attributes, sample_dimensions, shade

AOVS = ("depth", "normal", "position", "face", "patch")
TILE_PIXELS = 1 << 16
"""Pixels traced at once. Random numbers depend on it, so it is no setting."""

BACKGROUND_TOP = np.array([0.66, 0.67, 0.69])
BACKGROUND_BOTTOM = np.array([0.86, 0.86, 0.855])

ProgressCallback = Callable[[int, int], None]


class RenderInterrupted(KeyboardInterrupt):
    """Ctrl-C stopped `render`; `image` is the average of the samples taken until then."""

    def __init__(self, image: Image) -> None:
        super().__init__("rendering was interrupted")
        self.image = image


@dataclass(frozen=True)
class _Frame:
    """What stays the same over all tiles and samples of a picture."""

    scene: Scene
    camera: Camera
    width: int
    height: int
    integrator: str
    seed: int
    spp: int

    def tiles(self) -> list[NDArray[np.intp]]:
        pixels = np.arange(self.width * self.height)
        return [pixels[i : i + TILE_PIXELS] for i in range(0, len(pixels), TILE_PIXELS)]

    def rays(self, pixels: NDArray[np.intp], offset: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = pixels % self.width + offset[:, 0], pixels // self.width + offset[:, 1]
        return self.camera.rays(x, y, self.width, self.height)

    def spread(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Differences (3,) of ray directions between neighbouring samples in x and y."""
        corner = self.rays(np.array([0, 1, self.width]), np.zeros((3, 2)))[:, 3:]
        step = np.sqrt(self.spp)
        return (corner[1] - corner[0]) / step, (corner[2] - corner[0]) / step


def render(
    scene: Scene,
    camera: Camera | None = None,
    width: int = 960,
    height: int = 720,
    spp: int = 16,
    integrator: str = "ao",
    aovs: Sequence[str] = (),
    seed: int = 0,
    progress: ProgressCallback | None = None,
) -> Image:
    """A picture of the scene.

    Parameters
    ----------
    scene : Scene
        What to show.
    camera : Camera, optional
        Without it the scene is framed automatically.
    width, height : int
        Size in pixels.
    spp : int
        Samples a pixel, at least 1.
    integrator : {"ao", "facing", "normal", "uv"}
        "ao": clay under a soft sky and a key light; "facing": cosine of the angle between normal
        and view; "normal": limit normals as colours; "uv": a checker in the base faces.
    aovs : sequence of {"depth", "normal", "position", "face", "patch"}
        Layers to keep besides the colour, from one ray through each pixel's centre.
    seed : int
        Chooses the random numbers. Equal seeds give equal pictures, for any number of threads.
    progress : callable, optional
        Called with the pixel samples done and their total.

    Returns
    -------
    Image

    Raises
    ------
    ValueError
        An argument is wrong, or the scene is empty and no camera is given.
    RenderInterrupted
        Ctrl-C was pressed (a KeyboardInterrupt); it holds the picture so far.
    """
    positive_int("width", width), positive_int("height", height), positive_int("spp", spp)
    positive_int("seed", seed, minimum=0)
    one_of("integrator", integrator, INTEGRATORS)
    for name in aovs:
        one_of("aovs", name, AOVS)
    camera = camera or Camera.frame(scene, width / height)
    frame = _Frame(scene, camera, width, height, integrator, seed, spp)

    sums, hit_counts, counts = (np.zeros((width * height, k)) for k in (3, 1, 1))
    layers: dict[str, NDArray[Any]] = {}
    try:
        layers = _layers(frame, aovs)
        for index in range(spp):
            for number, pixels in enumerate(frame.tiles()):
                colours, found = _sample(frame, number, pixels, index)
                sums[pixels] += colours
                hit_counts[pixels, 0] += found
                counts[pixels] += 1
                if progress is not None:
                    progress(index * width * height + int(pixels[-1]) + 1, width * height * spp)
    except KeyboardInterrupt:
        raise RenderInterrupted(_image(frame, sums, hit_counts, counts, layers)) from None
    return _image(frame, sums, hit_counts, counts, layers)


def _sample(
    frame: _Frame, number: int, pixels: NDArray[np.intp], index: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """One sample of each of `pixels`: colours (n, 3), black for misses, and which ones hit."""
    sampler = Sampler(frame.seed, number, len(pixels), sample_dimensions(frame.integrator))
    samples = sampler.draw(index)
    rays = frame.rays(pixels, samples[:, :2])
    cast = frame.scene.cast_rays(rays.astype(np.float32), attributes=hit_attributes(frame.scene))
    found = np.isfinite(cast["t_hit"])
    hits = Hits.from_cast(frame.scene, rays, cast, frame.spread())
    colours = np.zeros((len(pixels), 3))
    colours[found] = shade(frame.integrator, frame.scene, frame.camera, hits, samples[found, 2:])
    return colours, found


def _layers(frame: _Frame, aovs: Sequence[str]) -> dict[str, NDArray[Any]]:
    """The chosen layers, (height, width) or (height, width, 3)."""
    if not aovs:
        return {}
    tiles = []
    for pixels in frame.tiles():
        rays = frame.rays(pixels, np.full((len(pixels), 2), 0.5)).astype(np.float32)
        tiles.append(frame.scene.cast_rays(rays, attributes=("points", "patch_ids")))
    keys = {
        "depth": "t_hit",
        "normal": "primitive_normals",
        "position": "points",
        "face": "primitive_ids",
        "patch": "patch_ids",
    }
    layers = {name: np.concatenate([tile[keys[name]] for tile in tiles]) for name in aovs}
    return {
        name: layer.reshape(frame.height, frame.width, *layer.shape[1:])
        for name, layer in layers.items()
    }


def _image(
    frame: _Frame,
    sums: NDArray[np.float64],
    hit_counts: NDArray[np.float64],
    counts: NDArray[np.float64],
    layers: dict[str, NDArray[Any]],
) -> Image:
    taken = np.maximum(counts, 1)
    rgba = np.concatenate([sums, hit_counts], axis=1) / taken
    height = np.linspace(0, 1, frame.height)[:, np.newaxis, np.newaxis]
    background = BACKGROUND_TOP + height * (BACKGROUND_BOTTOM - BACKGROUND_TOP)
    return Image(
        rgba.reshape(frame.height, frame.width, 4).astype(np.float32),
        np.broadcast_to(background, (frame.height, frame.width, 3)).astype(np.float32),
        layers,
    )
