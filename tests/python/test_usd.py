"""USD files: each attribute of a mesh, what is seen and where, materials, and writing."""

import os
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

import limitray as lr
from limitray.material import base_colors

pytest.importorskip("pxr", reason="needs usd-core (the extra limitray[usd])")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt

from limitray.usd import write_usd

FILES = Path(__file__).parents[1] / "cages" / "usd"
CAGES = Path(__file__).parents[1] / "cages"
MODELS = Path(os.environ.get("LIMITRAY_MODELS", Path(__file__).parents[3] / "shared" / "models"))


def down(*places):
    """Rays along -z from high above the places (x, y)."""
    return np.array([[x, y, 1e4, 0, 0, -1] for x, y in places], np.float64)


def hit_paths(scene, *places):
    """Path of the mesh that is hit at each place, None for a miss."""
    ids = scene.cast_rays(down(*places))["geometry_ids"]
    return [None if i == lr.INVALID_ID else scene.stage.paths[i] for i in ids]


def test_every_attribute_of_a_mesh():
    mesh = lr.Mesh.from_file(FILES / "tags.usda", prim="/Sheet")
    assert mesh.points.shape == (10, 3)
    assert mesh.face_vertex_counts.tolist() == [4, 4, 4, 4, 3]
    assert mesh.face_vertex_indices[:4].tolist() == [0, 3, 4, 1]
    assert mesh.orientation == "leftHanded"
    assert mesh.interpolate_boundary == "edgeOnly"
    assert mesh.face_varying_linear_interpolation == "boundaries"
    assert mesh.triangle_subdivision_rule == "smooth"
    edges, sharpnesses = mesh.crease_edges
    assert edges.tolist() == [[3, 4], [4, 5], [1, 4]]
    assert sharpnesses.tolist() == [1.5, 1.5, 10]
    assert [c.tolist() for c in mesh.corners] == [[0, 8], [2, np.inf]]
    assert mesh.hole_indices.tolist() == [3]
    assert sorted(mesh.primvars) == ["displayColor", "st", "weight"]
    assert isinstance(mesh.primvars["st"], lr.FaceVarying)
    assert mesh.primvars["weight"].interpolation == "vertex"
    assert mesh.primvars["displayColor"].interpolation == "constant"


def test_left_handed_normals_point_up():
    scene = lr.load_scene(FILES / "tags.usda")
    hit = scene.cast_rays(down((0.3, 0.3)))
    assert hit["primitive_normals"][0, 2] > 0
    assert scene.stage.up == (0, 0, 1)
    assert scene.stage.meters_per_unit == 0.01
    assert scene.stage.time == 1
    assert any("primvar short ignored" in note for note in scene.stage.notes)


def test_framing_stands_upright():
    scene = lr.load_scene(FILES / "tags.usda")
    np.testing.assert_array_equal(lr.Camera.frame(scene).up, (0, 0, 1))
    np.testing.assert_array_equal(lr.Camera.frame(scene, up=(1, 0, 0)).up, (1, 0, 0))
    scene.stage = None
    np.testing.assert_array_equal(lr.Camera.frame(scene).up, (0, 1, 0))


def test_points_at_a_time_code():
    heights = [
        float(lr.load_scene(FILES / "tags.usda", at).bounds()[1, 2]) for at in (None, 1, 2, 3)
    ]
    assert heights[0] == heights[1]
    np.testing.assert_allclose(np.array(heights[2:]) / heights[1], [2, 3], rtol=1e-2)


def test_a_start_without_an_end_is_the_time(tmp_path):
    stage = Usd.Stage.Open(str(FILES / "tags.usda"))
    stage.GetRootLayer().Export(str(tmp_path / "late.usda"))
    late = Usd.Stage.Open(str(tmp_path / "late.usda"))
    late.ClearMetadata("endTimeCode")
    late.SetStartTimeCode(2)
    late.GetRootLayer().Save()
    assert lr.load_scene(tmp_path / "late.usda").stage.time == 2


def test_schemes():
    scene = lr.load_scene(FILES / "schemes.usda")
    assert scene.stage.paths == ("/CatmullClark", "/Bilinear", "/None", "/Polygons")
    assert any("/Loop: subdivisionScheme loop is not supported" in n for n in scene.stage.notes)
    rays = down((0.9, 0.9), (4.9, 0.9), (8.9, 0.9))
    rays[:, 2] = 4
    hit = scene.cast_rays(rays)
    assert np.isfinite(hit["t_hit"]).tolist() == [False, True, True]
    np.testing.assert_allclose(hit["t_hit"][1:], 3, rtol=1e-12)
    np.testing.assert_allclose(hit["primitive_normals"][1:], [[0, 0, 1]] * 2, atol=1e-12)


