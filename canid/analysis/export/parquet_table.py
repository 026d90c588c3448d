"""Parquet through DuckDB: plain column names; units, comments and the UTC start in the file's metadata."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from canid.analysis.export import names
from canid.analysis.export.csv_table import TIME, TimeColumn, no_date
from canid.analysis.export.table import Origin, Table, in_ns
from canid.io.files import duckdb_files, opening
from canid.values import timestamps

Write = Callable[..., None]


@contextmanager
def opened() -> Iterator[Write]:
    """A database in memory, which writes tables to files that exist already: `write(path, table, origin, time)`.

    Column `t` in s; with `time` "utc" or "epoch" also a timestamp in ns (UTC, without a zone) or s since 1970. NaN is NULL.
    Metadata: `units` and `comments` (JSON objects by column), `start_utc` (ISO 8601), `start_ns`, `log`, `vehicle`,
    `program`.

    Raises:
        ConfigError: duckdb is missing; of `write`: the log states no date and `time` needs one.
        OSError: of `write`: the file cannot be written.
    """
    with duckdb_files.connected("Parquet", "export") as db:
        import duckdb

        yield partial(_write, db, duckdb.IOException)


def _write(
    db: Any, io_error: type[Exception], path: str, table: Table, origin: Origin, time: TimeColumn = "log"
) -> None:
    if time != "log" and origin.start_ns is None:
        raise no_date(origin)
    columns: dict[str, Any] = {}
    start = origin.start_ns or 0
    if time == "utc":
        columns["utc"] = (in_ns(table.t) + start).astype("datetime64[ns]")
    elif time == "epoch":
        whole, rest = np.divmod(in_ns(table.t) + start, timestamps.NS_PER_S)
        columns["epoch"] = whole + rest * 1e-9
    fields = (TIME, *table.fields)
    plain = names.unique([names.header(field.name) for field in fields], str, columns)
    for name, values in zip(plain, [table.t, *table.values(slice(None))], strict=True):
        # duckdb reads masked arrays with their mask as NULL
        columns[name] = np.ma.masked_where(np.isnan(values), values) if values.dtype == np.float64 else values
    named = list(zip(plain, fields, strict=True))
    metadata = {
        "units": json.dumps({name: field.unit for name, field in named}, ensure_ascii=False),
        "comments": json.dumps({n: f.comment for n, f in named if f.comment}, ensure_ascii=False),
        "start_utc": origin.start_text,
        "start_ns": "" if origin.start_ns is None else str(origin.start_ns),
        "log": origin.log,
        "vehicle": origin.vehicle,
        "table": table.title,
        "program": f"{origin.program} export",
    }
    db.register("exported", columns)
    fd = opening.existing(path)
    try:
        duckdb_files.write_parquet(db, "exported", fd, path, notes=metadata)
    except io_error as error:
        raise OSError(0, str(error).rpartition(": ")[2] or str(error)) from error
    finally:
        os.close(fd)
