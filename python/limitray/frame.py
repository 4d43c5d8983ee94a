"""The work of a picture: tiles of pixels, sample after sample, done side by side by threads."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from threading import Event

import numpy as np
from numpy.typing import NDArray

from limitray.camera import Camera
from limitray.hits import Rays, Shot
from limitray.scene import Scene
from limitray.vectors import Array, column, dot

TILE_PIXELS = 1 << 16
"""Pixels traced at once: many for the tracer, and few enough for the processor's cache."""


@dataclass(frozen=True)
class Tile:
    """Sample number `index` of the given pixels (n,)."""

    index: int
    pixels: NDArray[np.uint32]


TileJob = Callable[[Tile, Callable[[], None]], NDArray[np.float32]]
"""What is done for a tile; it calls the function it is given often, which raises to end it."""


@dataclass(frozen=True)
class Frame:
    """What stays the same over all tiles and samples of a picture."""

    scene: Scene
    camera: Camera
    width: int
    height: int
    seed: int
    spp: int

    def tiles(self) -> Iterator[Tile]:
        """All tiles of the first sample, then of the second, and so on."""
        pixels = np.arange(self.width * self.height, dtype=np.uint32)
        for index in range(self.spp):
            for i in range(0, len(pixels), TILE_PIXELS):
                yield Tile(index, pixels[i : i + TILE_PIXELS])

    def rays(self, pixels: NDArray[np.uint32], offset: Array) -> Rays:
        """Unit camera rays through the places `offset` (2, n) in [0, 1)^2 of pixels (n,)."""
        x = (pixels % self.width + offset[0]).astype(np.float64)
        y = (pixels // self.width + offset[1]).astype(np.float64)
        right, up, ahead = (column(axis) for axis in self.camera.axes())
        half = self.camera.half_width(self.width, self.height)
        across = ((2 / self.width * half) * x - half).astype(np.float32)
        upward = half * self.height / self.width - (2 / self.width * half) * y
        directions = across * right + upward.astype(np.float32) * up + ahead
        inverse = 1 / np.sqrt(dot(directions, directions))
        step = (2 / self.width * half / np.sqrt(self.spp) * inverse).astype(np.float32)
        return Rays(
            origins=np.repeat(column(self.camera.eye), len(pixels), axis=1),
            directions=directions * inverse,
            tnear=np.zeros(len(pixels), np.float32),
            pixels=pixels,
            spread=(np.asarray(step * right), np.asarray(step * -up)),
            shot=Shot(
                self.camera,
                self.width,
                self.height,
                np.stack([x, y], axis=-1).astype(np.float32),
                np.asarray(1 / inverse, np.float32),
            ),
        )


class _StoppedError(Exception):
    """The picture is not wanted any more."""


def run_jobs(frame: Frame, job: TileJob) -> Iterator[tuple[Tile, NDArray[np.float32]]]:
    """Does the job for all tiles; yields them in order, whatever the number of threads.

    Each thread shades its tile while the tracer works on the others'. When the caller stops early
    the work ends within a batch.
    """
    stop = Event()

    def check() -> None:
        if stop.is_set():
            raise _StoppedError

    threads = frame.scene.threads or os.cpu_count() or 1
    waiting: deque[tuple[Tile, Future[NDArray[np.float32]]]] = deque()
    with ThreadPoolExecutor(threads, "limitray-render") as pool:
        try:
            for tile in frame.tiles():
                waiting.append((tile, pool.submit(job, tile, check)))
                if len(waiting) > 2 * threads:
                    done, future = waiting.popleft()
                    yield done, future.result()
            while waiting:
                done, future = waiting.popleft()
                yield done, future.result()
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)
