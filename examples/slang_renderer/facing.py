"""Renders a cage with the Slang program beside this file, which imports limitray's tracer.

usage: python facing.py MODEL PICTURE.png [SIDE]
"""

import sys
from pathlib import Path

import numpy as np
import slangpy
from PIL import Image

import limitray as lr
from limitray.gpu import slang_folder

model, picture, side = sys.argv[1], sys.argv[2], int((*sys.argv, 256)[3])

# A device of our own that finds `import limitray;`.
device = slangpy.Device(
    type=slangpy.DeviceType.vulkan,
    compiler_options={"include_paths": [str(slang_folder())]},
    enable_hot_reload=False,
)
scene = lr.Scene(device="vulkan")
scene.add_mesh(lr.Mesh.from_file(model))
buffers = scene.slang_view(device)

usage = slangpy.BufferUsage.shader_resource | slangpy.BufferUsage.unordered_access
empty = lambda stride: device.create_buffer(  # noqa: E731
    data=np.zeros(side * side * stride, np.uint8), struct_size=stride, usage=usage
)
hits, values = empty(24), empty(4)
program = device.load_program(str(Path(__file__).with_name("facing.slang")), ["facing"])
device.create_compute_kernel(program).dispatch(
    [-(-side * side // 64) * 64, 1, 1],
    {"scene": buffers, "size": [side, side], "hits": hits, "picture": values},
)
grey = values.to_numpy().view(np.float32).reshape(side, side)
Image.fromarray((255 * np.clip(grey, 0, 1)).astype(np.uint8)).save(picture)
