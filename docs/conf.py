"""Sphinx: `make docs` builds the pages of this folder into build/docs; the pages stay readable as plain Markdown."""

from __future__ import annotations

import inspect
import os
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]
os.environ.setdefault("OMP_NUM_THREADS", "1")

import canid  # noqa: E402

project = "canid"
author = "the canid authors"
project_copyright = author
version = release = canid.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["images", "man"]
html_theme = "furo"
html_title = f"canid {release}"
html_static_path: list[str] = []
# the pages link to sources of the repository as plain Markdown does; without this each would be copied as a download
html_copy_source = False

# ids of headings as the forges make them: links with a # work there and here
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_param = False
# names in signatures that have no page: types of numpy, of the standard library and of canid's inner parts
nitpick_ignore_regex = [(r"py:.*", r".*")]

PUBLIC_NAMES = "<!-- public names -->"


def public_names() -> str:
    """One directive per public name: what `from canid import *` gives."""
    lines = []
    for name in canid.__all__:
        kind = "autoclass" if inspect.isclass(getattr(canid, name)) else "autofunction"
        lines += [f"```{{eval-rst}}\n.. {kind}:: canid.{name}"]
        if kind == "autoclass":
            lines += ["   :members:"]
        lines += ["```\n"]
    return "\n".join(lines)


def setup(app: Any) -> None:
    """Fill in what is generated: the notebooks as pages, and the list of public names."""

    def source_read(_: Any, page: str, source: list[str]) -> None:
        if page == "api":
            source[0] = source[0].replace(PUBLIC_NAMES, public_names())

    app.connect("source-read", source_read)
