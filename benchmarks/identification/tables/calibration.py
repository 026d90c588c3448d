"""Do the 95 % intervals hold the truth: six noises, four lengths, pedal and acceleration, three radars, drivers drawn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.identification import acceleration, bus, canid_side, loop_a
from benchmarks.identification.bounds import Lag
from benchmarks.identification.noise_models import NOISE_MODELS, REMNANT, NoiseModel
from benchmarks.identification.table import Settings, Table, each, held, text
from canid.values.types import Channel, Driver

NOISES = (*NOISE_MODELS, REMNANT)
MINUTES = (1.0, 3.0, 10.0, 20.0)
# sd of gap and range rate: m, m/s; a good radar, the usual one, a coarse one
RADARS = ((0.1, 0.05), (bus.GAP_SD, bus.RATE_SD), (0.4, 0.25))
# of published accelerations: sd of headway and range rate, s, m/s
SHARES = (0.3, 1.0, 2.0)
OUTPUTS = ("pedal", "acceleration")
ACCELERATION_SD = 0.02  # m/s², of its sensor
# s of history before what is used
BEFORE = 8.0
# share below which a cell of noise and length is printed: of its eight drives in 192, two or more miss
MIN_CELL = 0.8

PARAMETERS = (
    ("K1", 0, "K"),
    ("K2", 1, "K"),
    ("tau2", 1, "tau"),
    ("dead time 2", 1, "dead_time"),
    ("τ2+θ2", 1, "tau_plus_dead_time"),
    ("τ1+θ1", 0, "tau_plus_dead_time"),
)


class World(NamedTuple):
    """What a seed stands for."""

    output: str
    noise: NoiseModel
    minutes: float
    radar: int


class Held(NamedTuple):
    """One drive: errors and what the intervals say, of each of PARAMETERS."""

    world: World
    z: tuple[float, ...]  # error over half the interval's width, times 1.96
    inside: tuple[float, ...]  # 1, 0 or NaN
    quotable: tuple[bool, ...]
    width: tuple[float, ...]  # of the interval, over the truth


def world(seed: int) -> World:
    """Every combination once in 144 seeds."""
    k = seed
    minutes, k = MINUTES[k % 4], k // 4
    noise, k = NOISES[k % 6], k // 6
    output, k = OUTPUTS[k % 2], k // 2
    return World(output, noise, minutes, k % 3)


def drivers(seed: int) -> tuple[Lag, Lag]:
    """Draw a driver who answers with a pedal."""
    rng = np.random.default_rng([seed, 7])
    tau, dead_time = rng.uniform(0.25, 0.8, 2), np.round(rng.uniform(0.15, 0.5, 2), 2)
    gains = rng.uniform(2.5, 7.0), rng.uniform(4.0, 8.0)
    first, second = (Lag(*map(float, x)) for x in zip(gains, tau, dead_time, strict=True))
    return first, second


def measured(seed: int) -> tuple[bus.Seen, tuple[Lag, Lag]]:
    """Simulate one drive and take it over a bus through canid; and the truth."""
    of = world(seed)
    if of.output == "pedal":
        made = loop_a.drive(seed, 60.0 * of.minutes + BEFORE, noise_model=of.noise, channels=drivers(seed))
        streams = bus.sensed(made, seed, radar_sd=RADARS[of.radar])
        return bus.through_canid(streams, Driver(headway_desired=made.headway_desired)), made.channels
    behind = acceleration.drive(seed, of.minutes + BEFORE / 60.0, of.noise, SHARES[of.radar])
    output = behind.acceleration + np.random.default_rng((seed, 2)).normal(
        0.0, ACCELERATION_SD, len(behind.speed)
    )
    gap = (behind.inputs[:, 0] + acceleration.HEADWAY) * behind.speed
    t = np.round(np.arange(len(gap)) * acceleration.DT, 9)
    streams = [
        bus.Stream(t, ("gap", "range_rate"), np.column_stack([gap, behind.inputs[:, 1]])),
        bus.Stream(t, ("accel",), output[:, None]),
        bus.Stream(t, ("speed",), behind.speed[:, None]),
    ]
    driver = Driver(output="accel", headway_desired=acceleration.HEADWAY)
    return bus.through_canid(streams, driver), behind.channels


def identified(seed: int, seen: bus.Seen) -> tuple[Channel, ...]:
    """Fit one drive."""
    fit = canid_side.process(seen.output, seen.inputs, bus.GRID, seen.usable, seen.segment, bound=seen.bound)
    return fit.channels


def one(seed: int) -> Held:
    """Judge one drive."""
    seen, truth = measured(seed)
    channels = identified(seed, seen)
    z, inside, quotable, width = [], [], [], []
    for _, i, field in PARAMETERS:
        x = truth[i].tau + truth[i].dead_time if field == "tau_plus_dead_time" else getattr(truth[i], field)
        interval = getattr(channels[i], field)
        known = np.isfinite(interval.value)
        z.append(1.96 * (interval.value - x) / (0.5 * (interval.high - interval.low)) if known else np.nan)
        inside.append(float(interval.low <= x <= interval.high) if known else np.nan)
        quotable.append(bool(np.isfinite(canid_side.quoted(channels[i], field).value)))
        width.append((interval.high - interval.low) / x if known else np.nan)
    return Held(world(seed), tuple(z), tuple(inside), tuple(quotable), tuple(width))


def table(settings: Settings) -> list[Table]:
    """Coverage by noise and length, by output and radar."""
    done: list[Held] = each(settings, one)
    columns = ("drives", *(p[0] for p in PARAMETERS))
    rows = [("all", *_row(done)), ("of those quotable", *_row(done, quotable=True))]
    rows += [(n.name, *_row([d for d in done if d.world.noise == n])) for n in NOISES]
    rows += [(f"{m:g} min", *_row([d for d in done if d.world.minutes == m])) for m in MINUTES]
    rows += [(o, *_row([d for d in done if d.world.output == o])) for o in OUTPUTS]
    by_cell = {
        f"{n.name}, {m:g} min": [d for d in done if d.world.noise == n and d.world.minutes == m]
        for n in NOISES
        for m in MINUTES
    }
    cells = [(name, *_row(some)) for name, some in by_cell.items() if _least(some) < MIN_CELL]
    errors = np.array([d.z for d in done])
    means = [
        ("mean z", len(done), *np.nanmean(errors, axis=0)),
        ("sd of z", len(done), *np.nanstd(errors, axis=0)),
    ]
    note = "Pedal: radar at 20 Hz, sd of gap and range rate " + "; ".join(
        f"{a} m, {b} m/s" for a, b in RADARS
    )
    return [
        Table(
            "Share of 95 % intervals that hold the truth",
            ("drives of", *columns[:-1]),
            [row[:-1] for row in (*rows, *cells, *means)],
            (
                f"{columns[-1]}: {text(rows[0][-1])} of all drives, mean z {text(means[0][-1])}, sd {text(means[1][-1])}. "
                f"Of {len(by_cell)} cells of noise and length the {len(cells)} with a share below {MIN_CELL}. "
                f"z: error in standard deviations of the interval. {note}.",
            ),
        )
    ]


def _row(done: list[Held], quotable: bool = False) -> tuple[object, ...]:
    if not done:
        return (0, *("–" for _ in PARAMETERS))
    inside = np.array([d.inside for d in done])
    if quotable:
        inside = np.where([d.quotable for d in done], inside, np.nan)
    known = np.isfinite(inside)
    share = np.where(known, inside, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return (len(done), *(held(s, k, len(done)) for s, k in zip(share, known.sum(axis=0), strict=True)))


def _least(done: list[Held]) -> float:
    """Return the lowest share of a parameter."""
    inside = np.array([d.inside for d in done]).reshape(len(done), len(PARAMETERS))
    known = np.isfinite(inside)
    share = np.where(known, inside, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return float(np.where(known.any(axis=0), share, 1.0).min())
