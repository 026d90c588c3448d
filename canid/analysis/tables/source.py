"""A table as a source of columns: text, Parquet, or arrays; read in blocks, only the columns that are wanted."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from canid.io.logs.text_lines import LineCount
from canid.values.types import Array

# cells that hold no number, in a column of numbers. Whole powers of two: exact in a double, and no measured value
EMPTY, NO_NUMBER = -(2**62), -(2**61)
# rows of one block: numpy's overhead is spread over them, and 30 columns of them are 16 MB
BLOCK_ROWS = 65_536
# columns of a table
MAX_COLUMNS = 100_000
# numbers that are kept of one table: 0.8 GB; ten hours at 100 Hz with 25 columns
MAX_KEPT = 100_000_000
# rows from which kinds of columns are judged
SAMPLE_ROWS = 200
# texts by which programs say that nothing was measured, besides "nan"
NO_VALUE = (
    "null",
    "none",
    "na",
    "n/a",
    "<na>",
    "-",
    "--",
    "---",
    "?",
    "#n/a",
    "#n/v",
    "#nv",
    "missing",
    "void",
)

_NEGATIVE = re.compile(r"^(?:\(([\d.]+)\)|([\d.]+)-|- +([\d.].*))$")
# hyphens, dashes and minus signs of Unicode, and the dash of Windows read as Latin-1
_MINUS = str.maketrans(dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212\ufe63\uff0d\x96", "-"))


class Block(NamedTuple):
    """Some rows of a table."""

    numbers: (
        Array  # (n, k) of the columns asked for as numbers; a cell that holds none: EMPTY, NO_NUMBER or NaN
    )
    texts: list[list[str]]  # one list of n texts for each column asked for as texts
    lines: npt.NDArray[np.int64]  # (n,) of the file; where it has none, the rows counted from 1


class Source(Protocol):
    """A table."""

    name: str  # for messages
    headings: Sequence[str]
    rows: int  # as far as known before they are read; else 0
    count: LineCount  # the rows, and the lines that are none, of the latest reading
    progress: float  # 0..1, of the latest reading
    notes: Sequence[str]  # sentences of what the file has and the table has not

    def sample(self) -> list[list[str]]:
        """The texts of the first rows, up to `SAMPLE_ROWS`, a list per column."""

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Read these columns, by their places."""


def number(text: str) -> float:
    """The number that a cell holds: EMPTY, NO_NUMBER, or NaN where it says so.

    Example:
        >>> number(" 1.5 "), number(""), number("1.5 m") == NO_NUMBER, number("n/a"), number("\N{MINUS SIGN}1")
        (1.5, -4611686018427387904, True, nan, -1.0)
        >>> number("(1.25)"), number("1.25-")  # as accounts write negative numbers
        (-1.25, -1.25)
    """
    text = text.strip().translate(_MINUS)
    if not text:
        return EMPTY
    text = _NEGATIVE.sub(r"-\1\2\3", text)
    try:
        return float(text) if "_" not in text else NO_NUMBER
    except ValueError:
        return float("nan") if text.lower() in NO_VALUE else NO_NUMBER


def clean(values: Array) -> Array:
    """Numbers with NaN in every cell that holds none.

    Example:
        >>> clean(np.array([1.0, EMPTY, NO_NUMBER]))
        array([ 1., nan, nan])
    """
    return np.where((values == EMPTY) | (values == NO_NUMBER), np.nan, values)
