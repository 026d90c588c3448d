"""Check of a vehicle file against frames: what came for each role, how often, in which range, and what is missing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.analysis.drive import identification_verdict
from canid.analysis.drive.drive_parameters import whole_drive
from canid.analysis.drive.recorded_time import RecordedTime
from canid.analysis.drive.signal_columns import NO_DATA
from canid.models.pipeline import pipeline
from canid.signals.samples import session_clock, trace_assembly
from canid.signals.signal_checks import signal_checks
from canid.signals.signal_checks.drive_time import of_trace, too_short
from canid.signals.signal_checks.output_scale import OutputScale, output_scale
from canid.signals.vehicle import Vehicle, is_mapped, missing
from canid.values.roles import NEEDS, ROLES
from canid.values.types import (
    NAN,
    Array,
    Columns,
    DriveTime,
    Event,
    Flag,
    LearnGate,
    Sample,
    Signal,
    SignalFinding,
    SignalReport,
    Trace,
)

# correlation of range rate and change of the gap below which the sign of range rate is reported as wrong
WRONG_SIGN_CORRELATION = -0.5
# s over which the change of the gap is taken: a radar's quantisation of 0.1 m is small in it
GAP_CHANGE_S = 1.0
# changes of the gap that are needed for a judgement
MIN_GAP_CHANGES = 20
# m/s; a gap that changes faster is that of another vehicle, or of a standing one
MAX_GAP_RATE = 15.0
# roles that are sampled, not read, where the lead is chosen among radar tracks
CHOSEN = ("gap", "range_rate")
NOTHING_READ = Signal(np.zeros(0), np.zeros(0))


class Row(NamedTuple):
    """One role."""

    role: str
    unit: str
    source: str  # "MESSAGE.SIGNAL (0x123, bus 0)"
    readings: int
    rate: float  # 1/s
    missing_percent: float  # readings that were NaN
    low: float
    median: float
    high: float
    longest_gap: float = NAN  # s between two readings, from the beginning and to the end of the log
    stale_percent: float = NAN  # of the time in which the latest reading was older than the role allows


class GateSeries(NamedTuple):
    """The learning gate over time."""

    t: Array  # (n,) s
    gate: tuple[LearnGate, ...]  # (n,)
    learn: npt.NDArray[np.bool_]  # (n,)


class Check(NamedTuple):
    """Result of a check. Problems are sentences that say what to do; without any, the vehicle file fits."""

    frames: int
    duration: float  # s
    ids: dict[tuple[int, int], int]  # (bus, id) -> data frames
    rows: tuple[Row, ...]
    gates: dict[str, float]  # gate -> share of the time, %
    problems: tuple[str, ...]
    remarks: tuple[str, ...]
    time: DriveTime = DriveTime(0.0, 0.0, 0.0, 0.0)
    findings: tuple[SignalFinding, ...] = ()  # on the signals; problems as well
    # role -> its readings as they came; of a lead that is chosen among radar tracks its gap and range rate as sampled
    signals: Mapping[str, Signal] = {}
    gate: GateSeries = GateSeries(np.zeros(0), (), np.zeros(0, dtype=bool))
    unmapped: tuple[tuple[int, int, int], ...] = ()  # (bus, id, frames) that the vehicle file does not name
    left_out: Mapping[str, Mapping[str, int]] = {}  # role -> why a reading has no value -> how often
    lead_changes: tuple[float, ...] = ()  # s, when another vehicle ahead was followed
    output: str = ""  # role that the driver acts by
    output_scale: OutputScale | None = None  # of a pedal, as `identify` judges it
    apart: Mapping[str, int] = {}  # "error", "remote" -> frames, which are in `frames` and in no id
    paused: float = 0.0  # s of `duration` in which no frame came; rates and shares are those of the rest


class Contents(NamedTuple):
    """The ids of a log."""

    frames: dict[tuple[int, int, int], int]  # (bus, id, bytes) -> data frames
    duration: float  # s
    apart: Mapping[str, int] = {}  # "error", "remote" -> frames, whose id is that of no message
    paused: float = 0.0  # s of `duration` in which no frame came


def contents(chunks: Iterable[Columns], on_time: Callable[[float], None] | None = None) -> Contents:
    """Count data frames by bus, id and length, and error and remote frames apart.

    Example:
        >>> from canid.values.frame_columns import columns_of
        >>> from canid.values.types import Frame
        >>> contents([columns_of([Frame(0.0, 0, 0x123, b"ab"), Frame(0.5, 0, 0x123, b"cd")])])
        Contents(frames={(0, 291, 2): 2}, duration=0.5, apart={}, paused=0.0)
    """
    counts: Counter[tuple[int, int, int]] = Counter()
    apart: Counter[str] = Counter()
    clock, span = session_clock.init(), RecordedTime()
    for chunk in chunks:
        counts.update(_counted(chunk))
        apart.update(_apart(chunk))
        clock, timed = session_clock.step(clock, chunk)
        span = span.after(timed.frames.t)
        if on_time is not None:
            on_time(max(0.0, span.last))
    return Contents(dict(counts), span.duration, dict(apart), span.paused)


def _apart(chunk: Columns) -> dict[str, int]:
    """Frames that are no message's: an error frame's id is the error's class, a remote frame asks for another's data."""
    error, remote = (chunk.flags & int(flag) != 0 for flag in (Flag.ERROR, Flag.REMOTE))
    counts = {"error": int(error.sum()), "remote": int((remote & ~error).sum())}
    return {kind: n for kind, n in counts.items() if n}


def _counted(chunk: Columns) -> Counter[tuple[int, int, int]]:
    """How often each bus, id and length come together in data frames."""
    rows = chunk.flags & NO_DATA == 0
    bus, id_, length = chunk.bus[rows], chunk.id[rows], chunk.length[rows]
    keys = (
        bus.astype(np.uint64) << np.uint64(40)
        | id_.astype(np.uint64) << np.uint64(8)
        | length.astype(np.uint64)
    )
    distinct, counts = np.unique(keys, return_counts=True)
    return Counter(
        {
            (key >> 40, key >> 8 & 0xFFFFFFFF, key & 0xFF): n
            for key, n in zip(distinct.tolist(), counts.tolist(), strict=True)
        }
    )


def check(
    chunks: Iterable[Columns],
    vehicle: Vehicle,
    on_time: Callable[[float], None] | None = None,
    *,
    whole: bool = True,
) -> Check:
    """Run frames through decoding, lead selection and learning gate, and report what came.

    Args:
        chunks: the frames of a log or a bus.
        vehicle: from `read_vehicle`.
        on_time: called now and then with the time of the log, s.
        whole: they are those of a log; False: of a bus for some seconds, which may be too few for an estimate.
    """
    running = pipeline.build(vehicle, estimating=False)
    state = running.init()
    ids: Counter[tuple[int, int]] = Counter()
    apart: Counter[str] = Counter()
    values: dict[str, list[Array]] = {}
    points: dict[str, list[Array]] = {"gap": [], "range_rate": []}
    tracks = in_path = 0
    at: dict[str, list[Array]] = {}
    samples: list[Sample] = []
    reports: list[SignalReport] = []
    events: list[Event] = []
    # a log's times are those since its first frame, a bus is listened to from 0 on
    span = RecordedTime()
    for chunk in chunks:
        for key, n in _counted(chunk).items():
            ids[key[:2]] += n
        apart.update(_apart(chunk))
        state, out, decoded, t = running.decoded(state, chunk)
        span = span.after(t)
        for role, row, value in decoded.roles:
            values.setdefault(role, []).append(value)
            at.setdefault(role, []).append(t[row])
            if role in points:
                points[role].append(np.column_stack([t[row], value]))
        for track in decoded.tracks:
            tracks += int(track.valid.sum())
            in_path += int((track.valid & (np.abs(track.lateral) <= vehicle.lead.in_path)).sum())
        for _, item in out:
            if isinstance(item, Sample):
                samples.append(item)
            elif isinstance(item, SignalReport):
                reports.append(item)
            elif isinstance(item, Event):
                events.append(item)
        if on_time is not None:
            on_time(max(0.0, span.last))
    readings = {role: Signal(np.concatenate(at[role]), np.concatenate(values[role])) for role in values}
    rows = tuple(_row(role, vehicle, readings.get(role, NOTHING_READ), span) for role in vehicle.roles)
    findings = signal_checks.episodes(reports)
    trace = trace_assembly.trace(samples, vehicle.driver, pipeline.DT)._replace(findings=findings)
    sampled_roles = {
        role: Signal(trace.t, trace.signals[role])
        for role in CHOSEN
        if vehicle.lead.tracks is not None and np.isfinite(trace.signals.get(role, NAN)).any()
    }
    judged = trace.gate
    gates = {
        (gate.name.lower() if gate is not LearnGate.OPEN else "driving"): 100 * n / len(judged)
        for gate, n in Counter(judged).most_common()
    }
    decoding = state.sampler.decoding
    problems = list(missing(vehicle, decoding))
    invalid = [row for row in rows if row.readings and row.missing_percent == 100.0]
    says = {
        row.role: f"{row.role}: {row.source} came {row.readings} times, never with a valid value"
        for row in invalid
    }
    problems += [sentence for role, sentence in says.items() if _is_needed(role, vehicle)]
    problems += [event.says for event in events if event.what in ("ambiguous_bus", "ambiguous_source")]
    back = session_clock.back_in_time(state.sampler.clock)
    problems += [back] if back else []
    if not any("range_rate" in finding.roles for finding in findings):
        problems += _signs(points["gap"], points["range_rate"])
    problems += [signal_checks.sentence(finding) for finding in findings]
    remarks = list(signal_checks.remarks(state.signals))
    remarks += [event.says for event in events if event.what == "clock_step"]
    remarks += [f"{what}: {n} times" for what, n in sorted(decoding.counters.items())]
    task = vehicle.driver.task.replace("_", " ")
    remarks += [
        f"{sentence}; {task} does not need it"
        for role, sentence in says.items()
        if not _is_needed(role, vehicle)
    ]
    if vehicle.lead.tracks is not None:
        changes = sum(event.what == "target_change" for event in events)
        remarks.append(f"radar: {tracks} valid track reports; the lead changed {changes} times")
    summed = of_trace(trace)
    scale = output_scale(trace.output, trace.dt, trace.full_scale, findings)
    if scale is not None and scale.confirmed:
        remarks.append(scale.says)
    if not problems:
        problems += _unused(vehicle, summed, gates, tracks, in_path, whole=whole)
    if not problems and whole:
        problems += _withheld(trace, vehicle)
    numbers = sum(ids.values()) + sum(apart.values()), span.duration, dict(ids)
    return Check(
        *numbers,
        rows,
        gates,
        tuple(problems),
        tuple(remarks),
        summed,
        findings,
        readings | sampled_roles,
        GateSeries(trace.t, judged, trace.learn),
        tuple((bus, id_, n) for (bus, id_), n in sorted(ids.items()) if not _maps(vehicle, id_)),
        _left_out(decoding.counters, vehicle),
        tuple(event.t for event in events if event.what == "target_change"),
        vehicle.driver.output,
        scale,
        dict(apart),
        span.paused,
    )


def _withheld(trace: Trace, vehicle: Vehicle) -> list[str]:
    """Why `identify` would quote nothing of this log: the same fit of the whole drive, but for the driver's causes."""
    identified = whole_drive(trace, **vehicle.estimators)
    if identification_verdict.verdict(identified, vehicle.driver.output).identifiable:
        return []
    why = identification_verdict.why_nothing(identified, vehicle.driver.output)
    return [
        f"nothing may be quoted of this log, so it does not show whether the file fits: {why.rstrip('.')}"
    ]


