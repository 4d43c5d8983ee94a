"""Pictures: camera rays in large batches, shaded, averaged and shown on a background."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray._arrays import name_list, one_of, positive_int
from limitray.camera import Camera
from limitray.denoise import denoised, load_denoiser
from limitray.frame import Frame, Tile, TileJob, run_jobs
from limitray.hits import cast
from limitray.image import Image
from limitray.light import Lighting, RectangleLight, Sky, Sun, studio
from limitray.path import PURPOSES, PathIntegrator
from limitray.sampling import Sampler
from limitray.scene import Scene
from limitray.shading import INTEGRATORS, JITTER, shade

AOVS = ("depth", "normal", "position", "face", "patch")
MAX_LIGHTS = PURPOSES - 3

BACKGROUND_TOP = np.array([0.66, 0.67, 0.69])
BACKGROUND_BOTTOM = np.array([0.86, 0.86, 0.855])

ProgressCallback = Callable[[int, int], None]


class RenderInterrupted(KeyboardInterrupt):
    """Ctrl-C stopped `render`; `image` is the average of the samples taken until then."""

    def __init__(self, image: Image) -> None:
        super().__init__("rendering was interrupted")
        self.image = image


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
    *,
    sky: Sky | None = None,
    lights: Sequence[Sun | RectangleLight] = (),
    max_depth: int = 6,
    denoise: bool = False,
) -> Image:
    """A picture of the scene.

    One sample of every pixel is taken after the other, so that a picture that is stopped early is
    a whole one with more noise.

    Parameters
    ----------
    scene : Scene
        What to show.
    camera : Camera, optional
        Without it the scene is framed automatically.
    width, height : int
        Size in pixels.
    spp : int
        Samples a pixel, at least 1; powers of 2 are spread best.
    integrator : {"ao", "facing", "normal", "uv", "path"}
        "ao": clay under a soft sky and a key light; "facing": cosine of the angle between normal
        and view; "normal": limit normals as colours; "uv": a checker in the base faces; "path":
        all light, over any number of surfaces.
    aovs : sequence of {"depth", "normal", "position", "face", "patch"}
        Layers to keep besides the colour, from one ray through each pixel's centre.
    seed : int
        Chooses the random numbers. Equal seeds give equal pictures, for any number of threads.
    progress : callable, optional
        Called with the pixel samples done and their total.
    sky : ConstantSky, GradientSky or ImageSky, optional
        For "path": what rays see that leave the scene, and the background of the picture. Without
        a sky there is none (black) if lights are given; without both a studio is lit.
    lights : sequence of Sun and RectangleLight
        For "path", at most 29. Each is aimed at from every place that a path meets.
    max_depth : int
        For "path": surfaces that light may meet between its source and the camera, at least 1.
    denoise : bool
        For "path": remove the noise that is left, with the extra `limitray[denoise]`.

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
    positive_int("seed", seed, minimum=0), positive_int("max_depth", max_depth)
    one_of("integrator", integrator, INTEGRATORS)
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a limitray.Scene, not {scene!r}")
    if camera is not None and not isinstance(camera, Camera):
        raise ValueError(f"camera must be a limitray.Camera, not {camera!r}")
    for light in lights:
        if not isinstance(light, Sun | RectangleLight):
            raise ValueError(f"lights must hold Sun and RectangleLight, not {light!r}")
    if sky is not None and not isinstance(sky, Sky):
        raise ValueError(f"sky must be a ConstantSky, GradientSky or ImageSky, not {sky!r}")
    for name in name_list("aovs", aovs):
        one_of("aovs", name, AOVS)
    if integrator != "path" and (sky is not None or lights or denoise):
        raise ValueError(f'sky, lights and denoise are for the integrator "path", not {integrator}')
    if len(lights) > MAX_LIGHTS:
        raise ValueError(f"lights must be at most {MAX_LIGHTS}, not {len(lights)}")
    if denoise:
        load_denoiser()
    camera = camera or Camera.frame(scene, width / height)
    frame = Frame(scene, camera, width, height, seed, spp)
    background = _neutral(frame)
    job = _shading_job(frame, integrator)
    if integrator == "path":
        if sky is None and not lights:
            lighting = Lighting(*studio(camera))
        else:
            lighting = Lighting(sky, lights)
            background = _seen_behind(frame, lighting)
        job = _path_job(frame, lighting, max_depth, denoise)
    sums, counts = np.zeros((10, width * height)), np.zeros(width * height)
    layers: dict[str, NDArray[Any]] = {}
    try:
        layers = _layers(frame, aovs)
        for tile, values in run_jobs(frame, job):
            place = slice(int(tile.pixels[0]), int(tile.pixels[-1]) + 1)
            sums[: len(values), place] += values
            counts[place] += 1
            if progress is not None:
                done = tile.index * width * height + int(tile.pixels[-1]) + 1
                progress(done, width * height * spp)
    except KeyboardInterrupt:
        image = _image(frame, sums / np.maximum(counts, 1), background, layers, False)
        raise RenderInterrupted(image) from None
    return _image(frame, sums / counts, background, layers, denoise)


