"""The value that a result is shown as: a document of sections, which hold sentences, tables and figures.

What judges begins with ✓ (good), ✗ (bad) or ⚠ (careful), and words between backticks are code: the renderings show that
in their way. A column whose head begins with ">" holds numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Union

from markupsafe import Markup

from canid.ui.views.drawing.figure import Figure
from canid.values.findings import Provenance

# several: a line each; a `Markup` is a drawing
Cell = str | tuple[str, ...]


class Sentence(NamedTuple):
    """A sentence, or several; a plain `str` will do where nothing else is to be said of it."""

    text: str
    kind: str = ""  # class of the style sheet
    hang: str = "  "  # what the second and later lines of it begin with in a text


class Listing(NamedTuple):
    """Sentences that belong together, below a title or none."""

    items: Sequence[str]
    title: str = ""
    bullet: str = ""  # of a text; "1.": the page numbers them
    hang: str = "  "


class Table(NamedTuple):
    """Rows of cells; the first cell of each is what the row is about."""

    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    title: str = ""
    caption: str = ""  # what to know of it; the text has it in a sentence of its own, where it needs one
    kind: str = "narrow"  # class of the style sheet; "cards": on a phone a row is a card
    notes: Sequence[str] = ()  # below the rows


class Drawing(NamedTuple):
    """A figure that is drawn already."""

    svg: Markup
    title: str = ""
    caption: str = ""


class Fold(NamedTuple):
    """Blocks that a page shows with a click."""

    title: str
    blocks: Sequence[Block]
    kind: str = ""
    open: bool = False  # until the reader closes it


Block = Union[str, Sentence, Listing, Table, Figure, Drawing, Fold, None]  # noqa: UP007 (None: nothing to show)


class Section(NamedTuple):
    """Blocks under a heading of a page."""

    name: str  # id in the page
    title: str
    blocks: Sequence[Block]
    short: str = ""  # title in the table of contents


class Source(NamedTuple):
    """What a result was made from."""

    provenance: Provenance
    vehicle: str = ""  # its name
    health: Sequence[str] = ()  # what was wrong with the log, sentences
    damaged: bool = False


class Document(NamedTuple):
    """A result as a page shows it: the verdict first."""

    verb: str  # "canid check"
    kind: str  # of the verdict, for its color
    title: str
    says: Sequence[Block]  # below the title
    sections: Sequence[Section]
    source: Source
    about: str = ""  # what the title of the window begins with
    key: Sequence[tuple[str, Cell]] = ()  # the numbers to see first
    parts: Sequence[Document] = ()  # of several logs, one each
    short: str = ""  # name of a part


def chosen(head: Sequence[str], rows: Iterable[Mapping[str, Cell]], **more: str) -> Table:
    """The table of some of the columns that are known of each row.

    Example:
        >>> chosen(("role", ">low"), [{"role": "speed", ">low": "3", ">high": "9"}]).rows
        [['speed', '3']]
    """
    return Table(head, [[row[name] for name in head] for row in rows], **more)


def without_empty(table: Table) -> Table:
    """A table without the columns in which no row has anything.

    Example:
        >>> without_empty(Table(("role", "why", ">n"), [("gap", "", "3"), ("speed", "", "")])).head
        ('role', '>n')
    """
    kept = [k for k in range(len(table.head)) if not k or any(row[k] for row in table.rows)]
    rows = [tuple(row[k] for k in kept) for row in table.rows]
    return table._replace(head=tuple(table.head[k] for k in kept), rows=rows)
