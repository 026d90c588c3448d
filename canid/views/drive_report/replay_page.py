"""A replayed log as one self-contained HTML page: the live estimates over the drive, the monitor, findings and events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from canid.estimators import step_watch
from canid.findings import Provenance
from canid.signal_checks import signal_checks
from canid.signal_checks.drive_time import Flags, drive_time
from canid.types import (
    TASK_INPUTS,
    Array,
    BlockStatus,
    DriveTime,
    Estimate,
    Event,
    Identifiable,
    MonitorReport,
    SignalFinding,
    SignalReport,
)
from canid.views import estimate_text, identification_verdict, signal_text
from canid.views.drive_report import gates, page_parts
from canid.views.drive_report.estimates_over_time import estimates_over_time
from canid.views.drive_report.panels import Panel, instants, signal, stack
from canid.views.drive_report.replay_record import ReplayRecord, unit
from canid.views.drive_report.strips import Stretch, joined, strips
from canid.views.end_summary import EstimateTally
from canid.views.names import capitalised, readable
from canid.views.numbers import clock, number, role_unit
from canid.views.report.figure import Figure, Spec

# points of a line
MAX_POINTS = 4000
# events that are listed; of more, the first of each kind and a count
EVENTS_SHOWN = 60
# marks that are drawn: more would hide the lines
MARKS_SHOWN = 20
PANEL_PX = 90


class ReplayedLog(NamedTuple):
    """A replay, as the page shows it."""

    record: ReplayRecord
    output: str  # role of the driver's output
    task: str
    step: float  # s, of the samples
    duration: float  # s
    health: Sequence[str]  # what was wrong with the log, sentences
    provenance: Provenance
    vehicle: str  # its name
    damaged: bool = False


class Standing(NamedTuple):
    """One estimator at the end of the drive."""

    name: str
    headline: bool
    statuses: str
    at: str
    lines: list[str]


def page(log: ReplayedLog) -> str:
    """The page.

    Args:
        log: a replay.

    Returns:
        The page, to be stored as UTF-8.
    """
    record = log.record
    findings = tuple(sorted(record.findings.values(), key=lambda one: one.since))
    tally = _tally(record)
    t = np.array(record.t)
    learn = np.array(record.learn, dtype=bool)
    span = (float(t[0]), float(t[-1])) if len(t) else (0.0, max(log.duration, 1.0))
    time = drive_time(t, record.gates, learn, findings, log.step, follows=log.task != "lane_keeping")
    states = strips("states", "What could be said, and when", _CAPTION, _states(log, t, learn, span[1]), span)
    estimates = [
        figure
        for name in TASK_INPUTS[log.task]
        if (figure := estimates_over_time(f"live-{name}", record.estimates, name, log.output, span))
        is not None
    ]
    signals = _signals(log, t, span)
    kind, title, says = _verdict(tally, findings, time, log.output)
    return page_parts.render(
        "replay.html.j2",
        [states, *estimates, signals],
        title=title,
        says=says,
        kind=kind,
        log=log,
        standing=[_standing(name, tally, log.output) for name in sorted(tally.statuses)],
        states=states,
        estimates=estimates,
        signals=signals,
        time=signal_text.time(time),
        monitor=[(clock(one.t), _monitor_state(one), estimate_text.misfit(one)) for one in record.monitor],
        findings=findings,
        changes=_changes(record.estimates),
        counts=Counter(event.what for event in record.events).most_common(),
        events=_events(record.events),
        event_count=len(record.events),
        clock=clock,
        provenance=log.provenance,
    )


_CAPTION = (
    "fopdt, armax: the status of each estimator; headline: whose estimate is the one to quote; monitor: do the learned "
    "models still fit; gate: what is learned from, and why not."
)


_TITLES = {
    "identified": "Live, the driver was identified",
    "partly": "Live, the driver was identified in part",
    "nothing": "Live, nothing could be quoted",
}


def _tally(record: ReplayRecord) -> EstimateTally:
    """The last good estimates, without those of the time in which a signal was wrong and nobody knew it."""
    tally = EstimateTally()
    for e in record.estimates:
        tally.put(e)
    reports = [SignalReport(one.raised, (one,)) for one in record.findings.values()]
    for report in reports:
        tally.distrust(report)
    return tally


def _verdict(
    tally: EstimateTally, findings: Sequence[SignalFinding], time: DriveTime, output: str
) -> tuple[str, str, str]:
    """Kind as of `IdentificationVerdict`, title and sentences."""
    headline = tally.last_ok.get(tally.headline)
    used = f"{number(time.usable, 's')} of {number(time.total, 's')} were usable."
    if headline is None:
        wrong = [signal_checks.sentence(one) for one in findings if one.withholds]
        if wrong:
            return "nothing", _TITLES["nothing"], f"{capitalised(wrong[0])}. {used}"
        why = Counter(e.says for e in tally.last.values()).most_common(1)
        reason = why[0][0] if why else "no sample came"
        return "nothing", _TITLES["nothing"], f"At the end: {reason}. {used}"
    known = "; ".join(
        f"{readable(name)}: {said}"
        for name, c in headline.channels.items()
        if (said := identification_verdict.quoted(name, c, output))
    )
    known = capitalised(known)
    missing = estimate_text.all_missing(headline.channels, output)
    whole = all(c.status is Identifiable.OK for c in headline.channels.values())
    kind = ("identified" if whole else "partly") if known else "nothing"
    return (
        kind,
        _TITLES[kind],
        f"{known or 'No number may be quoted'} (last headline estimate, {headline.estimator} at {headline.t:.0f} s). "
        f"{f'{capitalised(missing)}. ' if missing else ''}{used}",
    )


def _standing(name: str, tally: EstimateTally, output: str) -> Standing:
    counts = tally.statuses[name]
    total = sum(counts.values())
    shares = ", ".join(
        f"{readable(status.value)} {100 * n / total:.0f} %"
        for status, n in sorted(counts.items(), key=lambda item: -item[1])
    )
    e = tally.last_ok.get(name)
    if e is None:
        return Standing(name, False, shares, "–", [f"no estimate: {tally.last[name].says}"])
    lines = [estimate_text.channel(channel, ch, output, None) for channel, ch in e.channels.items()]
    fit = f", fit {number(e.fit_percent, '%')} (simulated)" if e.fit_percent == e.fit_percent else ""
    at = f"{e.t:.1f} s, from {number(e.used, 's')} of driving{fit}"
    return Standing(name, name == tally.headline, shares, at, lines)


def _states(log: ReplayedLog, t: Array, learn: Flags, end: float) -> list[Stretch]:
    """A strip per estimator, of the headline, the monitor, findings and the gate."""
    record = log.record
    out: list[Stretch] = []
    for name in sorted({e.estimator for e in record.estimates}, key=lambda one: (one != "fopdt", one)):
        at = [(e.t, readable(e.status.value)) for e in record.estimates if e.estimator == name]
        out += joined(name, at, end)
    out += joined("headline", _headlines(record.estimates), end)
    out += joined("monitor", [(one.t, _monitor_state(one)) for one in record.monitor], end)
    out += [
        Stretch("signals", "finding", one.since, one.until if one.until == one.until else end)
        for one in record.findings.values()
    ]
    findings = tuple(record.findings.values())
    return out + gates.gate_strip(t, record.gates, learn, findings, log.step)


def _monitor_state(report: MonitorReport) -> str:
    if not report.fits:
        return "misfit"
    known = any(block.state is BlockStatus.FITS for block in report.blocks.values())
    return "fits" if known else "learning"


def _headlines(estimates: Sequence[Estimate]) -> list[tuple[float, str]]:
    """Whose estimate carried the headline, over time."""
    at: dict[float, str] = {}
    standing = ""
    for e in estimates:
        if e.headline:
            standing = e.estimator
        elif e.estimator == standing:
            standing = ""
        at[e.t] = standing or "none"
    return list(at.items())


def _changes(estimates: Sequence[Estimate]) -> list[str]:
    """Steps of the gains, each once."""
    return [step_watch.says(e.change) for e in estimates if e.change is not None and e.change.new]


def _signals(log: ReplayedLog, t: Array, span: tuple[float, float]) -> Figure | None:
    record = log.record
    panels = [
        Panel(f"{readable(role)} ({unit(role)})", [_line(t, values, role)], PANEL_PX)
        for role, values in record.signals.items()
        if np.isfinite(values).any()
    ]
    if np.isfinite(record.output).any():
        title = f"{readable(log.output)} ({role_unit(log.output)})"
        panels.append(Panel(title, [_line(t, record.output, log.output)], PANEL_PX))
    if not panels:
        return None
    marks = [event for event in record.events if event.what == "mark"][:MARKS_SHOWN]
    shapes, texts = instants([(event.t, "mark") for event in marks], "before")
    return stack(
        "signals", "Signals", "As sampled, 10 Hz.", panels, span=span, shapes=shapes, annotations=texts
    )


def _line(t: Array, values: Sequence[float], role: str) -> Spec:
    return signal(t, np.array(values), readable(role), "measured", MAX_POINTS, showlegend=False)


def _events(events: Sequence[Event]) -> list[Event]:
    """What is listed: all marks, and the first of the others."""
    if len(events) <= EVENTS_SHOWN:
        return list(events)
    seen: Counter[str] = Counter()
    kept = []
    for event in events:
        seen[event.what] += 1
        if event.what == "mark" or seen[event.what] <= max(EVENTS_SHOWN // 10, 1):
            kept.append(event)
    return kept[: 4 * EVENTS_SHOWN]