def _unused(
    vehicle: Vehicle, time: DriveTime, gates: Mapping[str, float], tracks: int, in_path: int, *, whole: bool
) -> list[str]:
    """Why nothing can be estimated from a log on which every role came: such a log does not show that the file fits."""
    short = too_short(time) if whole else ""
    if short:
        return [f"{short}: the log does not show whether the file fits"]
    if time.usable > 0.0:
        return []
    if time.driving > 0.0 and time.behind_lead == 0.0 and tracks:
        side = any(track.has_side for track in vehicle.lead.tracks or ())
        where = f", {in_path:,} of them within {vehicle.lead.in_path:g} m of the own path" if side else ""
        return [
            f"lead: {tracks:,} valid track reports{where}, and none became the vehicle ahead: "
            "check the unit, sign and scale of lead.distance, lead.rate and lead.lateral or lead.angle"
        ]
    if time.driving > 0.0 and time.behind_lead == 0.0:
        return [
            f"no vehicle ahead in {time.total:.0f} s: nothing can be estimated from this log, and it does not show whether "
            "gap and range rate fit; drive behind one"
        ]
    most = max(gates.items(), key=lambda item: item[1])[0].replace("_", " ") if gates else "nothing"
    return [
        f"nothing can be estimated from these {time.total:.0f} s, most of which the learning gate excludes ({most}): the "
        "log does not show whether the file fits"
    ]


