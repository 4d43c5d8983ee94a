"""Arrays on the device: rays that are read where they lie, answers that stay, rays made there."""

import numpy as np
import pytest
from gpu_devices import ALL, IDS, disagreements, on_both, require_gpu
from shapes import cage, cube, rays_towards, square

import limitray as lr

require_gpu()
slangpy = pytest.importorskip("slangpy")


def float_rays(scene, count, seed=0):
    return rays_towards(scene, count, seed, np.float32)


def buffer_of(scene, array):
    usage = slangpy.BufferUsage
    return scene.gpu_device.create_buffer(
        data=array, usage=usage.shader_resource | usage.unordered_access, struct_size=4,
        size=array.nbytes,
    )  # fmt: skip


def tensor_of(scene, array):
    return slangpy.Tensor.from_numpy(scene.gpu_device, array)


def part_of_a_tensor(scene, array):
    whole = np.concatenate([np.full((2, *array.shape[1:]), 7, np.float32), array])
    return tensor_of(scene, whole)[2:]


class Dlpack:
    """A host array of a library that numpy does not know."""

    def __init__(self, array):
        self._array = array

    def __dlpack__(self, **arguments):
        return self._array.__dlpack__(**arguments)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


@pytest.mark.parametrize("made", [buffer_of, tensor_of, part_of_a_tensor])
def test_rays_on_the_device(made):
    _, gpu = on_both(cage("torus"))
    rays = float_rays(gpu, 700)
    expected = gpu.cast_rays(rays, attributes=ALL)
    found = gpu.cast_rays(made(gpu, rays), attributes=ALL)
    for name in ALL:
        np.testing.assert_array_equal(found[name], expected[name])
    occluded = gpu.test_occlusions(made(gpu, rays))
    np.testing.assert_array_equal(occluded, np.isfinite(expected["t_hit"]))


def test_answers_on_the_device():
    _, gpu = on_both(cage("torus"))
    rays = float_rays(gpu, 24).reshape(2, 3, 4, 6)
    expected = gpu.cast_rays(rays, attributes=ALL)
    found = gpu.cast_rays(rays, attributes=ALL, output="device")
    for name in ALL:
        assert isinstance(found[name], slangpy.Tensor)
        assert tuple(found[name].shape) == expected[name].shape
        array = found[name].to_numpy()
        assert array.dtype == (np.uint32 if name in IDS else np.float32)
        np.testing.assert_array_equal(array, expected[name])
    occluded = gpu.test_occlusions(rays, output="device").to_numpy()
    np.testing.assert_array_equal(occluded, np.isfinite(expected["t_hit"]))


def test_nothing_goes_through_the_host(monkeypatch):
    monkeypatch.setattr("limitray.gpu.RAYS_PER_BATCH", 300)
    _, gpu = on_both(cube())
    rays = float_rays(gpu, 1000)
    far = np.linspace(1, 9, 1000, dtype=np.float32)
    expected = gpu.cast_rays(rays, tfar=far)
    on_device, limit = tensor_of(gpu, rays), tensor_of(gpu, far)
    tracer = gpu._scene._tracer
    before = tracer.uploaded, tracer.downloaded
    hits = gpu.cast_rays(on_device, tfar=limit, output="device")
    gpu.test_occlusions(on_device, tfar=limit, output="device")
    # Settings and counters only: 8 batches.
    assert 0 < tracer.uploaded - before[0] < 1000
    assert 0 < tracer.downloaded - before[1] < 1000
    for name, array in expected.items():
        np.testing.assert_array_equal(hits[name].to_numpy(), array)
    assert 100 < np.isfinite(expected["t_hit"]).sum() < 900


def test_answers_are_rays_of_the_next_query():
    # A renderer's loop: secondary rays are made on the device from the answers.
    _, gpu = on_both(square())
    ray = np.array([[0.25, 0.5, 3, 0, 0, -1]] * 5, np.float32)
    points = gpu.cast_rays(ray, attributes=("points",), output="device")["points"]
    limits = gpu.cast_rays(ray, output="device")["t_hit"]
    assert tuple(points.shape) == (5, 3)
    hits = gpu.cast_rays(ray, tfar=limits)  # inclusive
    np.testing.assert_array_equal(hits["t_hit"], 3)
    assert np.isposinf(gpu.cast_rays(ray, tnear=limits)["t_hit"]).all()


def test_dlpack_on_the_host():
    cpu, gpu = on_both(cube())
    rays = float_rays(cpu, 50)
    for scene in (cpu, gpu):
        np.testing.assert_array_equal(
            scene.cast_rays(Dlpack(rays))["t_hit"], scene.cast_rays(rays)["t_hit"]
        )


class CudaTensor:
    """What an array on a GPU that slangpy cannot read says of itself."""

    def __dlpack_device__(self):
        return (2, 0)


