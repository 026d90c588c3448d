"""What a sensor can do to a measurement: pure functions of a drive, a strength and a source of random numbers.

The truth stays that of the driver: nothing here adds a delay to the output itself, which no record of the output can
separate from the driver's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

import numpy as np

from tests.plants.outside_drives import Drive
from tests.plants.planted_drive import Array

# in the names of `roles`: the driver's output, whichever it is
OUTPUT = "output"
RADAR = ("gap", "range_rate")
Apply = Callable[[Drive, float, np.random.Generator], Drive]


class Effect(NamedTuple):
    """One effect at four strengths."""

    name: str
    strengths: tuple[float, float, float, float]
    unit: str
    apply: Apply
    # parts of the names of findings that name it rightly; (): no finding of the signals is about it
    named: tuple[str, ...] = ()


def _changed(
    drive: Drive, roles: Iterable[str], what: Callable[[Array], Array], mask: Array | None = None
) -> Drive:
    """The drive with some columns changed, where `mask` is true."""
    names = [drive.truth.output if role == OUTPUT else role for role in roles]
    columns = dict(drive.columns)
    for name in names:
        if name in columns:
            changed = what(columns[name])
            columns[name] = changed if mask is None else np.where(mask, changed, columns[name])
    return drive._replace(columns=columns)


def limit(
    drive: Drive, share: float, rng: np.random.Generator, *, role: str, sides: tuple[bool, bool]
) -> Drive:
    """A range that ends where a share of the samples lies, at the lower end, the upper one or half of it at both."""
    each = share / sum(sides)

    def clipped(x: Array) -> Array:
        low, high = np.nanquantile(x, (each, 1.0 - each))
        return np.clip(x, low if sides[0] else -np.inf, high if sides[1] else np.inf)

    return _changed(drive, (role,), clipped)


def _slow(t: Array, period: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rows at which a slower sender samples, each once; and which of them is the newest at each row."""
    phase = rng.uniform(0.0, period)
    began = np.floor((t - phase) / period) * period + phase
    rows, newest = np.unique(np.searchsorted(t, began), return_inverse=True)
    return rows, newest


def hold(drive: Drive, period: float, rng: np.random.Generator, *, roles: tuple[str, ...]) -> Drive:
    """Sampled every `period` s and held until the next sample; the roles together, as one message."""
    rows, newest = _slow(drive.t, period, rng)
    return _changed(drive, roles, lambda x: x[rows[newest]])


def apart(drive: Drive, periods: tuple[float, float], rng: np.random.Generator, *, held: bool) -> Drive:
    """Gap and range rate in messages of their own.

    Args:
        drive: to be changed.
        periods: s, of gap and range rate.
        rng: of the phases; equal periods have half of one between them.
        held: whether each value is written again until the next one comes; else the other rows are empty.
    """
    begin = rng.uniform(0.0, periods[0])
    columns, rows = dict(drive.columns), np.arange(len(drive.t))
    for role, period in zip(RADAR, periods, strict=True):
        numbers = np.floor((drive.t - begin) / period + 1e-6)
        new = np.diff(numbers, prepend=numbers[0] - 1) > 0
        x = columns[role]
        columns[role] = x[np.maximum.accumulate(new * rows)] if held else np.where(new, x, np.nan)
        begin += 0.5 * periods[0]
    return drive._replace(columns=columns)


def line(drive: Drive, period: float, rng: np.random.Generator, *, roles: tuple[str, ...]) -> Drive:
    """Sampled every `period` s and joined by lines, as a program interpolates onto one column of times."""
    rows, _ = _slow(drive.t, period, rng)
    return _changed(drive, roles, lambda x: np.interp(drive.t, drive.t[rows], x[rows]))


def step(drive: Drive, size: float, rng: np.random.Generator, *, role: str) -> Drive:
    """Rounded to multiples of `size`; of the output in its standard deviations, so that one table holds both outputs."""

    def rounded(x: Array) -> Array:
        width = size * (float(np.std(x)) if role == OUTPUT else 1.0)
        multiples: Array = np.rint(x / width) * width
        return multiples

    return _changed(drive, (role,), rounded)


