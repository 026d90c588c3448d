"""A replayed log as one self-contained HTML page: the live estimates over the drive, the monitor, findings and events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from canid.mathematics.estimators import step_watch
from canid.signals.signal_checks import signal_checks
from canid.signals.signal_checks.drive_time import Flags, drive_time
from canid.ui.views import signal_text
from canid.ui.views.document import document as doc
from canid.ui.views.document.document_page import page as html
from canid.ui.views.drawing.figure import Figure, Spec
from canid.ui.views.drawing.panels import Panel, instants, signal, stack, titled
from canid.ui.views.drive_report import gates
from canid.ui.views.drive_report.estimates_over_time import estimates_over_time
from canid.ui.views.drive_report.replay_record import ReplayRecord
from canid.ui.views.drive_report.strips import Stretch, joined, strips
from canid.ui.views.end_summary import EstimateTally, answer, by_estimator
from canid.values.text import estimate_text
from canid.values.text.names import capitalised, method, readable
from canid.values.text.numbers import clock, number, role_unit
from canid.values.types import (
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

# points of a line
MAX_POINTS = 4000
# events that are listed; of more, the first of each kind and a count
EVENTS_SHOWN = 60
# reports of the monitor that are listed
REPORTS_SHOWN = 60
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
    source: doc.Source


def page(log: ReplayedLog) -> str:
    """The page, to be stored as UTF-8."""
    record = log.record
    findings = tuple(sorted(record.findings.values(), key=lambda finding: finding.since))
    tally = _tally(record)
    t = np.array(record.t)
    learn = np.array(record.learn, dtype=bool)
    span = (float(t[0]), float(t[-1])) if len(t) else (0.0, max(log.duration, 1.0))
    time = drive_time(t, record.gates, learn, findings, log.step, follows=log.task != "lane_keeping")
    states = strips("states", "What could be said, and when", _CAPTION, _states(log, t, learn, span[1]), span)
    drawn = [
        estimates_over_time(f"live-{name}", record.estimates, name, log.output, span)
        for name in TASK_INPUTS[log.task]
    ]
    # steps of the gains, each once
    changes = [step_watch.says(e.change) for e in record.estimates if e.change is not None and e.change.new]
    known: list[doc.Block] = [*by_estimator(tally, log.output)] or ["No estimate came."]
    sections = [
        doc.Section("estimates", "Estimates", [*known, doc.Listing(changes), states, *drawn]),
        doc.Section("monitor", "Monitor and findings", [_monitor(record.monitor), gates.findings(findings)]),
        doc.Section("signals", "Signals", [f"{signal_text.time(time)}.", _signals(log, t, span)]),
        doc.Section("events", "Events and marks", _events(record.events), "Events"),
    ]
    kind, title, says = _verdict(tally, findings, time, log.output)
    return html(doc.Document("canid replay", kind, title, [says], sections, log.source, "Replay"))


_CAPTION = (
    "FOPDT, ARMAX: the status of each estimator; headline: whose estimate is the one to quote; monitor: do the learned "
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
    reports = [SignalReport(finding.raised, (finding,)) for finding in record.findings.values()]
    for item in chain[Estimate | SignalReport](record.estimates, reports):
        tally.put(item)
    return tally


def _verdict(
    tally: EstimateTally, findings: Sequence[SignalFinding], time: DriveTime, output: str
) -> tuple[str, str, str]:
    """Kind as of `IdentificationVerdict`, title and sentences."""
    headline = tally.last_ok.get(tally.headline)
    used = f"{number(time.usable, 's')} of {number(time.total, 's')} were usable."
    if headline is None:
        wrong = [signal_checks.sentence(finding) for finding in findings if finding.withholds]
        if wrong:
            return "nothing", _TITLES["nothing"], f"{capitalised(wrong[0])}. {used}"
        why = Counter(e.says for e in tally.last.values()).most_common(1)
        reason = why[0][0] if why else "no sample came"
        return "nothing", _TITLES["nothing"], f"At the end: {reason}. {used}"
    known = answer(tally, output)
    missing = estimate_text.all_missing(headline.channels, output)
    last = f"last headline estimate, {method(headline.estimator)} at {headline.t:.0f} s"
    whole = all(c.status is Identifiable.OK for c in headline.channels.values())
    kind = ("identified" if whole else "partly") if known else "nothing"
    return (
        kind,
        _TITLES[kind],
        f"{known or f'No number may be quoted ({last}).'} "
        f"{f'{capitalised(missing)}. ' if missing else ''}{used}",
    )


def _states(log: ReplayedLog, t: Array, learn: Flags, end: float) -> list[Stretch]:
    """A strip per estimator, of the headline, the monitor, findings and the gate."""
    record = log.record
    out: list[Stretch] = []
    for name in sorted(
        {e.estimator for e in record.estimates}, key=lambda estimator: (estimator != "fopdt", estimator)
    ):
        at = [(e.t, readable(e.status.value)) for e in record.estimates if e.estimator == name]
        out += joined(method(name), at, end)
    out += joined("headline", _headlines(record.estimates), end)
    out += joined("monitor", [(report.t, _monitor_state(report)) for report in record.monitor], end)
    out += [
        Stretch("signals", "finding", finding.since, finding.until if finding.until == finding.until else end)
        for finding in record.findings.values()
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
        at[e.t] = method(standing) or "none"
    return list(at.items())


def _monitor(reports: Sequence[MonitorReport]) -> doc.Table | str:
    """A row where the monitor's answer changed."""
    marks = {"fits": "✓ fits", "misfit": "✗ misfit"}
    rows = [
        (
            clock(report.t),
            marks.get(_monitor_state(report), _monitor_state(report)),
            estimate_text.misfit(report),
        )
        for report in reports
    ]
    more = len(rows) - REPORTS_SHOWN
    return (
        doc.Table(
            (">time", "state", "report"),
            rows[:REPORTS_SHOWN],
            caption="The monitor: do the learned models still predict the data? A row where its answer changed.",
            notes=[f"{more} more changes are not listed."] if more > 0 else [],
        )
        if rows
        else "The monitor gave no report: nothing was learned."
    )


