"""The tables of a fleet are written in a bounded memory, however many drives there are and however much each one says."""

from __future__ import annotations

from pathlib import Path

import duckdb
import pytest

from canid.analysis.fleet.storage import consolidated, parquet_files
from canid.analysis.fleet.storage.columns import DRIVES, Column
from canid.analysis.fleet.storage.outcome_rows import OUTCOMES

# bytes of JSON of a drive, as a diagnosis of 20 min has them
JSON_BYTES = 20_000
DRIVES_OF_PART = 4_000
PARTS = 4


def _value(column: Column) -> str:
    if column.name == "key":
        return "md5(n::VARCHAR)"
    if column.name == "identify_json":
        return f"repeat(md5(n::VARCHAR) || md5((n + 7)::VARCHAR), {JSON_BYTES // 64})"
    return f"NULL::{column.type}"


@pytest.mark.slow("320 MB of results")
def test_tables_are_written_in_less_memory_than_their_rows_take(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """320 MB of rows in the memory in which a quarter of them is written; each log has its row, `logs` in their order."""
    monkeypatch.setattr(parquet_files, "MEMORY_BYTES", 450_000_000)
    number = PARTS * DRIVES_OF_PART
    for k in range(PARTS):
        part = tmp_path / "parts" / f"{k + 1:06d}"
        part.mkdir(parents=True)
        with duckdb.connect(config={"threads": 1, "preserve_insertion_order": False}) as db:
            for name, columns in (("outcomes", OUTCOMES), ("drives", DRIVES)):
                chosen = ", ".join(
                    f"{_value(column)} AS {parquet_files.name(column.name)}" for column in columns
                )
                rows = (
                    f"SELECT {chosen} FROM range({k * DRIVES_OF_PART}, {(k + 1) * DRIVES_OF_PART}) AS of(n)"
                )
                parquet_files.write(db, rows, part / f"{name}.parquet")
    keys = duckdb.sql(f"SELECT md5(n::VARCHAR) FROM range({number}) AS of(n)").fetchall()
    logs = (
        {"log": f"/logs/{k:06d}.blf", "driver": "anna", "key": key, "status": "ok"}
        for k, (key,) in enumerate(keys)
    )
    consolidated.written(tmp_path, logs, lambda: None)
    listed = duckdb.sql(f"SELECT log, key FROM '{tmp_path}/logs.parquet'").fetchall()
    assert [log for log, _ in listed] == sorted(log for log, _ in listed)
    drives = duckdb.sql(f"SELECT log, key FROM '{tmp_path}/drives.parquet' WHERE length(identify_json) > 0")
    assert sorted(drives.fetchall()) == sorted(listed)
    assert len(listed) == number
