"""What the GPU tests are worth: a kernel with a planted fault must fail them; and the errors."""

import shutil
import sys

import numpy as np
import pytest
from gpu_devices import ALL, disagreements, require_gpu
from shapes import REPOSITORY, cage, rays_towards

import limitray as lr
from limitray.gpu import GpuScene


def test_without_slangpy(monkeypatch):
    monkeypatch.setitem(sys.modules, "slangpy", None)
    with pytest.raises(ImportError, match=r"pip install \"limitray\[gpu\]\""):
        GpuScene("gpu", folder=REPOSITORY / "nowhere")


def test_without_a_device():
    pytest.importorskip("slangpy")
    with pytest.raises(RuntimeError, match='device "metal": no GPU can be used here \\(metal: '):
        lr.Scene(device="metal")


def test_an_unknown_device():
    with pytest.raises(ValueError, match="device must be one of cpu, gpu, vulkan, cuda, metal"):
        lr.Scene(device="tpu")


FAULTS = {
    "math/thread_group.slang": ("int(first + component))", "int(first + (component + 1) % 3))"),
    "intersect/root_patch.slang": ("r.shear * g.get_z(v)", "r.shear * g.get_y(v)"),
    "intersect/domain.slang": ("index_u ^= in_u", "index_v ^= in_u"),
}


def altered_scene(folder, file, right, wrong):
    """A GPU scene whose kernels, copied to `folder`, have `wrong` instead of `right` in a file."""
    source = REPOSITORY / "src"
    for path in source.rglob("*.slang"):
        (folder / path.relative_to(source)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, folder / path.relative_to(source))
    text = (folder / "limitray" / file).read_text()
    assert right in text
    (folder / "limitray" / file).write_text(text.replace(right, wrong))
    scene = lr.Scene(device="vulkan")
    scene._scene = GpuScene("vulkan", folder=folder)
    return scene


@pytest.mark.parametrize("file", FAULTS)
def test_a_planted_fault_is_caught(tmp_path, file):
    require_gpu()  # skips this test alone
    cpu, gpu = lr.Scene(), altered_scene(tmp_path, file, *FAULTS[file])
    for scene in (cpu, gpu):
        scene.add_mesh(cage("torus_creases"))
    gpu._scene.set_newton(file != "intersect/domain.slang")
    rays = rays_towards(cpu, 200, dtype=np.float32)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    assert len(disagreements(a, b)) > 10


def test_splits_are_limited_a_ray(tmp_path):
    # No surface reaches the limits of 65,536 and 1,024 splits; these are 8 and 1.
    require_gpu()
    file = "intersect/intersect_patch.slang"
    gpu = altered_scene(tmp_path, file, "max_splits = 1u << 16", "max_splits = 8")
    text = (tmp_path / "limitray" / file).read_text()
    (tmp_path / "limitray" / file).write_text(text.replace("_rest = 1u << 10", "_rest = 1"))
    gpu.add_mesh(cage("torus"))
    gpu._scene.set_newton(False)
    rays = rays_towards(gpu, 100, dtype=np.float32)
    gpu.cast_rays(rays)
    counts = gpu.statistics()
    assert counts["unresolved"] > 0
    # Each patch may take up to the ray's limit what its predecessors left, and 1 in any case.
    assert counts["splits"] <= 8 * 100 + counts["patch_tests"]
