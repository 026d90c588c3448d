"""CSV (RFC 4180): a header with units, CRLF, an empty field for what was not measured; 1 M rows in seconds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import msgspec
import numpy as np

from canid.analysis.export import names
from canid.analysis.export.table import Field, Origin, Table, Values, in_ns
from canid.values.errors import ConfigError
from canid.values.types import Array

# "log": s since the log's first frame; "utc": ISO 8601; "epoch": s since 1970
TimeColumn = Literal["log", "utc", "epoch"]
# rows that are made text at once: some MB
ROWS_AT_ONCE = 16_384
TIME = Field("t", "s")


def header(table: Table, time: TimeColumn = "log") -> list[str]:
    """Cells of the first line.

    Example:
        >>> from canid.analysis.export.table import of_columns
        >>> header(of_columns("samples", "", np.zeros(1), [(Field("gap", "m"), np.zeros(1))]), "utc")
        ['utc', 't [s]', 'gap [m]']
    """
    first = {"log": [], "utc": ["utc"], "epoch": ["epoch [s]"]}[time]
    cells = [names.header(field.name, field.unit) for field in (TIME, *table.fields)]
    return [*first, *names.unique(cells, str, first)]


def header_line(table: Table, time: TimeColumn = "log") -> str:
    """The first line, without its end."""
    return b",".join(_quoted(cell) for cell in header(table, time)).decode()


def lines(table: Table, origin: Origin, time: TimeColumn = "log") -> Iterator[bytes]:
    r"""The file, piece by piece.

    Args:
        table: to write.
        origin: with the start of the log.
        time: the first column; "utc" and "epoch" stand before the column t.

    Raises:
        ConfigError: the log states no date, and `time` needs one.

    Example:
        >>> from canid.analysis.export.table import of_columns
        >>> gap = np.array([12.5, np.nan])
        >>> table = of_columns("samples", "", np.array([0.0, 0.1]), [(Field("gap", "m"), gap)])
        >>> b"".join(lines(table, Origin("a.blf", None)))
        b't [s],gap [m]\r\n0.0,12.5\r\n0.1,\r\n'
    """
    if time != "log" and origin.start_ns is None:
        raise no_date(origin)
    yield header_line(table, time).encode() + b"\r\n"
    for begin in range(0, len(table.t), ROWS_AT_ONCE):
        part = slice(begin, begin + ROWS_AT_ONCE)
        columns = [table.t[part], *table.values(part)]
        if time == "log" and all(c.dtype != object and not _infinite(c) for c in columns):
            rows = msgspec.json.encode(list(zip(*(c.tolist() for c in columns), strict=True)))
            yield rows[2:-2].replace(b"],[", b"\r\n").replace(b"null", b"") + b"\r\n"
            continue
        cells = [_cells(column) for column in columns]
        if time != "log":
            cells.insert(0, _stamps(table.t[part], origin.start_ns or 0, time))
        yield b"\r\n".join(map(b",".join, zip(*cells, strict=True))) + b"\r\n"


def no_date(origin: Origin) -> ConfigError:
    """The error where absolute times are wanted of a log without a date."""
    return ConfigError(
        f"{origin.log}: the log states no date, so there is no absolute time; export it with --time log"
    )


def numbers(values: Values) -> list[bytes]:
    """Numbers as their shortest exact text; empty where NaN."""
    if _infinite(values):
        return [b"" if x != x else repr(x).encode() for x in values.tolist()]
    return msgspec.json.encode(values.tolist())[1:-1].replace(b"null", b"").split(b",") if len(values) else []


def _infinite(values: Values) -> bool:
    return values.dtype == np.float64 and bool(np.isinf(values).any())


def _cells(values: Values) -> list[bytes]:
    if values.dtype != object:
        return numbers(values)
    known: dict[str | None, bytes] = {None: b""}
    out = []
    for text in values.tolist():
        cell = known.get(text)
        if isinstance(text, int):
            cell = str(text).encode()
        elif cell is None:
            cell = known[text] = _quoted(names.disarmed(text))
        out.append(cell)
    return out


def _quoted(text: str) -> bytes:
    plain = not any(c in text for c in ',"\r\n')
    return (text if plain else '"' + text.replace('"', '""') + '"').encode("utf-8", "backslashreplace")


def _stamps(t: Array, start_ns: int, time: TimeColumn) -> list[bytes]:
    ns = in_ns(t) + start_ns
    if time == "utc":
        return [f"{text}Z".encode() for text in np.datetime_as_string(ns.astype("datetime64[ns]"), unit="ns")]
    return [b"%d.%09d" % divmod(stamp, 1_000_000_000) for stamp in ns.tolist()]
