"""A diagnosis as the JSON object that docs/json.md describes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.analysis.drive.identification_json import OfLog
from canid.ui.views import closed_loop, search_bounds
from canid.ui.views.closed_loop import rms_error
from canid.ui.views.diagnosis_report.diagnosis_answer import answer
from canid.ui.views.diagnosis_report.diagnosis_parts import remarks
from canid.ui.views.search_bounds import AtBound
from canid.values.findings import Finding, Fit, Report, Rival, Trajectory, duration, nrmse, step, used_time
from canid.values.identified_model import IdentifiedModel
from canid.values.text.model_equation import equation
from canid.values.text.numbers import role_unit
from canid.values.types import Interval


class BoundReached(NamedTuple):
    """An estimate at an end of the range that is searched."""

    side: str  # "lower", "upper"
    range: tuple[float, float]
    unit: str


Bounds = Mapping[str, BoundReached]  # parameter -> where it stands


class FitOfModel(NamedTuple):
    """Baseline or extended model."""

    fit: Fit
    at_bound: Bounds


class Episode(NamedTuple):
    """When an effect was there."""

    start: float  # s
    stop: float


class NamedCause(NamedTuple):
    """A finding."""

    finding: Finding
    at_bound: Bounds
    episodes: tuple[Episode, ...]


class ClosedLoop(NamedTuple):
    """One quantity in closed loop: errors of the baseline and of the extended model, rms."""

    role: str
    unit: str
    before: float
    after: float
    gain: Interval
    worse: bool
    nrmse_before: float
    nrmse_after: float


class CalibratedRival(NamedTuple):
    """A published model."""

    rival: Rival
    at_bound: Bounds


class Shift(NamedTuple):
    """A parameter without and with the causes in the model."""

    before: Interval
    after: Interval


class FinalModel(NamedTuple):
    """What `canid simulate --model` drives."""

    equation: str
    model: IdentifiedModel


class Diagnosis(NamedTuple):
    """The object of `canid diagnose --json`."""

    log: str
    vehicle: str
    duration: float
    used_time: float
    unit: str
    report: Report
    says: str
    answer: str  # in plain sentences
    remarks: list[str]
    baseline: FitOfModel
    extended: FitOfModel
    findings: tuple[NamedCause, ...]
    closed_loop: tuple[ClosedLoop, ...]
    rivals: tuple[CalibratedRival, ...]
    shifts: Mapping[str, Shift]
    model: FinalModel | None
    of_log: OfLog


def document(report: Report, log: str, vehicle: str, of_log: OfLog | None = None) -> Diagnosis:
    """What `canid diagnose` writes of one report.

    Args:
        report: the diagnosis.
        log: name of the log.
        vehicle: name of the vehicle.
        of_log: what else is known of the log.
    """
    bounds = search_bounds
    return Diagnosis(
        log,
        vehicle,
        duration(report),
        used_time(report),
        role_unit(report.output),
        report,
        " ".join([bounds.without_intervals(report.says, report), *remarks(report)]),
        " ".join(answer(report)),
        remarks(report),
        _fit(report.baseline, report),
        _fit(report.extended, report),
        tuple(
            NamedCause(
                each, _bounds(bounds.of_finding(each)), tuple(Episode(*span) for span in each.episodes)
            )
            for each in report.findings
        ),
        tuple(_closed_loop(each) for each in report.closed_loop),
        tuple(CalibratedRival(each, _bounds(bounds.of_rival(each))) for each in report.rivals),
        {key: Shift(*pair) for key, pair in report.shifts.items()},
        None if report.model is None else FinalModel(equation(report.model), report.model),
        of_log or {},
    )


def _bounds(reached: Mapping[str, AtBound]) -> Bounds:
    return {key: BoundReached(at.side, (at.low, at.high), at.unit) for key, at in reached.items()}


def _fit(fit: Fit, report: Report) -> FitOfModel:
    return FitOfModel(fit, _bounds(search_bounds.of_fit(fit, 0.5 * step(report))))


def _closed_loop(loop: Trajectory) -> ClosedLoop:
    return ClosedLoop(
        loop.role,
        role_unit(loop.role),
        rms_error(loop, loop.before),
        rms_error(loop, loop.after),
        loop.gain,
        closed_loop.worse(loop),
        nrmse(loop.before, loop.measured),
        nrmse(loop.after, loop.measured),
    )
