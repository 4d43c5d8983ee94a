"""What the tests look at: small meshes, the cages of the project, and rays."""

import os
from pathlib import Path

import numpy as np

import limitray as lr
from limitray.cli import main

REPOSITORY = Path(__file__).parents[2]
CAGES_FOLDER = REPOSITORY / "tests/cages"
CAGES = sorted(CAGES_FOLDER.glob("*.obj"))
MODELS_FOLDER = Path(os.environ.get("LIMITRAY_MODELS", REPOSITORY.parent / "shared/models"))
MODELS = sorted(MODELS_FOLDER.rglob("*.obj"))
CLOSED = ("cube", "cube_semi_2_5", "cube_inf_loop", "torus", "icosahedron", "prism_5", "pole_8")

CUBE_POINTS = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
CUBE_INDICES = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 1, 3, 7, 5, 3, 2, 6, 7, 2, 0, 4, 6]


def assert_fails(capsys, arguments, code, message):
    """The command line ends with `code` and one line on stderr that holds `message`."""
    assert main(arguments) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("limitray: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err


def cube(**arguments):
    """A cube of side 2: eight vertices of valence 3."""
    return lr.Mesh(CUBE_POINTS, [4] * 6, CUBE_INDICES, **arguments)


def square():
    """The flat unit square, on which p(u, v) = (u, v, 0)."""
    return lr.Mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3])


def cage(name):
    """A cage of tests/cages."""
    return lr.Mesh.from_file(REPOSITORY / "tests/cages" / f"{name}.obj")


def scene_of(*meshes, **arguments):
    """A scene of `meshes`."""
    scene = lr.Scene()
    for mesh in meshes:
        scene.add_mesh(mesh, **arguments)
    return scene


def extent(scene):
    """Largest side of the bounds, and their middle."""
    low, high = scene.bounds()
    return float((high - low).max()), (low + high) / 2


def rays_towards(scene, count, seed=0, dtype=np.float64):
    """Random rays from a sphere around the scene towards points in its bounds."""
    rng = np.random.default_rng(seed)
    size, middle = extent(scene)
    origins = rng.normal(size=(count, 3))
    origins = middle + 2 * size * origins / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = rng.uniform(*scene.bounds(), size=(count, 3))
    return np.concatenate([origins, targets - origins], axis=1).astype(dtype)


def down(*places):
    """Rays along -z from high above the places (x, y)."""
    return np.array([[x, y, 1e4, 0, 0, -1] for x, y in places], np.float64)


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
