"""Delimited text as a source of columns: numbers by numpy's own reader, a block of lines at once.

What that reader refuses (texts among the numbers, quotes) is read cell by cell, which takes four times as long
(`python -m benchmarks tables`).
"""

from __future__ import annotations

import csv
import gzip
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from canid.errors import ConfigError, LogError
from canid.logs.text_lines import MAX_UNPACKED_RATIO, MIN_BOMB_BYTES
from canid.tables.source import EMPTY, SAMPLE_ROWS, Block, number
from canid.tables.text_layout import MAX_PREAMBLE_LINES, encoding_of, layout, split
from canid.types import Array

BLOCK_BYTES = 4 * 1024 * 1024
# bytes of one line: ten thousand columns of twenty characters
MAX_LINE_BYTES = 2 * 1024 * 1024
_EMPTY = str(EMPTY).encode()


class TextSource:
    """A file of delimited text, plain or gzipped."""

    def __init__(self, path: Path, names: Sequence[str] = ()):
        """Judge the layout. Raises LogError where it is no table."""
        self.name = str(path)
        self.damaged = 0
        self.progress = 0.0
        self._path = path
        self._size = path.stat().st_size
        lines = []
        with self._opened() as file:
            begin = b""
            for _ in range(MAX_PREAMBLE_LINES + SAMPLE_ROWS):
                line = self._line(file)
                if not line:
                    break
                begin += line
                lines.append(line)
        if not begin.strip():
            raise LogError(f"{path} is empty")
        encoding = encoding_of(begin, str(path))
        texts = [line.decode(encoding, errors="replace").rstrip("\r\n") for line in lines]
        self._layout = layout(texts, encoding, str(path), names)
        self.headings: Sequence[str] = self._layout.headings
        rows = [split(text, self._layout.delimiter) for text in texts[self._layout.skip :] if text.strip()]
        self._sample = [
            [row[k] if k < len(row) else "" for row in rows[:SAMPLE_ROWS]] for k in range(len(self.headings))
        ]

    def _opened(self) -> BinaryIO:
        if self._path.suffix.lower() == ".gz":
            return gzip.open(self._path, "rb")  # type: ignore[return-value]
        return self._path.open("rb")

    def _line(self, file: BinaryIO) -> bytes:
        try:
            line = file.readline(MAX_LINE_BYTES)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise LogError(f"{self._path}: cannot be unpacked ({error})") from None
        if len(line) == MAX_LINE_BYTES:
            raise LogError(f"{self._path}: is not a table: a line has more than {MAX_LINE_BYTES:,} bytes")
        return line

    def sample(self) -> list[list[str]]:
        """The texts of the first rows, a list per column; with a decimal point."""
        if not self._layout.decimal_comma:
            return self._sample
        return [[cell.replace(",", ".") for cell in column] for column in self._sample]

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Read these columns, by their places. Raises LogError where the file cannot be read to its end."""
        self.damaged, self.progress = 0, 0.0
        unpacked = 0
        with self._opened() as file:
            for _ in range(self._layout.skip):
                self._line(file)
            while True:
                try:
                    data = file.read(BLOCK_BYTES)
                except (EOFError, gzip.BadGzipFile, zlib.error, OSError) as error:
                    raise LogError(f"{self._path}: cannot be read to its end ({error})") from None
                if not data:
                    break
                if not data.endswith(b"\n"):
                    data += self._line(file)
                unpacked += len(data)
                if unpacked > max(MAX_UNPACKED_RATIO * self._size, MIN_BOMB_BYTES):
                    raise LogError(f"{self._path}: unpacks to more than {MAX_UNPACKED_RATIO} times its size")
                self.progress = min(1.0, unpacked / self._size)
                yield self._block(data, numbers, texts)

    def _block(self, data: bytes, numbers: Sequence[int], texts: Sequence[int]) -> Block:
        rows = self._rows(data) if texts else None
        values = self._fast(data, numbers) if numbers else None
        if values is None or (rows is not None and len(rows) != len(values)):
            rows = self._rows(data) if rows is None else rows
            values = self._slow(rows, numbers)
        columns = [[row[k].strip() if k < len(row) else "" for row in rows or ()] for k in texts]
        return Block(values, columns)

    def _fast(self, data: bytes, numbers: Sequence[int]) -> Array | None:
        """The numbers; None: not all cells are numbers."""
        d = self._layout.delimiter.encode()
        if b'"' in data or b"_" in data:
            return None
        if self._layout.decimal_comma:
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
            return np.loadtxt(
                data.decode("latin-1").split("\n"),
                delimiter=self._layout.delimiter or None,
                usecols=list(numbers),
                comments=None,
                ndmin=2,
            )
        except ValueError:
            return None

    def _rows(self, data: bytes) -> list[list[str]]:
        lines = data.decode(self._layout.encoding.removesuffix("-sig"), errors="replace").splitlines()
        if not self._layout.delimiter:
            return [row for row in map(str.split, lines) if row]
        try:
            return [row for row in csv.reader(lines, delimiter=self._layout.delimiter) if row]
        except csv.Error:
            return [split(line, self._layout.delimiter) for line in lines if line]

    def _slow(self, rows: list[list[str]], numbers: Sequence[int]) -> Array:
        last = max(numbers, default=-1)
        self.damaged += sum(len(row) <= last for row in rows)
        out = np.full((len(rows), len(numbers)), float(EMPTY))
        comma = self._layout.decimal_comma
        for j, k in enumerate(numbers):
            cells = [row[k] if k < len(row) else "" for row in rows]
            if comma:
                cells = [cell.replace(",", ".") for cell in cells]
            try:
                out[:, j] = list(map(float, cells))
            except ValueError:
                out[:, j] = list(map(number, cells))
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
