"""`limitray bench`: the table, the JSON and the plot of a short run, and how it fails."""

import json
import subprocess
from pathlib import Path

import pytest
from shapes import REPOSITORY, assert_fails

from limitray import _core
from limitray.cli import main

TORUS = str(REPOSITORY / "tests/cages/torus.obj")
STAGE = str(REPOSITORY / "tests/cages/usd/schemes.usda")
SHORT = ["--rays", "3e3", "--rounds", "1", "--threads", "1", "--isolation-level", "2"]
PEERS = ["embree-subdivision-4", "embree-triangles-4", "embree-triangles-8"]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_short_run(capsys, tmp_path):
    peers = ["--tracers", ",".join(PEERS)]
    assert main(["bench", TORUS, *SHORT, *peers, "--json", "torus.json"]) == 0
    table = capsys.readouterr().out
    for word in (*PEERS, "primary rays", "diffuse rays", "newton steps", "mismatches"):
        assert word in table
    report = json.loads((tmp_path / "torus.json").read_text())
    assert report["model"] == TORUS
    assert report["threads"] == 1
    assert report["isolation_level"] == 2
    assert {"cpu", "compiler", "isa", "embree", "commit"} <= set(report["machine"])
    rows = {(row["tracer"], row["rays"]): row for row in report["rows"]}
    assert len(rows) == 2 * (2 + len(PEERS))
    for row in rows.values():
        assert row["mrays_per_s"] > 0
        assert row["bytes"] > 0
        assert row["build_s"] >= 0
    for kind in ("primary", "diffuse"):
        ours, coarse, fine = (rows[name, kind] for name in ("limitray", *PEERS[1:]))
        assert ours["mismatches"] <= 3
        assert ours["mean_error"] < 1e-6
        assert 0 < fine["mean_error"] <= fine["max_error"]
        # The error of flat facets falls with the square of their size.
        assert 3 < coarse["mean_error"] / fine["mean_error"] < 5
        assert ours["per_ray"]["unresolved"] == 0


def test_one_mesh_of_a_stage(tmp_path):
    pytest.importorskip("pxr")
    choice = ["--prim", "/CatmullClark", "--tracers", "embree-triangles-4"]
    assert main(["bench", STAGE, *SHORT, *choice, "--json", "mesh.json"]) == 0
    report = json.loads((tmp_path / "mesh.json").read_text())
    assert report["model"] == STAGE
    assert report["faces"] == 6


def test_tolerance_chooses_the_level(tmp_path):
    cage = str(REPOSITORY / "tests/cages/pole_8.obj")
    levels = []
    for tolerance in ("1e-2", "1e-5"):
        choice = ["--tolerance", tolerance, "--tracers", "limitray"]
        assert main(["bench", cage, *SHORT[:-2], *choice, "--json", "pole.json"]) == 0
        levels.append(json.loads((tmp_path / "pole.json").read_text())["isolation_level"])
    assert levels[0] < levels[1]


def test_rays_sorted_beforehand_meet_the_same(tmp_path):
    program = Path(_core.__file__).with_name("limitray_bench")
    command = [program, TORUS, *SHORT, "--tracers", "embree-triangles-8"]
    for name, extra in (("plain", []), ("sorted", ["--sort"])):
        subprocess.run(
            [*command, *extra, "--json", f"{name}.json"], check=True, capture_output=True
        )
    plain, ordered = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("plain", "sorted"))
    for a, b in zip(plain["rows"], ordered["rows"], strict=True):
        assert (a["tracer"], a["rays"]) == (b["tracer"], b["rays"])
        if a["rays"] == "primary":  # the diffuse rays are drawn anew, from hits in another order
            assert a["mismatches"] == b["mismatches"]
            assert a["mean_error"] == pytest.approx(b["mean_error"])


def test_a_plot_is_written(tmp_path):
    pytest.importorskip("matplotlib")
    peers = ["--tracers", "embree-triangles-4"]
    assert main(["bench", TORUS, *SHORT, *peers, "--plot", "torus.png"]) == 0
    assert (tmp_path / "torus.png").read_bytes().startswith(b"\x89PNG")


FAILURES = [
    (["bench", "nothing.obj"], 1, "nothing.obj: No such file or directory"),
    (["bench", "bad.obj"], 1, "bad.obj:1: "),
    (["bench", STAGE], 1, "prim must name one of 5 meshes: /CatmullClark, "),
    (["bench", TORUS, "--prim", "/a"], 1, "prim must be None for an OBJ file, not '/a'"),
    (["bench", TORUS, "--rays", "many"], 2, '"many" is not a whole number from 1 to 1e9'),
    (["bench", TORUS, "--rays", "1.5"], 2, '"1.5" is not a whole number from 1 to 1e9'),
    (["bench", TORUS, "--tracers", "optix"], 2, '--tracers: unknown tracer "optix"'),
    (["bench", TORUS, "--json", "nowhere/a.json"], 1, "nowhere/a.json: No such file"),
    (["bench", TORUS, "--plot", "a.gif"], 2, '"a.gif" does not end in .png'),
]


@pytest.mark.parametrize(("arguments", "code", "message"), FAILURES)
def test_failures_are_one_line_and_an_exit_code(arguments, code, message, capsys, tmp_path):
    (tmp_path / "bad.obj").write_text("f 1 2 9\n")
    assert_fails(capsys, arguments, code, message)
