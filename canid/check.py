"""Does a vehicle file fit these frames: what came for each role, how often, in which range, and what is missing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from canid import pipeline
from canid.types import NAN, Event, Frame, Gate, Reading, Sample, TrackReading
from canid.vehicle import Vehicle, decoder, missing

# share of samples in which the lead moves the gap other than its range rate says, before the sign is doubted
DOUBT = -0.5
# s over which the gap's growth is taken: a radar's quantisation of 0.1 m is small in it
OVER = 1.0
# m/s; a gap that changes faster belongs to two vehicles, or to one that stands
FASTEST = 15.0


class Point(NamedTuple):
    """One reading."""

    t: float  # s
    value: float


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


class Check(NamedTuple):
    """The whole answer. Problems are sentences that say what to do; without any, the vehicle file fits."""

    frames: int
    duration: float  # s
    ids: dict[tuple[int, int], int]  # (bus, id) -> frames
    rows: tuple[Row, ...]
    gates: dict[str, float]  # gate -> share of the time, %
    problems: tuple[str, ...]
    remarks: tuple[str, ...]


class Contents(NamedTuple):
    """What frames there are, whatever they mean."""

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
    """Run frames through decoding, lead and gate, and tell what came.

    Args:
        frames: of a log or a bus.
        vehicle: from `read_vehicle`.
        on_time: called now and then with the time of the log.
    """
    running = pipeline.build(vehicle, estimating=False)
    state = running.init()
    decode_init, decode = decoder(vehicle)
    decoded = decode_init()
    ids: Counter[tuple[int, int]] = Counter()
    values: dict[str, list[float]] = {}
    points: dict[str, list[Point]] = {"gap": [], "range_rate": []}
    tracks = 0
    samples: list[Sample] = []
    events: list[Event] = []
    last = 0.0
    for frame in frames:
        ids[frame.bus, frame.id] += 1
        last = max(last, frame.t)
        decoded, readings = decode(decoded, frame)
        for reading in readings:
            if isinstance(reading, Reading):
                values.setdefault(reading.role, []).append(reading.value)
                if reading.role in points:
                    points[reading.role].append(Point(reading.t, reading.value))
            elif isinstance(reading, TrackReading):
                tracks += reading.valid
        state, out = running.step(state, frame)
        if out and on_time is not None:
            on_time(frame.t)
        samples += [item for item in out if isinstance(item, Sample)]
        events += [item for item in out if isinstance(item, Event)]
    rows = tuple(_row(role, vehicle, values.get(role, []), last) for role in vehicle.roles)
    shares = Counter(sample.gate for sample in samples)
    gates = {
        (gate.name.lower() if gate is not Gate.OPEN else "driving"): 100 * n / len(samples)
        for gate, n in shares.most_common()
    }
    problems = list(missing(vehicle, decoded))
    problems += [
        f"{row.role}: {row.source} came {row.readings} times and never held a value"
        for row in rows
        if row.readings and row.missing_percent == 100.0
    ]
    problems += [event.says for event in events if event.what == "ambiguous_bus"]
    if state.clock.dropped:
        problems.append(f"{state.clock.dropped} frames go back in time, by up to {state.clock.worst:.3g} s")
    problems += _signs(points["gap"], points["range_rate"])
    remarks = [f"{what}: {n} times" for what, n in sorted(decoded.counters.items())]
    if vehicle.lead.tracks is not None:
        changes = sum(event.what == "target_change" for event in events)
        remarks.append(f"radar: {tracks} valid track reports; the lead changed {changes} times")
    return Check(sum(ids.values()), last, dict(ids), rows, gates, tuple(problems), tuple(remarks))


def _row(role: str, vehicle: Vehicle, values: list[float], duration: float) -> Row:
    how = vehicle.roles[role]
    bus = "" if how.bus is None else f", bus {how.bus}"
    source = f"{how.message}.{how.signal} (0x{how.id:X}{bus})"
    array = np.array(values)
    known = array[np.isfinite(array)]
    low, median, high = np.percentile(known, [0, 50, 100]) if known.size else (NAN, NAN, NAN)
    lost = 100.0 * (1 - known.size / array.size) if array.size else NAN
    rate = array.size / duration if duration else NAN
    return Row(role, how.unit, source, array.size, rate, lost, float(low), float(median), float(high))


def _signs(gap: Sequence[Point], rate: Sequence[Point]) -> list[str]:
    """The gap must grow where range rate is positive: the commonest wrong sign in vehicle files.

    Judged on the readings as they came: smoothing has taken both for consistent already.
    """
    g = np.array([point for point in gap if np.isfinite(point.value)]).reshape(-1, 2)
    r = np.array([point for point in rate if np.isfinite(point.value)]).reshape(-1, 2)
    if len(g) < 2 or len(r) < 2:
        return []
    begin = np.arange(max(g[0, 0], r[0, 0]), min(g[-1, 0], r[-1, 0]) - OVER, OVER)
    grown = np.interp(begin + OVER, g[:, 0], g[:, 1]) - np.interp(begin, g[:, 0], g[:, 1])
    said = np.interp(begin + OVER / 2, r[:, 0], r[:, 1]) * OVER
    # another vehicle ahead, or none for a while: the gap jumps
    known = np.abs(grown) < FASTEST * OVER
    grown, said = grown[known], said[known]
    if len(grown) < 20 or np.std(grown) == 0 or np.std(said) == 0:
        return []
    if np.corrcoef(grown, said)[0, 1] < DOUBT:
        return ["range_rate: its sign contradicts d(gap)/dt; positive must be opening (set scale = -1)"]
    return []
