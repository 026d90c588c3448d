"""Samples and estimates as CSV (RFC 4180) and Parquet tables."""

from __future__ import annotations

import csv
import io
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from canid.errors import ConfigError, OutputError
from canid.types import Estimate, Trace


def samples_table(trace: Trace) -> dict[str, list[Any]]:
    """Columns: t (s), every role in its unit, output and inputs of the model, gate, learn."""
    columns: dict[str, list[Any]] = {"t": [round(float(t), 6) for t in trace.t]}
    columns |= {role: values.tolist() for role, values in trace.signals.items()}
    columns["output"] = trace.output.tolist()
    columns |= {f"input_{name}": trace.inputs[:, k].tolist() for k, name in enumerate(trace.input_names)}
    columns["gate"] = [gate.name.lower() for gate in trace.gate]
    columns["learn"] = [int(x) for x in trace.learn]
    return columns


def estimates_table(estimates: Iterable[Estimate]) -> dict[str, list[Any]]:
    """One row per estimate and channel: t, estimator, status, channel, can_tell, K, K_low, K_high, tau, ..."""
    rows: list[dict[str, Any]] = []
    for e in estimates:
        for name, ch in e.channels.items():
            row: dict[str, Any] = {
                "t": round(e.t, 6),
                "estimator": e.estimator,
                "status": e.status.value,
                "channel": name,
                "can_tell": ch.status.value,
            }
            for key in ("K", "tau", "dead_time", "tau_plus_dead_time"):
                iv = getattr(ch, key)
                row |= {key: iv.value, f"{key}_low": iv.low, f"{key}_high": iv.high}
            rows.append(row | {"fit_percent": e.fit_percent, "used": e.used})
    return {key: [row[key] for row in rows] for key in (rows[0] if rows else ())}


def csv_text(columns: Mapping[str, list[Any]]) -> str:
    r"""A table as CSV (RFC 4180). NaN becomes an empty field.

    Example:
        >>> csv_text({"t": [0.0, 0.1], "gap": [12.5, float("nan")]})
        't,gap\r\n0.0,12.5\r\n0.1,\r\n'
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(map(_cell, columns))
    writer.writerows(zip(*([_cell(x) for x in column] for column in columns.values()), strict=True))
    return text.getvalue()


def _cell(x: Any) -> Any:
    """NaN becomes empty; text that a spreadsheet would run as a formula is made plain text."""
    if isinstance(x, str) and x.startswith(("=", "+", "-", "@", "\t", "\r")):
        return f"'{x}"
    return None if isinstance(x, float) and x != x else x


def parquet(columns: Mapping[str, list[Any]]) -> bytes:
    """A table as a Parquet file. NaN becomes NULL.

    Raises:
        ConfigError: duckdb is missing.
        OutputError: the folder of temporary files is full.
    """
    try:
        import duckdb
    except ImportError as error:
        raise ConfigError("Parquet needs duckdb: pip install 'canid[export]'") from error
    import numpy as np

    # duckdb reads masked arrays with their mask as NULL
    table = {
        name: np.ma.masked_invalid(np.array(values, dtype=float))
        if values and isinstance(values[0], float)
        else np.array(values)
        for name, values in columns.items()
    }
    # duckdb writes to a path only: a new folder, so that no other file is there
    with tempfile.TemporaryDirectory(prefix="canid-") as folder:
        path = Path(folder) / "table.parquet"
        target = str(path).replace("'", "''")
        try:
            with duckdb.connect() as db:
                db.register("exported", table)
                db.execute(f"COPY exported TO '{target}' (FORMAT parquet, COMPRESSION zstd)")
            return path.read_bytes()
        except (duckdb.IOException, OSError) as error:
            why = str(error).rpartition(": ")[2]
            raise OutputError(f"{folder}: the table cannot be written there ({why})") from error
