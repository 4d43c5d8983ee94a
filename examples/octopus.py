"""An octopus: a cage grown by extruding faces, with texture coordinates, and its painted skin.

Comes in: nothing. Goes out: `octopus()`, a `limitray.Mesh`, and `materials()` for its faces.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from builder import Builder, rotation
from numpy.typing import NDArray

import limitray as lr

SEGMENTS, STEPS = 16, 20
HEAD_T, ARM_T = 0.5, 0.5
"""The head has the upper half of the skin's image; every arm has the lower half."""

SKIN, EYE = 0, 1


def octopus() -> lr.Mesh:
    """An octopus with eight curling arms and two eyes. Axis y; it looks along z."""
    return _build().mesh()


def _build() -> Builder:
    profile = [
        (0.30, 2.02), (0.66, 1.90), (0.92, 1.60), (1.00, 1.22), (0.90, 0.84),
        (0.70, 0.54), (0.66, 0.34), (0.80, 0.18), (0.80, -0.12), (0.50, -0.20), (0.22, -0.14),
    ]  # fmt: skip
    b = Builder()
    for radius, height in profile:
        for k in range(SEGMENTS):
            angle = 2 * math.pi * (k + 0.5) / SEGMENTS
            lean = -0.28 * max(0.0, height - 0.5)  # the head hangs back a little
            b.point(radius * math.cos(angle), height, radius * math.sin(angle) + lean)
    ring = [list(range(i * SEGMENTS, (i + 1) * SEGMENTS)) for i in range(len(profile))]
    for i, (upper, lower) in enumerate(pairwise(ring)):
        for k in range(SEGMENTS):
            m = (k + 1) % SEGMENTS
            t, down = (1 - HEAD_T * row / (len(profile) - 1) for row in (i, i + 1))
            left, right = k / SEGMENTS, (k + 1) / SEGMENTS
            b.st[len(b.faces)] = [(left, t), (right, t), (right, down), (left, down)]
            b.faces.append([upper[k], upper[m], lower[m], lower[k]])
    for cap, t in ((ring[0][::-1], 1.0), (ring[-1], 1 - HEAD_T)):
        b.st[len(b.faces)] = [(0.5, t)] * SEGMENTS
        b.faces.append(cap)

    for k in (1, 5):
        _eye(b, 3 * SEGMENTS + k)
    for k in range(0, SEGMENTS, 2):
        _arm(b, 7 * SEGMENTS + k, k // 2)
    return b


def _eye(b: Builder, face: int) -> None:
    """A rimmed socket in one face of the head, and the ball in it."""
    corners = [b.points[v] for v in b.faces[face]]
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    normal /= np.linalg.norm(normal)
    lid = [(0.5, 1 - 0.34 * HEAD_T)] * 4
    for scale, rise in ((0.92, 0.10), (0.78, 0.03)):
        for wall in b.extrude([face], scale * np.eye(3), rise * normal):
            b.st[wall] = lid
    rim = b.faces[face]
    b.crease(1.5, *rim, rim[0])
    for wall in b.extrude([face], 0.94 * np.eye(3), -0.10 * normal):
        b.st[wall] = lid
    ball = b.extrude([face], 1.06 * np.eye(3), 0.10 * normal)
    ball += b.extrude([face], 0.72 * np.eye(3), 0.10 * normal)
    for wall in ball:
        b.st[wall] = [(0.0, 0.0)] * 4
        b.material[wall] = EYE
    b.st[face] = [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)]
    b.material[face] = EYE


def _arm(b: Builder, face: int, number: int) -> None:
    """An arm from one face: it falls to the ground, winds along it and curls up at its end."""
    centre = np.mean([b.points[v] for v in b.faces[face]], axis=0)
    heading = np.array([centre[0], 0.0, centre[2]]) / math.hypot(centre[0], centre[2])
    upward = np.array([0.0, 1.0, 0.0])
    side = np.cross(heading, upward)
    flat = number % 2 == 1  # curls along the ground, else up from it
    for i in range(STEPS):
        way = i / (STEPS - 1)
        curl = 0.95 * max(0.0, way - 0.40) / 0.60
        pitch = -0.55 if i == 0 else 0.22 if 2 <= i <= 4 else 0.0
        pitch += 0.04 if flat and i > 4 else 0.0 if flat else curl
        yaw = 0.22 * math.sin(2.6 * math.pi * way + 2.1 * number) + (curl if flat else 0.0)
        side = rotation(upward, yaw) @ side
        turn = rotation(side, pitch) @ rotation(upward, yaw)
        heading = turn @ heading
        walls = b.extrude([face], (0.915 if i else 1.15) * turn, 0.32 * 0.95**i * heading)
        for k, wall in enumerate(walls):
            t, out = ARM_T * i / STEPS, ARM_T * (i + 1) / STEPS
            left, right = k / 4, (k + 1) / 4
            b.st[wall] = [(left, t), (right, t), (right, out), (left, out)]
    b.st[face] = [(0.5, ARM_T - 1e-3)] * 4


