"""Rows of delimited text: which lines are rows, which are of no interest, and which are damaged.

A row is one line; a quote that is open at the line's end makes that line damaged, and no other. A row has as many cells
as most of the first rows; one more that is empty, behind a last delimiter, does no harm.
"""

from __future__ import annotations

import contextlib
import csv
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.tables.headings import heading, role_of
from canid.analysis.tables.source import NO_NUMBER, number
from canid.io.logs.text_lines import MAX_FOOTER_LINES, Block, LineCount, filled, is_footer
from canid.io.logs.text_lines import line as line_of
from canid.signals.vehicle.units import unit_of
from canid.values.errors import ConfigError

_Bools = npt.NDArray[np.bool_]
_HASH, _QUOTE, _NUL, _FEED, _RETURN = b'#"\0\n\r'
_LETTERS = np.array([chr(k).isalpha() for k in range(256)])
_BLANKS = np.array([chr(k).isspace() for k in range(256)])
# TunerStudio's lines that say where a mark was set
_MARKS = b"MARK "
# bytes by which a line of the header is recognised before its cells are: a quote and some letters
_BEGIN_BYTES = 4
# cells of a line that are names of known columns, or units, from which on it is no row: a text among numbers may be one
_MIN_NAMES = 2
HEADERS, COMMENTS = "header lines", "comments"
# words before the means and sums that programs write below the rows
_SUMMARY_WORDS = {
    "average", "avg", "count", "max", "maximum", "mean", "median", "min", "minimum",
    "mittelwert", "moyenne", "range", "sd", "std", "stdev", "sum", "summe", "total",
}  # fmt: skip


class Rows(NamedTuple):
    """The rows among the lines of a block."""

    which: npt.NDArray[np.int64]  # (n,) line numbers
    texts: list[bytes]  # (n,) with their ends; empty where `data` has them all
    data: bytes  # all lines, where each is a row without quotes; else empty
    cells: list[list[str]]  # (n,) of rows with quotes; of others empty


