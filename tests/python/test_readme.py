"""The README's samples are real: the Python one runs, the C++ one is the tested consumer."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
README = (REPOSITORY / "README.md").read_text()


def blocks(language: str) -> list[str]:
    """The fenced code blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_python_sample_hits_the_cage():
    (sample,) = blocks("python")
    names = {}
    exec(sample.replace('"tests/', f'"{REPOSITORY}/tests/'), names)
    hit, found = names["hit"], names["hit"]["t_hit"] < float("inf")
    assert hit["t_hit"].shape == (180, 320)
    assert found[90, 160], "the middle of the picture shows the surface"
    assert not found[0, 0], "a corner of the picture shows the background"
    assert hit["points"].shape == hit["primitive_normals"].shape == (180, 320, 3)


def test_cpp_sample_is_the_consumer_that_scripts_test_builds():
    (sample,) = blocks("cpp")
    consumer = (REPOSITORY / "tests/consumer/trace_cube.cpp").read_text()
    assert consumer.endswith(sample)


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^):]+)\)", README))))
def test_links_lead_somewhere(target):
    assert (REPOSITORY / target).exists()


def test_commands_exist():
    commands = set(re.findall(r"^    \.venv/bin/limitray (\w+)", README, re.MULTILINE))
    assert commands == {"info", "render"}
    limitray = Path(sys.executable).with_name("limitray")
    for command in commands:
        subprocess.run([limitray, command, "--help"], check=True, capture_output=True)
