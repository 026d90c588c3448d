"""What the terminal view shows: a value, and how each output of the pipeline and each report changes it."""

from __future__ import annotations

from collections.abc import Mapping
from operator import attrgetter
from typing import Any, NamedTuple

from canid.values.types import (
    DIAGNOSIS,
    Channel,
    Estimate,
    Event,
    MonitorReport,
    Sample,
    SignalFinding,
    SignalReport,
    Status,
)

Item = Sample | Estimate | MonitorReport | SignalReport | Event

# events that are kept: a tall terminal shows as many
EVENTS_KEPT = 12
# s between two points of the trend: finer than a column of the widest plot (5 min on some 80 dots)
TREND_STEP_S = 1.0
# s of the trend that are kept: the last minutes
TREND_SPAN_S = 300.0
# s; a sample so much earlier than the one before it belongs to another pass of a replay
BACKWARDS_S = 1.0


class HealthLine(NamedTuple):
    """One line on the state of a bus, the recorder or the estimators; red where something is wrong."""

    text: str
    wrong: bool = False


class TrendPoint(NamedTuple):
    """The headline estimate at one time."""

    t: float  # s
    channels: Mapping[str, Channel]


class Bus(NamedTuple):
    """One bus of a session, in numbers."""

    name: str
    load: float  # share of the bus's time; NaN: unknown


class Recording(NamedTuple):
    """The recorder of a session, in numbers."""

    state: str  # of `io.recording.recorder_stats.Stats`
    path: str  # "": nothing is recorded
    frames: int  # received
    written: int
    bytes: int
    lag: float  # s from a frame's arrival until it was written; NaN: unknown
    dropped: int  # by buses and disk together
    elapsed: float  # s
    buses: tuple[Bus, ...]


class Replayed(NamedTuple):
    """How far a replay is."""

    t: float  # s of the drive
    duration: float  # s; NaN: not known yet
    paused: bool  # by the page, not by the terminal
    speed: float  # factor of real time


class View(NamedTuple):
    """Everything that the terminal view shows."""

    title: str
    t: float = 0.0
    output: str = "pedal"
    sample: Sample | None = None
    estimates: tuple[Estimate, ...] = ()  # the latest of each estimator
    last_ok: tuple[Estimate, ...] = ()  # the latest "ok" of each estimator
    headlined: str = ""  # estimator of the latest headline estimate
    trend: tuple[TrendPoint, ...] = ()  # of the headline estimate
    lines: tuple[HealthLine, ...] = ()
    events: tuple[Event, ...] = ()
    monitor: MonitorReport | None = None  # the latest of the model monitor
    signals: tuple[SignalFinding, ...] = ()  # that stand
    diagnosis: Event | None = None  # the latest of the drive so far
    truth: tuple[tuple[str, str], ...] = ()  # (channel, known values), in a demonstration
    recording: Recording | None = None
    replayed: Replayed | None = None
    estimating: bool = True  # False: `canid record`, which has no estimators


def update(view: View, item: Item) -> View:
    """Take one output of the pipeline into the view."""
    if isinstance(item, Sample):
        if item.t < view.t - BACKWARDS_S:
            view = _before(view)
        return view._replace(t=item.t, sample=item)
    if isinstance(item, Event):
        if item.what == DIAGNOSIS:
            return view._replace(diagnosis=item)
        return view._replace(events=(*view.events, item)[-EVENTS_KEPT:])
    if isinstance(item, MonitorReport):
        return view._replace(t=max(view.t, item.t), monitor=item)
    if isinstance(item, SignalReport):
        wrong = [finding for finding in item.findings if finding.withholds]
        return view._replace(
            signals=tuple(finding for finding in item.findings if finding.until != finding.until),
            # what was good while a signal was wrong, and nobody knew it yet
            last_ok=tuple(
                e
                for e in view.last_ok
                if not any(finding.since <= e.t <= finding.raised for finding in wrong)
            ),
        )
    others = tuple(e for e in view.estimates if e.estimator != item.estimator)
    view = view._replace(
        t=max(view.t, item.t), estimates=tuple(sorted((*others, item), key=attrgetter("estimator")))
    )
    if item.headline:
        view = view._replace(headlined=item.estimator, trend=_longer(view.trend, item))
    if item.status is Status.OK:
        others = tuple(e for e in view.last_ok if e.estimator != item.estimator)
        view = view._replace(last_ok=(*others, item))
    return view


def with_status(view: View, values: Mapping[str, Any]) -> View:
    """Take the numbers of a session (`ui.cli.live_session.Recorded`) or of a replay into the view.

    Example:
        >>> with_status(View("replay"), {"t": 3.0, "duration": None, "paused": False, "speed": 10.0}).replayed
        Replayed(t=3.0, duration=nan, paused=False, speed=10.0)
    """
    if "duration" in values:
        replayed = Replayed(
            _number(values.get("t")),
            _number(values["duration"]),
            bool(values.get("paused")),
            _number(values.get("speed"), float("inf")),
        )
        return view._replace(replayed=replayed)
    if "state" not in values:
        return view
    recording = Recording(
        state=str(values["state"]),
        path=str(values.get("path") or ""),
        frames=int(values.get("frames", 0)),
        written=int(values.get("written", 0)),
        bytes=int(values.get("bytes", 0)),
        lag=_number(values.get("lag")),
        dropped=int(values.get("drops", 0)) + int(values.get("drops_disk", 0)),
        elapsed=_number(values.get("elapsed")),
        buses=tuple(Bus(str(b["name"]), _number(b.get("load"))) for b in values.get("buses", ())),
    )
    return view._replace(recording=recording)


def frozen(now: View, then: View) -> View:
    """The drive of `then` with the recorder, the buses, the events and the signal findings of `now`."""
    names = ("lines", "events", "signals", "diagnosis", "recording", "replayed")
    live = {name: getattr(now, name) for name in names}
    return then._replace(**live)


def _number(x: Any, unknown: float = float("nan")) -> float:
    return unknown if x is None else float(x)


def _before(view: View) -> View:
    """The view as before the drive; what belongs to the session stays."""
    return View(
        view.title,
        output=view.output,
        lines=view.lines,
        events=view.events,
        truth=view.truth,
        recording=view.recording,
        replayed=view.replayed,
    )


def _longer(trend: tuple[TrendPoint, ...], e: Estimate) -> tuple[TrendPoint, ...]:
    if trend and e.t - trend[-1].t < TREND_STEP_S:
        return trend
    return (*(p for p in trend if p.t > e.t - TREND_SPAN_S), TrendPoint(e.t, e.channels))
