"""USD assets made as production ones are: references, payloads, variants, instancers, odd meshes.

A chess set: left-handed pieces with non-manifold edges, of several files, as native instances.
"""

import numpy as np
import pytest
from PIL import Image

import limitray as lr
from limitray.cli import main
from limitray.material import base_colors

pytest.importorskip("pxr", reason="needs usd-core (the extra limitray[usd])")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

ROUND, PROFILE = 48, 30
COLORS = {"White": (0.75, 0.5, 0.25), "Black": (0.0625, 0.125, 0.25)}


def piece(turn):
    """A lathed piece of 1,440 quads with two vanes that stand on its rings: points, quads.

    Where a vane meets the body, three faces share an edge.
    """
    angle = 2 * np.pi * np.arange(ROUND) / ROUND
    height = np.linspace(0, 2, PROFILE + 1)
    radius = 0.45 + 0.12 * np.cos(3 * height + turn) - 0.1 * height
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    body = np.concatenate(
        [np.column_stack([r * ring, np.full(ROUND, z)]) for r, z in zip(radius, height)]
    )
    i, j = np.meshgrid(np.arange(PROFILE), np.arange(ROUND), indexing="ij")
    k = (j + 1) % ROUND
    quads = np.stack(
        [i * ROUND + j, i * ROUND + k, (i + 1) * ROUND + k, (i + 1) * ROUND + j], axis=-1
    ).reshape(-1, 4)
    points, vanes = [body], []
    for column in (0, ROUND // 2):
        outer = body[np.arange(8, 13) * ROUND + column] * [1.6, 1.6, 1]
        start = sum(map(len, points))
        points.append(outer)
        rows = np.arange(4)
        inner = (rows + 8) * ROUND + column
        vanes.append(np.stack([inner, start + rows, start + rows + 1, inner + ROUND], axis=1))
    return 0.5 * np.concatenate(points), np.concatenate([quads, *vanes])


def write_piece(path, turn, left_handed):
    """A file with one component: its mesh, and a variant set for its colour."""
    stage = Usd.Stage.CreateNew(str(path))
    root = UsdGeom.Xform.Define(stage, "/Piece").GetPrim()
    stage.SetDefaultPrim(root)
    mesh = UsdGeom.Mesh.Define(stage, "/Piece/Geom/Body")
    points, quads = piece(turn)
    if left_handed:
        quads = quads[:, ::-1].copy()
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([4] * len(quads))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.astype(np.int32).ravel()))
    mesh.CreateOrientationAttr("leftHanded" if left_handed else "rightHanded")
    variants = root.GetVariantSets().AddVariantSet("shade")
    for name, color in COLORS.items():
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            look = UsdShade.Material.Define(stage, "/Piece/Looks/Main")
            shader = UsdShade.Shader.Define(stage, "/Piece/Looks/Main/Surface")
            shader.CreateIdAttr("UsdPreviewSurface")
            shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
            shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.3)
            look.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(look)
    variants.SetVariantSelection("White")
    stage.GetRootLayer().Save()
    return len(quads)


