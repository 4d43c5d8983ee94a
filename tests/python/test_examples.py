"""The scripts of examples/ run, and the gallery's text names what they make."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from shapes import REPOSITORY

EXAMPLES = REPOSITORY / "examples"
FIGURE = REPOSITORY / "docs/figure1.png"
GALLERY = REPOSITORY / "docs/gallery"
ALL_EXAMPLES = "".join(path.read_text() for path in EXAMPLES.glob("*.py"))
PICTURES = sorted(path.stem for path in GALLERY.glob("*.png"))


def run(name, *arguments):
    """What an example prints."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_example_is_run_by_a_test():
    tests = "".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    for example in EXAMPLES.glob("*.py"):
        used = f'"{example.name}"' in tests or f"from {example.stem} import" in ALL_EXAMPLES
        assert used, example.name


def test_first_picture(tmp_path):
    run("first_picture.py", tmp_path / "cube.png")
    with Image.open(tmp_path / "cube.png") as picture:
        assert picture.size == (320, 240)
        assert np.asarray(picture).std() > 10


def test_exact_hits():
    lines = run("exact_hits.py").splitlines()
    assert len(lines) == 2
    for line, bound in zip(lines, (1e-6, 1e-14), strict=True):
        assert float(re.search(r"at most (\S+) from the limit", line)[1]) < bound


def test_gallery(tmp_path):
    run("gallery.py", "--scale", "0.06", "--spp", "1", "--output", tmp_path)
    assert sorted(path.stem for path in tmp_path.iterdir()) == PICTURES


def test_gallery_refuses_unknown_names():
    done = subprocess.run(
        [sys.executable, EXAMPLES / "gallery.py", "teapot"], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert '"teapot" is not one of demo, gear' in done.stderr


def test_figure1(tmp_path):
    quick = ["--scale", "0.06", "--spp", "1", "--rays", "1000"]
    lines = run("figure1.py", *quick, "--output", tmp_path / "figure.png").splitlines()
    assert len(lines) == 6
    for line in lines[:5]:
        primary, diffuse = re.fullmatch(r".+: (\d+\.\d) / (\d+\.\d)", line).groups()
        assert float(primary) >= 0
        assert float(diffuse) >= 0
    with Image.open(tmp_path / "figure.png") as made, Image.open(FIGURE) as kept:
        assert made.size == kept.size
    assert FIGURE.stat().st_size < 500_000


def test_the_figure_has_thousands_of_semi_sharp_creases():
    program = (
        "import limitray, models; info = limitray.mesh_info(models.knot()); "
        "print(sum(n for s, n in info['creases_by_sharpness'].items() if 0 < float(s) < 10))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=EXAMPLES, capture_output=True, text=True, check=True
    )
    assert int(done.stdout) > 2000


@pytest.mark.parametrize("name", PICTURES)
def test_the_gallery_shows_its_pictures_and_their_commands(name):
    text = (GALLERY / "README.md").read_text()
    assert f"({name}.png)" in text
    assert f"python examples/gallery.py {name}" in text
    with Image.open(GALLERY / f"{name}.png") as picture:
        assert max(picture.size) <= 1200
        assert np.asarray(picture.convert("L")).std() > 10
