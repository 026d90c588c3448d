"""From a drive to what an identifier gets: readings on clocks of their own, then canid's way, or a plain one.

canid's way is that of `canid.models.pipeline.pipeline`, from the reading on: lead, smoothing, sampling, gate. The peers get
the same readings joined by lines at 10 Hz, which is what a careful script does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.identification.loops import Drive
from canid.signals.samples import lead, learning_gate, own_speed, sampling_grid
from canid.signals.samples.sampler import MADE, SMOOTH_ALONG_S, WIDEST_ALONG_S
from canid.values.types import Driver, Reading, Sample

GRID = 0.1  # s
RADAR, CONTROL = 0.05, 0.02  # s between two messages
GAP_SD, RATE_SD = 0.25, 0.12  # m, m/s


class Seen(NamedTuple):
    """A drive at 10 Hz."""

    output: np.ndarray  # (n,) %
    inputs: np.ndarray  # (n, 2) headway error s, range rate m/s
    usable: np.ndarray  # (n,) bool
    segment: np.ndarray  # (n,)
    bound: np.ndarray  # (n,) % that the demand did not exceed, see canid.values.types.Sample


class Stream(NamedTuple):
    """One message as it came."""

    t: np.ndarray  # (n,) s
    roles: tuple[str, ...]
    values: np.ndarray  # (n, roles)


def clock(rng: np.random.Generator, period: float, end: float) -> np.ndarray:
    """Return (n,) s: when a message comes, its first at random, in whole ns as logs keep them."""
    return np.round(np.arange(rng.uniform(0.0, period), end, period) * 1e9) * 1e-9


def sensed(
    drive: Drive, seed: int, noisy: bool = True, radar_sd: tuple[float, float] = (GAP_SD, RATE_SD)
) -> list[Stream]:
    """Put the drive on a bus: radar at 20 Hz, pedal, brake and speed at 50 Hz, each with a clock of its own."""
    rng = np.random.default_rng([seed, 5])
    t = np.arange(len(drive.pedal)) * drive.dt
    end = float(t[-1])

    def seen(at: np.ndarray, *columns: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(at, t, column) for column in columns])

    radar, pedal, brake, speed = (clock(rng, period, end) for period in (RADAR, CONTROL, CONTROL, CONTROL))
    ahead = seen(radar, drive.gap, drive.range_rate)
    if noisy and drive.uniform:
        error = rng.uniform(-1.0, 1.0, ahead.shape) * 3.0**0.5 * radar_sd
        step = np.array([0.1, 0.05])  # m, m/s; a radar's resolution
        ahead = step * np.round((ahead + error) / step)
    elif noisy:
        ahead = ahead + rng.standard_normal(ahead.shape) * radar_sd
    held = drive.brake[np.minimum((brake / drive.dt).astype(int), len(t) - 1)]
    return [
        Stream(radar, ("gap", "range_rate"), ahead),
        Stream(pedal, ("pedal",), seen(pedal, drive.pedal)),
        Stream(brake, ("brake",), held[:, None].astype(float)),
        Stream(speed, ("speed",), seen(speed, drive.speed)),
    ]


def samples(streams: list[Stream], driver: Driver) -> list[Sample]:
    """Take the readings through canid's lead, sampling and gate."""
    roles = {
        role: sampling_grid.Role(switch=role == "brake", needed=role != "brake")
        for stream in streams
        for role in stream.roles
    }
    if driver.task == "car_following":
        roles |= MADE | {
            "lead_speed": sampling_grid.Role(),
            "own_speed": sampling_grid.Role(smooth=SMOOTH_ALONG_S, widest=WIDEST_ALONG_S),
        }
    rows = sorted((float(t), i, k) for i, s in enumerate(streams) for k, t in enumerate(s.t))
    settings = lead.Settings()
    follow, judged, out = lead.init(), learning_gate.init(), []
    readings: dict[str, list[tuple[float, float, int]]] = {}
    for number, (t, i, k) in enumerate(rows):
        for role, value in zip(streams[i].roles, streams[i].values[k], strict=True):
            follow, items = lead.step(follow, Reading(t, role, float(value)), settings)
            for item in items:
                if isinstance(item, Reading):
                    readings.setdefault(item.role, []).append((item.t, item.value, number))
    columns = {role: [np.array(x) for x in zip(*of, strict=True)] for role, of in readings.items()}
    if "speed" in columns:
        columns["own_speed"] = columns["speed"]
    grid = sampling_grid.put(
        sampling_grid.init(), {role: sampling_grid.Readings(*of) for role, of in columns.items()}
    )
    _, parts = sampling_grid.take(grid, np.array([t for t, _, _ in rows]), GRID, roles)
    for points in parts:
        at_points = own_speed.range_rates(points.values)
        for at, *values in zip(points.t.tolist(), *(x.tolist() for x in at_points.values()), strict=True):
            judged, sample = learning_gate.step(
                judged, at, dict(zip(at_points, values, strict=True)), driver, GRID
            )
            out.append(sample)
    return out


def through_canid(streams: list[Stream], driver: Driver) -> Seen:
    """Return canid's samples as columns."""
    out = samples(streams, driver)
    return Seen(
        np.array([s.output for s in out]),
        np.array([s.inputs for s in out]),
        np.array([s.learn for s in out]),
        np.array([s.segment for s in out]),
        np.array([s.bound for s in out]),
    )


def by_lines(streams: list[Stream], driver: Driver, held: bool = False) -> Seen:
    """Join the readings by lines at 10 Hz, or hold the last one."""
    begin = max(float(s.t[0]) for s in streams)
    end = min(float(s.t[-1]) for s in streams)
    at = np.arange(np.ceil(begin / GRID), np.floor(end / GRID) + 1) * GRID
    columns: dict[str, np.ndarray] = {}
    for stream in streams:
        last = np.searchsorted(stream.t, at, side="right") - 1
        for role, value in zip(stream.roles, stream.values.T, strict=True):
            columns[role] = value[last] if held or role == "brake" else np.interp(at, stream.t, value)
    if driver.task == "car_following":
        headway = columns["gap"] / columns["speed"]
        inputs = np.column_stack([headway - driver.headway_desired, columns["range_rate"]])
    else:
        inputs = columns["lateral_offset"][:, None]
    n = len(at)
    return Seen(
        columns[driver.output], inputs, np.full(n, True), np.zeros(n, dtype=np.int64), np.full(n, np.nan)
    )


def exactly(drive: Drive) -> Seen:
    """Take the drive at 10 Hz without any sensor between."""
    every = round(GRID / drive.dt)
    usable = drive.exact[::every]
    inputs = np.column_stack(drive.inputs)[::every]
    none = np.full(len(usable), np.nan)
    return Seen(drive.pedal[::every], inputs, usable, np.zeros(len(usable), dtype=np.int64), none)
