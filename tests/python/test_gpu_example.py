"""A renderer of one's own that imports the Slang modules: examples/slang_renderer runs."""

import subprocess
import sys

import numpy as np
import pytest
from gpu_devices import require_gpu
from PIL import Image
from shapes import REPOSITORY, cage, scene_of

import limitray as lr
from limitray.gpu import slang_folder

require_gpu()
FOLDER = REPOSITORY / "examples/slang_renderer"
SIDE = 64


@pytest.mark.parametrize("name", ["cube", "torus"])
def test_its_picture_shows_the_limit_surface(name, tmp_path):
    model, picture = REPOSITORY / f"tests/cages/{name}.obj", tmp_path / "a.png"
    command = [sys.executable, FOLDER / "facing.py", model, picture, str(SIDE)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    camera = lr.Camera((0, 0, 5), (0, 0, 0), fov_deg=np.degrees(2 * np.arctan(0.5)))
    y, x = np.indices((SIDE, SIDE)) + 0.5
    directions = camera.rays(x, y, SIDE, SIDE)[..., 3:]
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    hits = scene_of(cage(name)).cast_camera_rays(camera, SIDE, SIDE)
    expected = np.abs((hits["primitive_normals"] * directions).sum(axis=-1))
    found = np.asarray(Image.open(picture), float) / 255
    assert (np.abs(found - expected) > 0.01).mean() < 0.002
    assert 0.05 < np.isfinite(hits["t_hit"]).mean() < 0.95


def test_the_program_is_short():
    assert len((FOLDER / "facing.slang").read_text().splitlines()) <= 32


def test_the_modules_are_installed_where_the_call_says():
    assert (slang_folder() / "limitray.slang").is_file()
    source = REPOSITORY / "src"
    modules = {p.relative_to(source) for p in source.rglob("*.slang")}
    assert modules <= {p.relative_to(slang_folder()) for p in slang_folder().rglob("*.slang")}


def test_a_scene_on_the_cpu_has_no_slang_view():
    with pytest.raises(ValueError, match="slang_view needs a scene on a GPU"):
        lr.Scene().slang_view()
