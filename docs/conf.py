"""Sphinx: `make docs` builds the pages of this folder into build/docs; the pages stay readable as plain Markdown."""

from __future__ import annotations

import inspect
import os
import re
import sys
from enum import Enum
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]
os.environ.setdefault("OMP_NUM_THREADS", "1")

from notebook_page import markdown  # noqa: E402

import canid  # noqa: E402

project = "canid"
author = "the canid authors"
project_copyright = author
version = release = canid.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["images", "man", "notebooks"]
html_theme = "furo"
html_title = f"canid {release}"
html_static_path: list[str] = []
# the pages link to sources of the repository as plain Markdown does; without this each would be copied as a download
html_copy_source = False

# quotation marks are those of commands and Python; `names` in docstrings are code
smartquotes = False
default_role = "code"

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
# classes in signatures that have no entry: of other packages, and of canid's inner parts
nitpick_ignore_regex = [("py:(class|obj)", ".*")]

PUBLIC = [name for name in dir(canid) if not name.startswith("_")]
PUBLIC_NAMES = "<!-- public names -->"
RESULT_TYPES = "<!-- result types -->"
ERRORS = "<!-- errors -->"
NOTEBOOK = re.compile(r"<!-- notebook (\S+) -->")
# fields are in the signature; what they mean stands in the docstring
TYPES = (
    "canid.values.types.Interval", "canid.values.types.Channel", "canid.values.types.Estimate", "canid.values.types.Status",
    "canid.values.types.Identifiable", "canid.values.types.Trace", "canid.analysis.drive.drive_parameters.Identified",
    "canid.values.findings.Report",
    "canid.values.findings.Finding",
)  # fmt: skip


def public_names() -> str:
    """One directive per function and class of canid's own in `dir(canid)`, functions first."""
    functions = [name for name in PUBLIC if inspect.isfunction(getattr(canid, name))]
    classes = [name for name in PUBLIC if name not in functions and not is_value(getattr(canid, name))]
    return rst(
        [f".. autofunction:: canid.{name}" for name in functions]
        + [f".. autoclass:: canid.{name}\n   :members:" for name in classes]
    )


def result_types() -> str:
    """The types of results: the public ones, and further ones that public functions return."""
    public = [f"canid.{name}" for name in PUBLIC if is_value(getattr(canid, name))]
    further = [name for name in TYPES if name.rpartition(".")[2] not in PUBLIC]
    return rst([f".. autoclass:: {name}" for name in (*public, *further)])


def errors() -> str:
    """The errors that a user can correct, from their base on."""
    return rst(
        [
            f".. autoexception:: canid.values.errors.{each.__name__}"
            for each in canid.CanidError.__subclasses__()
        ]
    )


def is_value(item: object) -> bool:
    """Whether it is a NamedTuple or an Enum: its fields, or its names, are its documentation."""
    return inspect.isclass(item) and issubclass(item, (tuple, Enum))


def rst(directives: list[str]) -> str:
    """Directives of reStructuredText within a page of Markdown."""
    return "\n".join(f"```{{eval-rst}}\n{each}\n```\n" for each in directives)


def setup(app: Any) -> None:
    """Fill in what is made from the code, the names of the API, and the notebook on its page."""

    def source_read(_: Any, page: str, source: list[str]) -> None:
        if page == "api":
            made = {PUBLIC_NAMES: public_names(), RESULT_TYPES: result_types(), ERRORS: errors()}
            for mark, text in made.items():
                source[0] = source[0].replace(mark, text)

        source[0] = NOTEBOOK.sub(lambda found: markdown(DOCS / found[1]).replace("](../", "]("), source[0])

    app.connect("source-read", source_read)
