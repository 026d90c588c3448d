"""A table of named columns as a trace, as the verbs read it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from canid.analysis.tables.column_map import ColumnMap, read_map
from canid.analysis.tables.table import Selection, open_table, trace_of
from canid.models.pipeline import pipeline
from canid.values.types import Trace


def read_table(
    path: Path,
    columns: ColumnMap | str | Path | None = None,
    *,
    where: Sequence[str] = (),
    vehicle_id: int | None = None,
) -> Trace:
    """The table through the pipeline; `columns`: a column map, or the file or name of one."""
    by = columns if isinstance(columns, ColumnMap) or columns is None else read_map(columns)
    chosen = Selection(tuple(where), None if vehicle_id is None else str(vehicle_id))
    return trace_of(open_table(path, by, chosen), pipeline.DT)