class RowForm(NamedTuple):
    """What a row of a table looks like."""

    delimiter: bytes  # b"": white space
    encoding: str
    width: int  # cells
    skip: int  # the line of the header, or of its units: the rows come behind it
    headers: frozenset[bytes]  # its lines that may be repeated among the rows
    hashes: bool  # a row may begin with "#"
    words: bool = False  # or with a word

    def cells(self, text: bytes) -> list[str]:
        """The cells of a line. Raises ValueError with what is wrong with it.

        >>> RowForm(b",", "utf-8", 2, 0, frozenset(), False).cells(b'1,"a,b"')
        ['1', 'a,b']
        """
        line = text.decode(self.encoding, errors="replace").rstrip("\r\n")
        if not self.delimiter:
            return line.split()
        delimiter = self.delimiter.decode()
        if '"' not in line:
            return line.split(delimiter)
        try:
            return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True), [])
        except csv.Error as error:
            open_ = "unexpected end" in str(error)
            raise ValueError("a quote is open at its end" if open_ else "its quotes are damaged") from None

    def _cells(self, text: bytes) -> list[str]:
        """The cells of a line; none where its quotes are damaged."""
        with contextlib.suppress(ValueError):
            return self.cells(text)
        return []

    def names_columns(self, cells: Sequence[str], number: int) -> bool:
        """Whether a line among the rows names the columns again. Raises ConfigError where it names them otherwise."""
        columns = _columns_of(cells)
        if columns and columns not in [_columns_of(self._cells(header)) for header in self.headers]:
            raise ConfigError(f"line {number} names columns otherwise than the header: cut the file there")
        return bool(columns)

    def wrong(self, cells: Sequence[str]) -> str:
        """Why these are not the cells of a row; "": they are."""
        n = len(cells)
        if n == self.width or (n == self.width + 1 and self.delimiter and not cells[-1].strip()):
            return ""
        return f"it has {n:,} cells, and a row has {self.width:,}"

    def rows(self, block: Block, count: LineCount) -> Rows:
        """Find the rows of a block, and count its lines."""
        octets = np.frombuffer(block.data, np.uint8, int(block.ends[-1]))
        begin = np.concatenate([[0], block.ends[:-1]])
        there = filled(block)
        numbers = np.arange(block.number, block.number + len(begin))
        header = there & (numbers <= self.skip)
        count.others[HEADERS] += int(header.sum())
        good, quoted, doubtful = self._judged(octets, begin, block.ends)
        quoted &= there & ~header & ~doubtful
        doubtful &= there & ~header
        good &= there & ~header & ~doubtful & ~quoted
        cells: dict[int, list[str]] = {}
        for k, found_cells in self._quoted(block.data, begin, block.ends, quoted):
            if self.wrong(found_cells):
                doubtful[k] = True
            else:
                good[k], cells[k] = True, found_cells
        doubtful |= quoted & ~good
        for k in np.flatnonzero(doubtful).tolist():
            line = block.data[int(begin[k]) : int(block.ends[k])]
            outcome = self._doubtful(line, count)
            if outcome is not None and self.names_columns(self._cells(line), block.number + k):
                count.others[HEADERS] += 1
                outcome = None
            few = len(count.rows_in_words) < MAX_FOOTER_LINES
            if isinstance(outcome, list) and few and not self.words and is_footer(outcome[0]):
                count.rows_in_words[block.number + k] = outcome[0]
            if isinstance(outcome, str):
                item = line_of(block, k, int(begin[k]), int(block.ends[k]))
                count.miss(item._replace(text="") if self.words else item, outcome)
            elif outcome is not None:
                good[k], cells[k] = True, outcome
        which = np.flatnonzero(good)
        worded = np.isin(which, [row - block.number for row in count.rows_in_words])
        count.took(block.number, which[~worded])
        count.read += int(worded.sum())
        if len(which) == len(good) and not cells:
            return Rows(numbers, [], block.data, [])
        edges = zip(begin[which].tolist(), block.ends[which].tolist(), strict=True)
        texts = [block.data[a:b] for a, b in edges]
        return Rows(numbers[which], texts, b"", [cells.get(k, []) for k in which.tolist()] if cells else [])

    def _judged(
        self, octets: npt.NDArray[np.uint8], begin: npt.NDArray[np.int64], ends: npt.NDArray[np.int64]
    ) -> tuple[_Bools, _Bools, _Bools]:
        """Lines with the cells of a row; with quotes; and those that have to be read one by one."""
        if self.delimiter:
            marks = np.flatnonzero(octets == self.delimiter[0])
        else:
            blank = _BLANKS[octets]
            # a cell begins where white space ends; the first one makes a cell more than delimiters
            marks = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
        n = np.diff(np.searchsorted(marks, np.concatenate([[0], ends]))) + bool(self.delimiter)
        good = n == self.width
        doubtful = ~good | (octets[begin] == _HASH)
        if not self.words:
            doubtful |= _LETTERS[octets[begin]]
        quoted = np.zeros(len(good), bool)
        at = np.flatnonzero(octets == _QUOTE)
        quoted[np.searchsorted(ends, at, "right")] = True
        # within quotes a delimiter separates no cells
        doubtful &= ~quoted | (octets[begin] == _HASH)
        at = np.flatnonzero(octets == _NUL)
        doubtful[np.searchsorted(ends, at, "right")] = True
        if self.headers:
            # a line that begins as one of the header's does may be that line
            padded = np.concatenate([octets, np.zeros(_BEGIN_BYTES, np.uint8)])
            first = padded[begin[:, None] + np.arange(_BEGIN_BYTES)]
            for header in self.headers:
                known = np.frombuffer(header[:_BEGIN_BYTES], np.uint8)
                doubtful |= (first[:, : len(known)] == known).all(axis=1) & ~_numeric(octets[begin])
        return good, quoted, doubtful

    def _quoted(
        self, data: bytes, begin: npt.NDArray[np.int64], ends: npt.NDArray[np.int64], quoted: _Bools
    ) -> Iterator[tuple[int, list[str]]]:
        """The cells of lines with quotes, all together; up to the first that is damaged."""
        which = np.flatnonzero(quoted).tolist()
        if not which or not self.delimiter:
            return
        texts = (
            data[int(begin[k]) : int(ends[k])].decode(self.encoding, errors="replace").rstrip("\r\n")
            for k in which
        )
        reader = csv.reader(texts, delimiter=self.delimiter.decode(), skipinitialspace=True, strict=True)
        for n, k in enumerate(which, 1):
            try:
                cells = next(reader)
            except csv.Error:
                return
            if reader.line_num != n:
                return
            yield k, cells

    def _doubtful(self, line: bytes, count: LineCount) -> list[str] | str | None:
        """The cells of a row, what is wrong with the line, or None: it is blank or of no interest, and counted."""
        text = line.rstrip(b"\r\n")
        if not text.strip():
            return None
        if text.split() in [header.split() for header in self.headers]:
            count.others[HEADERS] += 1
            return None
        if b"\0" in text:
            return "it holds a NUL"
        try:
            cells = self.cells(text)
        except ValueError as error:
            return str(error)
        summary = not self.words and cells[0].strip(" :.").lower() in _SUMMARY_WORDS
        why = self.wrong(cells) or ("it sums up rows" if summary else "")
        if why and text.startswith(_MARKS):
            count.others[COMMENTS] += 1
            return None
        if text.startswith(b"#") and not self.hashes:
            if why:
                count.others[COMMENTS] += 1
                return None
            return "it has the cells of a row and begins as a comment"
        return why or cells