@pytest.fixture(scope="module")
def chess(tmp_path_factory):
    """32 pieces of 46,336 faces by references with payloads, on 64 squares by an instancer."""
    folder = tmp_path_factory.mktemp("chess")
    (folder / "assets").mkdir()
    kinds = 6
    for kind in range(kinds):
        assert write_piece(folder / f"assets/body{kind}.usdc", kind, kind % 2 == 0) == 1448
        (folder / f"assets/piece{kind}.usda").write_text(
            '#usda 1.0\n(defaultPrim = "Piece")\n'
            f'def "Piece" (payload = @./body{kind}.usdc@) {{}}\n'
        )
    stage = Usd.Stage.CreateNew(str(folder / "set.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 0.05)
    for k in range(32):
        row, column = divmod(k, 8)
        prim = stage.DefinePrim(f"/Set/P{k}")
        prim.GetReferences().AddReference(f"./assets/piece{k % kinds}.usda")
        prim.GetVariantSets().SetSelection("shade", "White" if row < 2 else "Black")
        prim.SetInstanceable(True)
        y = row if row < 2 else row + 4
        UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(column, y, 0))
    board = UsdGeom.PointInstancer.Define(stage, "/Set/Board")
    square = UsdGeom.Mesh.Define(stage, "/Set/Board/Prototypes/Square")
    square.CreatePointsAttr(
        [(-0.48, -0.48, 0), (0.48, -0.48, 0), (0.48, 0.48, 0), (-0.48, 0.48, 0)]
    )
    square.CreateFaceVertexCountsAttr([4])
    square.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    square.CreateSubdivisionSchemeAttr("none")
    board.CreatePrototypesRel().SetTargets([square.GetPath()])
    board.CreatePositionsAttr([(k % 8, k // 8, 0) for k in range(64)])
    board.CreateProtoIndicesAttr([0] * 64)
    board.CreateIdsAttr(list(range(100, 164)))
    board.CreateInvisibleIdsAttr([100 + 27])
    camera = UsdGeom.Camera.Define(stage, "/Set/Shot")
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(24.0)
    camera.CreateFocalLengthAttr(40.0)
    view = Gf.Matrix4d().SetLookAt(Gf.Vec3d(3.5, -7, 7), Gf.Vec3d(3.5, 3, 0), Gf.Vec3d(0, 0, 1))
    camera.AddTransformOp().Set(view.GetInverse())
    stage.GetRootLayer().Save()
    return folder / "set.usda"


@pytest.fixture(scope="module")
def chess_scene(chess):
    return lr.load_scene(chess)


def test_every_piece_is_there_and_shares_its_patches(chess_scene):
    assert chess_scene.stage.notes == ()
    assert chess_scene.geometry_count() == 32 + 63
    assert len(set(chess_scene.stage.paths)) == 32 + 1
    assert chess_scene.stage.up == (0, 0, 1)
    assert chess_scene.stage.meters_per_unit == 0.05
    statistics = [chess_scene.mesh_statistics(k) for k in range(32)]
    sizes = {(s["patches"], s["build_seconds"]) for s in statistics}
    assert len(sizes) == 12, "six shapes, each once a colour: variants are other prototypes"


def test_pieces_have_their_colours_and_face_outwards(chess_scene):
    rng = np.random.default_rng(5)
    columns, rows = np.meshgrid(np.arange(8), [0, 1, 6, 7])
    centres = np.stack([columns.ravel(), rows.ravel()], axis=1).repeat(20, axis=0)
    angles, heights = rng.random(len(centres)) * 2 * np.pi, 0.05 + 0.15 * rng.random(len(centres))
    outward = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    target = np.column_stack([centres, heights])
    # From the gap between two pieces, whose radius is below 0.3, towards the axis below the vanes.
    rays = np.concatenate([target + 0.45 * outward, -outward], axis=1)
    hits = chess_scene.cast_rays(rays, attributes=("points", "sub_quads", "dp_du", "dp_dv"))
    assert np.isfinite(hits["t_hit"]).all()
    facing = (hits["primitive_normals"] * outward).sum(axis=1)
    assert (facing > 0.3).all(), "left-handed and right-handed pieces alike"
    white = centres[:, 1] < 4
    expected = np.where(white[:, np.newaxis], COLORS["White"], COLORS["Black"])
    np.testing.assert_allclose(base_colors(chess_scene, hits), expected, atol=1e-7)


def test_non_manifold_vanes_are_met_where_they_stand(chess_scene):
    """Across a vane: its two sides are one sheet, so that the ray meets it once."""
    for column in range(8):
        points, quads = piece(column % 6)
        x, y, z = points[quads[-6]].mean(axis=0)  # of a vane on the side of +x
        ray = np.array([[column + x, y + 0.3, z, 0, -1, 0]])
        assert chess_scene.count_intersections(ray, tfar=0.6).tolist() == [1]
        assert chess_scene.cast_rays(ray)["t_hit"][0] == pytest.approx(0.3, abs=1e-6)


def test_the_hidden_square_is_a_hole(chess_scene):
    rays = np.array([[k % 8, k // 8, -5, 0, 0, 1] for k in range(16, 48)], np.float64)
    hit = np.isfinite(chess_scene.cast_rays(rays, tfar=5.01)["t_hit"])
    assert np.flatnonzero(~hit).tolist() == [27 - 16]


def test_pictures_of_any_shape_show_the_film_gate(chess_scene):
    """The corners of the film gate, 3:2, are at the same pixels of the gate in every picture."""
    camera = chess_scene.stage.cameras["/Set/Shot"]
    assert camera.aspect == pytest.approx(1.5)
    assert camera.fov_deg == pytest.approx(2 * np.degrees(np.arctan(18 / 40)))
    axes = camera.axes()
    gate = np.array([18 / 40, 12 / 40, 1])
    for width, height in ((300, 200), (600, 200), (300, 600)):
        if width / height > 1.5:
            right, top = width / 2 + height * 0.75, 0.0
        else:
            right, top = float(width), height / 2 - width / 3
        ray = camera.rays(np.array(right), np.array(top), width, height)
        np.testing.assert_allclose(axes @ ray[3:], gate, atol=1e-6)


def test_render_through_the_camera_of_the_set(chess, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["--camera", "/Set/Shot", "--integrator", "facing", "--spp", "16"]
    pictures = []
    for name, size in (("gate", "90x60"), ("wide", "180x60")):
        assert main(["render", str(chess), "-o", f"{name}.png", "--size", size, *options]) == 0
        pictures.append(np.asarray(Image.open(f"{name}.png"), float))
    assert capsys.readouterr() == ("gate.png\nwide.png\n", "")
    gate, wide = pictures
    assert np.abs(wide[:, 45:135] - gate).mean() < 4, "the middle of the wide one is the gate"
    assert np.abs(wide[:, :90] - gate).mean() > 24


LEAF = """#usda 1.0
(defaultPrim = "Leaf")
def Xform "Leaf"
{
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "Square"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        uniform token subdivisionScheme = "none"
        float xformOp:rotateZ = 30
        uniform token[] xformOpOrder = ["xformOp:rotateZ"]
    }
}
"""
FIELD = """#usda 1.0
(defaultPrim = "Field")
def PointInstancer "Field"
{
    rel prototypes = [</Field/Protos/Leaf>, </Field/Protos/Pair>]
    int[] protoIndices = [0, 1, 0, 1, 0]
    point3f[] positions.timeSamples = {
        1: [(0, 0, 0), (5, 0, 0), (10, 0, 0), (15, 0, 2), (20, 0, 0)],
        3: [(0, 4, 0), (5, 0, 4), (10, 0, 0), (15, 0, 2), (20, 8, 0)],
    }
    quatf[] orientations = [
        (1, 0, 0, 0), (0.8, 0, 0.6, 0), (1, 0, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)
    ]
    float3[] scales = [(1, 1, 1), (2, 1, 3), (1, 1, 1), (1, 2, 1), (1, 1, 1)]
    int64[] invisibleIds = [4]
    float3 xformOp:scale = (1, 2, 1)
    uniform token[] xformOpOrder = ["xformOp:scale"]
    def Scope "Protos"
    {
        def "Leaf" (
            instanceable = true
            references = @leaf.usda@
        )
        {
        }
        def PointInstancer "Pair"
        {
            rel prototypes = [</Field/Protos/Pair/Leaf>]
            int[] protoIndices = [0, 0]
            point3f[] positions = [(0, 0, 0), (0, 0, 2.5)]
            double3 xformOp:translate = (0.5, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def "Leaf" (references = @leaf.usda@)
            {
            }
        }
    }
}
"""
NESTED = """#usda 1.0
def Xform "World"
{
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def "Far" (
        instanceable = true
        references = @field.usda@
    )
    {
        double3 xformOp:translate = (0, 50, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def "Near" (references = @field.usda@)
    {
    }
    def "Hidden" (references = @field.usda@)
    {
        token visibility = "invisible"
        double3 xformOp:translate = (0, 0, 500)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


@pytest.mark.parametrize("time", [1, 2, 3])
def test_nested_instancers_stand_where_usd_says(tmp_path, time):
    """Instancers of instances and of instancers, against the bounds that USD itself computes."""
    for name, text in (("leaf", LEAF), ("field", FIELD), ("nested", NESTED)):
        (tmp_path / f"{name}.usda").write_text(text)
    scene = lr.load_scene(tmp_path / "nested.usda", time)
    assert scene.stage.notes == ()
    fields, leaves, pairs = 2, 2, 2
    assert scene.geometry_count() == fields * (leaves + 2 * pairs)
    stage = Usd.Stage.Open(str(tmp_path / "nested.usda"))
    boxes = UsdGeom.BBoxCache(Usd.TimeCode(time), ["default"])
    box = boxes.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    np.testing.assert_allclose(scene.bounds(), [box.GetMin(), box.GetMax()], atol=1e-4)