def test_flat_polygons_are_covered_once():
    """Random places over the triangle and the pentagon of subdivisionScheme none."""
    scene = lr.load_scene(FILES / "schemes.usda")
    rng = np.random.default_rng(0)
    places = rng.random((4000, 2)) * [3, 3] + [-1, 0]
    polygon = np.array([(0, 0), (2, 0), (2, 2), (1, 3), (0, 3), (-1, 1)], float)
    edges = np.roll(polygon, -1, axis=0) - polygon
    offsets = places[:, np.newaxis] - polygon
    sides = edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0]
    inside = (sides > 0).all(axis=1)
    rays = down(*places)
    counts = scene.count_intersections(rays, tfar=1e4 - 4)
    np.testing.assert_array_equal(counts, inside.astype(int))
    assert any("1 concave polygons" in note for note in scene.stage.notes)


def test_one_loop_mesh_is_one_clear_message():
    with pytest.raises(ValueError, match="/Loop: subdivisionScheme loop is not supported"):
        lr.Mesh.from_file(FILES / "schemes.usda", prim="/Loop")


def test_transforms_visibility_and_purpose():
    scene = lr.load_scene(FILES / "placed.usda")
    names = ["Turned", "Mirrored", "Reset", "Rendered"]
    assert scene.stage.paths == (
        *(f"/World/{name}" for name in names),
        "/Copies/A/Tile",
        "/Copies/B/Tile",
    )
    places = (7.5, 1.5), (14.5, -0.5), (-49.5, 0.5), (2.5, 0.5), (0.5, 20.5), (0.5, 30.5), (0, 5)
    assert hit_paths(scene, *places) == [*scene.stage.paths, None]
    later = lr.load_scene(FILES / "placed.usda", 20)
    assert hit_paths(later, (17.5, 1.5), (24.5, -0.5), (-49.5, 0.5))[:3] == [
        "/World/Turned",
        "/World/Mirrored",
        "/World/Reset",
    ]
    with_guides = lr.load_scene(FILES / "placed.usda", purposes=("guide", "proxy"))
    assert with_guides.stage.paths == ("/World/Guide", "/World/Proxies/Below")
    assert {note.split(":")[0] for note in scene.stage.notes} == {
        "/World/Collapsed",
        "1 Sphere prims left out",
        "/World/Flat",
    }


def test_mirrored_meshes_keep_their_outer_side():
    """A mirror turns the winding in space, but what was outside stays outside."""
    scene = lr.load_scene(FILES / "placed.usda")
    normals = scene.cast_rays(down((7.5, 1.5), (14.5, -0.5)))["primitive_normals"]
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, 1]], atol=1e-12)


def test_native_instances_share_their_patches():
    scene = lr.load_scene(FILES / "placed.usda")
    a, b = (scene.stage.paths.index(f"/Copies/{name}/Tile") for name in "AB")
    hits = scene.cast_rays(down((0.5, 20.5), (0.5, 30.5)), attributes=("patch_ids",))
    assert hits["geometry_ids"].tolist() == [a, b]
    assert hits["patch_ids"][0] == hits["patch_ids"][1]
    np.testing.assert_allclose(hits["primitive_uvs"], 0.5, atol=1e-6)


def test_camera_of_the_stage():
    stage = lr.load_scene(FILES / "placed.usda").stage
    camera = stage.cameras["/World/Shot"]
    np.testing.assert_allclose(camera.eye, (10, 0, 8), atol=1e-12)
    np.testing.assert_allclose(camera.center, (10, 0, 4), atol=1e-12)
    np.testing.assert_allclose(camera.up, (-1, 0, 0), atol=1e-12)
    assert camera.fov_deg == pytest.approx(2 * np.degrees(np.arctan(0.5)))


def test_point_instancer():
    scene = lr.load_scene(FILES / "instancer.usda")
    assert scene.geometry_count() == 4
    hits = scene.cast_rays(down((0.5, 0.5), (20.5, 1.5), (30.5, 0.5), (9.5, 0.5), (9.5, 3.5)))
    assert np.isfinite(hits["t_hit"]).tolist() == [True, True, False, True, True]
    np.testing.assert_allclose(
        1e4 - hits["t_hit"][np.isfinite(hits["t_hit"])], [101, 102, 100, 100], atol=1e-6
    )


def grid_of_instances(path, count):
    """A stage with `count` instances of a small cage by a point instancer."""
    stage = Usd.Stage.CreateNew(str(path))
    instancer = UsdGeom.PointInstancer.Define(stage, "/Field")
    mesh = UsdGeom.Mesh.Define(stage, "/Field/Prototypes/Cube")
    cube = lr.Mesh.from_file(CAGES / "cube.obj")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(cube.points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(cube.face_vertex_counts.copy()))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(cube.face_vertex_indices.copy()))
    instancer.CreatePrototypesRel().SetTargets([mesh.GetPath()])
    side = int(np.ceil(np.sqrt(count)))
    y, x = np.divmod(np.arange(count), side)
    positions = np.stack([4 * x, 4 * y, 0 * x], axis=1).astype(np.float32)
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.zeros(count, np.int32)))
    stage.GetRootLayer().Save()
    return positions


