"""Cages written as OBJ and USD read back equal; `limitray convert`, and USD on the command line."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from shapes import CAGES, REPOSITORY, assert_fails, cage, same

import limitray as lr
from limitray.cli import main
from limitray.obj import write_obj

FILES = REPOSITORY / "tests/cages/usd"
SEAMS = str(REPOSITORY / "tests/cages/cube_seams.obj")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("path", CAGES, ids=lambda p: p.stem)
def test_obj_reads_back_equal(path):
    mesh = lr.Mesh.from_file(path)
    assert write_obj(mesh, "again.obj") == ()
    assert same(lr.Mesh.from_file("again.obj"), mesh)


def test_odd_numbers_survive():
    points = np.random.default_rng(0).normal(size=(4, 3)) * [1e-30, 1e30, 1 / 3]
    mesh = lr.Mesh(points, [4], [0, 1, 2, 3], corner_indices=[1], corner_sharpnesses=[0.1])
    write_obj(mesh, "odd.obj")
    np.testing.assert_array_equal(lr.Mesh.from_file("odd.obj").points, points)


def test_left_handed_faces_turn_round():
    mesh = lr.Mesh.from_file(FILES / "tags.usda")
    lost = write_obj(mesh, "turned.obj")
    assert sorted(line.split()[1] for line in lost) == ["displayColor", "weight"]
    turned = lr.Mesh.from_file("turned.obj")
    assert turned.orientation == "rightHanded"
    assert turned.face_vertex_indices[:4].tolist() == [0, 1, 4, 3]
    for uv in ((0.2, 0.6), (0.7, 0.1)):
        a, b = mesh.limit(0, uv), turned.limit(0, uv[::-1])
        np.testing.assert_allclose(a["points"], b["points"], atol=1e-6)
        np.testing.assert_allclose(a["normals"], b["normals"], atol=1e-6)
    st, turned_st = mesh.primvars["st"], turned.primvars["st"]
    np.testing.assert_array_equal(
        st.values[st.indices[[0, 3, 2, 1]]], turned_st.values[turned_st.indices[:4]]
    )


def test_convert_there_and_back(capsys):
    assert main(["convert", SEAMS, "a.usdc"]) == 0
    assert main(["convert", "a.usdc", "b.obj"]) == 0
    assert capsys.readouterr() == ("", "")
    assert same(lr.Mesh.from_file("b.obj"), cage("cube_seams"), np.float32)


def test_convert_tells_what_is_lost(capsys):
    assert main(["convert", str(FILES / "tags.usda"), "a.obj", "--prim", "/Sheet"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert all(line.endswith("left out: OBJ cannot hold it") for line in lines)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([SEAMS, "a.usdz"], "a.usdz: must end in .obj, .usd, .usda or .usdc"),
        (["none.obj", "a.usda"], "none.obj: No such file"),
        ([str(FILES / "schemes.usda"), "a.obj"], "prim must name one of 5 meshes"),
        ([str(FILES / "schemes.usda"), "a.obj", "--prim", "/Loop"], "subdivisionScheme loop"),
    ],
)
def test_convert_errors(arguments, message, capsys):
    assert_fails(capsys, ["convert", *arguments], 1, message)
    assert list(Path().iterdir()) == []


TINY = ["--size", "32x24", "--spp", "1"]


def test_render_of_a_stage(capsys):
    stage = str(FILES / "placed.usda")
    assert main(["render", stage, "-o", "a.png", *TINY]) == 0
    assert "Sphere prims left out" in capsys.readouterr().err
    arguments = ["--camera", "/World/Shot", "--time", "10", "--integrator", "facing"]
    assert main(["render", stage, "-o", "b.png", *arguments, *TINY]) == 0
    assert np.ptp(np.asarray(Image.open("b.png"))) > 0
    assert main(["render", stage, "-o", "c.png", "--camera", "/World/Flat", *TINY]) == 1
    assert "there is no camera /World/Flat; found: /World/Shot" in capsys.readouterr().err
    one = ["--prim", "/World/Turned"]
    assert main(["render", stage, "-o", "d.png", *one, *TINY]) == 0
    assert main(["render", stage, "-o", "e.png", *one, "--time", "1", *TINY]) == 1
    assert "--time is for whole USD stages" in capsys.readouterr().err


def test_render_with_a_texture(capsys):
    Image.new("RGB", (4, 4), (255, 0, 0)).save("red.png")
    assert main(["render", SEAMS, "-o", "a.exr", "--texture", "red.png", *TINY]) == 0
    import OpenEXR

    with OpenEXR.File("a.exr", separate_channels=True) as exr:
        channels = {name: channel.pixels for name, channel in exr.channels().items()}
    seen = channels["A"] > 0.5
    assert seen.any()
    assert (channels["R"][seen] > channels["G"][seen]).all()
    cube = str(REPOSITORY / "tests/cages/cube.obj")
    assert main(["render", cube, "-o", "b.png", "--texture", "red.png", *TINY]) == 1
    assert '--texture needs texture coordinates: the primvar "st"; found: none' in (
        capsys.readouterr().err
    )


def test_cast_writes_primvars():
    rays = np.array([[0, 0, 5, 0, 0, -1], [9, 0, 5, 0, 0, -1]], np.float64)
    np.save("rays.npy", rays)
    arguments = ["--attributes", "points,primvars:st"]
    assert main(["cast", SEAMS, "rays.npy", "-o", "hits.npz", *arguments]) == 0
    with np.load("hits.npz") as hits:
        assert {"points", "primvars:st", "primvars:st:du", "primvars:st:dv"} <= set(hits)
        assert hits["primvars:st"][0].any()
        assert not hits["primvars:st"][1].any()
    assert main(["cast", SEAMS, "rays.npy", "-o", "hits.npz", "--attributes", "primvars:x"]) == 1


def test_info_of_one_mesh_of_a_stage(capsys):
    arguments = ["--prim", "/Sheet", "--json"]
    assert main(["info", str(FILES / "tags.usda"), *arguments]) == 0
    assert '"orientation": "leftHanded"' in capsys.readouterr().out
