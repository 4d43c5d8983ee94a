"""USD meshes that are wrong: what is refused by name, and what is repaired with a note."""

import re

import numpy as np
import pytest
from shapes import CAGES_FOLDER, down

import limitray as lr
from limitray.material import base_colors

pytest.importorskip("pxr", reason="needs usd-core (the extra limitray[usd])")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from limitray.usd import write_usd

CAGES, FILES = CAGES_FOLDER, CAGES_FOLDER / "usd"


def broken_stage(path, change):
    stage = Usd.Stage.CreateNew(str(path))
    mesh = UsdGeom.Mesh.Define(stage, "/Broken")
    mesh.CreatePointsAttr(
        [Gf.Vec3f(0, 0, 0), Gf.Vec3f(1, 0, 0), Gf.Vec3f(1, 1, 0), Gf.Vec3f(0, 1, 0)]
    )
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    change(mesh)
    stage.GetRootLayer().Save()


def test_a_broken_mesh_is_named(tmp_path):
    broken_stage(tmp_path / "a.usda", lambda m: m.CreateFaceVertexIndicesAttr([0, 1, 2, 9]))
    with pytest.raises(ValueError, match=r"a\.usda: .*/Broken: face_vertex_indices\[3\]"):
        lr.load_scene(tmp_path / "a.usda")
    broken_stage(tmp_path / "b.usda", lambda m: m.CreatePointsAttr([]))
    with pytest.raises(ValueError, match="/Broken: has no faces or no points"):
        lr.load_scene(tmp_path / "b.usda")


def test_faces_that_are_none_are_left_out(tmp_path):
    """A triangle stored as a quad, a line, and a bow tie, between faces with all that follows."""

    def change(mesh):
        points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0), (3, 0, 0)]
        mesh.CreatePointsAttr([Gf.Vec3f(*p) for p in points])
        mesh.CreateSubdivisionSchemeAttr("none")
        faces = [(1, 2, 1, 2), (0, 1, 2, 3), (1, 2, 1, 5), (1, 4, 5, 2), (4, 6, 6, 5)]
        mesh.CreateFaceVertexCountsAttr([len(f) for f in faces])
        mesh.CreateFaceVertexIndicesAttr([v for f in faces for v in f])
        mesh.CreateHoleIndicesAttr([2, 3])
        primvars = UsdGeom.PrimvarsAPI(mesh)
        for name, place, count in (("face", "uniform", 5), ("corner", "faceVarying", 20)):
            primvar = primvars.CreatePrimvar(name, Sdf.ValueTypeNames.FloatArray, place)
            primvar.Set(list(range(count)))
        subset = UsdGeom.Subset.CreateGeomSubset(mesh, "Last", "face", [0, 4], "materialBind")
        look = UsdShade.Material.Define(mesh.GetPrim().GetStage(), "/Red")
        shader = UsdShade.Shader.Define(mesh.GetPrim().GetStage(), "/Red/S")
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(1, 0, 0))
        look.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(look)

    broken_stage(tmp_path / "d.usda", change)
    mesh = lr.Mesh.from_file(tmp_path / "d.usda")
    assert mesh.face_vertex_counts.tolist() == [4, 4, 3]
    assert mesh.face_vertex_indices.tolist() == [0, 1, 2, 3, 1, 4, 5, 2, 4, 6, 5]
    assert mesh.hole_indices.tolist() == [1]
    face, corner = mesh.primvars["face"], mesh.primvars["corner"]
    assert face.values[face.indices].ravel().tolist() == [1, 3, 4]
    assert corner.values[corner.indices].ravel().tolist() == [*range(4, 8), *range(12, 18), 19]
    scene = lr.load_scene(tmp_path / "d.usda")
    assert scene.stage.notes == (
        "/Broken: 1 faces repeat a vertex beside itself, which is taken once",
        "/Broken: 2 faces left out: fewer than 3 vertices, or one of them twice",
    )
    rays = down((0.4, 0.5), (2.3, 0.3), (1.5, 0.5))
    hits = scene.cast_rays(rays, attributes=("sub_quads", "dp_du", "dp_dv"))
    assert hits["primitive_ids"].tolist() == [0, 2, lr.INVALID_ID]
    seen = {name: array[:2] for name, array in hits.items()}
    np.testing.assert_array_equal(base_colors(scene, seen), [lr.Material().base_color, (1, 0, 0)])