def test_ten_thousand_instances_cost_the_memory_of_one(tmp_path):
    positions = grid_of_instances(tmp_path / "many.usdc", 10_000)
    start = time.perf_counter()
    scene = lr.load_scene(tmp_path / "many.usdc")
    assert scene.geometry_count() == 10_000
    one = scene.mesh_statistics(0)
    assert one["patches"] < 1000
    assert scene.mesh_statistics(9_999) == one
    hit = scene.cast_rays(down(*positions[:, :2]))
    np.testing.assert_array_equal(hit["geometry_ids"], np.arange(10_000))
    assert time.perf_counter() - start < 30


def test_materials():
    scene = lr.load_scene(FILES / "materials.usda")
    places = [(0.5, 0.25), (1.5, 0.25), (0.5, 0.75), (1.5, 0.75)]  # the quadrants of the image
    places += [(x, y + 0.5) for y in (10, 20, 30, 40, 50) for x in (0.5, 1.5)]
    attributes = ("sub_quads", "dp_du", "dp_dv")
    hits = scene.cast_rays(down(*places), attributes=attributes)
    colours = base_colors(scene, hits)
    np.testing.assert_allclose(
        colours,
        [
            *[(0, 0, 1), (1, 1, 1), (1, 0, 0), (0, 1, 0)],
            *[(0.75, 0.5, 0.25)] * 2,
            *[(0.1, 0.2, 0.3), (0.75, 0.5, 0.25)],
            *[(1, 0, 0), (0, 1, 0)],
            *[lr.Material().base_color] * 2,
            *[(0.18, 0.18, 0.18)] * 2,
        ],
        atol=1e-6,
    )
    assert any("/Materials/Missing/Image: texture ignored" in n for n in scene.stage.notes)


def test_display_color_of_an_instance():
    scene = lr.load_scene(FILES / "placed.usda")
    hits = scene.cast_rays(down((0.25, 20.25)), attributes=("sub_quads", "dp_du", "dp_dv"))
    u, v = 0.25, 0.25
    corners = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
    weights = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
    np.testing.assert_allclose(base_colors(scene, hits)[0], weights @ corners, atol=1e-6)


def test_texture_inside_a_package(tmp_path):
    stage = Usd.Stage.Open(str(FILES / "materials.usda"))
    for path in ("/Missing", "/Materials/Missing"):  # a package must be complete
        stage.RemovePrim(path)
    stage.GetRootLayer().Export(str(tmp_path / "m.usda"))
    shutil.copy(FILES / "quadrants.png", tmp_path)
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "m.usda"), str(tmp_path / "m.usdz"))
    scene = lr.load_scene(tmp_path / "m.usdz")
    hits = scene.cast_rays(down((1.5, 0.75)), attributes=("sub_quads", "dp_du", "dp_dv"))
    np.testing.assert_allclose(base_colors(scene, hits)[0], (0, 1, 0), atol=1e-6)


def same(a, b, dtype=np.float64):
    """Whether two cages are equal: arrays, rules and primvars; points as `dtype`."""
    np.testing.assert_array_equal(a.points.astype(dtype), b.points.astype(dtype))
    for name in ("face_vertex_counts", "face_vertex_indices", "hole_indices"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    for x, y in zip((*a.crease_edges, *a.corners), (*b.crease_edges, *b.corners)):
        np.testing.assert_array_equal(x, y)
    for name in (
        *("interpolate_boundary", "face_varying_linear_interpolation", "orientation"),
        *("triangle_subdivision_rule", "creasing_method"),
    ):
        assert getattr(a, name) == getattr(b, name)
    assert list(a.primvars) == list(b.primvars)
    for name, primvar in a.primvars.items():
        assert type(primvar) is type(b.primvars[name])
        np.testing.assert_array_equal(primvar.values, b.primvars[name].values)
        np.testing.assert_array_equal(primvar.indices, b.primvars[name].indices)
    return True


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

    def repeat(mesh):
        mesh.CreateHoleIndicesAttr([0, 0])

    broken_stage(tmp_path / "twice.usda", repeat)
    assert lr.Mesh.from_file(tmp_path / "twice.usda").hole_indices.tolist() == [0]


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


def usd_models():
    return sorted((MODELS / "usd").glob("**/*.usd*")) if (MODELS / "usd").exists() else []


@pytest.mark.parametrize("path", usd_models(), ids=lambda p: p.stem)
def test_shared_models_load(path):
    scene = lr.load_scene(path)
    stage = Usd.Stage.Open(str(path))
    meshes = [
        prim
        for prim in stage.Traverse(Usd.TraverseInstanceProxies())
        if prim.IsA(UsdGeom.Mesh) and UsdGeom.Imageable(prim).ComputeVisibility() != "invisible"
    ]
    loops = [p for p in meshes if UsdGeom.Mesh(p).GetSubdivisionSchemeAttr().Get() == "loop"]
    assert scene.geometry_count() == len(meshes) - len(loops)
    assert sum("subdivisionScheme loop" in note for note in scene.stage.notes) == len(loops)
    if scene.geometry_count() == 0 or path.stem == "CubeWithHoles":
        return
    camera = lr.Camera.frame(scene, up=scene.stage.up)
    seen = lr.render(scene, camera, 40, 30, 1, "facing").rgba[..., 3]
    assert 0.02 < seen.mean() < 0.95
