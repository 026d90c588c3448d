"""Arrays as a source of columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from canid.analysis.tables.headings import heading
from canid.analysis.tables.source import EMPTY, NO_VALUE, SAMPLE_ROWS, Block, number
from canid.io.logs.text_lines import LineCount
from canid.values.types import Array


class ArraySource:
    """Columns in memory, all of one length."""

    def __init__(
        self,
        columns: Mapping[str, Any],
        name: str = "the table",
        count: LineCount | None = None,
        notes: Sequence[str] = (),
    ):
        """Take the columns. Raises ValueError where one of them is not one-dimensional, or has another length."""
        self.name = name
        self.rows = 0
        self.notes = notes
        self._lines = count  # of the file that was read
        self.count = LineCount()
        self.progress = 1.0
        self._columns = [_plain(key, column) for key, column in columns.items()]
        self.headings: Sequence[str] = [
            _with_unit(str(key), column) for key, column in zip(columns, self._columns, strict=True)
        ]
        lengths = {str(key): len(column) for key, column in zip(columns, self._columns, strict=True)}
        if len(set(lengths.values())) > 1:
            shown = ", ".join(f"{key} {n:,}" for key, n in list(lengths.items())[:8])
            raise ValueError(
                f"{name}: its columns have different lengths ({shown}); give one value per row and column"
            )

    def sample(self) -> list[list[str]]:
        """The texts of the first rows, a list per column."""
        return [_texts(column[:SAMPLE_ROWS]) for column in self._columns]

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """All rows at once."""
        n = len(self._columns[0]) if self._columns else 0
        values = np.full((n, len(numbers)), float(EMPTY))
        for j, k in enumerate(numbers):
            values[:, j] = _numbers(self._columns[k])
        self.count = LineCount(read=n) if self._lines is None else deepcopy(self._lines)
        yield Block(values, [_texts(self._columns[k]) for k in texts], np.arange(1, n + 1))


def _with_unit(name: str, column: Any) -> str:
    """A heading that states the unit in which `blocks` gives dates and spans of time: no number can be mistaken for it."""
    unit = {"M": "ns", "m": "s"}.get(column.dtype.kind)
    return name if unit is None or heading(name).unit is not None else f"{name} [{unit}]"


def _plain(key: object, column: Any) -> Any:
    """An array of numbers, times or objects."""
    if isinstance(column, np.ma.MaskedArray):
        column = np.where(column.mask, np.nan, column.data.astype(float))
    elif hasattr(column, "to_numpy"):
        column = column.to_numpy()
    array = np.asarray(column)
    if array.ndim != 1:
        raise ValueError(f"{key}: has {array.ndim} dimensions; give an array with one value per row")
    return array


def _numbers(column: Any) -> Array:
    if column.dtype.kind == "M":
        stamps = column.astype("datetime64[ns]")
        return np.where(np.isnat(stamps), float(EMPTY), stamps.astype(np.int64).astype(float))
    if column.dtype.kind == "m":
        spans = column.astype("timedelta64[ns]")
        return np.where(np.isnat(spans), float(EMPTY), spans.astype(np.int64) * 1e-9)
    if column.dtype.kind in "biuf":
        values = column.astype(float)
        return np.where(np.isnan(values), float(EMPTY), values)
    return np.array([_number(x) for x in column], float)


def _number(x: Any) -> float:
    if x is None:
        return EMPTY
    try:
        value = float(x)
    except (TypeError, ValueError):
        text = str(x)
        return EMPTY if text.lower() in ("nat", *NO_VALUE) else number(text)
    return EMPTY if value != value else value


def _texts(column: Any) -> list[str]:
    if column.dtype.kind == "M":
        # as nanoseconds since 1970
        return ["" if x < 0 else str(x) for x in column.astype("datetime64[ns]").astype(np.int64).tolist()]
    return ["" if x is None or x != x else str(x) for x in column.tolist()]
