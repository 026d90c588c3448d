"""The desk path gives the very samples, events and health that frame by frame gives, to the last bit."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

from canid import logs
from canid.frames import open_log, write_log
from canid.frames.columns import select
from canid.types import Columns, Event, Flag, Frame, Sample, Trace
from canid.vehicle import Vehicle, read_vehicle

REPO = Path(__file__).parents[1]
DATA = REPO / "../shared/data"
URBAN = REPO / "replay_logs" / "following_urban.blf"


def frame_by_frame(path: Path, vehicle: Vehicle, **part: float) -> tuple[Trace, logs.Health]:
    """What the live pipeline makes of a log."""
    log = open_log(path)
    samples: list[Sample] = []
    events: list[Event] = []
    state, frames, last = None, 0, 0.0
    for after, frame, out in logs.run(log, vehicle, estimating=False, **part):
        state, frames, last = after, frames + 1, frame.t
        samples += [item for item in out if isinstance(item, Sample)]
        events += [item for item in out if isinstance(item, Event)]
    health = logs.health(log, vehicle, state, frames, last, events)
    return logs.trace(samples, vehicle.driver, part.get("dt", 0.1)), health


def check_same(path: Path, vehicle: Vehicle, **part: float) -> tuple[Trace, logs.Health]:
    drive = logs.read_drive(path, vehicle, estimating=False, **part)
    trace, health = frame_by_frame(path, vehicle, **part)
    assert drive.health == health
    for name, theirs, ours in zip(Trace._fields, trace, drive.trace, strict=True):
        if name == "signals":
            assert set(theirs) == set(ours)
            for role in theirs:
                assert np.array_equal(theirs[role], ours[role], equal_nan=True), role
        elif isinstance(theirs, np.ndarray):
            assert theirs.dtype == ours.dtype
            assert np.array_equal(theirs, ours, equal_nan=theirs.dtype == float), name
        else:
            assert theirs == ours, name
    return drive.trace, drive.health


@pytest.mark.parametrize(
    ("log", "vehicle", "part"),
    [
        ("following_lost_lead.blf", "generic", {}),
        ("following_motorway.asc", "generic", {"stop": 60.0}),
        ("following_urban.blf", "generic", {"start": 17.3, "stop": 55.0}),
        ("following_urban.blf", "generic", {"dt": 0.02, "stop": 30.0}),
        ("lane_keeping.blf", "generic_lane", {"stop": 60.0}),
    ],
)
def test_simulated_logs(log: str, vehicle: str, part: dict[str, float]) -> None:
    """Following and lane keeping, whole and in part, on a coarse and on a fine grid."""
    trace, health = check_same(REPO / "replay_logs" / log, read_vehicle(vehicle), **part)
    assert trace.t.size > 100
    assert health.mapped > 5


@pytest.mark.parametrize(
    ("log", "vehicle"),
    [
        ("openacc/human_h22_v5.blf", "openacc"),
        ("openacc/acc_long_h10_v5.blf", "openacc"),
        ("rav4/rav4_highway.blf", "toyota_rav4_2017"),
    ],
)
def test_measured_logs(log: str, vehicle: str) -> None:
    """Real logs: two buses, radar tracks of which one is chosen, an acceleration instead of a pedal."""
    path = DATA / log
    if not path.exists():
        pytest.skip(f"measured logs are not there: {path}")
    check_same(path, read_vehicle(vehicle))


def in_small_chunks(parts: Iterable[Columns], size: int) -> Iterable[Columns]:
    """As `gather`, but the other way round."""
    return (select(part, slice(k, k + 301)) for part in parts for k in range(0, len(part.t), 301))


def shifted(after: float, by: float) -> Callable[[Frame], Frame]:
    return lambda frame: frame._replace(t=frame.t + by if frame.t > after else frame.t)


def spoilt(kind: str, frames: list[Frame]) -> Iterable[Frame]:
    """Everything that clocks, buses and loggers do to a log."""
    rng = random.Random(kind)
    if kind == "clock set back":
        return map(shifted(10.0, -7.0), frames)
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
            for f in (frame, frame._replace(t=frame.t + 1e-4), frame._replace(t=frame.t + 2e-4))
        ]
    raise ValueError(kind)


KINDS = (
    "clock set back", "clock set ahead", "long pause", "short pause", "reordered", "far out of order", "radar lost",
    "bursts", "a second bus", "cut, remote and error frames", "one signal missing", "very fast",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_is_wrong_with_a_log(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Clock steps, pauses, frames out of order, missing and spoilt ones: the same, in whatever chunks they come."""
    path = tmp_path / "x.blf"
    frames = [frame for frame in open_log(URBAN) if frame.t < 32.0]
    write_log(path, spoilt(kind, frames), 1.7e9)
    vehicle = read_vehicle("generic")
    trace, _ = check_same(path, vehicle)
    assert trace.t.size > 50
    monkeypatch.setattr(logs, "gather", in_small_chunks)
    check_same(path, vehicle)


def test_radar_tracks_in_small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The choice among tracks goes on from chunk to chunk."""
    path = DATA / "rav4" / "rav4_highway.blf"
    if not path.exists():
        pytest.skip(f"measured logs are not there: {path}")
    monkeypatch.setattr(logs, "gather", in_small_chunks)
    check_same(path, read_vehicle("toyota_rav4_2017"), stop=12.0)


def test_a_log_that_is_damaged(tmp_path: Path) -> None:
    """The same frames, the same damage."""
    path = tmp_path / "x.blf"
    data = bytearray(URBAN.read_bytes())
    data[len(data) // 2] ^= 16
    path.write_bytes(data)
    _, health = check_same(path, read_vehicle("generic"))
    assert health.damage is not None
