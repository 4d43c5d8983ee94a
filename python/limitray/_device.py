"""The part of `Scene` that is about the device it traces on."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from limitray import _core
from limitray.gpu import GpuScene


class OnDevice:
    """A scene that lies on the CPU or on a GPU."""

    _scene: _core.Scene | GpuScene
    _turn: AbstractContextManager[Any]

    @property
    def gpu_device(self) -> Any:
        """The `slangpy.Device` of a scene on a GPU; None on the CPU.

        `cast_rays` and `test_occlusions` read float32 rays (..., 6), tnear and tfar that lie on
        this device: a `slangpy.Buffer` of 6 floats a ray, a contiguous `slangpy.Tensor`, or with
        device="cuda" a `torch.Tensor`, which slangpy copies on the device. Their values are not
        checked. Hits are those of what has been submitted to the device before.
        """
        return None if self._gpu is None else self._gpu.device

    @property
    def _gpu(self) -> GpuScene | None:
        return self._scene if isinstance(self._scene, GpuScene) else None

    def slang_view(self, device: Any = None) -> dict[str, Any]:
        """The Slang struct SceneView of a scene on a GPU, for kernels of one's own.

        Buffers on `gpu_device`, or, copied through the host, on another `slangpy.Device`. They are
        what the scene is now: ask again after a change. Raises ValueError for a scene on the CPU.
        """
        if self._gpu is None:
            raise ValueError('slang_view needs a scene on a GPU: Scene(device="gpu")')
        with self._turn:
            return self._gpu.slang_view(device)

    def device_name(self) -> str:
        """Name of what traces float32 rays: "cpu", or that of the GPU."""
        return "cpu" if self._gpu is None else self._gpu.adapter
