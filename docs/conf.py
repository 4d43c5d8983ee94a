"""Sphinx configuration: `sphinx-build -W docs build/docs`, with limitray[docs] installed."""

import re
from pathlib import Path

_PYPROJECT = (Path(__file__).parents[1] / "pyproject.toml").read_text()

project = "limitray"
author = "the limitray authors"
version = release = re.search(r'^version = "(.+)"$', _PYPROJECT, re.MULTILINE)[1]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
myst_heading_anchors = 3
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"limitray {release}"
html_show_copyright = False