def test_a_mesh_of_no_faces_at_all_is_named(tmp_path):
    broken_stage(tmp_path / "e.usda", lambda m: m.CreateFaceVertexIndicesAttr([0, 1, 1, 0]))
    with pytest.raises(ValueError, match="/Broken: 1 faces left out: fewer than 3 vertices"):
        lr.load_scene(tmp_path / "e.usda")


def test_creases_off_the_mesh_are_dropped_with_a_note(tmp_path):
    def change(mesh):
        mesh.CreateCreaseIndicesAttr([0, 2, 3])
        mesh.CreateCreaseLengthsAttr([3])
        mesh.CreateCreaseSharpnessesAttr([2.0])

    broken_stage(tmp_path / "c.usda", change)
    scene = lr.load_scene(tmp_path / "c.usda")
    assert scene.stage.notes == ("/Broken: 1 crease edges ignored: no face has them",)
    edges, sharpnesses = lr.Mesh.from_file(tmp_path / "c.usda").crease_edges
    assert edges.tolist() == [[2, 3]]
    assert sharpnesses.tolist() == [2]


def test_the_last_sharpness_counts(tmp_path):
    def change(mesh):
        mesh.CreateCreaseIndicesAttr([0, 1, 2, 1, 0])
        mesh.CreateCreaseLengthsAttr([3, 2])
        mesh.CreateCreaseSharpnessesAttr([2.0, 3.0])
        mesh.CreateCornerIndicesAttr([1, 0, 1])
        mesh.CreateCornerSharpnessesAttr([1.0, 2.0, 4.0])

    broken_stage(tmp_path / "f.usda", change)
    edges, sharpnesses = lr.Mesh.from_file(tmp_path / "f.usda").crease_edges
    assert edges.tolist() == [[1, 2], [0, 1]]
    assert sharpnesses.tolist() == [2, 3]
    corners, sharpnesses = lr.Mesh.from_file(tmp_path / "f.usda").corners
    assert corners.tolist() == [0, 1]
    assert sharpnesses.tolist() == [2, 4]
    assert lr.load_scene(tmp_path / "f.usda").stage.notes == (
        "/Broken: 1 crease edges ignored: they come again later",
        "/Broken: 1 corners ignored: they come again later",
    )


def test_errors(tmp_path, capfd):
    with pytest.raises(ValueError, match="prim must name one of 5 meshes: /CatmullClark, "):
        lr.Mesh.from_file(FILES / "schemes.usda")
    with pytest.raises(ValueError, match="prim /World/Shot is no mesh"):
        lr.Mesh.from_file(FILES / "placed.usda", prim="/World/Shot")
    for name in ("nonsense here", "/World /Turned", "/World[0]", "", "/", "/World.visibility"):
        with pytest.raises(ValueError, match=f"prim {re.escape(name)} is no mesh of this file"):
            lr.Mesh.from_file(FILES / "placed.usda", prim=name)
    assert capfd.readouterr() == ("", "")
    with pytest.raises(FileNotFoundError):
        lr.load_scene(tmp_path / "none.usda")
    (tmp_path / "bad.usda").write_text("#usda 1.0\ndef Mesh {")
    with pytest.raises(ValueError, match=r"bad\.usda: cannot be read as USD"):
        lr.load_scene(tmp_path / "bad.usda")
    with pytest.raises(ValueError, match=r'a USD file ends in .*not "\.obj"'):
        lr.load_scene(CAGES / "cube.obj")
    with pytest.raises(ValueError, match="time must be finite"):
        lr.load_scene(FILES / "tags.usda", float("nan"))
    with pytest.raises(ValueError, match=r"^tolerance must be a number above 0, not 0"):
        lr.load_scene(FILES / "tags.usda", tolerance=0)
    with pytest.raises(ValueError, match=r"^isolation_level must be 1 to 10, not 11"):
        lr.load_scene(FILES / "tags.usda", isolation_level=11)
    with pytest.raises(ValueError, match="Chaikin"):
        write_usd(lr.Mesh.from_file(CAGES / "cube_chaikin.obj"), tmp_path / "x.usda")
    with pytest.raises(ValueError, match="prim must be a path"):
        write_usd(lr.Mesh.from_file(CAGES / "cube.obj"), tmp_path / "x.usda", "no path")


def test_a_hole_named_twice_is_one(tmp_path):
    broken_stage(tmp_path / "twice.usda", lambda m: m.CreateHoleIndicesAttr([0, 0]))
    assert lr.Mesh.from_file(tmp_path / "twice.usda").hole_indices.tolist() == [0]
