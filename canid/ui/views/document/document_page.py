"""A document as one self-contained HTML page: it loads nothing, style, scripts and data are in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from markupsafe import Markup

from canid.ui.views.document.document import Block, Cell, Document, Fold, without_empty
from canid.ui.views.document.document_text import WHOLE_NUMBER
from canid.ui.views.document.templates import code, environment, file_text
from canid.ui.views.document.terms import TermLinks
from canid.ui.views.drawing.figure import Figure, script
from canid.ui.views.drawing.plotly_package import plotly_script

STYLES = ("document/page.css", "drawing/drawing.css", "document/document.css")
# classes of what judges
MARKS = {"✓": "passed", "✗": "failed", "⚠": "at-bound"}


def page(document: Document) -> str:
    """The page, to be stored as UTF-8.

    The plotly.js of the installed plotly package draws the plots; without that package the page has its text and tables,
    and says how to get the plots.

    Example:
        >>> from canid.values.findings import Provenance
        >>> from canid.ui.views.document.document import Source
        >>> "<h1>Fits</h1>" in page(Document("canid check", "fits", "Fits", ["✓ all"], (), Source(Provenance())))
        True
    """
    drawn = list(_figures(document))
    plotly = plotly_script() if drawn else None
    templates = environment()
    terms = TermLinks()
    templates.filters.update(marked=marked, without_empty=without_empty, termed=terms.linked)
    templates.filters.update(spoken=lambda text: terms.linked(spoken(text)))
    return templates.get_template("document/document.html.j2").render(
        of=document,
        terms=terms,
        p=document.source.provenance,
        plotly=plotly,
        drawn=drawn,
        specs=Markup(script(drawn)),
        style=Markup("").join(map(file_text, STYLES)),
        script=file_text("document/page.js"),
    )


def marked(cell: Cell) -> Markup:
    """Text with its mark in color and code as code; a drawing as it is; of several lines each in a line of its own.

    Example:
        >>> marked("✓ map `pedal`")
        Markup('<span class="passed">✓</span> map <code>pedal</code>')
        >>> marked(("<b>", "2"))
        Markup('&lt;b&gt;<span class="line">2</span>')
    """
    if isinstance(cell, tuple):
        first, *rest = map(marked, cell) if cell else [Markup("")]
        return first + Markup("").join(Markup('<span class="line">{}</span>').format(line) for line in rest)
    if isinstance(cell, Markup):
        return cell
    mark = MARKS.get(cell[:1])
    return (
        code(cell)
        if mark is None
        else Markup('<span class="{}">{}</span>').format(mark, cell[0]) + code(cell[1:])
    )


def spoken(text: str) -> Markup:
    """A sentence as `marked`, whose numbers are not broken from their intervals and units.

    Example:
        >>> str(spoken("✓ 5 s later"))
        '<span class="passed">✓</span> <span class="whole">5 s</span> later'
    """
    shown = str(marked(text))
    return Markup(WHOLE_NUMBER.sub(r'<span class="whole">\g<0></span>', shown))


def _figures(document: Document) -> Iterator[Figure]:
    for section in document.sections:
        yield from _drawn(section.blocks)
    for part in document.parts:
        yield from _figures(part)


def _drawn(blocks: Iterable[Block]) -> Iterator[Figure]:
    for block in blocks:
        if isinstance(block, Figure):
            yield block
        elif isinstance(block, Fold):
            yield from _drawn(block.blocks)
