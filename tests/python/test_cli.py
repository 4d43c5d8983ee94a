"""The command line: what it writes, what it prints, and how it fails."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from shapes import REPOSITORY, assert_fails, cage, rays_towards, scene_of

from limitray.cli import main

CUBE = str(REPOSITORY / "tests/cages/cube.obj")
TINY = ["--size", "32x24", "--spp", "1"]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_render_writes_a_picture(capsys):
    assert main(["render", CUBE, "-o", "cube.png", *TINY]) == 0
    with Image.open("cube.png") as picture:
        assert picture.size == (32, 24)
    printed = capsys.readouterr()
    assert printed.out == "cube.png\n"
    assert printed.err == ""


def test_render_takes_a_camera_and_layers():
    options = ["--eye", "-1,-2,7", "--center", "0,0,0", "--up", "0,0,1", "--fov", "35"]
    layers = ["--aov", "depth,normal,position,face,patch"]
    assert main(["render", CUBE, "-o", "cube.exr", *TINY, *options, *layers]) == 0
    assert os.path.getsize("cube.exr") > 1000


@pytest.mark.parametrize("integrator", ["ao", "facing", "normal", "uv", "path"])
def test_render_takes_integrators(integrator):
    assert main(["render", CUBE, "-o", "cube.png", *TINY, "--integrator", integrator]) == 0


def test_render_takes_light_and_a_finish():
    path = ["--integrator", "path", "--sun", "0,1,1"]
    Image.new("RGB", (8, 4), (200, 150, 90)).save("sky.png")
    pictures = []
    for options in ([], ["--sky", "1,0.5,0.2"], ["--sky", "sky.png"], ["--max-depth", "1"],
                    ["--roughness", "0.3"], ["--roughness", "0.3", "--metallic", "1"]):  # fmt: skip
        assert main(["render", CUBE, "-o", "cube.png", *TINY, *path, *options]) == 0
        pictures.append(Path("cube.png").read_bytes())
    assert len(set(pictures)) == len(pictures) - 1, "a convex shape has one bounce"
    assert pictures[3] == pictures[0]


def test_render_prints_statistics(capsys):
    assert main(["render", CUBE, "-o", "cube.png", *TINY, "--stats"]) == 0
    table = capsys.readouterr().out
    for word in ("patches", "rays a second", "patch tests", "unresolved", "cube.png"):
        assert word in table
    assert main(["render", CUBE, "-o", "cube.png", *TINY, "--json", "--isolation-level", "2"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["statistics"]["unresolved"] == 0
    assert facts["statistics"]["rays"] >= 32 * 24
    assert facts["mesh"]["patches"] > 0
    assert not facts["interrupted"]


def test_seeds_and_threads(capsys):
    for name, options in (("a", []), ("b", ["--threads", "1"]), ("c", ["--seed", "5"])):
        assert main(["render", CUBE, "-o", f"{name}.png", *TINY, *options]) == 0
    a, b, c = (Path(f"{name}.png").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_info_prints_a_table_and_json(capsys):
    assert main(["info", CUBE]) == 0
    assert re.search(r"vertices by valence +3: 8", capsys.readouterr().out)
    assert main(["info", CUBE, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["model"] == CUBE
    assert facts["extraordinary_vertices"] == 8


def test_tolerance_chooses_the_level_in_every_command(capsys):
    """`info` and `render` tell the level; `cast` hits what it hits at that level."""
    np.save("rays.npy", rays_towards(scene_of(cage("cube")), 40, dtype=np.float64))
    levels, distances = [], []
    for tolerance in ("1e-2", "1e-5", "1e-7"):
        option = ["--tolerance", tolerance]
        assert main(["info", CUBE, "--json", *option]) == 0
        facts = json.loads(capsys.readouterr().out)
        assert facts["limit_error"] <= float(tolerance)
        levels.append(facts["isolation_level"])
        assert main(["render", CUBE, "-o", "cube.png", *TINY, "--json", *option]) == 0
        assert json.loads(capsys.readouterr().out)["mesh"]["isolation_level"] == levels[-1]
        found = []
        for chosen in (option, ["--isolation-level", str(levels[-1])]):
            assert main(["cast", CUBE, "rays.npy", "-o", "hits.npz", *chosen]) == 0
            found.append(np.load("hits.npz")["t_hit"])
        np.testing.assert_array_equal(*found)
        distances.append(found[0])
        capsys.readouterr()
    assert levels[0] < levels[1] < levels[2]
    assert (distances[0] != distances[2]).any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_cast_writes_hits(capsys, dtype):
    scene = scene_of(cage("cube"))
    rays = rays_towards(scene, 60, dtype=dtype).reshape(5, 12, 6)
    np.save("rays.npy", rays)
    assert main(["cast", CUBE, "rays.npy", "-o", "hits.npz", "--attributes", "points"]) == 0
    written, expected = np.load("hits.npz"), scene.cast_rays(rays, attributes=("points",))
    assert set(written) == set(expected)
    for name, array in expected.items():
        np.testing.assert_array_equal(written[name], array)
    assert "of 60 rays hit" in capsys.readouterr().out
    arguments = ["cast", CUBE, "rays.npy", "-o", "hits.npz", "--tfar", "0.001", "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["hits"] == 0


PATH = ["render", CUBE, "-o", "a.png", "--integrator", "path"]
BOTH = ["--isolation-level", "3", "--tolerance", "1e-3"]
FAILURES = [
    (["render", "nothing.obj", "-o", "a.png"], 1, "nothing.obj: No such file or directory"),
    (["render", CUBE, "-o", "nowhere/a.png"], 1, "nowhere/a.png: No such file or directory"),
    (["render", "bad.obj", "-o", "a.png"], 1, "bad.obj:1: "),
    (["render", CUBE, "-o", "folder.png"], 1, "folder.png: Is a directory"),
    (["render", CUBE, "-o", "a.jpg"], 2, '"a.jpg" does not end in .png or .exr'),
    (["render", CUBE], 2, "Missing option '--output'"),
    (["render", CUBE, "-o", "a.png", "--fast"], 2, "No such option: --fast"),
    (["render", CUBE, "-o", "a.png", "--size", "12"], 2, '"12" is not a size such as 960x720'),
    (["render", CUBE, "-o", "a.png", "--size", "0x9"], 2, '"0x9" is not a size'),
    (["render", CUBE, "-o", "a.png", "--eye", "1,2"], 2, '"1,2" is not three numbers'),
    (["render", CUBE, "-o", "a.png", "--eye", "1,2,3"], 2, "go together"),
    (["render", CUBE, "-o", "a.png", "--spp", "0"], 2, "--spp"),
    (
        ["render", CUBE, "-o", "a.png", "--integrator", "x"],
        2,
        '--integrator: "x" is not one of ao, facing',
    ),
    (["render", CUBE, "-o", "a.exr", "--aov", "z"], 2, '"z" is not one of depth, normal'),
    (["render", CUBE, "-o", "a.png", "--aov", "depth"], 2, "needs an output that ends in .exr"),
    (["render", CUBE, "-o", "a.png", "--fov", "200"], 1, "fov_deg must be above 0 and below 180"),
    (["render", CUBE, "-o", "a.png", "--fov", "nan"], 1, "fov_deg must be above 0 and below 180"),
    (["render", CUBE, "-o", "a.png", "--denoise"], 2, "--denoise: for --integrator path alone"),
    (
        ["render", CUBE, "-o", "a.png", "--max-depth", "3", "--roughness", "0.5"],
        2,
        "--max-depth, --roughness: for --integrator path alone",
    ),
    (["render", CUBE, "-o", "a.png", "--threads", "4097"], 2, "--threads"),
    (["render", CUBE, "-o", "a.png", "--camera", "/a"], 1, "--camera is for whole USD stages"),
    ([*PATH, "--metallic", "1"], 1, "--metallic needs --roughness"),
    ([*PATH, "--roughness", "2"], 1, "roughness must be 0.05 to 1, not 2"),
    ([*PATH, "--sky", "blue"], 2, '"blue" is not three numbers'),
    (["info"], 2, "Missing argument 'MODEL'"),
    (["info", CUBE, "--isolation-level", "11"], 2, "--isolation-level"),
    (["info", CUBE, *BOTH], 2, "--isolation-level, --tolerance: exclude each other"),
    (["render", CUBE, "-o", "a.png", *BOTH], 2, "--tolerance: exclude each other"),
    (["cast", CUBE, "short.npy", "-o", "a.npz", *BOTH], 2, "--tolerance: exclude each other"),
    (["info", CUBE, "--tolerance", "nan"], 1, "tolerance must be a number above 0, not nan"),
    (["cast", CUBE, "rays.npy", "-o", "a.npz"], 1, "rays.npy: No such file or directory"),
    (["cast", CUBE, CUBE, "-o", "a.npz"], 1, "not a .npy file of numbers"),
    (["cast", CUBE, "short.npy", "-o", "a.npz"], 1, "rays must have shape (..., 6), not (3, 5)"),
    (["cast", CUBE, "rays1.npy", "-o", "a.npz", "--tnear", "-1"], 1, "tnear must be at least 0"),
    (["cast", CUBE, "rays1.npy", "-o", "a.npz", "--tfar", "nan"], 1, "not NaN, got nan"),
    (["cast", CUBE, "short.npy", "-o", "a.npy"], 2, '"a.npy" does not end in .npz'),
    (["draw"], 2, "No such command 'draw'"),
]


@pytest.mark.parametrize(("arguments", "code", "message"), FAILURES)
def test_failures_are_one_line_and_an_exit_code(arguments, code, message, capsys, tmp_path):
    np.save("short.npy", np.zeros((3, 5)))
    np.save("rays1.npy", np.zeros((1, 6)))
    (tmp_path / "bad.obj").write_text("f 1 2 9\n")
    (tmp_path / "folder.png").mkdir()
    before = sorted(tmp_path.iterdir())
    assert_fails(capsys, arguments, code, message)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("command", [[], ["render"], ["info"], ["cast"], ["convert"]])
def test_help_teaches(command, capsys):
    assert main([*command, "--help"]) == 0
    text = capsys.readouterr().out
    if command:
        assert "Examples" in text
        assert f"limitray {command[0]} " in text
    else:
        assert all(name in text for name in ("render", "info", "cast", "convert", "Exit codes"))


def test_examples_in_the_help_run(capsys):
    """Each example line, with the model and sizes replaced by small ones."""
    np.save("rays.npy", rays_towards(scene_of(cage("cube")), 10))
    shutil.copy(REPOSITORY / "tests/cages/cube_seams.obj", "spot.obj")
    Image.new("RGB", (4, 4)).save("spot_texture.png")
    for command in ("render", "info", "cast", "convert"):
        main([command, "--help"])
        examples = re.findall(r"limitray (\w+ spot\.obj.*)", capsys.readouterr().out)
        assert len(examples) >= (1 if command == "convert" else 2)
        for example in examples:
            arguments = example.split()
            arguments += TINY if command == "render" else []
            assert main(arguments) == 0


def test_an_unknown_instruction_set_is_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "limitray.cli", "info", CUBE],
        env={**os.environ, "LIMITRAY_ISA": "sse9"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert re.fullmatch(r"limitray: LIMITRAY_ISA: .*sse9.*\n", done.stderr)


def test_the_program_is_installed():
    program = Path(sys.executable).with_name("limitray")
    done = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    assert re.fullmatch(r"limitray \d+\.\d+\.\d+.*\n", done.stdout)
    empty = subprocess.run([program], capture_output=True, text=True)
    assert empty.returncode == 2
    assert "Usage" in empty.stdout
