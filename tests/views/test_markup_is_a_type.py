"""What is markup is known by its type alone: text of a log is escaped, whatever it begins with."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from markupsafe import Markup

from canid.views.document.document import Listing, Table
from canid.views.document.document_page import marked
from canid.views.notebook.fragment import fragment

CANID = Path(__file__).parents[2] / "canid"
HOSTILE = "{}<script>alert(1)</script>"
# comparisons of a text with the beginning of an element
BY_TEXT = re.compile(
    r"""(startswith\(\s*[("']+\s*<|\[:\d+\]\s*[!=]=\s*["']<|["']<\w+["' ]+\s*(not\s+)?in\b|is_safe)"""
)
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
