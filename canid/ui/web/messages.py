"""Messages to the page: the outputs of the pipeline as JSON of `views.json_values`, with the texts of the other views."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from canid.ui.views.terminal_view.state import HealthLine
from canid.values.signal_table import SignalTable
from canid.values.text import estimate_text, json_values
from canid.values.text.numbers import UNITS, gain_unit
from canid.values.types import TASK_INPUTS, Estimate, Event, MonitorReport, Sample, SignalReport

Item = Sample | Estimate | MonitorReport | SignalReport | Event


def encode(message: dict[str, Any]) -> bytes:
    """One message as one line."""
    return json_values.line(message).encode("utf-8", "replace") + b"\n"


def of_item(item: Item, output: str) -> dict[str, Any]:
    """One output of the pipeline; `output` is the role of the driver's output, "" where it is not known yet.

    Example:
        >>> of_item(Event(1.0, "mark", "overtaking"), "pedal")
        {'kind': 'event', 't': 1.0, 'event': 'mark', 'says': 'overtaking'}
    """
    if isinstance(item, Sample):
        return {"kind": "sample", **sample(item)}
    if isinstance(item, Estimate):
        return {
            "kind": "estimate",
            "value": json_values.plain(item),
            "missing": estimate_text.all_missing(item.channels),
            "units": {name: gain_unit(output, name) for name in item.channels},
        }
    if isinstance(item, MonitorReport):
        return {
            "kind": "monitor",
            "value": json_values.plain(json_values.MonitorLine(item.t, item)),
            "says": estimate_text.misfit(item),
        }
    if isinstance(item, SignalReport):
        return {"kind": "signals", "value": json_values.plain(item)}
    return {"kind": "event", **json_values.plain(item)}


def sample(s: Sample) -> dict[str, Any]:
    """A sample; its inputs by name."""
    names = next((names for names in TASK_INPUTS.values() if len(names) == len(s.inputs)), ())
    return {
        "t": json_values.number(round(s.t, 6)),
        "output": json_values.number(s.output),
        "inputs": {name: json_values.number(x) for name, x in zip(names, s.inputs, strict=False)},
        "gate": s.gate.value,
        "learn": bool(s.learn),
        "segment": int(s.segment),
        "signals": {role: json_values.number(x) for role, x in s.signals.items()},
    }


def of_lines(lines: Iterable[HealthLine], output: str) -> dict[str, Any]:
    """The state of buses, recorder and estimators; the role of the driver's output and its unit."""
    shown = [{"text": line.text, "wrong": line.wrong} for line in lines]
    return {"kind": "health", "lines": shown, "output": output, "unit": UNITS.get(output, "")}


def of_table(table: SignalTable) -> dict[str, Any]:
    """The table of all signals: bus, name, text, rate and age of each.

    Example:
        >>> from canid.values.signal_table import Row
        >>> of_table(SignalTable(1.5, [Row(0, "A.B", "10 m", 9.8765, 0.012)], 0.001))
        {'kind': 'table', 't': 1.5, 'rows': [[0, 'A.B', '10 m', 9.88, 0.01]], 'failure': ''}
    """
    rows = [
        [row.bus, row.name, row.text, json_values.number(float(f"{row.rate:.3g}")), round(row.age, 2)]
        for row in table.rows
    ]
    return {
        "kind": "table",
        "t": json_values.number(round(table.t, 3)),
        "rows": rows,
        "failure": table.failure,
    }


def of_status(values: dict[str, Any]) -> dict[str, Any]:
    """Numbers on the session or the replay; null where a number is not finite."""
    return {"kind": "status", "value": json_values.plain(values)}
