"""`mesh_info`: counts that can be checked by hand."""

import json

import numpy as np
from shapes import CAGES, cage, cube

import limitray as lr


def test_a_creased_cube():
    mesh = cube(
        crease_indices=[4, 5, 7, 6, 0, 1],
        crease_lengths=[4, 2],
        crease_sharpnesses=[2.5, 10],
        corner_indices=[3],
        corner_sharpnesses=[1.25],
    )
    info = lr.mesh_info(mesh, isolation_level=3)
    expected = {
        "faces": 6,
        "faces_by_size": {"4": 6},
        "vertices": 8,
        "vertices_by_valence": {"3": 8},
        "extraordinary_vertices": 8,
        "edges": 12,
        "boundary_edges": 0,
        "non_manifold_edges": 0,
        "creases_by_sharpness": {"2.5": 3, "infinite": 1},
        "corners_by_sharpness": {"1.25": 1},
        "holes": 0,
        "unused_points": 0,
    }
    assert {key: info[key] for key in expected} == expected
    assert info["patches"] == sum(info["patches_by_type"].values())
    assert info["patches"] == sum(info["patches_by_level"].values())
    low, high = np.array(info["extent"])
    assert (low < -0.5).all()
    assert (high <= 1).all()


def test_an_n_gon_a_boundary_and_a_pole():
    prism = lr.mesh_info(cage("prism_64"))
    assert prism["faces_by_size"] == {"4": 64, "64": 2}
    sheet = lr.mesh_info(cage("sheet_edge_and_corner"))
    assert sheet["faces"] == 12
    assert sheet["boundary_edges"] == sheet["boundary_vertices"] == 14
    assert sheet["extraordinary_vertices"] == 0
    pole = lr.mesh_info(cage("pole_48"))
    assert pole["vertices_by_valence"]["48"] == 2


def test_an_isolated_point_is_no_vertex():
    info = lr.mesh_info(cage("cube_isolated"))
    assert (info["vertices"], info["unused_points"]) == (8, 1)
    assert info["warnings"]


def test_non_manifold_edges_are_counted():
    assert lr.mesh_info(cage("non_manifold_edge"))["non_manifold_edges"] == 1


def test_every_cage_gives_json():
    for path in CAGES:
        json.dumps(lr.mesh_info(lr.Mesh.from_file(path), isolation_level=2), allow_nan=False)


def test_a_mesh_of_holes_has_no_extent():
    info = lr.mesh_info(cube(hole_indices=range(6)))
    assert info["patches"] == 0
    assert info["extent"] is None
