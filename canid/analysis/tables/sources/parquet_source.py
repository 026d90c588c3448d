"""Parquet as a source of columns, read by duckdb."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from canid.analysis.tables.source import BLOCK_ROWS, EMPTY, MAX_COLUMNS, NO_NUMBER, SAMPLE_ROWS, Block
from canid.io.files import duckdb_files
from canid.io.files.duckdb_files import OpenFile
from canid.io.logs.text_lines import LineCount
from canid.signals.vehicle.quoting import brief
from canid.values.errors import DamagedLogError, LogError
from canid.values.types import Array

# types that are read as numbers, and those whose numbers count from 1970, in nanoseconds
_NUMERIC = re.compile(r"(U?(TINYINT|SMALLINT|INTEGER|BIGINT|HUGEINT)|FLOAT|DOUBLE|BOOLEAN|DECIMAL.*)")
_STAMPS = re.compile(r"TIMESTAMP.*|DATE")
# types that have a text; lists and structures have none that a table needs
_TEXTS = re.compile(r"VARCHAR|ENUM.*|TIME.*|UUID|INTERVAL")
# characters of a cell that are read: a dictionary holds one long text once, and a million rows name it
MAX_TEXT = 200
# What duckdb may take, and bytes that a column of one group of rows may have when unpacked, by the file's own word: ten
# million doubles. A hostile file must not take the machine's memory.
_MEMORY, _MAX_GROUP_BYTES = "256MB", 80_000_000


class ParquetSource:
    """A Parquet file."""

    notes: Sequence[str] = ()

    def __init__(self, path: Path):
        """Read the columns' names and types. Raises LogError where it is no Parquet file."""
        self.name = str(path)
        self.count = LineCount()
        self.progress = 0.0
        self._path = path
        rows = self._all("DESCRIBE SELECT *")
        self.headings: Sequence[str] = [str(row[0]) for row in rows]
        self._types = [str(row[1]) for row in rows]
        if len(rows) > MAX_COLUMNS:
            raise LogError(f"{path}: has {len(rows):,} columns; at most {MAX_COLUMNS:,} are read")
        self.rows = int(self._all("SELECT count(*)")[0][0])
        sizes = self._all(
            "SELECT path_in_schema, max(total_uncompressed_size)", duckdb_files.parquet_sizes, "GROUP BY 1"
        )
        self._sizes = {str(name).partition(", ")[0]: int(size or 0) for name, size in sizes}

    def _connect(self) -> Any:
        # each thread has a group of rows in memory
        return duckdb_files.connected("Parquet", "export", memory_limit=_MEMORY, threads=1)

    def _all(
        self,
        select: str,
        source: Callable[[list[OpenFile]], str] = duckdb_files.parquet,
        rest: str = "",
        most: int = MAX_COLUMNS * 100,
    ) -> list[tuple[Any, ...]]:
        db = self._connect()
        try:
            with duckdb_files.opened() as files:
                query = f"{select} FROM {source([files.add(self._path)])} {rest}"
                rows: list[tuple[Any, ...]] = db.execute(query).fetchmany(most)
            return rows
        except Exception as error:  # duckdb raises many kinds for damaged files
            raise LogError(
                f"{self.name}: is not a Parquet file that can be read ({_reason(error)})"
            ) from None
        finally:
            db.close()

    def sample(self) -> list[list[str]]:
        """The texts of the first rows, a list per column."""
        wanted = ", ".join(self._as_text(k) if self._fits(k) else "''" for k in range(len(self.headings)))
        # no LIMIT: it keeps the rows before their texts are shortened, a copy of each
        rows = self._all(f"SELECT {wanted}", most=SAMPLE_ROWS)
        return [["" if row[k] is None else str(row[k]) for row in rows] for k in range(len(self.headings))]

    def _column(self, k: int) -> str:
        quoted = self.headings[k].replace('"', '""')
        return f'"{quoted}"'

    def _as_text(self, k: int) -> str:
        if _STAMPS.fullmatch(self._types[k]):
            # as nanoseconds since 1970: exact, and without a time zone of this machine
            return f"epoch_ns({self._column(k)})::VARCHAR"
        if _NUMERIC.fullmatch(self._types[k]) or _TEXTS.fullmatch(self._types[k]):
            return f"left({self._column(k)}::VARCHAR, {MAX_TEXT})"
        return "''"

    def _fits(self, k: int) -> bool:
        return self._sizes.get(self.headings[k], 0) <= _MAX_GROUP_BYTES

    def _as_number(self, k: int) -> str:
        if _STAMPS.fullmatch(self._types[k]):
            return f"epoch_ns({self._column(k)})"
        if _NUMERIC.fullmatch(self._types[k]):
            return f"{self._column(k)}::DOUBLE"
        # a text that is no number is counted, not taken for an empty cell
        return (
            f"CASE WHEN {self._column(k)} IS NULL THEN NULL ELSE "
            f"coalesce(try_cast({self._as_text(k)} AS DOUBLE), {NO_NUMBER}::DOUBLE) END"
        )

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Read these columns, by their places; damage ends them. Raises LogError where nothing can be read."""
        self.count, self.progress = LineCount(), 0.0
        large = next((k for k in (*numbers, *texts) if not self._fits(k)), None)
        if large is not None:
            size = self._sizes[self.headings[large]] / 1e6
            raise LogError(
                f"{self.name}: column {brief(self.headings[large])} has {size:,.0f} MB in one group of rows, and "
                f"{_MAX_GROUP_BYTES / 1e6:.0f} are read; write it in groups of fewer rows"
            )
        wanted = [self._as_number(k) for k in numbers] + [self._as_text(k) for k in texts]
        select = ", ".join(f"{expression} AS c{j}" for j, expression in enumerate(wanted))
        db, files = self._connect(), duckdb_files.Files()
        try:
            cursor = db.execute(f"SELECT {select} FROM {duckdb_files.parquet([files.add(self._path)])}")
            while rows := cursor.fetchmany(BLOCK_ROWS):
                columns = list(zip(*rows, strict=True))
                values: Array = np.full((len(rows), len(numbers)), float(EMPTY))
                for j in range(len(numbers)):
                    values[:, j] = [EMPTY if x is None else x for x in columns[j]]
                which = np.arange(self.count.read + 1, self.count.read + len(rows) + 1)
                self.count.read += len(rows)
                self.progress = self.count.read / max(self.rows, 1)
                words = [["" if x is None else str(x) for x in c] for c in columns[len(numbers) :]]
                yield Block(values, words, which)
        except Exception as error:  # duckdb raises many kinds for damaged files
            why = f"cannot be read to its end ({_reason(error)})"
            if not self.count.read:
                raise DamagedLogError(f"{self.name}: {why}") from None
            self.count.cut = True
            self.count.damaged.add(0, 0, f"it {why}")
        finally:
            db.close()
            files.close()


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