def _signals(log: ReplayedLog, t: Array, span: tuple[float, float]) -> Figure | None:
    record = log.record
    panels = [
        Panel(titled(role, role_unit(role)), [_line(t, values, role)], PANEL_PX)
        for role, values in record.signals.items()
        if np.isfinite(values).any()
    ]
    if np.isfinite(record.output).any():
        panels.append(
            Panel(titled(log.output, role_unit(log.output)), [_line(t, record.output, log.output)], PANEL_PX)
        )
    if not panels:
        return None
    marks = [event for event in record.events if event.what == "mark"][:MARKS_SHOWN]
    shapes, texts = instants([(event.t, "mark") for event in marks], "before")
    return stack(
        "signals", "Signals", "As sampled, 10 Hz.", panels, span=span, shapes=shapes, annotations=texts
    )


def _line(t: Array, values: Sequence[float], role: str) -> Spec:
    return signal(t, np.array(values), readable(role), "measured", MAX_POINTS, showlegend=False)


def _events(events: Sequence[Event]) -> list[doc.Block]:
    """How many of each kind; all marks, and the first of the others."""
    seen: Counter[str] = Counter()
    kept = []
    for event in events:
        seen[event.what] += 1
        few = len(events) <= EVENTS_SHOWN or seen[event.what] <= max(EVENTS_SHOWN // 10, 1)
        if event.what == "mark" or few:
            kept.append(event)
    kept = kept[: 4 * EVENTS_SHOWN]
    if not kept:
        return ["None."]
    counts = ", ".join(f"{readable(what)}: {n}" for what, n in seen.most_common())
    less = " The list has all marks and the first of the others." * (len(kept) < len(events))
    table = doc.Table(
        (">time", "event", "what happened"), [(clock(e.t), readable(e.what), e.says) for e in kept]
    )
    return [f"{counts}.{less}", table if len(kept) <= 12 else doc.Fold(f"{len(kept)} events", [table])]
