"""Check of a vehicle file against frames: what came for each role, how often, in which range, and what is missing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid import pipeline
from canid.frame_columns import chunks
from canid.signal_checks import signal_checks
from canid.signal_checks.drive_time import drive_time
from canid.types import (
    NAN,
    Array,
    DriveTime,
    Event,
    Frame,
    LearnGate,
    Sample,
    Signal,
    SignalFinding,
    SignalReport,
)
from canid.vehicle import Vehicle, decoder, is_mapped, missing
from canid.vehicle.roles import NEEDS, ROLES

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
    ids: dict[tuple[int, int], int]  # (bus, id) -> frames
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


class Contents(NamedTuple):
    """The ids of a log."""

    frames: dict[tuple[int, int, int], int]  # (bus, id, bytes) -> frames
    duration: float  # s


def contents(frames: Iterable[Frame], on_time: Callable[[float], None] | None = None) -> Contents:
    """Count frames by bus, id and length.

    Example:
        >>> contents([Frame(0.0, 0, 0x123, b"ab"), Frame(0.5, 0, 0x123, b"cd")])
        Contents(frames={(0, 291, 2): 2}, duration=0.5)
    """
    counts: Counter[tuple[int, int, int]] = Counter()
    last = 0.0
    for frame in frames:
        counts[frame.bus, frame.id, len(frame.data)] += 1
        last = max(last, frame.t)
        if on_time is not None:
            on_time(frame.t)
    return Contents(dict(counts), last)


def check(frames: Iterable[Frame], vehicle: Vehicle, on_time: Callable[[float], None] | None = None) -> Check:
    """Run frames through decoding, lead selection and learning gate, and report what came.

    Args:
        frames: of a log or a bus.
        vehicle: from `read_vehicle`.
        on_time: called now and then with the time of the log, s.
    """
    running = pipeline.build(vehicle, estimating=False)
    state = running.init()
    ids: Counter[tuple[int, int]] = Counter()
    values: dict[str, list[Array]] = {}
    points: dict[str, list[Array]] = {"gap": [], "range_rate": []}
    tracks = 0
    at: dict[str, list[Array]] = {}
    chosen: dict[str, list[float]] = {role: [] for role in CHOSEN if vehicle.lead.tracks is not None}
    times: list[float] = []
    learn: list[bool] = []
    judged: list[LearnGate] = []
    reports: list[SignalReport] = []
    events: list[Event] = []
    last = 0.0
    init_decoding, decode = decoder(vehicle)
    decoding = init_decoding()
    for chunk in chunks(frames):
        ids.update(zip(chunk.bus.tolist(), chunk.id.tolist(), strict=True))
        last = max(last, float(chunk.t.max()))
        decoding, decoded = decode(decoding, chunk)
        for role, row, value in decoded.roles:
            values.setdefault(role, []).append(value)
            at.setdefault(role, []).append(chunk.t[row])
            if role in points:
                points[role].append(np.column_stack([chunk.t[row], value]))
        tracks += sum(int(track.valid.sum()) for track in decoded.tracks)
        state, out = running.step(state, chunk)
        for _, item in out:
            if isinstance(item, Sample):
                times.append(item.t)
                learn.append(item.learn)
                judged.append(item.gate)
                for role, sampled in chosen.items():
                    sampled.append(item.signals.get(role, NAN))
            elif isinstance(item, SignalReport):
                reports.append(item)
            elif isinstance(item, Event):
                events.append(item)
        if on_time is not None:
            on_time(last)
    readings = {role: Signal(np.concatenate(at[role]), np.concatenate(values[role])) for role in values}
    rows = tuple(_row(role, vehicle, readings.get(role, NOTHING_READ), last) for role in vehicle.roles)
    grid = np.array(times)
    sampled_roles = {role: Signal(grid, np.array(x)) for role, x in chosen.items() if np.isfinite(x).any()}
    gates = {
        (gate.name.lower() if gate is not LearnGate.OPEN else "driving"): 100 * n / len(judged)
        for gate, n in Counter(judged).most_common()
    }
    problems = list(missing(vehicle, decoding))
    invalid = [row for row in rows if row.readings and row.missing_percent == 100.0]
    says = {
        row.role: f"{row.role}: {row.source} came {row.readings} times, never with a valid value"
        for row in invalid
    }
    problems += [sentence for role, sentence in says.items() if _is_needed(role, vehicle)]
    problems += [event.says for event in events if event.what in ("ambiguous_bus", "ambiguous_source")]
    clock = state.sampler.clock
    if clock.dropped:
        problems.append(f"{clock.dropped} frames go back in time, by up to {clock.worst:.3g} s")
    findings = signal_checks.episodes(reports)
    if not any("range_rate" in one.roles for one in findings):
        problems += _signs(points["gap"], points["range_rate"])
    problems += [signal_checks.sentence(one) for one in findings]
    remarks = list(signal_checks.remarks(state.signals))
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
    follows = vehicle.driver.task != "lane_keeping"
    summed = drive_time(grid, judged, np.array(learn, dtype=bool), findings, pipeline.DT, follows=follows)
    numbers = sum(ids.values()), last, dict(ids)
    return Check(
        *numbers,
        rows,
        gates,
        tuple(problems),
        tuple(remarks),
        summed,
        findings,
        readings | sampled_roles,
        GateSeries(grid, tuple(judged), np.array(learn, dtype=bool)),
        tuple((bus, id_, n) for (bus, id_), n in sorted(ids.items()) if not _maps(vehicle, id_)),
        _left_out(decoding.counters, vehicle),
        tuple(event.t for event in events if event.what == "target_change"),
        vehicle.driver.output,
    )


def _left_out(counters: Mapping[str, int], vehicle: Vehicle) -> dict[str, dict[str, int]]:
    """Why readings of each role have no value; the decoder counts them as "role: why"."""
    found: dict[str, dict[str, int]] = {}
    for what, n in sorted(counters.items()):
        role, _, why = what.partition(": ")
        if role in vehicle.roles and why:
            found.setdefault(role, {})[why] = n
    return found


def _is_needed(role: str, vehicle: Vehicle) -> bool:
    """Whether a task goes wrong where a role is mapped and never measured: its inputs and output, and all switches."""
    driver = vehicle.driver
    return role in (*NEEDS[driver.task], driver.output, "speed") or ROLES[role].kind == "bool"


def _maps(vehicle: Vehicle, id_: int) -> bool:
    """Whether a vehicle maps something of the frames with an id, of 11 or 29 bits."""
    return is_mapped(vehicle, id_, extended=True) or is_mapped(vehicle, id_, extended=False)


def _row(role: str, vehicle: Vehicle, readings: Signal, duration: float) -> Row:
    how = vehicle.roles[role]
    bus = "" if how.bus is None else f", bus {how.bus}"
    source = f"{how.message}.{how.signal} (0x{how.id:X}{bus})"
    array = readings.value
    known = array[np.isfinite(array)]
    low, median, high = np.percentile(known, [0, 50, 100]) if known.size else (NAN, NAN, NAN)
    lost = 100.0 * (1 - known.size / array.size) if array.size else NAN
    rate = array.size / duration if duration else NAN
    longest, stale = _gaps(readings.t, duration, how.stale)
    numbers = float(low), float(median), float(high)
    return Row(role, how.unit, source, array.size, rate, lost, *numbers, longest, stale)


def _gaps(t: Array, duration: float, allowed: float) -> tuple[float, float]:
    """Longest time without a reading, s, and the share of the time in which the latest was too old, %.

    Args:
        t: (n,) s, of the readings.
        duration: s, of the log.
        allowed: s, the age from which on a reading no longer counts.

    Example:
        >>> _gaps(np.array([0.0, 1.0, 4.0]), 4.0, 1.0)
        (3.0, 50.0)
    """
    if not t.size or duration <= 0.0:
        return (duration, 100.0) if duration > 0.0 else (NAN, NAN)
    gaps = np.diff(np.concatenate([[0.0], np.maximum.accumulate(t), [max(duration, float(t.max()))]]))
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
