"""The records that C++, Python and Slang share: sizes and offsets, as each of them sees them."""

import numpy as np
import pytest
from gpu_devices import require_gpu
from shapes import square

import limitray as lr
from limitray import _core
from limitray.gpu_layout import GEOMETRY, HIT, INFO, INSTANCE, STRIDES

# A member of a Slang struct may be several fields of the record.
RECORDS = {
    "PatchInfo": (INFO, {}),
    "GeometryRecord": (GEOMETRY, {"center_and_radius": "center"}),
    "InstanceRecord": (INSTANCE, {}),
    "LeafHit": (HIT, {}),
}


def elements():
    """Layout of an element of each buffer that the kernels are given."""
    tracer = lr.Scene(device="vulkan")._scene._tracer
    path = str(tracer._folder / "kernels/closest_hits.cs.slang")
    parameters = tracer.device.load_program(path, ["three_lanes"]).layout.parameters
    scene = next(p for p in parameters if p.name == "scene").type_layout
    scene = scene.element_type_layout if scene.element_type_layout is not None else scene
    found = {field.name: field.type_layout.element_type_layout for field in scene.fields}
    hits = next(p for p in parameters if p.name == "hits").type_layout
    return found | {"hits": hits.element_type_layout}


@pytest.fixture(scope="module")
def layouts():
    require_gpu()
    return elements()


@pytest.mark.parametrize(
    ("buffer", "record"),
    [
        ("infos", "PatchInfo"),
        ("geometries", "GeometryRecord"),
        ("instances", "InstanceRecord"),
        ("hits", "LeafHit"),
    ],
)
def test_slang_sees_the_records_of_python(layouts, buffer, record):
    dtype, names = RECORDS[record]
    layout = layouts[buffer]
    assert layout.name == record
    assert layout.stride == dtype.itemsize
    offsets = {field.name: field.offset for field in layout.fields}
    expected = {name: dtype.fields[names.get(name, name)][1] for name in offsets}
    assert offsets == expected
    assert set(dtype.names) - {names.get(name, name) for name in offsets} <= {
        "radius",  # in center_and_radius
        "left_handed",  # in center_low
    }


def test_slang_sees_elements_of_the_size_that_python_says(layouts):
    sizes = {name: layout.stride for name, layout in layouts.items() if name != "hits"}
    assert sizes == STRIDES


def test_python_sees_the_records_of_cpp():
    cpp = _core.Scene.gpu_layout()
    halves = cpp["PatchInfo"].pop("sub_quad"), cpp["PatchInfo"].pop("level")
    offsets = {name: INFO.fields[name][1] for name in INFO.names}
    assert halves == (offsets["sub_quad_and_level"], offsets.pop("sub_quad_and_level") + 2)
    assert cpp.pop("PatchInfo") == {"size": INFO.itemsize, **offsets}
    # Words of 4 bytes a component: what load_net, load_bump, load_model and intersect_boxes count.
    assert cpp.pop("PatchNet") == {"size": 4 * 3 * 16, "c": 0}
    assert cpp.pop("PatchBump") == {"size": 4 * 3 * 4, "c": 0}
    assert cpp.pop("PatchModel") == {"size": 64, "axis": 0, "curvature": 60}
    axis = {"p": 0, "p_u": 4, "p_v": 8, "d_u": 12, "d_v": 14}  # bounds in two bytes each
    assert cpp.pop("PatchModelAxis") == {"size": 16, **axis}
    assert cpp.pop("BvhNode") == {"size": 224, "lo": 0, "hi": 96, "child": 192}
    assert cpp == {}


def test_words_of_a_patch_info_are_its_fields():
    core = _core.Scene(1)
    core.add_mesh(square()._cage, 2, np.eye(4), 1e-5, 0)
    words = core.mesh_data(0)["infos"]
    info = np.ascontiguousarray(words).view(INFO).reshape(-1)
    assert info["face"].tolist() == [0] * len(info)
    assert (info["sub_quad_and_level"] & 0xFFFF == 0).all()
    assert info["du"] * info["dv"] @ np.ones(len(info)) == pytest.approx(1)