def materials(size: int = 1024) -> tuple[list[lr.Material], list[int]]:
    """Wet skin and eyes, and which of them each face of `octopus()` has."""
    skin = lr.Material(texture=lr.Texture(_skin(size), "repeat", "clamp"), roughness=0.38)
    eye = lr.Material(texture=lr.Texture(_iris(256), "clamp", "clamp"), roughness=0.08)
    return [skin, eye], _build().material_numbers()


def _noise(size: int, cells: int, seed: int) -> NDArray[np.float64]:
    """Smooth random values (size, size) in about 0 to 1, periodic, with `cells` bumps a side."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.normal(size=(size, size)))
    across, down = np.fft.rfftfreq(size, 1 / size), np.fft.fftfreq(size, 1 / size)
    distance = np.hypot(across[np.newaxis], down[:, np.newaxis])
    field = np.fft.irfft2(spectrum * np.exp(-((distance / cells) ** 2)), (size, size))
    return np.asarray(0.5 + 0.22 * field / field.std())


def _skin(size: int) -> NDArray[np.float32]:
    """Linear colours (size, size, 3): a mottled head above, arms with two rows of suckers below."""
    t, s = np.meshgrid(1 - (np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size,
                       indexing="ij")  # fmt: skip
    # An arm is nine times as long as it is thick; fields repeat along it.
    stretched = np.where(t[:, 0] < ARM_T, 9 * t[:, 0], t[:, 0]) % 1
    lines = (size * stretched).astype(int)
    coarse, fine, grain = (_noise(size, cells, cells)[lines] for cells in (7, 26, 90))
    dark, warm, pale = (np.array(c) for c in ((0.20, 0.02, 0.015), (0.62, 0.11, 0.035),
                                              (0.85, 0.50, 0.28)))  # fmt: skip
    mottle = np.clip(1.6 * (0.55 * coarse + 0.30 * fine + 0.15 * grain) - 0.30, 0, 1)
    crown = np.clip(12 * (1 - t) - 0.25, 0, 1)  # the image has no detail at its upper end
    mottle = 0.6 + crown * (mottle - 0.6)
    spots = np.clip(9 * (fine - 0.66), 0, 1) * np.where(t < ARM_T, 0.35, 1) * crown
    skin = dark + mottle[..., np.newaxis] * (warm - dark)
    skin += 0.75 * spots[..., np.newaxis] * (pale - skin)
    below = np.where(t < ARM_T, np.clip(1.6 - 9 * np.abs(s - 0.625), 0, 1), 0)
    below = np.maximum(below, np.where(t >= ARM_T, np.clip(1 - 9 * (t - ARM_T), 0, 1), 0))
    skin += (0.85 * below)[..., np.newaxis] * (pale - skin)
    step = ARM_T / (2 * STEPS)
    for row, shift in ((0.565, 0.0), (0.685, 0.5)):
        along = ((t / step + shift) % 1 - 0.5) * step
        distance = np.hypot((s - row) / 0.040, along / 0.0050) + 9 * (t > ARM_T)
        ring = np.clip(4 * (1 - distance), 0, 1)[..., np.newaxis]
        hollow = np.clip(4 * (0.5 - distance), 0, 1)[..., np.newaxis]
        skin += ring * (np.array((0.93, 0.72, 0.55)) - skin)
        skin += 0.7 * hollow * (warm - skin)
    return np.clip(skin, 0, 1).astype(np.float32)


def _iris(size: int) -> NDArray[np.float32]:
    """Linear colours (size, size, 3): a golden eye with a bar for a pupil."""
    y, x = np.meshgrid(*2 * [np.linspace(-1, 1, size)], indexing="ij")
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    rays = 0.82 + 0.18 * np.cos(37 * angle) * np.cos(13 * angle + 1)
    iris = (rays * np.clip(1.35 - radius, 0, 1))[..., np.newaxis] * (0.95, 0.62, 0.12)
    ball = np.clip(12 * (radius - 0.92), 0, 1)[..., np.newaxis]
    pupil = np.clip(14 * (1 - np.hypot(x / 0.62, y / 0.24)), 0, 1)[..., np.newaxis]
    iris += ball * (np.array((0.10, 0.03, 0.02)) - iris)
    return np.clip(iris * (1 - pupil) + 0.004, 0, 1).astype(np.float32)
