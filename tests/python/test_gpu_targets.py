"""The Slang modules compile for every vendor and are twins of the C++ headers. Needs no GPU."""

import ctypes
import re
from pathlib import Path

import pytest
from shapes import REPOSITORY

SOURCE = REPOSITORY / "src"
MODULES = sorted((SOURCE / "limitray").rglob("*.slang"))
TARGETS = ("spirv", "cuda", "metal", "hlsl", "wgsl")
TRACERS = ("closest_hits", "any_hits", "camera_hits")
ENTRIES = (
    *((file, entry) for file in TRACERS for entry in ("three_lanes", "one_lane")),
    ("attributes", "attributes"),
    ("camera_attributes", "attributes"),
)


def compile_slang(*arguments):
    """Runs slangpy's compiler with slangc's arguments: its diagnostics and the code."""
    slangpy = pytest.importorskip("slangpy")
    slang = ctypes.CDLL(str(next(Path(slangpy.__file__).parent.glob("libslang-compiler*"))))
    pointer, size = ctypes.c_void_p, ctypes.c_size_t(0)
    slang.spCreateSession.restype = slang.spCreateCompileRequest.restype = pointer
    slang.spGetCompileRequestCode.restype = slang.spGetEntryPointCode.restype = pointer
    slang.spGetDiagnosticOutput.restype = ctypes.c_char_p
    session = pointer(slang.spCreateSession(None))
    request = pointer(slang.spCreateCompileRequest(session))
    options = [option.encode() for option in arguments]
    try:
        status = slang.spProcessCommandLineArguments(
            request, (ctypes.c_char_p * len(options))(*options), len(options)
        )
        status = status if status < 0 else slang.spCompile(request)
        said = (slang.spGetDiagnosticOutput(request) or b"").decode()
        if status < 0:
            return said, b""
        code = slang.spGetEntryPointCode(request, 0, ctypes.byref(size))
        code = code or slang.spGetCompileRequestCode(request, ctypes.byref(size))
        return said, ctypes.string_at(code, size.value)
    finally:
        slang.spDestroyCompileRequest(request)
        slang.spDestroySession(session)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("file", "entry"), ENTRIES)
def test_kernels_compile_for(target, file, entry):
    said, code = compile_slang(
        str(SOURCE / "kernels" / f"{file}.cs.slang"),
        *("-target", target, "-entry", entry, "-stage", "compute", "-I", str(SOURCE)),
    )
    assert len(code) > 10_000, said
    assert "error" not in said


def test_entry_points_are_short():
    files = sorted((SOURCE / "kernels").glob("*.cs.slang"))
    assert [file.name.split(".")[0] for file in files] == sorted({file for file, _ in ENTRIES})
    assert all(len(file.read_text().splitlines()) < 60 for file in files)


def test_the_example_renderer_compiles():
    example = REPOSITORY / "examples/slang_renderer/facing.slang"
    said, code = compile_slang(
        str(example), *("-target", "spirv", "-entry", "facing", "-stage", "compute"),
        *("-I", str(SOURCE)),
    )  # fmt: skip
    assert len(code) > 10_000, said


# What the GPU has and the CPU has not: lanes, loads, and de Casteljau's scheme instead of weights.
GPU_ONLY = {
    "bezier": {"mix", "evaluate_cubic", "restrict_cubic"},
    "patch_buffer": {
        *("own_axes", "load_net", "load_bump", "load_model", "miss", "assert_layout"),
        *("center", "left_handed", "instance_count", "use_newton"),
        *("vector_to_world", "point_to_world", "normal_to_world"),
    },
    "bvh": {"begin", "climb", "is_pending", "nearest_behind", "next_leaf", "entry_of"},
    "ray": {
        *("axes_of", "axis_z_of"),
        *("is_finite", "pick", "lost_in_sum", "two_sum", "upper_half", "add_scaled", "inverse_of"),
    },
    "root_patch": {"sum_abs", "corners", "keep_corners"},
    "domain": {"interval_size", "make", "splits_u", "size_u", "size_v", "u0", "v0"},
    "newton": {"make", "times", "bound", "det", "beyond"},
    "intersect_patch": {"make", "freeze_bumps", "bisect", "keep_flag", "kept_flag"},
    "hit_attributes": {"load_patch", "scaled", "normal_at"},
    "depth_cluster": {"make", "tell"},
    "gregory": set(),
}


def functions_of(path):
    text = re.sub(r"//.*", "", path.read_text())
    names = set(re.findall(r"\b[\w<>:]+[&*]? (\w+)(?:<[^()]*>)?\([^;{}]*\)\s*(?:const )?\{", text))
    # Types in a field's initial value look alike.
    return {name for name in names if name[0].islower()} - {"if", "for", "while", "switch"}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_functions_are_named_as_in_the_twin(path):
    twin = path.with_suffix(".h")
    if not twin.exists():
        assert path.stem in ("thread_group", "trace")
        return
    words = set(re.findall(r"\w+", twin.read_text()))
    if path.stem == "bezier":
        words |= set(re.findall(r"\w+", twin.with_name("net.h").read_text()))
    members = {"get_x", "get_y"}
    unknown = functions_of(path) - words - GPU_ONLY[path.stem] - members
    assert not unknown, f"{path.name} has functions that {twin.name} has not"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_steps_are_told_as_in_the_twin(path):
    twin = path.with_suffix(".h")
    steps = set(re.findall(r"\bS\d\b", path.read_text()))
    if twin.exists():
        # The walk of the whole algorithm is told in intersect_patch.h.
        assert steps <= set(re.findall(r"\bS\d\b", twin.read_text()))
    assert len(path.read_text().splitlines()) < 350
