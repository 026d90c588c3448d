"""MATLAB .mat (version 5) by scipy: a struct for each table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO

import numpy as np

from canid.analysis.export import names
from canid.analysis.export.table import Origin, Table
from canid.values import timestamps
from canid.values.errors import ConfigError

# bytes of text at the beginning of the file (MAT-File Format, level 5)
TEXT_BYTES = 116
TEXT = "MATLAB 5.0 MAT-file, canid export"
# bytes that a variable of version 5 may have
MAX_VARIABLE_BYTES = 2**31 - 1


def write(file: BinaryIO, tables: Sequence[Table], origin: Origin) -> None:
    """Write all tables.

    Variables: `info` (log, vehicle, start_utc, start_epoch in s) and a struct for each table: t (s), the columns,
    `units`, `names` (as in the DBC), `comments`, and `texts` with the value tables. A message that is called as another
    variable gets a number. NaN: not measured.

    Raises:
        ConfigError: a table is too large for this format.
    """
    from scipy.io import savemat

    for table in tables:
        if 8 * len(table.t) * (1 + len(table.fields)) > MAX_VARIABLE_BYTES:
            raise ConfigError(
                f"{table.title}: has more than 2 GB, which a .mat cannot hold; use --to parquet or mf4"
            )
    start = file.tell()
    # scipy takes one variable after the other: only one table is in memory
    savemat(file, _Variables(tables, origin), long_field_names=True, oned_as="column")
    end = file.tell()
    file.seek(start)
    file.write(TEXT.ljust(TEXT_BYTES).encode("ascii"))
    file.seek(end)


class _Variables(dict[str, Any]):
    """A mapping whose values are made when they are written."""

    def __init__(self, tables: Sequence[Table], origin: Origin) -> None:
        titles = [table.name or table.group for table in tables]
        self._named = list(zip(names.unique(titles, names.matlab_name, ("info",)), tables, strict=True))
        self._origin = origin

    def items(self) -> Iterator[tuple[str, Any]]:  # type: ignore[override]
        origin = self._origin
        epoch = timestamps.epoch_seconds(origin.start_ns)
        yield (
            "info",
            {
                "log": origin.log,
                "vehicle": origin.vehicle,
                "start_utc": origin.start_text,
                "start_epoch": epoch,
                "program": origin.program,
            },
        )
        for name, table in self._named:
            yield name, _struct(table)


def _struct(table: Table) -> dict[str, Any]:
    # value tables are in `texts`: a cell for each frame would take a hundred times the space
    meanings = {f"{field.name} text" for field in table.fields if field.choices}
    values = table.values(slice(None))
    kept = [
        (field, v)
        for field, v in zip(table.fields, values, strict=True)
        if field.name not in meanings or v.dtype != object
    ]
    plain = names.unique(
        [f.name for f, _ in kept], names.matlab_name, ("t", "units", "names", "comments", "texts")
    )
    named = list(zip(plain, kept, strict=True))
    out: dict[str, Any] = {"t": table.t}
    for name, (_, column) in named:
        out[name] = column if column.dtype != object else np.array([x or "" for x in column], dtype=object)
    out["units"] = {"t": "s"} | {name: field.unit for name, (field, _) in named}
    out["names"] = {name: field.name for name, (field, _) in named}
    comments = {name: field.comment for name, (field, _) in named if field.comment}
    if comments:
        out["comments"] = comments
    tables = {
        name: {
            "value": np.array(list(field.choices), dtype=np.float64),
            "text": np.array(list(field.choices.values()), dtype=object),
        }
        for name, (field, _) in named
        if field.choices
    }
    if tables:
        out["texts"] = tables
    return out
