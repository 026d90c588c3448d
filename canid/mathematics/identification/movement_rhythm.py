"""A pedal that moves at intervals and stands still in between: in a fixed rhythm, or by waits more even than chance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.values.runs import Flags, runs
from canid.values.types import Array

# of the drive that a rhythm of holds fills at least; looking away does not
MIN_RHYTHM_SHARE = 0.5
# standard deviations of chance's chi-squared above its mean that the evidence of a rhythm must have: the best of 300
# frequencies is tested
RHYTHM_SIGMAS = 8.0
# 1/s, frequencies of a rhythm: decisions every 0.3 to 4 s, as far apart as half a minute distinguishes
RHYTHM_STEP_HZ = 0.01
RHYTHM_HZ = np.arange(0.25, 3.2, RHYTHM_STEP_HZ)
# Hz from a rhythm, further than its line of half a minute is wide: there the power is that of movements without it
AROUND_HZ = np.arange(0.06, 0.2, RHYTHM_STEP_HZ)
# of its refinement; and of an overtone's evidence that the fundamental must have: it has all of it but for the grid's errors
RHYTHM_FINE_STEPS, FUNDAMENTAL_SHARE = 21, 0.7
# s; movements keep step with a rhythm for so long
RHYTHM_WINDOW_S = 30.0
# movements; with fewer no rhythm is distinguished from chance
MIN_MOVES = 20
# movements; so many waits give their coefficient of variation to a tenth
MIN_WAITS = 50
# Coefficient of variation of the time from one movement to the next, below which it is a wait: 1 by chance. Waits drawn
# evenly from 0.5 to 1.5 s have 0.29, behind sensor and grid up to 0.40; of 140 planted drives with a pedal that stands
# still for half of the time or more none of a driver who acts at all times was below 0.54, and none of the others below 0.5.
MAX_WAIT_VARIATION = 0.45
# sensor steps that a movement takes in the median: single ones are the rounding of a slow movement
MIN_MOVEMENT_STEPS = 2
# s; faster is continuous control (Gawthrop 2011)
MIN_WAIT_S = 0.4


def step_size(y: Array) -> float:
    """Return the sensor's step: the least distance between two levels at which it stood still.

    Example:
        >>> round(step_size(np.repeat(0.4 * np.arange(12), 2)), 3)
        0.4
    """
    # between two messages a sample is interpolated; a repeat is a level of the sensor itself
    levels = np.unique(np.round(y[1:][np.diff(y) == 0], 6))
    if levels.size >= 10:
        return float(np.quantile(np.diff(levels), 0.1))
    d = np.abs(np.diff(y))
    d = d[d > 1e-6]
    return float(np.quantile(d, 0.1)) if d.size else 1e-3


def rhythm(y: Array, free: Flags, step: float, dt: float) -> tuple[float, float, float]:
    """Interval (s) of the rhythm in which the pedal moves, the evidence for it, and what is needed; (0, 0, inf): none.

    The times at which it moves, as points on a circle of the rhythm's length, within half a minute each: twice the
    squared length of their mean direction over their number is 2 Δ log likelihood against no rhythm (Rayleigh's test;
    Mardia & Jupp 2000, sec. 6.3.1), with two degrees of freedom, a direction and a strength, in every window. The test
    takes movements as independent. Those of a slow pedal on a coarse sensor, or between rests at 0 %, are not: what is
    needed grows with the power of the same movements at neighbouring frequencies.
    """
    moves = np.flatnonzero(moving(y, step) & free)
    share = moves.size / max(int(free.sum()), 1)
    if moves.size < MIN_MOVES or share > 1 - MIN_RHYTHM_SHARE:
        return 0.0, 0.0, np.inf
    window = moves // round(RHYTHM_WINDOW_S / dt)
    times = [moves[window == w] * dt for w in np.unique(window)]
    by_chance = 2.0 * len(times)
    frequency, power = _strongest(RHYTHM_HZ, times)
    # movements in a rhythm are in that of its overtones too; those of an overtone cancel at the fundamental
    for part in range(int(frequency / RHYTHM_HZ[0]), 1, -1):
        near = frequency / part + RHYTHM_STEP_HZ * np.linspace(-1, 1, RHYTHM_FINE_STEPS)
        slower, as_strong = _strongest(near, times)
        if as_strong > FUNDAMENTAL_SHARE * power:
            frequency, power = slower, as_strong
            break
    frequency, power = _strongest(frequency + RHYTHM_STEP_HZ * np.linspace(-1, 1, RHYTHM_FINE_STEPS), times)
    # movements that come in clusters agree at all slow rhythms alike
    level = max(by_chance, float(np.median(_powers(frequency + np.r_[-AROUND_HZ[::-1], AROUND_HZ], times))))
    return 1 / frequency, power, level * (1.0 + RHYTHM_SIGMAS * float(np.sqrt(2 / by_chance)))


def _powers(hz: Array, times: list[Array]) -> Array:
    """Evidence that the times in each window agree, at each frequency (Hz)."""
    power: Array = np.zeros(hz.size)
    for t in times:
        power += 2 * np.abs(np.exp(2j * np.pi * np.outer(hz, t)).sum(axis=1)) ** 2 / t.size
    return power


def _strongest(hz: Array, times: list[Array]) -> tuple[float, float]:
    """The frequency (Hz) at which the times in each window agree most, and its evidence."""
    power = _powers(hz, times)
    k = int(np.argmax(power))
    return float(hz[k]), float(power[k])


def moving(y: Array, step: float) -> Flags:
    """Where the pedal moves by more than its sensor's rounding.

    >>> moving(np.array([0.0, 0.4, 0.4]), 0.4).tolist()
    [False, True, False]
    """
    out: Flags = np.abs(np.diff(y, prepend=y[0])) > 0.5 * step
    return out


class Waiting(NamedTuple):
    """How a driver acts who decides at intervals."""

    interval: float  # s, mean, from one movement to the next
    regular: bool  # in a fixed rhythm


def waiting(y: Array, free: Flags, dt: float) -> Waiting | None:
    """Whether the pedal is held between movements; None: it is not, or too few movements show it.

    Args:
        y: (n,) pedal.
        free: (n,) where it is measured and neither at an end nor the brake pressed.
        dt: s.

    >>> t = np.arange(6000) * 0.1
    >>> held = np.round(20 * np.sin(0.3 * np.floor(t / 0.9)))
    >>> waiting(held, np.full(6000, True), 0.1).regular, waiting(np.round(20 * np.sin(0.3 * t)), np.full(6000, True), 0.1)
    (True, None)
    """
    if not free.any():
        return None
    step = step_size(y[free])
    if len(runs(moving(y, step) & free)) < MIN_MOVES:
        return None
    interval, evidence, needed = rhythm(y, free, step, dt)
    if evidence > needed:
        return Waiting(interval, True)
    mean = _even_waits(y, free, step, dt)
    return None if mean is None else Waiting(mean, False)


def _even_waits(y: Array, free: Flags, step: float, dt: float) -> float | None:
    """Mean time in s between movements that come more evenly than by chance; None: they do not."""
    moves = moving(y, step)
    if not np.mean(moves[free]) <= 1 - MIN_RHYTHM_SHARE:
        return None
    waits, sizes = [], []
    for first, stop in runs(free):
        moved = runs(moves[first:stop])
        begins = np.array([a for a, _ in moved])
        waits += (dt * np.diff(begins)).tolist()
        sizes += [abs(y[first + b - 1] - y[first + a - 1]) for a, b in moved if a]
    if len(waits) < MIN_WAITS:
        return None
    mean, sd = float(np.mean(waits)), float(np.std(waits))
    even = sd < MAX_WAIT_VARIATION * mean and mean >= MIN_WAIT_S
    return mean if even and float(np.median(sizes)) > (MIN_MOVEMENT_STEPS - 0.5) * step else None
