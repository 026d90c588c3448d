"""Samples and estimates as tables that other programs read: CSV and Parquet (DuckDB)."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from canid.errors import ConfigError, OutputError
from canid.types import Estimate, Trace


def samples_table(trace: Trace) -> dict[str, list[Any]]:
    """Columns: t (s), every role in its unit, the model's output and inputs, gate, learn."""
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


def write_table(path: str | Path, columns: Mapping[str, list[Any]], *, overwrite: bool = False) -> None:
    """Write a table; the suffix chooses .csv or .parquet. NaN becomes an empty field or NULL.

    Raises:
        ConfigError: another suffix, or duckdb is missing.
        OutputError: the file exists, or cannot be written.
    """
    path = Path(path)
    if path.suffix not in (".csv", ".parquet"):
        raise ConfigError(f'{path}: cannot export to "{path.suffix}"; use .csv or .parquet')
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: exists already; choose another name or use --force")
    rows = zip(*([_cell(x) for x in column] for column in columns.values()), strict=True)
    try:
        if path.suffix == ".csv":
            with path.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(map(_cell, columns))
                writer.writerows(rows)
        else:
            _parquet(path, columns)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


def _cell(x: Any) -> Any:
    """NaN is left empty; text that a spreadsheet would run as a formula is made plain text."""
    if isinstance(x, str) and x.startswith(("=", "+", "-", "@", "\t", "\r")):
        return f"'{x}"
    return None if isinstance(x, float) and x != x else x


def _parquet(path: Path, columns: Mapping[str, list[Any]]) -> None:
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
    target = str(path).replace("'", "''")
    try:
        with duckdb.connect() as db:
            db.register("exported", table)
            db.execute(f"COPY exported TO '{target}' (FORMAT parquet, COMPRESSION zstd)")
    except duckdb.IOException as error:
        raise OutputError(f"{path}: cannot be written ({str(error).rpartition(': ')[2]})") from error
