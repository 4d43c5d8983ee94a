"""Arrays that lie on a GPU: what `Scene` takes and gives without a copy through the host.

What slangpy allows: its own buffers and tensors are read where they lie. It cannot read memory that
another library owns, so CUDA tensors of PyTorch are copied on the device by slangpy's bridge; other
libraries' GPU arrays are refused. Arrays on the host, DLPack's included, are numpy's business.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from limitray.gpu_tracer import Tracer, import_slangpy

HOST_DLPACK_DEVICES = (1, 3, 13)  # kDLCPU, kDLCUDAHost, kDLCUDAManaged


@dataclass(frozen=True)
class DeviceArray:
    """32-bit floats in a buffer of a device; `first` is the word where they begin."""

    buffer: Any
    first: int
    shape: tuple[int, ...]

    dtype = np.dtype(np.float32)

    def __len__(self) -> int:
        return self.shape[0]

    def flat(self, *width: int) -> DeviceArray:
        """The same words as an array (n, *width)."""
        return DeviceArray(self.buffer, self.first, (prod(self.shape) // prod(width), *width))


def is_on_device(values: object) -> bool:
    """Whether `values` is an array of slangpy or lies on a GPU, as DLPack tells."""
    if type(values).__module__.split(".")[0] == "slangpy":
        return True
    place = getattr(values, "__dlpack_device__", None)
    return place is not None and int(place()[0]) not in HOST_DLPACK_DEVICES


def is_buffer(values: object) -> bool:
    """Whether `values` is a slangpy.Buffer, which has a size and no shape."""
    return type(values).__module__.split(".")[0] == "slangpy" and not hasattr(values, "shape")


def device_array(name: str, values: Any, tracer: Tracer) -> DeviceArray:
    """`values`, for which is_on_device holds, as a DeviceArray of `tracer`'s device.

    Raises ValueError if they are no contiguous 32-bit floats or lie on another device.
    """
    slangpy = import_slangpy()
    if isinstance(values, slangpy.Buffer):
        _check_device(name, values.device, tracer)
        if values.size % 4 != 0:
            raise ValueError(f"{name} must be a buffer of floats, not of {values.size} bytes")
        return DeviceArray(values, 0, (values.size // 4,))
    if isinstance(values, slangpy.Tensor):
        _check_device(name, values.device, tracer)
        kind, element = str(values.dtype.full_name), tuple(values.dtype.shape)
        if kind != "float" and not kind.startswith("vector<float,"):
            raise ValueError(f"{name} must hold float, not {kind}")
        if not values.is_contiguous():
            raise ValueError(f"{name} must be contiguous; its strides are {tuple(values.strides)}")
        words = prod(element)
        return DeviceArray(values.storage, values.offset * words, (*values.shape, *element))
    if slangpy.is_torch_tensor(values):
        return _from_torch(name, values, tracer)
    raise ValueError(
        f"{name} lies on a GPU as {type(values).__module__}.{type(values).__name__}; slangpy reads "
        "its own Buffer and Tensor, and torch.Tensor"
    )


def _check_device(name: str, device: Any, tracer: Tracer) -> None:
    if device is not tracer.device:
        raise ValueError(
            f"{name} lies on another slangpy device than the scene; make it on scene.gpu_device"
        )


def _from_torch(name: str, tensor: Any, tracer: Tracer) -> DeviceArray:
    slangpy = import_slangpy()
    if not (tracer.device.desc.type == slangpy.DeviceType.cuda):
        raise ValueError(f'{name} is a torch tensor on a GPU: it needs a scene with device="cuda"')
    if str(tensor.dtype) != "torch.float32":
        raise ValueError(f"{name} must hold float32, not {tensor.dtype}")
    shape = tuple(int(length) for length in tensor.shape)
    buffer = tracer.empty_buffer(max(4, 4 * prod(shape)), 4)
    if prod(shape) > 0 and not slangpy.copy_torch_tensor_to_buffer(tensor.contiguous(), buffer):
        raise ValueError(f"{name}: slangpy could not copy the torch tensor on the device")
    return DeviceArray(buffer, 0, shape)
