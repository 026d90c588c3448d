"""Tables in plain text: a check's answer, a log's contents, a drive's parameters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from canid.check import Check, Contents
from canid.types import NAN
from canid.views.as_json import number


def columns(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Align columns: the first to the left, the others to the right.

    Example:
        >>> columns(("role", "n"), [("speed", "12")])
        ['role    n', 'speed  12']
    """
    cells = [list(head), *(list(row) for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    return [
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]


def short(x: float) -> str:
    """Four significant figures, or a dash.

    Example:
        >>> short(1234.56), short(float("nan"))
        ('1235', '–')
    """
    return f"{x:.4g}" if x == x else "–"


def check(found: Check) -> list[str]:
    """The answer of `canid check`."""
    rows = [
        (
            row.role,
            row.unit,
            row.source,
            f"{row.readings:,}",
            short(row.rate),
            short(row.missing_percent),
            short(row.low),
            short(row.median),
            short(row.high),
        )
        for row in found.rows
    ]
    lines = [f"{found.frames:,} frames, {len(found.ids)} ids, {found.duration:.1f} s", ""]
    lines += columns(("role", "unit", "from", "readings", "1/s", "missing %", "low", "median", "high"), rows)
    lines += ["", "time: " + ", ".join(f"{gate} {share:.0f} %" for gate, share in found.gates.items())]
    lines += list(found.remarks)
    lines += (
        ["", *(f"✗ {problem}" for problem in found.problems)]
        if found.problems
        else ["", "✓ the vehicle file fits"]
    )
    return lines


def check_json(found: Check) -> dict[str, Any]:
    """The same for programs."""
    return {
        "frames": found.frames,
        "duration": found.duration,
        "roles": {
            row.role: {
                "from": row.source,
                "unit": row.unit,
                "readings": row.readings,
                "rate": number(row.rate),
                "missing_percent": number(row.missing_percent),
                "low": number(row.low),
                "median": number(row.median),
                "high": number(row.high),
            }
            for row in found.rows
        },
        "gates": found.gates,
        "problems": list(found.problems),
        "remarks": list(found.remarks),
    }


def contents(found: Contents) -> list[str]:
    """What is in a log, without a vehicle file."""
    rows = [
        (
            f"bus {bus}",
            f"0x{id_:X}",
            str(length),
            f"{n:,}",
            short(n / found.duration if found.duration else NAN),
        )
        for (bus, id_, length), n in sorted(found.frames.items())
    ]
    total = f"{sum(found.frames.values()):,} frames, {len(rows)} ids, {found.duration:.1f} s"
    return [total, "", *columns(("bus", "id", "bytes", "frames", "1/s"), rows)]


def contents_json(found: Contents) -> dict[str, Any]:
    """The same for programs."""
    ids = [
        {"bus": bus, "id": id_, "bytes": length, "frames": n}
        for (bus, id_, length), n in sorted(found.frames.items())
    ]
    return {"frames": sum(found.frames.values()), "duration": found.duration, "ids": ids}
