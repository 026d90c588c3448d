"""MCAP for Foxglove and PlotJuggler: JSON messages with a schema, in the order of time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from canid.analysis.export.csv_table import numbers
from canid.analysis.export.table import Field, Origin, Table, Values, in_ns
from canid.values.errors import ConfigError
from canid.values.terminal_text import terminal_text

# s of all tables that are made messages at once
SLICE_S = 20.0
# bytes of a compressed chunk: what a program reads for one instant
CHUNK_BYTES = 1 << 21


def topic(table: Table) -> str:
    """Name of a table's channel.

    Example:
        >>> from canid.analysis.export.table import of_columns
        >>> topic(of_columns("signals", "SPEED.bus1", np.zeros(0), []))
        '/signals/SPEED/bus1'
    """
    return terminal_text("/" + table.title.replace(".", "/"))


def write(file: BinaryIO, tables: Sequence[Table], origin: Origin) -> None:
    """Write all tables.

    A message for each row: `{"t": s, "gap": m, ...}`; what was not measured is left out. Log time: ns since 1970 UTC; since
    the log's first frame, or an earlier one behind it, where it states no date.

    Raises:
        ConfigError: mcap is missing.
    """
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise ConfigError("MCAP needs mcap: pip install 'canid[export]'") from error
    # a log time has no sign: without a date the earliest frame, not the first, is 0 where it comes before it
    earliest = min((int(in_ns(table.t[:1])[0]) for table in tables if len(table.t)), default=0)
    start = max(origin.start_ns or 0, -earliest)
    writer = Writer(file, chunk_size=CHUNK_BYTES)
    writer.start(profile="", library=f"{origin.program} export")
    writer.add_metadata(
        "canid",
        {
            "log": _text(origin.log),
            "vehicle": _text(origin.vehicle),
            "start_utc": origin.start_text,
            "program": origin.program,
        },
    )
    channels = []
    for table in tables:
        schema = writer.register_schema(topic(table)[1:], "jsonschema", json.dumps(_schema(table)).encode())
        units = {field.name: field.unit for field in table.fields if field.unit}
        channels.append(writer.register_channel(topic(table), "json", schema, {"units": json.dumps(units)}))
    last = max((float(table.t[-1]) for table in tables if len(table.t)), default=-1.0)
    ends = np.append(np.arange(SLICE_S, last, SLICE_S), np.inf)
    at = [0] * len(tables)
    for end in ends.tolist():
        rows: list[bytes] = []
        stamps: list[npt.NDArray[np.int64]] = []
        which: list[npt.NDArray[np.int64]] = []
        for k, table in enumerate(tables):
            stop = int(np.searchsorted(table.t, end))
            if stop > at[k]:
                part = slice(at[k], stop)
                stamps.append(in_ns(table.t[part]) + start)
                which.append(np.full(stop - at[k], channels[k]))
                rows += messages(table, part)
                at[k] = stop
        if not rows:
            continue
        stamp = np.concatenate(stamps)
        order = np.argsort(stamp, kind="stable")
        channel_ids = np.concatenate(which)[order].tolist()
        for row, channel, ns in zip(order.tolist(), channel_ids, stamp[order].tolist(), strict=True):
            writer.add_message(channel, ns, rows[row], ns)
    writer.finish()  # type: ignore[no-untyped-call]


def messages(table: Table, part: slice) -> list[bytes]:
    """The rows as JSON objects.

    Example:
        >>> from canid.analysis.export.table import of_columns
        >>> gap = np.array([3.5, np.nan])
        >>> messages(of_columns("samples", "", np.array([0.0, 0.1]), [(Field("gap"), gap)]), slice(None))
        [b'{"t":0.0,"gap":3.5}', b'{"t":0.1}']
    """
    pieces = [[b'{"t":' + cell for cell in numbers(table.t[part])]]
    for field, values in zip(table.fields, table.values(part), strict=True):
        key = b"," + json.dumps(_text(field.name)).encode() + b":"
        pieces.append([key + cell if cell else b"" for cell in _cells(values)])
    return [b"".join(row) + b"}" for row in zip(*pieces, strict=True)]


def _cells(values: Values) -> list[bytes]:
    if values.dtype != object:
        # JSON has no infinity
        return numbers(
            np.where(np.isfinite(values), values, np.nan) if values.dtype == np.float64 else values
        )
    known: dict[str | None, bytes] = {None: b""}
    for text in set(values.tolist()) - {None}:
        known[text] = json.dumps(_text(text)).encode()
    return [known[text] for text in values.tolist()]


def _schema(table: Table) -> dict[str, Any]:
    kinds = {"number": "number", "integer": "integer", "text": "string"}
    properties = {
        _text(field.name): {"type": kinds[field.kind]} | _described(field)
        for field in (Field("t", "s", "time since the log's first frame"), *table.fields)
    }
    return {"title": _text(table.title), "type": "object", "properties": properties}


def _described(field: Field) -> dict[str, str]:
    says = ", ".join(part for part in (field.unit and f"unit: {field.unit}", field.comment) if part)
    return {"description": _text(says)} if says else {}


def _text(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode()
