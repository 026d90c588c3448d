"""Blocks of a document as text."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence

from canid.ui.views.document.document import Block, Listing, Sentence, Table

# columns of a terminal that nobody has made wider
WIDTH = 80


def lines(blocks: Iterable[Block], width: int | None = None) -> list[str]:
    """Blocks below each other with a blank line between them; what has a title is indented below it.

    Args:
        blocks: sentences, listings and tables; what is empty is left out.
        width: columns, which nothing exceeds; a table that is wider has a paragraph for each row. None: sentences are
            not wrapped.

    Example:
        >>> lines(["A and B.", Listing(["one two"], "why"), Table(("n",), [])], 7)
        ['A and', '  B.', '', 'why', '  one', '    two']
    """
    out: list[str] = []
    for block in blocks:
        made = block_lines(block, width)
        out += [""] * bool(out and made) + made
    return out


def block_lines(block: Block, width: int | None = None) -> list[str]:
    """One block; nothing of a listing or table that is empty."""
    if isinstance(block, str):
        block = Sentence(block)
    if isinstance(block, Sentence):
        return wrapped(block.text, width, block.hang) if block.text else []
    assert isinstance(block, Listing | Table | None)
    if block is None:
        return []
    indent = "  " * bool(block.title)
    inner = None if width is None else width - len(indent)
    if isinstance(block, Table):
        made = _rows(block)
        if inner is not None and max(map(len, made), default=0) > inner:
            made = _records(block, inner)
    else:
        made = [line for item in block.items for line in wrapped(block.bullet + item, inner, block.hang)]
    title = wrapped(block.title, width) if block.title and made else []
    return title + [indent + line for line in made]


# a number that stays in one line with its symbol, its 95 % interval and its unit
_UNIT = r"(?: (?:%|°|s|m|ms|min|h|m/s²?|km/h|Hz|rad/s)(?![\w/²]))"
_SYMBOL = r"(?:(?<!\w)(?:K|τ\+θ|τ|θ) )?"
WHOLE_NUMBER = re.compile(rf"{_SYMBOL}[-+±]?\d[\d.,]*(?: \[[^\[\]]{{1,40}}\]{_UNIT}?|{_UNIT})")
# a character that no text has, and at which no line is broken
_KEPT = "\ufffe"


def wrapped(text: str, width: int | None = WIDTH, hang: str = "  ") -> list[str]:
    """A sentence in lines; the second and later ones begin with `hang`. No line ends within a number with its interval.

    Example:
        >>> wrapped("later by 0.73 [0.57, 0.91] s", 22)
        ['later by', '  0.73 [0.57, 0.91] s']
        >>> wrapped("by 1.1 s (τ 0.8 [0.4, 1.1] s)", 26)
        ['by 1.1 s', '  (τ 0.8 [0.4, 1.1] s)']
    """
    if width is None:
        return [text]
    whole = WHOLE_NUMBER.sub(lambda match: match[0].replace(" ", _KEPT), text)
    lines = textwrap.wrap(whole, width, subsequent_indent=hang, break_on_hyphens=False) or [""]
    return [line.replace(_KEPT, " ") for line in lines]


def _records(table: Table, width: int) -> list[str]:
    """A row as a paragraph: its first cell, and each further one after the name of its column."""
    out = []
    for name, *cells in (
        [cell if isinstance(cell, str) else " ".join(cell) for cell in row] for row in table.rows
    ):
        heads = (head.removeprefix(">").strip() for head in table.head[1:])
        known = [
            f"{head} {cell.strip()}".strip() for head, cell in zip(heads, cells, strict=True) if cell.strip()
        ]
        out += wrapped(f"{name.rstrip()}: {', '.join(known)}", width, "    ")
    return [*out, *(line for note in table.notes for line in wrapped(note, width))]


def _rows(table: Table) -> list[str]:
    """Without a head where no column has a name."""
    rows = [[cell if isinstance(cell, str) else " ".join(cell) for cell in row] for row in table.rows]
    made = columns([name.removeprefix(">") for name in table.head], rows) if rows else []
    return [*(made if any(table.head) else made[1:]), *table.notes]


def columns(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Align columns: the first to the left, the others to the right.

    Example:
        >>> columns(("role", "n"), [("speed", "12")])
        ['role    n', 'speed  12']
    """
    cells = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join([row[0].ljust(widths[0]), *(map(str.rjust, row[1:], widths[1:]))]).rstrip() for row in cells
    ]