def _left_out(counters: Mapping[str, int], vehicle: Vehicle) -> dict[str, dict[str, int]]:
    """Why readings of each role have no value; the decoder counts them as "role: why"."""
    left_out: dict[str, dict[str, int]] = {}
    for what, n in sorted(counters.items()):
        role, _, why = what.partition(": ")
        if role in vehicle.roles and why:
            left_out.setdefault(role, {})[why] = n
    return left_out


def _is_needed(role: str, vehicle: Vehicle) -> bool:
    """Whether a task goes wrong where a role is mapped and never measured: its inputs and output, and all switches."""
    driver = vehicle.driver
    return role in (*NEEDS[driver.task], driver.output, "speed") or ROLES[role].kind == "bool"


def _maps(vehicle: Vehicle, id_: int) -> bool:
    """Whether a vehicle maps something of the frames with an id, of 11 or 29 bits."""
    return is_mapped(vehicle, id_, extended=True) or is_mapped(vehicle, id_, extended=False)


def _row(role: str, vehicle: Vehicle, readings: Signal, span: RecordedTime) -> Row:
    how = vehicle.roles[role]
    array = readings.value
    known = array[np.isfinite(array)]
    low, median, high = np.percentile(known, [0, 50, 100]) if known.size else (NAN, NAN, NAN)
    lost = 100.0 * (1 - known.size / array.size) if array.size else NAN
    rate = span.rate(array.size)
    longest, _ = _gaps(readings.t, (span.first, span.last), how.stale)
    # of a silent log no role is to blame
    begin, end = span.without_pauses(np.array([span.first, span.last])).tolist()
    _, stale = _gaps(span.without_pauses(readings.t), (begin, end), how.stale)
    numbers = float(low), float(median), float(high)
    return Row(role, how.unit, how.where, array.size, rate, lost, *numbers, longest, stale)


