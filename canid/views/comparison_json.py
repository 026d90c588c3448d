"""A comparison of two drivers as the JSON object that docs/json.md describes."""

from __future__ import annotations

from typing import Any

from canid.comparison.comparison import Comparison, Row
from canid.comparison.conditions import Condition
from canid.comparison.drive import Side
from canid.views import comparison_text, json_values
from canid.views.json_values import interval, number


def to_json(of: Comparison) -> dict[str, Any]:
    """The JSON object of `canid compare`; null where nothing is known."""
    return {
        "verdict": of.verdict,
        "says": comparison_text.sentence(of),
        "a": _side(of.a),
        "b": _side(of.b),
        "parameters": [_row(row) for row in of.rows],
        "causes": [json_values.plain(cause) for cause in of.causes],
        "conditions": [_condition(row) for row in of.conditions],
        "remarks": list(of.remarks),
        "critical": number(of.critical),
        "margins_at": None if of.point is None else {"speed": of.point.speed, "headway": of.point.headway},
    }


def _side(side: Side) -> dict[str, Any]:
    drives = [
        {
            "name": drive.name,
            "method": drive.method,
            "vehicle": drive.vehicle,
            "output": drive.output or None,
            "used": number(drive.used),
        }
        for drive in side.drives
    ]
    return {"label": side.label, "drives": drives}


def _row(row: Row) -> dict[str, Any]:
    return {
        "name": row.name,
        "unit": row.unit,
        "a": interval(row.a),
        "b": interval(row.b),
        "why_not": row.why or None,
        "difference": interval(row.difference),
        "together": interval(row.together),
        "ratio": interval(row.ratio),
        "p": number(row.p),
        "p_adjusted": number(row.p_adjusted),
        "differs": row.differs if row.compared else None,
        "detectable": number(row.detectable),
        "spread": number(row.spread),
        "drives": list(row.drives),
    }


def _condition(row: Condition) -> dict[str, Any]:
    return {
        "name": row.name,
        "unit": row.unit,
        "a": interval(row.a),
        "b": interval(row.b),
        "overlap": number(row.overlap),
    }
