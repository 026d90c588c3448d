"""Messages to the page: the outputs of the pipeline as JSON of `views.json_values`, with the texts of the other views."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from canid.types import TASK_INPUTS, Estimate, Event, MonitorReport, Sample, SignalReport
from canid.views import estimate_text, json_values
from canid.views.numbers import UNITS, gain_unit
from canid.views.terminal_view.state import HealthLine

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
            "value": json_values.estimate(item),
            "missing": estimate_text.all_missing(item.channels),
            "units": {name: gain_unit(output, name) for name in item.channels},
        }
    if isinstance(item, MonitorReport):
        return {
            "kind": "monitor",
            "value": json_values.monitor_report(item),
            "says": estimate_text.misfit(item),
        }
    if isinstance(item, SignalReport):
        return {"kind": "signals", "value": json_values.signal_report(item)}
    return {"kind": "event", **json_values.event(item)}


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


def of_status(values: dict[str, Any]) -> dict[str, Any]:
    """Numbers on the session or the replay; null where a number is not finite."""
    return {"kind": "status", "value": json_values.plain(values)}
