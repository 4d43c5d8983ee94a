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


@pytest.mark.parametrize("file", FAULTS)
def test_a_planted_fault_is_caught(tmp_path, file):
    require_gpu()  # skips this test alone
    source = REPOSITORY / "src"
    for path in source.rglob("*.slang"):
        (tmp_path / path.relative_to(source)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, tmp_path / path.relative_to(source))
    right, wrong = FAULTS[file]
    text = (tmp_path / "limitray" / file).read_text()
    assert right in text
    (tmp_path / "limitray" / file).write_text(text.replace(right, wrong))

    cpu, gpu = lr.Scene(), lr.Scene(device="vulkan")
    gpu._scene = GpuScene("vulkan", folder=tmp_path)
    for scene in (cpu, gpu):
        scene.add_mesh(cage("torus_creases"))
    gpu._scene.set_newton(file != "intersect/domain.slang")
    rays = rays_towards(cpu, 200, dtype=np.float32)
    a, b = (scene.cast_rays(rays, attributes=ALL) for scene in (cpu, gpu))
    assert len(disagreements(a, b)) > 10
