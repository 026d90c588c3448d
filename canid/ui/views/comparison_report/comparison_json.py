"""A comparison of two drivers as the JSON object that docs/json.md describes."""

from __future__ import annotations

from typing import NamedTuple

from canid.analysis.comparison.comparison import Comparison, Row
from canid.analysis.comparison.drive import Side
from canid.ui.views.comparison_report import comparison_document


class ComparedDrive(NamedTuple):
    """One drive of a side."""

    name: str
    method: str
    vehicle: str
    output: str
    used: float  # s


class ComparedSide(NamedTuple):
    """One driver."""

    label: str
    drives: tuple[ComparedDrive, ...]


class ComparedRow(NamedTuple):
    """One parameter."""

    row: Row
    differs: bool | None  # None: not compared


class OperatingPoint(NamedTuple):
    """Where margins are computed."""

    speed: float  # m/s
    headway: float  # s


class Compared(NamedTuple):
    """The object of `canid compare --json`."""

    comparison: Comparison
    says: str
    a: ComparedSide
    b: ComparedSide
    parameters: tuple[ComparedRow, ...]
    margins_at: OperatingPoint | None
    command: str


def document(made: Comparison, command: str) -> Compared:
    """What `canid compare` writes."""
    return Compared(
        made,
        comparison_document.sentence(made),
        _side(made.a),
        _side(made.b),
        tuple(ComparedRow(row, row.differs if row.compared else None) for row in made.rows),
        None if made.point is None else OperatingPoint(made.point.speed, made.point.headway),
        command,
    )


def _side(side: Side) -> ComparedSide:
    drives = (ComparedDrive(d.name, d.method, d.vehicle, d.output, d.used) for d in side.drives)
    return ComparedSide(side.label, tuple(drives))
