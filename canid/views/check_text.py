"""The result of `canid check` as text and as JSON: roles of a vehicle file, or the ids of a log."""

from __future__ import annotations

from typing import Any

from canid.types import NAN
from canid.vehicle_check import Check, Contents
from canid.views import json_values, signal_text
from canid.views.names import readable
from canid.views.numbers import number
from canid.views.table import columns

# significant digits: enough to see an offset of 0.1 in 100
TABLE_DIGITS = 4


def check(found: Check) -> list[str]:
    """What came for each role of the vehicle file, the state of the gate, and the problems."""
    rows = [
        (
            row.role,
            row.unit,
            row.source,
            f"{row.readings:,}",
            *(
                number(x, digits=TABLE_DIGITS)
                for x in (row.rate, row.missing_percent, row.low, row.median, row.high)
            ),
        )
        for row in found.rows
    ]
    lines = [f"{found.frames:,} frames, {len(found.ids)} ids, {found.duration:.1f} s", ""]
    lines += columns(("role", "unit", "from", "readings", "1/s", "missing %", "low", "median", "high"), rows)
    lines += [
        "",
        f"time: {signal_text.time(found.time)}",
        "learning gate: " + ", ".join(f"{_gate(gate)} {share:.0f} %" for gate, share in found.gates.items()),
    ]
    lines += list(found.remarks)
    problems = [f"✗ {problem}" for problem in found.problems]
    return [*lines, "", *(problems or ["✓ the vehicle file fits"])]


def _gate(name: str) -> str:
    # the key of JSON for an open gate is older than the definition of driving
    return "open" if name == "driving" else readable(name)


def check_json(found: Check) -> dict[str, Any]:
    """The same as JSON."""
    return {
        "frames": found.frames,
        "duration": found.duration,
        "roles": {
            row.role: {
                "from": row.source,
                "unit": row.unit,
                "readings": row.readings,
                "rate": json_values.number(row.rate),
                "missing_percent": json_values.number(row.missing_percent),
                "low": json_values.number(row.low),
                "median": json_values.number(row.median),
                "high": json_values.number(row.high),
                "longest_gap": json_values.number(row.longest_gap),
                "stale_percent": json_values.number(row.stale_percent),
                "left_out": dict(found.left_out.get(row.role, {})),
            }
            for row in found.rows
        },
        "gates": found.gates,
        "time": json_values.plain(found.time),
        "signals": [json_values.signal_finding(one) for one in found.findings],
        "problems": list(found.problems),
        "remarks": list(found.remarks),
        "lead_changes": list(found.lead_changes),
        "unmapped": [{"bus": bus, "id": id_, "frames": n} for bus, id_, n in found.unmapped],
    }


def contents(found: Contents) -> list[str]:
    """The ids of a log, without a vehicle file."""
    rows = [
        (
            f"bus {bus}",
            f"0x{id_:X}",
            str(length),
            f"{n:,}",
            number(n / found.duration if found.duration else NAN, digits=TABLE_DIGITS),
        )
        for (bus, id_, length), n in sorted(found.frames.items())
    ]
    total = f"{sum(found.frames.values()):,} frames, {len(rows)} ids, {found.duration:.1f} s"
    return [total, "", *columns(("bus", "id", "bytes", "frames", "1/s"), rows)]


def contents_json(found: Contents) -> dict[str, Any]:
    """The same as JSON."""
    ids = [
        {"bus": bus, "id": id_, "bytes": length, "frames": n}
        for (bus, id_, length), n in sorted(found.frames.items())
    ]
    return {"frames": sum(found.frames.values()), "duration": found.duration, "ids": ids}
