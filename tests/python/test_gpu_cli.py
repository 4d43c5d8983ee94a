"""The command line with --device."""

import json
from pathlib import Path

import numpy as np
import pytest
from gpu_devices import require_gpu
from PIL import Image
from shapes import REPOSITORY, cage, rays_towards, scene_of

import limitray as lr
from limitray.cli import main

require_gpu()
CUBE = str(REPOSITORY / "tests/cages/cube.obj")
TINY = ["--size", "32x24", "--spp", "1"]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("integrator", ["ao", "path"])
def test_render_shows_the_same_picture(capsys, integrator):
    options = [*TINY, "--integrator", integrator]
    assert main(["render", CUBE, "-o", "cpu.png", *options]) == 0
    assert main(["render", CUBE, "-o", "gpu.png", *options, "--device", "gpu", "--stats"]) == 0
    assert lr.Scene(device="gpu").device_name() in capsys.readouterr().out
    a, b = (np.asarray(Image.open(name), float) for name in ("cpu.png", "gpu.png"))
    assert (np.abs(a - b).max(axis=2) > 3).mean() < 0.01
    assert np.ptp(a) > 50


def test_render_of_several_meshes(capsys):
    # A stage of two meshes, one of them placed twice.
    usd = pytest.importorskip("pxr.Usd")
    geom = pytest.importorskip("pxr.UsdGeom")
    stage = usd.Stage.CreateNew("two.usda")
    for i, name in enumerate(("cube", "torus")):
        shift = (3.0 * i, 0.0, 0.0)
        mesh, found = geom.Mesh.Define(stage, f"/{name}"), cage(name)
        mesh.CreatePointsAttr([tuple(map(float, p)) for p in found.points + shift])
        mesh.CreateFaceVertexCountsAttr(found.face_vertex_counts.tolist())
        mesh.CreateFaceVertexIndicesAttr(found.face_vertex_indices.tolist())
    copy = stage.DefinePrim("/copy")
    copy.GetReferences().AddInternalReference("/cube")
    geom.Xformable(copy).AddTranslateOp().Set((0, 3, 0))
    stage.Save()
    for device in ("cpu", "gpu"):
        options = ["-o", f"{device}.png", *TINY, "--integrator", "normal", "--device", device]
        assert main(["render", "two.usda", *options, "--json"]) == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["device"] == lr.Scene(device=device).device_name()
        assert facts["statistics"]["rays"] >= 32 * 24
    a, b = (np.asarray(Image.open(name), float) for name in ("cpu.png", "gpu.png"))
    assert (np.abs(a - b).max(axis=2) > 3).mean() < 0.02
    assert np.ptp(a) > 50


def test_cast():
    rays = rays_towards(scene_of(cage("cube")), 60, dtype=np.float32)
    np.save("rays.npy", rays)
    for device in ("cpu", "gpu"):
        command = ["cast", CUBE, "rays.npy", "-o", f"{device}.npz", "--device", device]
        assert main(command) == 0
    a, b = (np.load(f"{device}.npz") for device in ("cpu", "gpu"))
    np.testing.assert_allclose(a["t_hit"], b["t_hit"], rtol=1e-5)


def test_bench(capsys):
    short = ["--rays", "2e3", "--rounds", "2", "--isolation-level", "2", "--json", "gpu.json"]
    assert main(["bench", CUBE, "--device", "gpu", *short]) == 0
    table = capsys.readouterr().out
    report = json.loads(Path("gpu.json").read_text())
    assert report["device"] in table
    assert report["isolation_level"] == 2
    assert len(report["rows"]) == 6
    for row in report["rows"]:
        assert row["tracer"] in table
        assert row["mrays_per_s"] > 0
        assert row["count"] == 45 * 45
        assert row["mismatches"] <= 1


FAILURES = [
    (["render", CUBE, "-o", "a.png", "--device", "tpu"], 2, '--device: "tpu" is not one of cpu,'),
    (["bench", CUBE, "--device", "tpu"], 2, '--device: "tpu" is not one of cpu, gpu'),
    (["bench", CUBE, "--device", "gpu", "--tracers", "x"], 2, "are for --device cpu"),
    (["render", CUBE, "-o", "a.png", "--device", "metal"], 1, 'device "metal": no GPU can be used'),
]


@pytest.mark.parametrize(("arguments", "code", "message"), FAILURES)
def test_failures_are_one_line_and_an_exit_code(arguments, code, message, capsys):
    assert main(arguments) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert message in printed.err
