"""A GPU, its kernels and its buffers: the only file that imports slangpy."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from limitray import _core

BACKENDS = ("vulkan", "cuda", "metal")
"""Devices by name; "gpu" takes the first of them that there is."""

THREADS = 64
"""A multiple of the threads of a workgroup, which kernels declare: 64, or 32 of one lane each."""

CUDA_ARGUMENTS = ["--maxrregcount=64"]


def slang_folder() -> Path:
    """Folder of the Slang modules: the search path of a renderer that says `import limitray;`."""
    return Path(_core.__file__).parent / "slang"


def import_slangpy() -> Any:
    """The module slangpy; ImportError that names the extra without it."""
    try:
        import slangpy
    except ImportError as error:
        raise ImportError(
            f'tracing on a GPU needs slangpy: pip install "limitray[gpu]" ({error})'
        ) from None
    return slangpy


class Tracer:
    """A device and its kernels, shared by all scenes on it.

    `name` is "gpu", "vulkan", "cuda" or "metal"; `folder` holds the Slang modules. Raises
    ImportError without slangpy, and RuntimeError that lists what was found if no device can be
    used. `uploaded` and `downloaded` count the bytes that went from and to the host.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self._slangpy = import_slangpy()
        self._folder = folder
        self.name = name
        self.uploaded = self.downloaded = 0
        self.device = self._open(name)
        self._kernels: dict[tuple[str, str], Any] = {}

    def _open(self, name: str) -> Any:
        found = []
        for backend in BACKENDS if name == "gpu" else (name,):
            kind = self._slangpy.DeviceType[backend]
            try:
                if self._slangpy.Device.enumerate_adapters(kind):
                    # On CUDA, registers for half of the threads of an sm_90 (docs/gpu.md).
                    options = {
                        "include_paths": [str(self._folder), str(self._slangpy.SHADER_PATH)],
                        "downstream_args": CUDA_ARGUMENTS if backend == "cuda" else [],
                    }
                    return self._slangpy.Device(
                        type=kind, compiler_options=options, enable_hot_reload=False
                    )
                found.append(f"{backend}: no adapter")
            except RuntimeError as error:
                found.append(f"{backend}: {str(error).splitlines()[0]}")
        raise RuntimeError(f'device "{name}": no GPU can be used here ({"; ".join(found)})')

    def run(self, file: str, entry: str, threads: int, variables: dict[str, Any]) -> None:
        """Runs entry point `entry` of kernels/`file`.cs.slang."""
        if (file, entry) not in self._kernels:
            path = self._folder / "kernels" / f"{file}.cs.slang"
            program = self.device.load_program(str(path), [entry])
            self._kernels[file, entry] = self.device.create_compute_kernel(program)
        workgroups = -(-threads // THREADS)
        self._kernels[file, entry].dispatch([workgroups * THREADS, 1, 1], variables)

    def buffer(self, array: NDArray[Any], stride: int = 4, device: Any = None) -> Any:
        """A buffer with the bytes of `array`, or one element if there are none.

        It lies on the tracer's device unless another one is given.
        """
        data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        if data.size == 0:
            return self.empty_buffer(stride, stride)
        self.uploaded += data.size
        return (device or self.device).create_buffer(
            size=data.size, struct_size=stride, usage=self._usage(), data=data
        )

    def empty_buffer(self, size: int, stride: int) -> Any:
        """A buffer of `size` bytes."""
        return self.device.create_buffer(size=size, struct_size=stride, usage=self._usage())

    def overwrite(self, buffer: Any, offset: int, array: NDArray[Any]) -> None:
        """Writes the bytes of `array` at `offset` of a buffer."""
        if array.size == 0:
            return
        encoder = self.device.create_command_encoder()
        data = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        encoder.upload_buffer_data(buffer, offset, data)
        self.device.submit_command_buffer(encoder.finish())
        self.uploaded += data.size

    def words(self, buffer: Any) -> NDArray[np.uint32]:
        """The 32-bit words of a buffer, on the host."""
        self.downloaded += buffer.size
        return np.asarray(buffer.to_numpy().view(np.uint8).view(np.uint32))

    def empty_tensor(self, shape: tuple[int, ...], kind: type) -> Any:
        """A slangpy.Tensor on the device; `kind` is np.float32 or np.uint32."""
        name = "float" if kind is np.float32 else "uint"
        return self._slangpy.Tensor.empty(self.device, shape, name, usage=self._usage())

    def copy(self, target: Any, target_at: int, source: Any, source_at: int, size: int) -> None:
        """Copies `size` bytes from one buffer of the device to another."""
        if size == 0:
            return
        encoder = self.device.create_command_encoder()
        encoder.copy_buffer(target, target_at, source, source_at, size)
        self.device.submit_command_buffer(encoder.finish())

    def _usage(self) -> Any:
        usage = self._slangpy.BufferUsage
        return (
            usage.shader_resource
            | usage.unordered_access
            | usage.copy_source
            | usage.copy_destination
        )


@cache
def open_tracer(name: str, folder: Path) -> Tracer:
    """The Tracer of a device; the same one each time."""
    return Tracer(name, folder)