def scale(drive: Drive, share: float, rng: np.random.Generator, *, role: str) -> Drive:
    """Too much by a share."""
    return _changed(drive, (role,), lambda x: (1.0 + share) * x)


def dead_zone(drive: Drive, size: float, rng: np.random.Generator) -> Drive:
    """A range rate that begins beyond `size` m/s."""
    return _changed(drive, ("range_rate",), lambda x: x - np.clip(x, -size, size))


def unsigned(drive: Drive, size: float, rng: np.random.Generator) -> Drive:
    """A range rate without its sign up to `size` m/s."""
    return _changed(drive, ("range_rate",), lambda x: np.where(np.abs(x) < size, np.abs(x), x))


def lag(drive: Drive, tau: float, rng: np.random.Generator, *, role: str) -> Drive:
    """First order, time constant `tau` s: a filter in one sensor."""

    def lagged(x: Array) -> Array:
        out, value = np.empty(len(x)), float(x[0])
        decay = np.exp(-np.diff(drive.t, prepend=drive.t[0]) / tau)
        for k, (a, each) in enumerate(zip(decay.tolist(), x.tolist(), strict=True)):
            value = a * value + (1.0 - a) * each
            out[k] = value
        return out

    return _changed(drive, (role,), lagged)


def late(drive: Drive, delay: float, rng: np.random.Generator, *, role: str) -> Drive:
    """Recorded `delay` s after what it shows."""
    return _changed(drive, (role,), lambda x: np.interp(drive.t - delay, drive.t, x))


def clock(drive: Drive, ppm: float, rng: np.random.Generator, *, role: str) -> Drive:
    """Stamped by a clock that runs off by so many millionths, right in the middle of the drive."""
    middle = 0.5 * (drive.t[0] + drive.t[-1])
    return _changed(
        drive, (role,), lambda x: np.interp(drive.t + 1e-6 * ppm * (drive.t - middle), drive.t, x)
    )


def zero(drive: Drive, share: float, rng: np.random.Generator, *, roles: tuple[str, ...]) -> Drive:
    """0 for "no target", in stretches of 2 to 20 s, together for the roles."""
    gone = np.zeros(len(drive.t), dtype=bool)
    while gone.mean() < share:
        start = rng.uniform(drive.t[0], drive.t[-1])
        gone |= (drive.t >= start) & (drive.t < start + rng.uniform(2.0, 20.0))
    return _changed(drive, roles, np.zeros_like, gone)


def wrap(drive: Drive, period: float, rng: np.random.Generator) -> Drive:
    """A counter of time that begins anew every `period` s, at least once in the drive."""
    span = float(drive.t[-1] - drive.t[0])
    first = rng.uniform(0.3, 0.7) * min(span, period)
    return drive._replace(t=np.mod(drive.t - drive.t[0] + period - first, period))


def drop(drive: Drive, share: float, rng: np.random.Generator) -> Drive:
    """Rows that were lost, each for itself."""
    kept = rng.random(len(drive.t)) >= share
    return drive._replace(t=drive.t[kept], columns={role: x[kept] for role, x in drive.columns.items()})


SHARES = (0.05, 0.1, 0.25, 0.5)
PERIODS = (0.2, 0.3, 0.5, 1.0)
DELAYS = (0.1, 0.2, 0.4, 0.8)
LIMITED, SLOW, COARSE = ("limited",), ("slow", "repeated", "frozen"), ("coarse", "steps")
LATE, EMPTY = ("late", "lag", "latency"), ("empty", "no_target", "frozen", "dead")
EVERYTHING = (OUTPUT, "speed", "gap", "range_rate", "accel", "brake")

