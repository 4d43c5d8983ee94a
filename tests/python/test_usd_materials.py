"""USD materials: the finish of UsdPreviewSurface, placed textures, and what each instance shows."""

from pathlib import Path

import numpy as np
import pytest
from shapes import REPOSITORY

import limitray as lr
from limitray.material import base_colors, finish

pytest.importorskip("pxr", reason="needs usd-core (the extra limitray[usd])")

FILES = REPOSITORY / "tests/cages/usd"
LEFT_BELOW, RIGHT_BELOW, LEFT_ABOVE, RIGHT_ABOVE = (
    (x, y) for y in (0.25, 0.75) for x in (0.25, 0.75)
)


def hits_at(scene, places):
    """Hits straight below the places (x, y)."""
    rays = np.array([[x, y, 1e3, 0, 0, -1] for x, y in places], np.float64)
    hits = scene.cast_rays(rays, attributes=("sub_quads", "dp_du", "dp_dv"))
    assert np.isfinite(hits["t_hit"]).all()
    return hits


@pytest.fixture(scope="module")
def finishes():
    return lr.load_scene(FILES / "finish.usda")


def test_constants(finishes):
    found = finish(finishes, hits_at(finishes, [(0.5, 0.5)]))
    np.testing.assert_allclose(found.colors, [(0.9, 0.6, 0.3)], atol=1e-7)
    assert found.roughness == pytest.approx(0.25)
    assert found.metallic == 1
    assert found.reflectance == pytest.approx((0.8 / 2.8) ** 2)


def test_what_cannot_be_shown_is_named_once(finishes):
    found = finish(finishes, hits_at(finishes, [(0.5, 10.5)]))
    assert found.roughness == pytest.approx(0.05)
    surface = "/Looks/Beyond/Surface"
    assert [note for note in finishes.stage.notes if "Beyond" in note] == [
        f"{surface}: roughness 0 is shown as 0.05",
        f"{surface}: not shown: opacity, clearcoat",
    ]
    assert not any("/Looks/Constant" in note for note in finishes.stage.notes)


def test_channels_of_one_image(finishes):
    """Green to roughness and blue to metallic, each with its own scale and bias."""
    places = [(x, y + 20) for x, y in (LEFT_BELOW, RIGHT_BELOW, LEFT_ABOVE, RIGHT_ABOVE)]
    found = finish(finishes, hits_at(finishes, places))
    blue, white, red, green = range(4)
    assert found.metallic[[blue, white, red, green]].tolist() == [1, 1, 0, 0]
    assert found.roughness[[blue, white, red, green]].tolist() == [0.25, 0.75, 0.25, 0.75]
    np.testing.assert_allclose(found.colors, 0.18, atol=1e-7)


def test_grey_images_are_linear(finishes):
    found = finish(finishes, hits_at(finishes, [(0.5, 60.5)]))
    assert found.roughness == pytest.approx(128 / 255)


def test_transformed_texture_coordinates(finishes):
    """UsdTransform2d against its own formula: scaled, turned anticlockwise, then moved."""
    rng = np.random.default_rng(3)
    places = rng.random((200, 2)) * [1, 1] + [0, 30]
    st = places - [0, 30]
    turned = np.stack([1 - st[:, 1], 0.5 + 2 * st[:, 0]], axis=1)  # (x, y) -> (-y, x)
    quadrant = np.floor(np.mod(turned, 1) * 2).astype(int)
    expected = np.array([[(0, 0, 1), (1, 1, 1)], [(1, 0, 0), (0, 1, 0)]])[
        quadrant[:, 1], quadrant[:, 0]
    ]
    away = (np.abs(np.mod(turned * 2, 1) - 0.5) < 0.4).all(axis=1)  # no blend of two quadrants
    assert away.sum() > 50
    colours = base_colors(finishes, hits_at(finishes, places[away]))
    np.testing.assert_allclose(colours, expected[away], atol=1e-6)


def test_materialx_is_one_warning_with_the_fallback(finishes):
    colours = base_colors(finishes, hits_at(finishes, [(0.5, 40.5), (0.5, 50.5)]))
    np.testing.assert_allclose(colours, [(0.25, 0.5, 0.75), (0.9, 0.6, 0.3)], atol=1e-7)
    assert [note for note in finishes.stage.notes if "MaterialX" in note] == [
        "/Looks/MaterialX: not shown: it has no UsdPreviewSurface "
        "(ND_standard_surface_surfaceshader); meshes with it show their displayColor, or else clay"
    ]


def test_the_fallback_of_a_missing_image(finishes):
    colours = base_colors(finishes, hits_at(finishes, [(0.5, 70.5)]))
    np.testing.assert_allclose(colours, [(0.5, 0.25, 0.125)], atol=1e-7)
    notes = [note for note in finishes.stage.notes if "nowhere.png" in note]
    assert notes == ["/Looks/Fallback/Image: texture ignored: no such file: nowhere.png"]


PIECE = """#usda 1.0
(defaultPrim = "Piece")
def Xform "Piece"
{
    def Mesh "Tile"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    }
}
"""


def look(name, color):
    return f"""
def Material "{name}"
{{
    token outputs:surface.connect = </{name}/S.outputs:surface>
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = {color}
        token outputs:surface
    }}
}}
"""


