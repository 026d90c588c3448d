"""A document is rendered as text of a width and as a page that loads nothing; what it holds is data in both."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from canid.ui.views.document.document import (
    Document,
    Drawing,
    Fold,
    Listing,
    Section,
    Sentence,
    Source,
    Table,
)
from canid.ui.views.document.document_page import page
from canid.ui.views.document.document_text import block_lines, lines
from canid.ui.views.drawing.figure import Figure, axis_suffix, line
from canid.ui.views.drawing.grid import Tile, grid
from canid.ui.views.notebook.fragment import fragment
from canid.values.findings import Provenance

EVIL = "</p><script>alert(1)</script>{{ 7*7 }}"
TABLE = Table(("what", ">n"), [("✓ a `b`", "1"), (EVIL, ("22", "33"))], "counts", "of all")
LISTING = Listing(["✗ one two three", EVIL], "why", "- ")


def test_text_is_wrapped_indented_below_its_titles_and_parted_by_blank_lines() -> None:
    """No line is wider than asked for; nothing stands for what is empty; nothing of the words is lost."""
    sentence = "A verdict of several words, and of a second clause."
    blocks = [sentence, Table(("n",), []), None, Listing((), "empty"), LISTING, TABLE]
    text = lines(blocks, 24)
    assert text[:4] == ["A verdict of several", "  words, and of a second", "  clause.", ""]
    assert text[4:7] == ["why", "  - ✗ one two three", "  - </p><script>alert(1)"]
    assert all(len(line) <= 24 for line in text)
    assert text[text.index("counts") - 1] == ""
    # a table that is too wide: a paragraph for each row
    assert text[text.index("counts") + 1 :][:2] == ["  ✓ a `b`: n 1", "  </p><script>alert(1)</"]
    assert "n 22 33" in " ".join(text)
    assert lines([TABLE])[1] == f"  what{' ' * (len(EVIL) - 4)}      n"
    assert text.count("") == 2
    assert lines([sentence, Sentence("b", hang="")]) == [sentence, "", "b"]
    # a table of which no column has a name has no head
    assert lines([Table(("", ""), [("K", "5")])]) == ["K  5"]


def test_a_page_shows_every_block_and_takes_none_for_markup() -> None:
    """Marks in color, code as code, drawings as they are; ids of sections and figures; names are data."""
    figure = Figure("f", EVIL, EVIL, EVIL, 100, [{"y": [1.0], "name": EVIL}], {"margin": {"t": 1, "b": 1}})
    drawing = Drawing(Markup("<svg></svg>"), EVIL, EVIL)
    sections = [
        Section("one", EVIL, [EVIL, Sentence(EVIL, "hint"), TABLE, LISTING, drawing]),
        Section("two", "Two", [Fold(EVIL, [figure, Listing(["a"], bullet="1.")], open=True), None], "2"),
    ]
    log = Provenance(log=EVIL, command=EVIL)
    source = Source(log, EVIL, [EVIL], True)
    of = Document("canid x", "bad", EVIL, [EVIL], sections, source, EVIL, [(EVIL, EVIL)])
    html = page(of)
    assert "<script>alert" not in html
    assert html.count("{{ 7*7 }}") >= 20
    assert '<span class="passed">✓</span> a <code>b</code>' in html
    assert '<td class="n">22<span class="line">33</span></td>' in html
    assert "<svg></svg>" in html
    assert html.count("<ol><li>a</li></ol>") == html.count('<p class="hint">&lt;/p&gt;') == 1
    assert [f'<section id="{name}"' in html for name in ("one", "two", "provenance")] == [True] * 3
    assert 'data-figure="f"' in html
    assert html.count('href="#two">2</a>') == 1
    # of several documents each is a part of its own, and its figures are in the page
    several = page(of._replace(sections=(), parts=[of._replace(short="part-1")]))
    assert 'id="part-1"' in several
    assert 'data-figure="f"' in several
    assert '"f": {"height": 100' in several


def test_a_notebook_shows_the_same_blocks_as_data() -> None:
    """Sentences, listings and tables with what they hold; a drawing as it is, everything else escaped; None is nothing."""
    drawing = Markup("<svg></svg>")
    shown = fragment(EVIL, EVIL, LISTING, TABLE._replace(rows=[(EVIL, ("22", drawing))]), drawing, None, "")
    assert "<script>" not in shown
    assert shown.count("{{ 7*7 }}") == 4
    assert shown.count("<svg></svg>") == 2
    assert "22 <svg></svg>" in shown
    assert ">n</th>" in shown
    assert "<table" not in fragment("a", TABLE._replace(rows=[]))


def test_a_grid_puts_each_panel_on_axes_of_its_own() -> None:
    """Four panels in two rows: no domain overlaps another; titles in the lowest row and the first column; on a phone below
    each other; a name stands once in the legend."""
    tiles = [Tile(str(k), [line([0.0], np.array([1.0]), "same", "after")], level=0.5) for k in range(4)]
    of = grid(Figure("a", "", "", ""), tiles, ("s", "m"), (100, 80))
    boxes = [
        (*of.layout[f"xaxis{axis_suffix(k)}"]["domain"], *of.layout[f"yaxis{axis_suffix(k)}"]["domain"])
        for k in range(4)
    ]
    for k, (left, right, low, high) in enumerate(boxes):
        assert 0.0 <= left < right <= 1.0
        assert 0.0 <= low < high <= 1.0
        for other in boxes[:k]:
            assert left >= other[1] or other[0] >= right or low >= other[3] or other[2] >= high
    titles = [of.layout[f"xaxis{axis_suffix(k)}"]["title"]["text"] for k in range(4)]
    assert titles == ["", "s", "s", "s"]
    assert [of.layout[f"yaxis{axis_suffix(k)}"]["title"]["text"] for k in range(4)] == ["m", "", "", "m"]
    assert [one["showlegend"] for one in of.data] == [True, False, False, False]
    assert [(one["xaxis"], one["yaxis"]) for one in of.data][3] == ("x4", "y4")
    assert [shape["yref"] for shape in of.layout["shapes"]] == ["y", "y2", "y3", "y4"]
    assert of.narrow is not None
    height, phone = of.narrow
    assert height > 4 * 80
    assert [phone[f"xaxis{axis_suffix(k)}"]["domain"] for k in range(4)] == [(0.0, 1.0)] * 4
    rows = [phone[f"yaxis{axis_suffix(k)}"]["domain"] for k in range(4)]
    assert all(below[1] < above[0] for above, below in pairwise(rows))


def test_a_page_without_figures_has_no_script() -> None:
    html = page(Document("canid x", "", "T", ["s"], [Section("a", "A", ["words"])], Source(Provenance())))
    assert "<script" not in html
    assert "<p>words</p>" in html


def test_a_notebook_has_the_colors_of_the_page_where_they_can_be_read_on_both_grounds() -> None:
    """WCAG's contrast of 3 for graphics, on white and on black; the page's own color wherever it has that."""
    from canid.ui.views.document.templates import file_text
    from canid.ui.views.drawing.palette import NOTEBOOK

    def contrasts(color: str) -> float:
        parts = [int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
        light = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
        return min((light + 0.05) / 0.05, 1.05 / (light + 0.05))

    root = str(file_text("document/page.css")).partition("}")[0]
    page = dict(re.findall(r"--([\w-]+): (#\w{6});", root))
    for name, color in NOTEBOOK.items():
        if color.startswith("#"):
            assert contrasts(color) >= 3.0, name
            # greys of several strengths are one grey in a notebook
            if contrasts(page[name]) >= 3.0 and name != "muted":
                assert color == page[name], name


def test_a_column_without_any_value_is_not_shown() -> None:
    table = Table(("role", "why", ">n"), [("gap", "", "3"), ("speed", "", "")])
    shown = page(Document("canid x", "fits", "T", (), [Section("s", "S", [table])], Source(Provenance())))
    assert ">why<" not in shown
    assert ">n<" in shown


def test_numbers_are_not_broken_from_interval_and_unit() -> None:
    """In a text at any width, and on a page, whose browser breaks lines."""
    says = "The driver does not respond to relative speeds below 0.974 [0.907, 1.04] m/s, 5.1 s later, by 12 % less."
    for width in range(30, 90):
        lines = block_lines(says, width)
        for whole in ("0.974 [0.907, 1.04] m/s", "5.1 s", "12 %"):
            assert any(whole in line for line in lines), width
    shown = page(Document("canid x", "fits", "T", (says,), (), Source(Provenance())))
    assert (
        '<span class="whole">0.974 [0.907, 1.04] m/s</span>, <span class="whole">5.1 s</span> later' in shown
    )
