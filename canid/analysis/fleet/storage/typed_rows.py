"""Rows of a table as lines of JSON, with the types that its columns state: what is stored can always be read again."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from canid.analysis.fleet.storage.columns import Column
from canid.io.files import opening

# a name in bytes that are no text; and NUL, which ends a text in some programs
_NO_TEXT = re.compile("[\ud800-\udfff\x00]")


def text(value: object) -> str:
    r"""A text as Unicode allows it: bytes of a name that are no text, and NUL, are escaped.

    Example:
        >>> text("Zoë"), text("a\udcff"), text(12)
        ('Zoë', 'a\\xff', '12')
    """
    return _NO_TEXT.sub(lambda match: f"\\x{ord(match[0]) & 0xFF:02x}", str(value))


def _number(value: Any) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None


def _integer(value: Any) -> int | None:
    return int(value) if math.isfinite(value) else None


_OF_TYPE: dict[str, Callable[[Any], Any]] = {
    "VARCHAR": text,
    "DOUBLE": _number,
    "BIGINT": _integer,
    "INTEGER": _integer,
    "BOOLEAN": bool,
}


def typed(row: Mapping[str, Any], columns: Sequence[Column]) -> dict[str, Any]:
    """The values of a row for these columns, in their types; None: not known.

    Example:
        >>> typed({"t": float("nan"), "n": 2.0, "other": 1}, [Column("t", "DOUBLE"), Column("n", "INTEGER")])
        {'t': None, 'n': 2}
    """
    return {column.name: _value(row.get(column.name), column.type) for column in columns}


def _value(value: Any, kind: str) -> Any:
    if value is None:
        return None
    if kind.endswith("[]"):
        return [_value(item, kind[:-2]) for item in value]
    return _OF_TYPE[kind](value)


def write_lines(path: Path, rows: Iterable[Mapping[str, Any]], columns: Sequence[Column]) -> None:
    """Write rows into a new file, a JSON object a line. Raises OSError."""
    with opening.create_file(path) as file:
        for row in rows:
            file.write(_json(typed(row, columns)).encode() + b"\n")


def _json(row: Mapping[str, Any]) -> str:
    return json.dumps(row, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def line(name: str, row: Mapping[str, Any]) -> bytes:
    r"""A row of a table as one line, from which `of_line` cuts the row without parsing it.

    Example:
        >>> line("power", {"key": "a"})
        b'["power",{"key":"a"}]\n'
    """
    return f'["{name}",{_json(row)}]\n'.encode()


def of_line(made: bytes) -> tuple[str, bytes]:
    r"""The table's name and the row as JSON.

    Example:
        >>> of_line(b'["power",{"key":"a"}]\n')
        ('power', b'{"key":"a"}')
    """
    name, _, row = made.partition(b",")
    return name[2:-1].decode("ascii", "replace"), row[:-2]
