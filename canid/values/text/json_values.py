"""Results as the JSON that other programs rely on: every NamedTuple by its fields; docs/json.md says what the keys mean.

The type of a document is also where its schema comes from (`json_schema.py`). Where a document is not the result itself, it
is a NamedTuple next to what fills it; the tables below have the keys that are no field's name.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import cache, partial
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from canid.values.types import MonitorReport

# versions of schemas, 1 where none is listed: grows when a name goes or changes its meaning, never for one that is added
SCHEMA_VERSIONS: Mapping[str, int] = {}

INLINE = "*"  # in the place of the field stand the keys of its value
# type.field -> its key; None: it is not written
KEYS: Mapping[str, str | None] = {
    "CalibratedRival.rival": INLINE,
    "Candidate.orders": INLINE,
    "CheckedRole.row": INLINE,
    "ClosedLoopError.gap": "nrmse_gap",
    "ClosedLoopError.speed": "nrmse_speed",
    "Compared.comparison": INLINE,
    "ComparedRow.row": INLINE,
    "Comparison.point": "margins_at",
    "Comparison.rows": "parameters",
    "DriveSummary.output": None,
    "Constancy.input_name": "input",
    "Constancy.over_time": INLINE,
    "Diagnosis.of_log": INLINE,
    "Diagnosis.report": INLINE,
    "DriveShare.name": "log",
    "DriveShare.used": "used_time",
    "Event.what": "event",
    "FinalModel.model": INLINE,
    "Fit.simulated": None,
    "FitOfModel.fit": INLINE,
    "Identification.of_log": INLINE,
    "Identification.results": INLINE,
    "LogContents.databases": "dbc",
    "LogContents.ids": None,
    "LogContents.start": None,
    "LogContents.stop": None,
    "Look.contents": INLINE,
    "LookedAt.message": INLINE,
    "MessageContents.changed": None,
    "MessageContents.database": "dbc",
    "MessageContents.longest": None,
    "MessageContents.shortest": None,
    "MonitorReport.t": None,
    "NamedCause.finding": INLINE,
    "Recorded.recorder": INLINE,
    "Report.measured": None,
    "Report.t": None,
    "Report.used": None,
    "Report.visible": "power",
    "Rival.nrmse": INLINE,
    "Row.role": None,
    "Row.source": "from",
    "Row.why": "why_not",
    "SignalFinding.name": "finding",
    "SignalReport.findings": "signals",
    "Stats.drops_bus": "drops",
    "Stats.drops_estimator": None,
    "Stats.waiting": None,
    "Studied.study": INLINE,
    "Visible.bends": "bends_K2",
}
# times that are written to the microsecond
ROUNDED = frozenset(
    (
        "Estimate.t",
        "Event.t",
        "MonitorLine.t",
        "SignalFinding.raised",
        "SignalFinding.since",
        "SignalFinding.until",
        "SignalReport.t",
    )
)
# texts that are null where they are empty
NULL_IF_EMPTY = frozenset(
    (
        "ComparedDrive.output",
        "Look.damage",
        "MessageContents.database",
        "MessageContents.name",
        "Report.recommended",
        "Row.why",
    )
)


Write = Callable[[Any], Any]


class Field(NamedTuple):
    """How a field is written."""

    key: str  # or INLINE
    write: Write


def number(x: float) -> float | None:
    """The number, or None if it is not finite.

    Example:
        >>> number(float("nan")) is None, number(2.0)
        (True, 2.0)
    """
    return float(x) if math.isfinite(x) else None


def plain(value: Any) -> Any:
    """Numbers, texts, enums, arrays, NamedTuples, mappings and sequences of such as JSON has them; null for NaN.

    Example:
        >>> from canid.values.types import Interval
        >>> plain({"K": Interval(1.0), "n": (1, 2)})
        {'K': {'value': 1.0, 'low': None, 'high': None}, 'n': [1, 2]}
    """
    kind: Any = type(value)
    return _writer(kind)(value)


@cache
def _writer(kind: Any) -> Write:
    """What writes values of a type: decided once, because live writes some hundred values with every estimate."""
    if issubclass(kind, Enum):
        return attrgetter("value")
    if issubclass(kind, float):
        return number
    if issubclass(kind, np.ndarray | np.generic):
        return lambda value: plain(value.tolist())
    if hasattr(kind, "_fields"):
        flat = [field for field in fields(kind) if field is not None and field.key != INLINE]
        return _record if len(flat) < len(fields(kind)) else partial(_flat_record, tuple(flat))
    if issubclass(kind, Mapping):
        return lambda value: {str(key): plain(part) for key, part in value.items()}
    if issubclass(kind, tuple | list):
        return lambda value: [plain(part) for part in value]
    return str if issubclass(kind, Path) else lambda value: value


def _flat_record(written: tuple[Field, ...], value: tuple[Any, ...]) -> dict[str, Any]:
    return {key: write(part) for (key, write), part in zip(written, value, strict=True)}


def _record(value: tuple[Any, ...]) -> dict[str, Any]:
    return {key: write(part) for key, (part, write) in _parts(value).items()}


def rounded(x: float) -> float | None:
    """A time, to the microsecond."""
    return number(round(x, 6))


def null_if_empty(text: str) -> str | None:
    """The text, or None if it is empty."""
    return text or None


@cache
def fields(kind: Any) -> tuple[Field | None, ...]:
    """How the fields of a NamedTuple are written, in their order; None: not at all.

    Example:
        >>> [field.key for field in fields(MonitorReport) if field]
        ['fits', 'since', 'block', 'says', 'blocks']
    """
    names: Sequence[str] = kind._fields
    written: list[Field | None] = []
    for name in names:
        path = f"{kind.__name__}.{name}"
        key = KEYS.get(path, name)
        write = rounded if path in ROUNDED else null_if_empty if path in NULL_IF_EMPTY else plain
        written.append(None if key is None else Field(key, write))
    return tuple(written)


def _parts(value: Any) -> dict[str, tuple[Any, Write]]:
    """The value of each key, and what writes it; a later one replaces an earlier one of the same name."""
    if isinstance(value, Mapping):
        return {str(key): (part, plain) for key, part in value.items()}
    parts: dict[str, tuple[Any, Write]] = {}
    kind: Any = type(value)
    for part, field in zip(value, fields(kind), strict=True):
        if field is None:
            continue
        key, write = field
        if key == INLINE:
            parts |= _parts(part)
        else:
            parts[key] = part, write
    return parts


class MonitorLine(NamedTuple):
    """A report of the monitor, as a line of its own."""

    t: float
    screen: MonitorReport


def document(name: str, value: Any) -> str:
    """What a verb writes, on one line: an object or a list of objects, each with the name and version of its schema.

    Args:
        name: of a schema.
        value: a NamedTuple or mapping, or a list of such, without its schema.

    Example:
        >>> document("replay", {"t": 1.0})
        '{"schema": "canid/replay/1", "t": 1.0}'
    """
    schema, written = {"schema": mark(name)}, plain(value)
    return line([schema | each for each in written] if isinstance(written, list) else schema | written)


def mark(name: str) -> str:
    """Name and version of a schema, as the `schema` of an object has them.

    Example:
        >>> mark("replay")
        'canid/replay/1'
    """
    return f"canid/{name}/{SCHEMA_VERSIONS.get(name, 1)}"


def line(value: Any) -> str:
    """One JSON value on one line; raises ValueError for NaN.

    Example:
        >>> line({"t": 1.0, "θ": None})
        '{"t": 1.0, "θ": null}'
    """
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