def _columns_of(cells: Sequence[str]) -> list[tuple[str, object]]:
    """The columns, or their units, that a line among the rows names; none where it names no columns.

    >>> _columns_of(["Time", "Speed [KM/H]"]) == _columns_of(["t", "v_ego [km/h]"]), _columns_of(["0.1", "m/s", "km/h"])
    (True, [])
    """
    texts = [text for cell in cells if (text := cell.strip(" []()"))]
    if any(text[0].isdigit() or number(text) > NO_NUMBER for text in texts):
        return []
    heads = [(heading(cell), unit_of(cell.strip(" []()"))) for cell in cells if cell.strip()]
    known = sum(role_of(head) is not None or unit is not None for head, unit in heads)
    if known < _MIN_NAMES or 2 * known < len(heads):
        return []
    return [(role_of(head) or head.name, unit or unit_of(head.unit or "")) for head, unit in heads]


def _numeric(first: npt.NDArray[np.uint8]) -> _Bools:
    """Whether lines begin as numbers do."""
    numeric: _Bools = ((first >= ord("0")) & (first <= ord("9"))) | (first == ord("-")) | (first == ord("."))
    return numeric


def form(
    texts: Sequence[bytes], numbers: Sequence[int], header: int, skip: int, delimiter: str, encoding: str
) -> RowForm:
    """Judge how many cells a row has.

    Args:
        texts: the first lines, without their ends.
        numbers: of these lines.
        header: the first of the header's lines.
        skip: how many of them come before the first row.
        delimiter: "": white space.
        encoding: of the file.
    """
    rows = [text for text in texts[skip:] if text.strip()]
    hashes = sum(text.startswith(b"#") for text in rows) * 2 > len(rows)
    letters = [bool(_LETTERS[text[0]]) for text in rows]
    words = letters[:1] == [True] or any(a and not b for a, b in pairwise(letters))
    made = RowForm(
        delimiter.encode(),
        encoding.removesuffix("-sig"),
        0,
        numbers[skip - 1] if skip else 0,
        frozenset(text.removeprefix(b"\xef\xbb\xbf") for text in texts[header:skip] if text.strip()),
        hashes,
        words,
    )
    widths: Counter[int] = Counter()
    for text in rows:
        if hashes or not text.startswith(b"#"):
            try:
                widths[len(made.cells(text))] += 1
            except ValueError:
                continue
    return made._replace(width=max(widths, key=lambda n: (widths[n], n), default=0))
