"""The result of `canid look` as JSON."""

from __future__ import annotations

from typing import Any

from canid.log_contents import LogContents, MessageContents, SignalContents
from canid.views.json_values import array, number
from canid.views.look_text import Head


def values(found: LogContents, head: Head) -> dict[str, Any]:
    """All that the text shows, and more; no row is left out."""
    return {
        "log": head.path,
        "format": head.format,
        "start_utc": number(head.start_utc),
        "duration": number(found.duration),
        "frames": found.frames,
        "damage": head.damage or None,
        "buses": [
            {name: number(x) if isinstance(x, float) else x for name, x in bus._asdict().items()}
            for bus in found.buses
        ],
        "dbc": [one._asdict() | {"buses": list(one.buses)} for one in found.databases],
        "messages": [_message(one) for one in found.messages],
        "signals": [_signal(one) for one in found.signals],
        "frames_left_out": found.frames_left_out,
        "signals_left_out": found.signals_left_out,
    }


def _message(one: MessageContents) -> dict[str, Any]:
    return {
        "bus": one.bus,
        "id": one.id,
        "extended": one.extended,
        "name": one.name or None,
        "dbc": one.database or None,
        "frames": one.frames,
        "rate": number(one.rate),
        "jitter": number(one.jitter),
        "longest_gap": number(one.longest_gap),
        "first": one.first,
        "last": one.last,
        "bytes": [one.shortest, one.longest],
        "changes": one.changes,
        "changed_bits": one.changed[: one.longest].tobytes().hex(),
        "fields": [field._asdict() for field in one.fields],
    }


def _signal(one: SignalContents) -> dict[str, Any]:
    numbers = ("low", "high", "mean", "last")
    out = {name: number(x) if name in numbers else x for name, x in one._asdict().items()}
    return out | {"entries": dict(one.entries), "course": array(one.course)}
