"""However frames are divided into chunks, the pipeline gives the same outputs to the last bit."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.analysis.drive import drive_reader
from canid.io.logs import open_log, write_log
from canid.models.pipeline import pipeline
from canid.signals.samples import trace_assembly
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.frame_columns import columns_of
from canid.values.types import Estimate, Event, Flag, Frame, Sample
from canid.values.window import Window
from tests.exact import exact
from tests.fixtures.measured_logs import MEASURED, MISSING

REPO = Path(__file__).parents[2]
LOGS = REPO / "replay_logs"


def outputs(
    frames: list[Frame], vehicle: Vehicle, sizes: Iterable[int], estimating: bool = False
) -> tuple[list[str], list[pipeline.Output], pipeline.State]:
    """Everything that the pipeline puts out for chunks of these sizes, each with the time of its frame."""
    running = pipeline.build(vehicle, estimating=estimating)
    state, rows, items, k = running.init(), [], [], 0
    for size in sizes:
        part = frames[k : k + size]
        if not part:
            break
        state, out = running.step(state, columns_of(part))
        # repr: NaN is NaN, -0.0 is not 0.0, and a numpy number is no float
        rows += [exact((part[row].t, item)) for row, item in out]
        items += [item for _, item in out]
        k += len(part)
    return rows, items, state


def forever(size: int) -> Iterable[int]:
    while True:
        yield size


def drawn(rng: random.Random, sizes: tuple[int, ...]) -> Iterable[int]:
    while True:
        yield rng.choice(sizes)


def check_same(
    frames: list[Frame], vehicle: Vehicle, seed: int, *, estimating: bool = False
) -> list[pipeline.Output]:
    """Outputs, their order, the frame that completed each, and what decoding and clock have counted."""
    rows, items, state = outputs(frames, vehicle, forever(len(frames)), estimating)
    rng = random.Random(seed)
    for sizes in ((1, 1, 2, 3, 11, 12, 50, 200), (200, 1000, 4096)):
        other, _, other_state = outputs(frames, vehicle, drawn(rng, sizes), estimating)
        assert other == rows, seed
        assert other_state.sampler.clock == state.sampler.clock
        assert other_state.sampler.decoding == state.sampler.decoding
        assert exact(pipeline.known(other_state)) == exact(pipeline.known(state))
    return items


def shifted(after: float, by: float) -> Callable[[Frame], Frame]:
    return lambda frame: frame._replace(t=frame.t + by if frame.t > after else frame.t)


def spoilt(kind: str, frames: list[Frame]) -> Iterable[Frame]:
    """Everything that clocks, buses and loggers do to a log."""
    rng = random.Random(kind)
    if kind == "clock set back":
        return map(shifted(10.0, -7.0), frames)
    if kind == "counter wraps":
        return map(shifted(10.0, -65.536), frames)
    if kind == "clock set ahead":
        return map(shifted(10.0, 5000.0), frames)
    if kind == "long pause":
        return [frame for frame in frames if not 8.0 < frame.t < 21.0]
    if kind == "short pause":
        return [frame for frame in frames if not 8.0 < frame.t < 14.5]
    if kind == "reordered":
        jittered = [frame._replace(t=max(frame.t + rng.uniform(-0.03, 0.03), 0.0)) for frame in frames]
        # as they were received, not as they are stamped
        return [frames[0], *jittered[1:]]
    if kind == "far out of order":
        return [f._replace(t=f.t - 0.5) if rng.random() < 0.01 and f.t > 1 else f for f in frames]
    if kind == "radar lost":
        return [frame for frame in frames if frame.id != 0x130 or int(frame.t / 2.7) % 3]
    if kind == "bursts":
        return [frame._replace(t=int(frame.t * 4) / 4) for frame in frames]
    if kind == "a second bus":
        echo = [frame._replace(bus=1) for frame in frames[300:] if frame.id in (0x110, 0x130)]
        return sorted([*frames, *echo], key=lambda frame: frame.t)
    if kind == "cut, remote and error frames":
        flags = (0, 0, 0, int(Flag.REMOTE), int(Flag.ERROR))
        cut = [f._replace(data=f.data[: rng.choice((8, 8, 2))], flags=rng.choice(flags)) for f in frames]
        return [f._replace(data=b"", length=0) if f.flags & Flag.REMOTE else f for f in cut]
    if kind == "one signal missing":
        return [frame for frame in frames if frame.id != 0x110]
    if kind == "very fast":
        return [
            f
            for frame in frames
            if frame.t < 12.0
            for f in (frame, frame._replace(t=frame.t + 1e-4), frame._replace(t=frame.t + 2e-4))
        ]
    raise ValueError(kind)


KINDS = (
    "clock set back", "counter wraps", "clock set ahead", "long pause", "short pause", "reordered", "far out of order",
    "radar lost", "bursts", "a second bus", "cut, remote and error frames", "one signal missing", "very fast",
)  # fmt: skip


@cache
def urban() -> list[Frame]:
    """25 s of following; do not change it."""
    return [frame for frame in open_log(LOGS / "following_urban.blf") if frame.t < 25.0]


@pytest.mark.slow("whole drives in many pieces")
@pytest.mark.parametrize("kind", KINDS)
def test_whatever_is_wrong_with_a_log(kind: str) -> None:
    """Clock steps, pauses, frames out of order, missing and spoilt ones; and samples come all the same."""
    items = check_same(list(spoilt(kind, urban())), read_vehicle("generic"), 1)
    assert sum(isinstance(item, Sample) for item in items) > 50


@pytest.mark.slow("whole logs")
@pytest.mark.parametrize("kind", ["clock set back", "long pause"])
def test_estimates_and_monitoring(kind: str) -> None:
    """Estimates, and what the monitor says, of a log that is not sound; the states that a restart keeps."""
    items = check_same(list(spoilt(kind, urban())), read_vehicle("generic"), 2, estimating=True)
    assert any(isinstance(item, Estimate) for item in items)


@settings(max_examples=10, deadline=None)
@given(
    sizes=st.lists(st.sampled_from((1, 1, 2, 3, 7, 30, 100)), min_size=1, max_size=400),
    kinds=st.lists(st.sampled_from(KINDS), min_size=1, max_size=3, unique=True),
    begin=st.floats(7.0, 13.0),
)
def test_any_division_into_chunks(sizes: list[int], kinds: list[str], begin: float) -> None:
    """A few seconds about what is wrong, several things at once, divided in any way."""
    frames = urban()
    for kind in kinds:
        frames = list(spoilt(kind, frames))
    frames = [frame for frame in frames if begin <= frame.t < begin + 3.0 or 5000.0 < frame.t < 5013.0]
    if not frames:
        return
    vehicle = read_vehicle("generic")
    rows, _, state = outputs(frames, vehicle, forever(len(frames)))
    other, _, other_state = outputs(frames, vehicle, [*sizes, len(frames)])
    assert other == rows
    assert other_state.sampler.decoding == state.sampler.decoding
    assert other_state.sampler.clock == state.sampler.clock


@pytest.mark.slow("whole logs")
@pytest.mark.parametrize(
    ("log", "vehicle", "until"),
    [
        (LOGS / "following_lost_lead.blf", "generic", 25.0),
        (LOGS / "lane_keeping.blf", "generic_lane", 12.0),
        (MEASURED / "openacc/human_h22_v5.blf", "openacc", 60.0),
        (MEASURED / "openacc/acc_long_h10_v5.blf", "openacc", 60.0),
        (MEASURED / "rav4/rav4_highway.blf", "toyota_rav4_2017", 4.0),
    ],
    ids=lambda x: x.stem if isinstance(x, Path) else str(x),
)
def test_simulated_and_measured_logs(log: Path, vehicle: str, until: float) -> None:
    """Following and lane keeping; two buses, radar tracks of which one is chosen, an acceleration for the pedal."""
    if not log.exists():
        pytest.skip(MISSING)
    frames = [frame for frame in open_log(log) if frame.t < until]
    assert any(isinstance(item, Sample) for item in check_same(frames, read_vehicle(vehicle), 3))


def test_radar_tracks_of_two_buses_with_short_frames() -> None:
    """The choice among tracks, the bus of each message and the counters go on from chunk to chunk."""
    log = MEASURED / "rav4/rav4_highway.blf"
    if not log.exists():
        pytest.skip(MISSING)
    rng = random.Random(4)
    frames = [
        frame._replace(
            bus=(frame.bus + 1) % 2 if rng.random() < 0.02 else frame.bus,
            data=frame.data[:5] if rng.random() < 0.01 else frame.data,
        )
        for frame in open_log(log)
        if frame.t < 3.0
    ]
    items = check_same(frames, read_vehicle("toyota_rav4_2017"), 4)
    assert any(isinstance(item, Sample) for item in items)


@pytest.mark.parametrize(
    "part", [{"start": 17.3, "stop": 42.0}, {"dt": 0.02, "stop": 12.0}, {"stop": 12.0, "span": 0.05}]
)
def test_a_part_of_a_log(part: dict[str, float]) -> None:
    """A log read as a trace, and run in chunks of 50 ms: the same samples and health, on any grid and from any start."""
    log, vehicle = open_log(LOGS / "following_urban.blf"), read_vehicle("generic")
    span, dt = part.pop("span", 0.7), part.get("dt", 0.1)
    within = Window(part.get("start", -math.inf), part["stop"])
    drive = drive_reader.read_drive(log.path, vehicle, estimating=False, **part)
    samples, events, frames, state, last = [], [], 0, None, 0.0
    for after, chunk, out in drive_reader.run(
        log, vehicle, estimating=False, span=span, dt=dt, within=within
    ):
        assert chunk.t[-1] - chunk.t[0] <= span
        samples += [item for item in out if isinstance(item, Sample)]
        events += [item for item in out if isinstance(item, Event)]
        state, frames, last = after, frames + len(chunk.t), float(chunk.t[-1])
    trace = trace_assembly.trace(samples, vehicle.driver, dt)
    assert exact(drive_reader.health(log, vehicle, state, frames, last, events)) == exact(drive.health)
    assert len(trace.t) > 100
    for ours, theirs in zip(trace[1:4], drive.trace[1:4], strict=True):
        assert np.array_equal(ours, theirs, equal_nan=True)
    assert trace.gate == drive.trace.gate
    for role, values in trace.signals.items():
        assert np.array_equal(values, drive.trace.signals[role], equal_nan=True)


def test_a_log_that_is_damaged(tmp_path: Path) -> None:
    """What the reader lost is in the health of the drive; the rest is read."""
    path = tmp_path / "x.blf"
    write_log(path, urban(), 1.7e9)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 16
    path.write_bytes(data)
    drive = drive_reader.read_drive(path, "generic", estimating=False)
    assert drive.health.damage is not None
    assert drive.trace.t.size > 50
