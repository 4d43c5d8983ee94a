"""Ctrl-C: calls end within half a second, the scene stays usable, a picture is saved."""

import os
import pty
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image
from shapes import REPOSITORY

CAST = """
import time, signal, sys
import numpy as np
import limitray as lr

scene = lr.Scene()
scene.add_mesh(lr.Mesh.from_file(sys.argv[1]))
rays = np.tile(np.array([[0, 2, 8, 0.02, 0, -1.0]]), (4_000_000, 1))
print("ready", flush=True)
try:
    scene.{call}
except KeyboardInterrupt:
    print(time.time(), flush=True)
print(scene.test_occlusions(rays[:5]).tolist(), flush=True)
"""
CALLS = ["cast_rays(rays)", "test_occlusions(rays)", "count_intersections(rays)"]
DEMO = str(REPOSITORY / "tests/cages/demo.obj")


@pytest.mark.parametrize("call", CALLS)
def test_a_long_call_ends_within_half_a_second(call):
    program = [sys.executable, "-c", CAST.format(call=call), DEMO]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        sent = time.time()
        process.send_signal(signal.SIGINT)
        stopped = float(process.stdout.readline())
        usable = process.stdout.readline()
    assert process.returncode == 0
    assert stopped - sent < 0.5
    assert usable == "[True, True, True, True, True]\n"


def test_render_shows_progress_and_saves_the_picture_so_far(tmp_path):
    output = tmp_path / "part.png"
    program = [sys.executable, "-m", "limitray.cli", "render", DEMO, "-o", output]
    terminal, stderr = pty.openpty()
    with subprocess.Popen(
        [*program, "--spp", "512", "--size", "320x240"],
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
    ) as process:
        seen = b""
        while b" 1 %" not in seen:
            seen += os.read(terminal, 4096)
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=20)
    os.close(stderr)
    os.close(terminal)
    assert b"rendering" in seen
    assert process.returncode == 130
    assert printed == f"{output} (stopped early)\n"
    with Image.open(output) as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (240, 320, 3)
    assert len(np.unique(pixels)) > 50