def _gaps(t: Array, span: tuple[float, float], allowed: float) -> tuple[float, float]:
    """Longest time without a reading, s, and the share of the time in which the latest was too old, %.

    Args:
        t: (n,) s, of the readings.
        span: s, of the log's earliest and latest frame.
        allowed: s, the age from which on a reading no longer counts.

    Example:
        >>> _gaps(np.array([0.0, 1.0, 4.0]), (0.0, 4.0), 1.0)
        (3.0, 50.0)
    """
    begin, end = span
    duration = end - begin
    if not t.size or duration <= 0.0:
        return (duration, 100.0) if duration > 0.0 else (NAN, NAN)
    gaps = np.diff(np.concatenate([[begin], np.sort(t), [max(end, float(t.max()))]]))
    return float(gaps.max()), 100.0 * float(np.maximum(gaps - allowed, 0.0).sum()) / duration


def _signs(gap: list[Array], rate: list[Array]) -> list[str]:
    """The sign of range rate, which must be positive where the gap grows: the commonest wrong sign in vehicle files.

    Uses the readings as they came: smoothing treats both as consistent already.
    """
    g, r = (np.concatenate([np.zeros((0, 2)), *parts]) for parts in (gap, rate))
    g, r = g[np.isfinite(g[:, 1])], r[np.isfinite(r[:, 1])]
    if len(g) < 2 or len(r) < 2:
        return []
    start = np.arange(max(g[0, 0], r[0, 0]), min(g[-1, 0], r[-1, 0]) - GAP_CHANGE_S, GAP_CHANGE_S)
    grown = np.interp(start + GAP_CHANGE_S, g[:, 0], g[:, 1]) - np.interp(start, g[:, 0], g[:, 1])
    predicted = np.interp(start + GAP_CHANGE_S / 2, r[:, 0], r[:, 1]) * GAP_CHANGE_S
    # where the vehicle ahead changes or disappears, the gap jumps
    known = np.abs(grown) < MAX_GAP_RATE * GAP_CHANGE_S
    grown, predicted = grown[known], predicted[known]
    if len(grown) < MIN_GAP_CHANGES or np.std(grown) == 0 or np.std(predicted) == 0:
        return []
    if np.corrcoef(grown, predicted)[0, 1] < WRONG_SIGN_CORRELATION:
        return ["range_rate: its sign contradicts d(gap)/dt; positive must be opening (set scale = -1)"]
    return []