EFFECTS: tuple[Effect, ...] = (
    Effect("output ends below", SHARES, "of the time", partial(limit, role=OUTPUT, sides=(True, False))),
    Effect("output ends above", SHARES, "of the time", partial(limit, role=OUTPUT, sides=(False, True))),
    Effect(
        "range rate limited",
        SHARES,
        "of the time",
        partial(limit, role="range_rate", sides=(True, True)),
        LIMITED,
    ),
    Effect(
        "range rate limited on one side",
        SHARES,
        "of the time",
        partial(limit, role="range_rate", sides=(True, False)),
        LIMITED,
    ),
    Effect("gap limited", SHARES, "of the time", partial(limit, role="gap", sides=(False, True)), LIMITED),
    Effect("all held", PERIODS, "s", partial(hold, roles=EVERYTHING), SLOW),
    Effect("output held", PERIODS, "s", partial(hold, roles=(OUTPUT,)), SLOW),
    Effect("radar held", PERIODS, "s", partial(hold, roles=RADAR), SLOW),
    Effect("all joined by lines", PERIODS, "s", partial(line, roles=EVERYTHING), SLOW),
    Effect("output joined by lines", PERIODS, "s", partial(line, roles=(OUTPUT,)), SLOW),
    Effect("radar joined by lines", PERIODS, "s", partial(line, roles=RADAR), SLOW),
    Effect("steps of the output", (0.1, 0.2, 0.5, 1.0), "sd", partial(step, role=OUTPUT), COARSE),
    Effect("steps of the range rate", (0.1, 0.25, 0.5, 1.0), "m/s", partial(step, role="range_rate"), COARSE),
    Effect("steps of the gap", (0.25, 0.5, 1.0, 2.0), "m", partial(step, role="gap"), COARSE),
    Effect("steps of the speed", (0.1, 0.28, 0.5, 1.0), "m/s", partial(step, role="speed"), COARSE),
    Effect(
        "scale of the range rate", (0.02, 0.05, 0.08, 0.12), "too much", partial(scale, role="range_rate")
    ),
    Effect("scale of the gap", (0.02, 0.05, 0.08, 0.12), "too much", partial(scale, role="gap")),
    Effect("dead zone of the range rate", (0.05, 0.1, 0.2, 0.4), "m/s", dead_zone, ("nonlinear",)),
    Effect("sign of the range rate lost", (0.1, 0.2, 0.3, 0.5), "m/s", unsigned, ("nonlinear",)),
    Effect("range rate lags", DELAYS, "s", partial(lag, role="range_rate"), LATE),
    Effect("gap lags", DELAYS, "s", partial(lag, role="gap"), LATE),
    Effect("speed lags", DELAYS, "s", partial(lag, role="speed"), LATE),
    Effect("gap late", DELAYS, "s", partial(late, role="gap"), LATE),
    Effect("range rate late", DELAYS, "s", partial(late, role="range_rate"), LATE),
    Effect("clock of the output", (50.0, 100.0, 300.0, 1000.0), "ppm", partial(clock, role=OUTPUT)),
    Effect("0 without a target", (0.01, 0.05, 0.2, 0.5), "of the time", partial(zero, roles=RADAR), EMPTY),
    Effect(
        "gap 0 without a target", (0.01, 0.05, 0.2, 0.5), "of the time", partial(zero, roles=("gap",)), EMPTY
    ),
    # s: a minute, 16 bits of ms, an hour, 32 bits of µs
    Effect("time wraps", (60.0, 65.536, 3600.0, 4294.967296), "s", wrap),
    Effect("rows lost", (0.05, 0.2, 0.5, 0.8), "of them", drop),
)


class Drawn(NamedTuple):
    """An effect at a strength."""

    effect: Effect
    strength: float

    def __str__(self) -> str:
        return f"{self.effect.name} {self.strength:g} {self.effect.unit}"


def drawn_effects(
    rng: np.random.Generator, most: int = 3, among: tuple[Effect, ...] = EFFECTS
) -> tuple[Drawn, ...]:
    """Draw 1 to `most` effects of different names, each between its weakest and its strongest."""
    number = int(rng.integers(1, most + 1))
    chosen = sorted(rng.choice(len(among), number, replace=False).tolist())
    out = []
    for k in chosen:
        low, *_, high = among[k].strengths
        strength = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        # a counter has the lengths that counters have
        if among[k].apply is wrap:
            strength = float(rng.choice(among[k].strengths))
        out.append(Drawn(among[k], strength))
    return tuple(out)


def applied(drive: Drive, effects: Iterable[Drawn], rng: np.random.Generator) -> Drive:
    """One after the other, in the order of `EFFECTS`: what happens to time comes last."""
    for each in effects:
        drive = each.effect.apply(drive, each.strength, rng)
    return drive
