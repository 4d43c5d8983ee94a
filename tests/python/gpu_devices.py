"""Where the GPU tests run: a Vulkan device, software or not, or a skip."""

import os

import numpy as np
import pytest

import limitray as lr

FLOATS = ("primitive_uvs", "primitive_normals", "points", "dp_du", "dp_dv")
IDS = ("geometry_ids", "primitive_ids", "sub_quads", "patch_ids")
ALL = ("t_hit", *IDS, *FLOATS, "t_error")


def require_gpu():
    """Skips the module without a GPU, unless LIMITRAY_REQUIRE_GPU says that there must be one."""
    try:
        lr.Scene(device="vulkan")
    except (ImportError, RuntimeError) as error:
        if os.environ.get("LIMITRAY_REQUIRE_GPU"):
            raise
        pytest.skip(f"{error}; or run scripts/with_lavapipe", allow_module_level=True)


def on_both(*meshes, **arguments):
    """A scene of `meshes` on the CPU, and one on the GPU."""
    scenes = lr.Scene(), lr.Scene(device="vulkan")
    for scene in scenes:
        for mesh in meshes:
            scene.add_mesh(mesh, **arguments)
    return scenes


def disagreements(cpu, gpu):
    """Rays whose hits on two scenes differ by more than the bounds of both allow."""
    hit = np.isfinite(cpu["t_hit"])
    wrong = hit != np.isfinite(gpu["t_hit"])
    both = hit & ~wrong
    distance = np.abs(cpu["t_hit"][both] - gpu["t_hit"][both])
    wrong[both] = distance > cpu["t_error"][both] + gpu["t_error"][both]
    return np.flatnonzero(wrong)


def same_patch(cpu, gpu):
    """Rays that both scenes say to hit the same patch."""
    return np.isfinite(cpu["t_hit"]) & (cpu["patch_ids"] == gpu["patch_ids"])
