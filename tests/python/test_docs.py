"""The manual's samples run: Python blocks one after the other, commands as they stand, doctests."""

import doctest
import importlib
import pkgutil
import re
import shlex

import pytest
from shapes import REPOSITORY

import limitray
from limitray.cli import main

PAGES = sorted((REPOSITORY / "docs").rglob("*.md"))
MODULES = [name for _, name, _ in pkgutil.walk_packages(limitray.__path__, "limitray.")]


@pytest.fixture(autouse=True)
def _in_a_folder_with_the_cages(tmp_path, monkeypatch):
    (tmp_path / "tests").symlink_to(REPOSITORY / "tests")
    monkeypatch.chdir(tmp_path)


def blocks(page, language):
    """The fenced blocks of one language on a page."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=lambda p: p.name)
def test_python_samples_run(page):
    names = {}
    for block in blocks(page, "python"):
        exec(compile(block, page.name, "exec"), names)


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "console")], ids=lambda p: p.name)
def test_commands_run(page):
    commands = "".join(blocks(page, "console")).splitlines()
    assert commands
    for command in commands:
        program, *arguments = shlex.split(command)
        assert program == "limitray"
        assert main(arguments) == 0


def test_pages_have_samples():
    with_samples = {page.name for page in PAGES if blocks(page, "python")}
    assert {"tutorial.md", "howto.md", "rendering.md"} <= with_samples


def test_doctests_run():
    tried = 0
    for name in MODULES:
        if name.rpartition(".")[2] not in ("_core", "gpu"):
            result = doctest.testmod(importlib.import_module(name))
            assert result.failed == 0, name
            tried += result.attempted
    assert tried > 0
