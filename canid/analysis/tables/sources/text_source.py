"""Delimited text as a source of columns: numbers by numpy's own reader, a block of lines at once.

What that reader refuses (texts among the numbers, quotes) is read cell by cell, which takes four times as long
(`python -m benchmarks tables`). Which lines are rows is decided in `text_rows`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from canid.analysis.tables.source import EMPTY, NO_NUMBER, SAMPLE_ROWS, Block, number
from canid.analysis.tables.sources.cell_units import units_of, with_units
from canid.analysis.tables.sources.grouped_numbers import any_by_commas, any_by_points, plain
from canid.analysis.tables.sources.text_layout import MAX_PREAMBLE_LINES, encoding_of, layout
from canid.analysis.tables.sources.text_rows import Rows, form
from canid.io.logs.content import with_open_quotes
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import LineCount, blocks
from canid.values.errors import ConfigError, DamagedLogError, LogError
from canid.values.types import Array

# bytes of one line: ten thousand columns of twenty characters
MAX_LINE_BYTES = 2 * 1024 * 1024
_EMPTY = str(EMPTY).encode()


class TextSource:
    """A file of delimited text, plain or gzipped."""

    notes: Sequence[str] = ()

    def __init__(self, path: Path, names: Sequence[str] = ()):
        """Judge the layout. Raises LogError where it is no table."""
        self.name = str(path)
        self.rows = 0
        self.count = LineCount()
        self.progress = 0.0
        self._path = path
        texts, numbers = self._first_lines(MAX_PREAMBLE_LINES + SAMPLE_ROWS)
        encoding = encoding_of(texts)
        shown = [text.decode(encoding, errors="replace") for text in texts]
        self._layout = layout(shown, encoding, str(path), names)
        self.headings: Sequence[str] = self._layout.headings
        delimiter, skip = self._layout.delimiter, self._layout.skip
        self._form = form(texts, numbers, self._layout.header, skip, delimiter, encoding)
        rows = []
        for text in texts[skip:]:
            try:
                cells = self._form.cells(text)
            except ValueError:
                continue
            if not self._form.wrong(cells):
                rows.append([cell.strip() for cell in cells])
        self._grouped = not self._layout.decimal_comma and any_by_commas(rows)
        self._units = units_of(self.headings, rows)
        self.headings = with_units(self.headings, self._units)
        rows = [[self._plain(cell, k) for k, cell in enumerate(row)] for row in rows]
        self._sample = [
            [row[k] if k < len(row) else "" for row in rows[:SAMPLE_ROWS]] for k in range(len(self.headings))
        ]

    def _first_lines(self, most: int) -> tuple[list[bytes], list[int]]:
        """The first lines without their ends, and their numbers; none that is too long or holds a NUL."""
        texts: list[bytes] = []
        numbers: list[int] = []
        binary = 0
        count = LineCount()
        for block in blocks(self._path, ReadState(), count, MAX_LINE_BYTES):
            begin = 0
            for k, end in enumerate(block.ends[:most].tolist()):
                text = block.data[begin:end].rstrip(b"\r\n")
                begin = end
                if b"\0" in text:
                    binary += 1
                else:
                    texts.append(text)
                    numbers.append(block.number + k)
            if len(texts) + binary >= most:
                break
        if binary > len(texts) / 2:
            raise LogError(f"{self._path}: is not a table: it holds binary data")
        if not any(text.strip() for text in texts):
            if count.cut:
                raise DamagedLogError(
                    f"{self._path}: cannot be read ({count.damaged.sentence('lines', 0, -1)})"
                )
            if count.bad:
                raise LogError(f"{self._path}: is not a table: a line has more than {MAX_LINE_BYTES:,} bytes")
            raise LogError(f"{self._path} is empty")
        parts = with_open_quotes([text.decode("latin-1") for text in texts[:most]])
        return [b" ".join(texts[a:b]) for a, b in parts], [numbers[b - 1] for _, b in parts]

    def sample(self) -> list[list[str]]:
        """The texts of the first rows, a list per column; with a decimal point and without separators."""
        return self._sample

    def _plain(self, cell: str, place: int) -> str:
        if place in self._units:
            cell = cell.strip().removesuffix(self._units[place]).rstrip()
        return plain(cell, self._layout.decimal_comma, self._grouped)

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Read these columns, by their places. Raises LogError where the file cannot be read."""
        self.count, self.progress = LineCount(), 0.0
        state = ReadState(size=self._path.stat().st_size)
        try:
            for block in blocks(self._path, state, self.count, MAX_LINE_BYTES):
                rows = self._form.rows(block, self.count)
                self.progress = min(1.0, state.done / max(state.size, 1))
                if len(rows.which):
                    yield self._block(rows, numbers, texts)
        except OSError as error:
            raise LogError(f"cannot read {self._path}: {error.strerror or error}") from None
        except ConfigError as error:
            raise ConfigError(f"{self._path}: {error}") from None

    def _block(self, rows: Rows, numbers: Sequence[int], texts: Sequence[int]) -> Block:
        values = self._fast(rows, numbers) if numbers and not any(rows.cells) else None
        cells = self._cells(rows) if texts or (numbers and values is None) else []
        if values is None:
            values = self._slow(cells, numbers) if numbers else np.zeros((len(rows.which), 0))
        if len(numbers) > 1:
            for k in np.flatnonzero((values == NO_NUMBER).all(axis=1)).tolist():
                self._form.names_columns(cells[k], int(rows.which[k]))
        columns = [[row[k].strip() if k < len(row) else "" for row in cells] for k in texts]
        return Block(values, columns, rows.which)

    def _fast(self, rows: Rows, numbers: Sequence[int]) -> Array | None:
        """The numbers; None: not all cells are numbers."""
        data = rows.data or b"".join(rows.texts)
        d = self._form.delimiter
        if b'"' in data or b"_" in data or (self._layout.decimal_comma and d == b","):
            return None
        if self._layout.decimal_comma:
            if any_by_points(data):
                return None
            data = data.replace(b",", b".")
        if d:
            if d + d in data:
                data = data.replace(d + d, d + _EMPTY + d).replace(d + d, d + _EMPTY + d)
            data = data.replace(b"\r\n", b"\n")
            if d + b"\n" in data:
                data = data.replace(d + b"\n", d + _EMPTY + b"\n")
            if b"\n" + d in data or data.startswith(d):
                data = (b"\n" + data).replace(b"\n" + d, b"\n" + _EMPTY + d)
        try:
            values = np.loadtxt(
                data.decode("latin-1").split("\n"),
                delimiter=self._layout.delimiter or None,
                usecols=list(numbers),
                comments=None,
                ndmin=2,
            )
        except ValueError:
            return None
        return values if len(values) == len(rows.which) else None

    def _cells(self, rows: Rows) -> list[list[str]]:
        texts = rows.texts or rows.data.split(b"\n")[: len(rows.which)]
        if not rows.cells:
            return [self._form.cells(text) for text in texts]
        return [known or self._form.cells(text) for known, text in zip(rows.cells, texts, strict=True)]

    def _slow(self, rows: list[list[str]], numbers: Sequence[int]) -> Array:
        out = np.full((len(rows), len(numbers)), float(EMPTY))
        as_written = not (self._layout.decimal_comma or self._grouped)
        for j, k in enumerate(numbers):
            cells = [row[k] if k < len(row) else "" for row in rows]
            plain_already = k in self._units or not as_written
            if plain_already:
                cells = [self._plain(cell, k) for cell in cells]
            try:
                # Python takes 2026_05 as a number
                out[:, j] = list(map(number if any("_" in cell for cell in cells) else float, cells))
            except ValueError:
                # not twice: 1.234 may be a number of thousands
                out[:, j] = [number(cell if plain_already else self._plain(cell, k)) for cell in cells]
        return out


def text_source(path: Path, names: Sequence[str] = ()) -> TextSource:
    """Open delimited text.

    Raises:
        ConfigError: the file cannot be opened.
        LogError: it is no table.
    """
    try:
        return TextSource(path, names)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from None
