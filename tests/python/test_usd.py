"""USD files: each attribute of a mesh, what is seen and where, cameras and base colours."""

import shutil
import time

import numpy as np
import pytest
from shapes import CAGES_FOLDER, MODELS_FOLDER, down

import limitray as lr
from limitray.material import base_colors

pytest.importorskip("pxr", reason="needs usd-core (the extra limitray[usd])")
from pxr import Usd, UsdGeom, UsdUtils, Vt

FILES = CAGES_FOLDER / "usd"


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
    cube = lr.Mesh.from_file(CAGES_FOLDER / "cube.obj")
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


def usd_models():
    return (
        sorted((MODELS_FOLDER / "usd").glob("**/*.usd*"))
        if (MODELS_FOLDER / "usd").exists()
        else []
    )


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
