"""Stretches of a recorded drive in which the monitor reports that what was learnt no longer fits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from canid.analysis.drive.drive_parameters import ROWS_AT_ONCE, samples
from canid.models.monitor import change_monitor
from canid.values.types import MonitorReport, Sample, Trace


class Misfit(NamedTuple):
    """One stretch."""

    block: str  # the suspected one
    since: float  # s
    until: float | None  # s, of the report that all fits again, or suspects another block; None: it stands
    says: str


def misfits(reports: Iterable[MonitorReport]) -> list[Misfit]:
    """Merge reports to stretches, one for each suspected block.

    Args:
        reports: of one drive, in their order.

    Example:
        >>> of = [MonitorReport(t, not block, t - 5.0, block, block, {}) for t, block in (
        ...     (10.0, ""), (20.0, "driver"), (30.0, "driver"), (40.0, ""))]
        >>> misfits(of)
        [Misfit(block='driver', since=15.0, until=40.0, says='driver')]
    """
    out: list[Misfit] = []
    stands = False
    for report in reports:
        if stands and report.block != out[-1].block:
            out[-1] = out[-1]._replace(until=report.t)
            stands = False
        if not report.fits and not stands:
            out.append(Misfit(report.block, report.since, None, report.says))
            stands = True
    return out


def monitor_reports(trace: Trace) -> Iterator[MonitorReport]:
    """The monitor's reports along a trace, the same as live."""
    monitor = change_monitor.make(trace.input_names)
    state = monitor.init()
    for sample in _with_signals(trace):
        state, report = monitor.step(state, sample)
        if report is not None:
            yield report


def _with_signals(trace: Trace) -> Iterator[Sample]:
    """The samples with their signals, which the estimators do without."""
    roles = tuple(trace.signals)
    for k, sample in enumerate(samples(trace)):
        at = k % ROWS_AT_ONCE
        if at == 0:
            part = slice(k, k + ROWS_AT_ONCE)
            columns = [trace.signals[role][part].tolist() for role in roles]
        yield sample._replace(signals={role: x[at] for role, x in zip(roles, columns, strict=True)})
