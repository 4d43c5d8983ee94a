"""Cages written as USD read back equal."""

import numpy as np
import pytest
from shapes import CAGES_FOLDER, same

import limitray as lr

pytest.importorskip("pxr", reason="needs usd-core (the extra limitray[usd])")
from limitray.usd import write_usd

CAGES, FILES = CAGES_FOLDER, CAGES_FOLDER / "usd"


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
@pytest.mark.parametrize(
    "name", ["torus_creases", "cube_seams", "sheet_none", "icosahedron_smooth", "cube_hole"]
)
def test_written_cages_read_back_equal(name, suffix, tmp_path):
    mesh = lr.Mesh.from_file(CAGES / f"{name}.obj")
    write_usd(mesh, tmp_path / f"cage{suffix}")
    assert same(lr.Mesh.from_file(tmp_path / f"cage{suffix}"), mesh, np.float32)


def test_the_order_of_holes_is_kept(tmp_path):
    cube = lr.Mesh.from_file(CAGES / "cube.obj")
    holes = lr.Mesh(
        cube.points, cube.face_vertex_counts, cube.face_vertex_indices, hole_indices=[4, 1, 2]
    )
    write_usd(holes, tmp_path / "cage.usda")
    assert same(lr.Mesh.from_file(tmp_path / "cage.usda"), holes, np.float32)


def test_all_primvars_are_written(tmp_path):
    mesh = lr.Mesh.from_file(FILES / "tags.usda")
    wide = lr.Primvar(np.arange(14.0).reshape(2, 7), "uniform", [0, 1, 0, 1, 1])
    mesh = lr.Mesh(
        mesh.points,
        mesh.face_vertex_counts,
        mesh.face_vertex_indices,
        orientation="leftHanded",
        primvars={**mesh.primvars, "wide": wide},
    )
    write_usd(mesh, tmp_path / "cage.usdc", "/a/b")
    again = lr.Mesh.from_file(tmp_path / "cage.usdc", "/a/b")
    assert sorted(again.primvars) == ["displayColor", "st", "weight", "wide"]
    np.testing.assert_array_equal(again.primvars["wide"].values, wide.values)
    assert again.primvars["wide"].interpolation == "uniform"
