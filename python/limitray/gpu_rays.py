"""Rays on their way to a GPU: batches of them as the Slang structs of kernels/rays.slang."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from limitray.gpu_arrays import DeviceArray
from limitray.gpu_tracer import Tracer

Numbers = NDArray[Any] | DeviceArray


class RaySource(Protocol):
    """Rays, on the host or on the device."""

    hit_kernels: str
    attribute_kernels: str

    def __len__(self) -> int: ...

    def batch(self, tracer: Tracer, rows: slice) -> dict[str, Any]:
        """Some of the rays, as a Slang struct."""
        ...


@dataclass(frozen=True)
class BufferRays:
    """Rays (n, 6); limits of 1 number or of n."""

    rays: Numbers
    tnear: Numbers
    tfar: Numbers
    hit_kernels = "closest_hits"
    attribute_kernels = "attributes"

    def __len__(self) -> int:
        return len(self.rays)

    def batch(self, tracer: Tracer, rows: slice) -> dict[str, Any]:
        """The Slang struct RayBuffer."""
        buffer, first = _words(tracer, self.rays, rows, 6)
        return {"rays": buffer, "first": first, **_limits(tracer, self.tnear, self.tfar, rows)}


@dataclass(frozen=True)
class CameraRays:
    """Rays of a pinhole camera through the places `positions` (n, 2), or the centres of all pixels.

    `view` (4, 3): the eye, the direction through the picture's top left corner, and how it changes
    with a pixel across and a pixel down.
    """

    view: NDArray[np.float32]
    width: int
    count: int
    positions: Numbers | None
    tnear: Numbers
    tfar: Numbers
    hit_kernels = "camera_hits"
    attribute_kernels = "camera_attributes"

    def __len__(self) -> int:
        return self.count

    def batch(self, tracer: Tracer, rows: slice) -> dict[str, Any]:
        """The Slang struct CameraRays."""
        places = np.zeros((0, 2), np.float32) if self.positions is None else self.positions
        buffer, first = _words(tracer, places, rows, 2)
        return {
            "positions": buffer,
            "first": first,
            "stride": 0 if self.positions is None else 2,
            "width": self.width,
            "first_pixel": rows.start,
            "view": tracer.buffer(np.pad(self.view, ((0, 0), (0, 1))), 16),
            **_limits(tracer, self.tnear, self.tfar, rows),
        }


def _words(tracer: Tracer, numbers: Numbers, rows: slice, width: int) -> tuple[Any, int]:
    """A buffer that holds rows of `width` numbers, and the word where they begin."""
    if isinstance(numbers, DeviceArray):
        return numbers.buffer, numbers.first + width * rows.start
    return tracer.buffer(np.asarray(numbers[rows], np.float32)), 0


def _limits(tracer: Tracer, tnear: Numbers, tfar: Numbers, rows: slice) -> dict[str, Any]:
    members = {}
    for name, limit in (("tnear", tnear), ("tfar", tfar)):
        one = len(limit) == 1
        buffer, first = _words(tracer, limit, slice(0, 1) if one else rows, 1)
        members[name] = {"values": buffer, "first": first, "stride": 0 if one else 1}
    return members
