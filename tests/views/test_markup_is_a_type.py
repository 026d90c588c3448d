"""What is markup is known by its type alone: text of a log is escaped, whatever it begins with."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from markupsafe import Markup

from canid.ui.views.document.document import Listing, Table
from canid.ui.views.document.document_page import marked
from canid.ui.views.notebook.fragment import fragment

CANID = Path(__file__).parents[2] / "canid"
HOSTILE = "{}<script>alert(1)</script>"
# comparisons of a text with the beginning of an element
BY_TEXT = re.compile(
    r"""(startswith\(\s*[("']+\s*<|\[:\d+\]\s*[!=]=\s*["']<|["']<\w+["' ]+\s*(not\s+)?in\b|is_safe)"""
)
# where a text that is no literal becomes markup, and why it may
MADE = {
    ("canid/ui/views/document/templates.py", "code"): "escapes it first",
    ("canid/ui/views/document/templates.py", "css_string"): "is of letters, digits and code points alone",
    ("canid/ui/views/document/templates.py", "file_text"): "a file of the package",
    ("canid/ui/views/document/document_page.py", "page"): "JSON whose every < is escaped",
    ("canid/ui/views/document/document_page.py", "spoken"): "is markup already, to which elements are added",
    (
        "canid/ui/views/document/terms.py",
        "linked",
    ): "is markup already, or escaped first, to which elements are added",
    ("canid/ui/views/drawing/palette.py", "light"): "is markup already, whose colors are replaced",
    ("canid/ui/views/drawing/plotly_package.py", "plotly_script"): "a file of the package",
    ("canid/ui/views/notebook/fragment.py", "fragment"): "of a template that escapes",
    ("canid/ui/views/signal_page/signal_page.py", "file"): "JSON whose every < is escaped",
    ("canid_study/views/study_page.py", "page"): "drawn by matplotlib, and a file of the package",
}
INSERTS = re.compile(r"\.(inner|outer)HTML\b|insertAdjacentHTML|document\.write\b")


@pytest.mark.parametrize(
    "begins", ["<svg ", "<svg>", "<div>", "<span class='passed'>", "✓ <svg>", "> ", "`<svg>`"]
)
def test_no_text_is_markup_by_its_beginning(begins: str) -> None:
    """In a cell, a head, a line, a title, a block of a notebook and of a page."""
    text = HOSTILE.format(begins)
    shown = [
        fragment("a", Table(("b",), [(text,)])),
        fragment("a", Table(("b",), [((text, text),)])),
        fragment("a", Table((text,), [("b",)])),
        fragment("a", Listing([text])),
        fragment("a", text),
        fragment(text),
        marked(text),
        marked((text, text)),
    ]
    for each in shown:
        assert "<script" not in each
        assert "<svg" not in each
        assert "&lt;script&gt;" in each


def test_a_drawing_is_markup_by_its_type() -> None:
    """And stays as it is, next to text that is escaped."""
    drawing = Markup("<svg></svg>")
    shown = fragment("a", Table(("b", "c"), [(drawing, "<svg></svg>")]))
    assert (shown.count("<svg></svg>"), shown.count("&lt;svg&gt;")) == (1, 1)


def test_no_source_judges_markup_by_its_text() -> None:
    """Neither Python nor a template, and no script inserts text as elements."""
    found = [
        f"{path.relative_to(CANID)}:{number}"
        for suffix in ("*.py", "*.j2", "*.html", "*.js")
        for path in sorted(CANID.rglob(suffix))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if ">>>" not in line and (BY_TEXT.search(line) or INSERTS.search(line))
    ]
    assert found == []


def markup_made(source: str) -> Iterator[str]:
    """Functions of a source that make markup of what is no literal."""
    for owner in ast.walk(ast.parse(source)):
        if isinstance(owner, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.Module):
            for node in _within(owner):
                if isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in (
                    "Markup",
                    "safe",
                ):
                    if not all(isinstance(each, ast.Constant) for each in node.args):
                        yield getattr(owner, "name", "")
                elif isinstance(node, ast.ImportFrom) and node.module == "markupsafe":
                    yield from (each.asname for each in node.names if each.asname)


def _within(owner: ast.AST) -> Iterator[ast.AST]:
    """Nodes of a function, without those of functions in it."""
    for child in ast.iter_child_nodes(owner):
        yield child
        if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from _within(child)


def test_markup_is_made_of_literals() -> None:
    """Whatever is put into them is escaped by their type; every other place is known, with its reason."""
    found = {
        (str(path.relative_to(CANID.parent)), name)
        for package in (CANID, CANID.parent / "canid_study")
        for path in sorted(package.rglob("*.py"))
        if "Markup" in (source := path.read_text(encoding="utf-8"))
        for name in markup_made(source)
    }
    assert found == set(MADE)


@pytest.mark.parametrize(
    "source",
    [
        "Markup(text)",
        "Markup(f'<b>{text}</b>')",
        "Markup('<b>' + text)",
        "markupsafe.Markup('<b>%s' % text)",
        "from markupsafe import Markup as M",
        "f = lambda text: Markup(text)",
    ],
)
def test_markup_of_a_text_is_found(source: str) -> None:
    """The test above would fail for each of these."""
    assert list(markup_made(source))