def _shading_job(frame: Frame, integrator: str) -> TileJob:
    """One sample of each pixel of a tile: rows r, g, b, alpha (4, n)."""

    def job(tile: Tile, check: Callable[[], None]) -> NDArray[np.float32]:
        sampler = Sampler(frame.seed, tile.index)
        rays = frame.rays(tile.pixels, sampler.square(JITTER, tile.pixels))
        check()
        hits = cast(frame.scene, rays)
        values = np.zeros((4, len(tile.pixels)), np.float32)
        values[:3, hits.found] = shade(integrator, frame.scene, frame.camera, hits, sampler)
        values[3, hits.found] = 1
        return values

    return job


def _path_job(frame: Frame, lighting: Lighting, max_depth: int, denoise: bool) -> TileJob:
    """The same for the integrator "path"; to denoise, then base colour and normal: (10, n)."""

    def job(tile: Tile, check: Callable[[], None]) -> NDArray[np.float32]:
        sampler = Sampler(frame.seed, tile.index)
        rays = frame.rays(tile.pixels, sampler.square(JITTER, tile.pixels))
        light, first = PathIntegrator(frame.scene, lighting, max_depth, check).trace(rays, sampler)
        layers = [first.colors, first.normals] if denoise else []
        return np.concatenate([light, first.found[np.newaxis], *layers])

    return job


def _seen_behind(frame: Frame, lighting: Lighting) -> NDArray[np.float32]:
    """The sky and the suns behind the scene, at the centres of the pixels: (h, w, 3)."""
    pixels = np.arange(frame.width * frame.height, dtype=np.uint32)
    rays = frame.rays(pixels, np.full((2, len(pixels)), 0.5, np.float32))
    seen = lighting.distant(rays.origins, rays.directions)
    colours = sum((colour for colour, _ in seen), np.zeros((3, 1), np.float32))
    return np.ascontiguousarray(colours.T).reshape(frame.height, frame.width, 3)


def _neutral(frame: Frame) -> NDArray[np.float32]:
    height = np.linspace(0, 1, frame.height)[:, np.newaxis, np.newaxis]
    background = BACKGROUND_TOP + height * (BACKGROUND_BOTTOM - BACKGROUND_TOP)
    return np.broadcast_to(background, (frame.height, frame.width, 3)).astype(np.float32)


def _layers(frame: Frame, aovs: Sequence[str]) -> dict[str, NDArray[Any]]:
    """The chosen layers, (height, width) or (height, width, 3)."""
    if not aovs:
        return {}
    hits = frame.scene.cast_camera_rays(
        frame.camera, frame.width, frame.height, attributes=("points", "patch_ids")
    )
    keys = {
        "depth": "t_hit",
        "normal": "primitive_normals",
        "position": "points",
        "face": "primitive_ids",
        "patch": "patch_ids",
    }
    return {name: hits[keys[name]] for name in aovs}


def _image(
    frame: Frame,
    means: NDArray[np.float64],
    background: NDArray[np.float32],
    layers: dict[str, NDArray[Any]],
    denoise: bool,
) -> Image:
    planes = means.T.reshape(frame.height, frame.width, 10).astype(np.float32)
    image = Image(np.ascontiguousarray(planes[..., :4]), background, layers)
    if denoise:
        albedo, normals = (np.ascontiguousarray(planes[..., k : k + 3]) for k in (4, 7))
        behind = (1 - image.rgba[..., 3:]) * background
        clean = denoised(image.linear(), albedo + np.minimum(behind, 1), normals)
        image.rgba[..., :3] = np.maximum(clean - behind, 0)
    return image