def side(name, opinion, y, count):
    pieces = "".join(
        f"""
    def "P{k}" (instanceable = true
        references = @piece.usda@)
    {{
        double3 xformOp:translate = ({2 * k}, {y}, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}"""
        for k in range(count)
    )
    api = 'prepend apiSchemas = ["MaterialBindingAPI"]'
    return f'def Xform "{name}" ({api})\n{{\n    {opinion}{pieces}\n}}\n'


def test_instances_show_what_they_inherit(tmp_path):
    """Pieces of one mesh under parents with a material, another one, a displayColor, and none."""
    (tmp_path / "piece.usda").write_text(PIECE)
    looks = {"Ivory": (0.75, 0.5, 0.25), "Ebony": (0.125, 0.0625, 0.5)}
    sides = [
        side("None", "", 0, 2),
        side("White", "rel material:binding = </Ivory>", 5, 3),
        side("Black", "rel material:binding = </Ebony>", 10, 3),
        side("Painted", "color3f[] primvars:displayColor = [(1, 0, 0.5)]", 15, 2),
    ]
    stage = "#usda 1.0\n" + "".join(look(n, c) for n, c in looks.items()) + "".join(sides)
    (tmp_path / "board.usda").write_text(stage)
    scene = lr.load_scene(tmp_path / "board.usda")
    assert scene.stage.notes == ()
    assert scene.geometry_count() == 10
    rows = [(2, 0, lr.Material().base_color), (3, 5, looks["Ivory"]), (3, 10, looks["Ebony"])]
    rows.append((2, 15, (1, 0, 0.5)))
    places = [(2 * k + 0.5, y + 0.5) for count, y, _ in rows for k in range(count)]
    expected = [colour for count, _, colour in rows for _ in range(count)]
    hits = hits_at(scene, places)
    np.testing.assert_allclose(base_colors(scene, hits), expected, atol=1e-7)
    assert len(scene.material_sets(np.arange(10))) == 4, "equal instances share their materials"


def test_a_reference_to_nothing_is_named(tmp_path):
    (tmp_path / "piece.usda").write_text(PIECE)
    (tmp_path / "a.usda").write_text(
        '#usda 1.0\ndef "A" (references = @piece.usda@) {}\ndef "B" (payload = @gone.usda@) {}\n'
        'def "C" (references = @looks.mtlx@) {}\n'
    )
    scene = lr.load_scene(tmp_path / "a.usda")
    assert scene.stage.paths == ("/A/Tile",)
    gone, looks = scene.stage.notes
    assert "gone.usda" in gone
    assert "looks.mtlx" in looks
    (tmp_path / "b.usda").write_text('#usda 1.0\ndef "B" (payload = @gone.usda@) {}\n')
    with pytest.raises(ValueError, match=r"b\.usda: no mesh can be traced: .*gone\.usda"):
        lr.load_scene(tmp_path / "b.usda")


def test_a_reference_to_nothing_is_quiet(tmp_path, capfd):
    (tmp_path / "b.usda").write_text('#usda 1.0\ndef "B" (payload = @gone.usda@) {}\n')
    with pytest.raises(ValueError, match="gone"):
        lr.load_scene(Path(tmp_path / "b.usda"))
    assert capfd.readouterr() == ("", "")


def test_binding_a_material_that_is_not_there(tmp_path):
    (tmp_path / "piece.usda").write_text(PIECE)
    (tmp_path / "a.usda").write_text(
        "#usda 1.0\n" + side("Lost", "rel material:binding = </Looks/Gold>", 0, 1)
    )
    (note,) = lr.load_scene(tmp_path / "a.usda").stage.notes
    assert note.startswith("/Looks/Gold: not shown: there is no such material on the stage")


FIELD = """#usda 1.0
def PointInstancer "Field"
{
    rel prototypes = [</Field/Plain>, </Field/Own>]
    int[] protoIndices = [0, 0, 1, 0, 1]
    point3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0), (6, 0, 0), (8, 0, 0)]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] (
        interpolation = "vertex"
    )
    int[] primvars:displayColor:indices = [0, 1, 1, 0, 2]
    float[] primvars:age = [1, 2, 3, 4, 5] (
        interpolation = "vertex"
    )
    def "Plain" (references = @piece.usda@)
    {
    }
    def "Own" (references = @piece.usda@)
    {
        over "Tile"
        {
            color3f[] primvars:displayColor = [(0.5, 0.25, 0.125)]
        }
    }
}
"""


def test_an_instancer_colours_its_instances(tmp_path):
    """Meshes without a displayColor of their own have that of their instance."""
    (tmp_path / "piece.usda").write_text(PIECE)
    (tmp_path / "field.usda").write_text(FIELD)
    scene = lr.load_scene(tmp_path / "field.usda")
    assert scene.stage.notes == ("/Field: primvars of instances ignored: age",)
    hits = hits_at(scene, [(2 * k + 0.5, 0.5) for k in range(5)])
    own = (0.5, 0.25, 0.125)
    expected = [(1, 0, 0), (0, 1, 0), own, (1, 0, 0), own]
    np.testing.assert_allclose(base_colors(scene, hits), expected, atol=1e-7)
    (tmp_path / "field.usda").write_text(FIELD.replace("indices = [0, 1, 1, 0, 2]", "x = [0]"))
    notes = lr.load_scene(tmp_path / "field.usda").stage.notes
    assert any("displayColor of instances ignored: 3 colours of 3 values for 5" in n for n in notes)