def test_arrays_that_do_not_fit_are_refused():
    cpu, gpu = on_both(cube())
    rays = float_rays(cpu, 6)
    device = gpu.gpu_device
    wrong = [
        (tensor_of(gpu, rays[:, :5].copy()), r"rays must have shape \(..., 6\), not \(6, 5\)"),
        (buffer_of(gpu, rays.reshape(-1)[:10].copy()), r"shape \(..., 6\), not \(10,\)"),
        (tensor_of(gpu, rays.astype(np.float64)), "rays must hold float, not double"),
        (tensor_of(gpu, rays)[::2], "rays must be contiguous"),
        (CudaTensor(), "rays lies on a GPU as test_gpu_arrays.CudaTensor; slangpy reads its own"),
    ]  # fmt: skip
    for array, message in wrong:
        with pytest.raises(ValueError, match=message):
            gpu.cast_rays(array)
    limit = slangpy.Tensor.from_numpy(device, np.ones(5, np.float32))
    with pytest.raises(ValueError, match=r"tfar must be a number or have shape \(6,\), not \(5,\)"):
        gpu.cast_rays(rays, tfar=limit)
    with pytest.raises(ValueError, match="rays lies on a GPU, the scene on the CPU"):
        cpu.cast_rays(tensor_of(gpu, rays))
    with pytest.raises(ValueError, match='output must be "host" for a scene on the CPU'):
        cpu.cast_rays(rays, output="device")
    with pytest.raises(ValueError, match="output must be one of host, device, not 'disk'"):
        gpu.test_occlusions(rays, output="disk")
    assert cpu.gpu_device is None


def test_camera_rays_are_those_of_the_cpu():
    cpu, gpu = on_both(cage("torus"))
    camera = lr.Camera.frame(cpu, aspect=1.5)
    a, b = (scene.cast_camera_rays(camera, 60, 40, attributes=ALL) for scene in (cpu, gpu))
    assert a["t_hit"].shape == b["t_hit"].shape == (40, 60)
    flat = [
        {name: hits[name].reshape(-1, *hits[name].shape[2:]) for name in ALL} for hits in (a, b)
    ]
    # The rays themselves are rounded a little differently: at an edge one may miss.
    assert len(disagreements(*flat)) <= 3
    assert (a["patch_ids"] == b["patch_ids"]).mean() > 0.99
    inside = (a["patch_ids"] == b["patch_ids"]) & np.isfinite(a["t_hit"])
    assert np.abs(a["points"] - b["points"])[inside].max() < 2e-3
    assert np.median(np.abs(a["points"] - b["points"])[inside]) < 2e-6


def test_camera_rays_through_places():
    cpu, gpu = on_both(square())
    camera = lr.Camera((0.5, 0.5, 2), (0.5, 0.5, 0), fov_deg=60)
    places = np.array([[[5, 5], [5.5, 3.5], [0, 0]]], np.float32)
    expected = cpu.cast_camera_rays(camera, 10, 10, places, attributes=("points",))
    on_device = tensor_of(gpu, places)
    pairs = slangpy.Tensor.empty(gpu.gpu_device, (1, 3), "float2")
    pairs.storage.copy_from_numpy(places)
    for given in (places, on_device, pairs):
        hits = gpu.cast_camera_rays(camera, 10, 10, given, attributes=("points",))
        assert hits["t_hit"].shape == (1, 3)
        np.testing.assert_allclose(hits["t_hit"], expected["t_hit"], atol=1e-6)
        np.testing.assert_allclose(hits["points"], expected["points"], atol=1e-6)
    np.testing.assert_allclose(expected["t_hit"], [[2, 2, np.inf]], atol=1e-6)
    limited = gpu.cast_camera_rays(camera, 10, 10, places, tfar=[[1.9, 2.1, 9]])
    np.testing.assert_allclose(limited["t_hit"], [[np.inf, 2, np.inf]], atol=1e-6)
    with pytest.raises(ValueError, match=r"positions must be numbers of shape \(..., 2\)"):
        gpu.cast_camera_rays(camera, 10, 10, places[..., :1])


def test_camera_rays_stay_on_the_device(monkeypatch):
    monkeypatch.setattr("limitray.gpu.RAYS_PER_BATCH", 1000)
    _, gpu = on_both(cube())
    camera = lr.Camera.frame(gpu, aspect=1)
    expected = gpu.cast_camera_rays(camera, 70, 70)
    tracer = gpu._scene._tracer
    before = tracer.uploaded, tracer.downloaded
    hits = gpu.cast_camera_rays(camera, 70, 70, output="device")
    assert tracer.uploaded - before[0] < 1000
    assert tracer.downloaded - before[1] < 1000
    for name, array in expected.items():
        np.testing.assert_array_equal(hits[name].to_numpy(), array)
