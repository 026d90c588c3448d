"""Parquet as a source of columns, read by duckdb."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from canid.errors import ConfigError, LogError
from canid.tables.source import BLOCK_ROWS, MAX_COLUMNS, NO_NUMBER, SAMPLE_ROWS, Block
from canid.types import Array

# types that are read as numbers, and those whose numbers count from 1970, in nanoseconds
_NUMERIC = re.compile(r"(U?(TINYINT|SMALLINT|INTEGER|BIGINT|HUGEINT)|FLOAT|DOUBLE|BOOLEAN|DECIMAL.*)")
_STAMPS = re.compile(r"TIMESTAMP.*|DATE")
# bytes that duckdb may take: a hostile file must not take the machine's
_MEMORY = "1GB"


class ParquetSource:
    """A Parquet file."""

    def __init__(self, path: Path):
        """Read the columns' names and types. Raises LogError where it is no Parquet file."""
        self.name = str(path)
        self.damaged = 0
        self.progress = 0.0
        # duckdb takes *, ? and [ in a name for a pattern
        literal = re.sub(r"([*?\[])", r"[\1]", str(path.resolve())).replace("'", "''")
        self._from = f"read_parquet('{literal}')"
        rows = self._all(f"DESCRIBE SELECT * FROM {self._from}")
        self.headings: Sequence[str] = [str(row[0]) for row in rows]
        self._types = [str(row[1]) for row in rows]
        if len(rows) > MAX_COLUMNS:
            raise LogError(f"{path}: has {len(rows):,} columns; at most {MAX_COLUMNS:,} are read")
        self._count = int(self._all(f"SELECT count(*) FROM {self._from}")[0][0])

    def _connect(self) -> Any:
        try:
            import duckdb
        except ImportError as error:
            raise ConfigError("Parquet needs duckdb: pip install 'canid[export]'") from error
        settings: dict[str, Any] = {"memory_limit": _MEMORY, "autoinstall_known_extensions": False}
        return duckdb.connect(config=settings)

    def _all(self, query: str) -> list[tuple[Any, ...]]:
        db = self._connect()
        try:
            rows: list[tuple[Any, ...]] = db.execute(query).fetchall()
            return rows
        except Exception as error:  # duckdb raises many kinds for damaged files
            raise LogError(
                f"{self.name}: is not a Parquet file that can be read ({_reason(error)})"
            ) from None
        finally:
            db.close()

    def sample(self) -> list[list[str]]:
        """The texts of the first rows, a list per column."""
        wanted = ", ".join(self._as_text(k) for k in range(len(self.headings)))
        rows = self._all(f"SELECT {wanted} FROM {self._from} LIMIT {SAMPLE_ROWS}")
        return [["" if row[k] is None else str(row[k]) for row in rows] for k in range(len(self.headings))]

    def _column(self, k: int) -> str:
        quoted = self.headings[k].replace('"', '""')
        return f'"{quoted}"'

    def _as_text(self, k: int) -> str:
        if _STAMPS.fullmatch(self._types[k]):
            # as nanoseconds since 1970: exact, and without a time zone of this machine
            return f"epoch_ns({self._column(k)})::VARCHAR"
        return f"{self._column(k)}::VARCHAR"

    def _as_number(self, k: int) -> str:
        if _STAMPS.fullmatch(self._types[k]):
            return f"epoch_ns({self._column(k)})"
        if _NUMERIC.fullmatch(self._types[k]):
            return f"{self._column(k)}::DOUBLE"
        # a text that is no number is counted, not taken for an empty cell
        text = self._column(k)
        return (
            f"CASE WHEN {text} IS NULL THEN NULL ELSE "
            f"coalesce(try_cast({text}::VARCHAR AS DOUBLE), {NO_NUMBER}::DOUBLE) END"
        )

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Read these columns, by their places. Raises LogError where the file is damaged."""
        from canid.tables.source import EMPTY

        self.progress = 0.0
        wanted = [self._as_number(k) for k in numbers] + [self._as_text(k) for k in texts]
        select = ", ".join(f"{one} AS c{j}" for j, one in enumerate(wanted))
        db = self._connect()
        try:
            found = db.execute(f"SELECT {select} FROM {self._from}")
            done = 0
            while rows := found.fetchmany(BLOCK_ROWS):
                columns = list(zip(*rows, strict=True))
                values: Array = np.full((len(rows), len(numbers)), float(EMPTY))
                for j in range(len(numbers)):
                    values[:, j] = [EMPTY if x is None else x for x in columns[j]]
                done += len(rows)
                self.progress = done / max(self._count, 1)
                yield Block(
                    values, [["" if x is None else str(x) for x in c] for c in columns[len(numbers) :]]
                )
        except Exception as error:
            raise LogError(f"{self.name}: cannot be read to its end ({_reason(error)})") from None
        finally:
            db.close()


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
