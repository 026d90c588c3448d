"""Episodes in which the pedal stands still although the driver, as modelled, would move it.

Two explanations of every sample are held against each other: the driver drives (model plus coloured noise), or the
foot holds (the sample before, to within the sensor's step). The most likely path through both (Viterbi 1967) gives
the episodes and their evidence. What the episodes look like names the cause: always at the same top level - a
ceiling; nearly all the time and with a rhythm - act and wait; now and then - looking away.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from canid.diagnosis.driver_data import DriverData
from canid.diagnosis.solved import Solved
from canid.findings import Flags
from canid.types import Array

# s; a shorter standstill is a foot that turns round
SHORTEST = 1.3
# 1/s; an episode begins once a minute, and lasts some three seconds (Boer 2001; glances: Klauer et al. 2006)
BEGINS, ENDS = 1 / 60.0, 1 / 3.0
# of a sensor's step; rounding alone spreads a held value by 0.29 of it, and a foot trembles a little
TREMBLE = 0.35
# 2 Δ log likelihood that all episodes together must have above what each costs: a foot at rest between two motions
# reached 12 on clean drives
NEEDED = 30.0
# and so many episodes, as one may be a rest: each alone must bear its own weight of evidence
EPISODES = 2
# of the drive that a rhythm of holds fills at least; looking away does not
FULL = 0.5
# standard deviations above chance that a rhythm must have: 300 frequencies are looked at
BEATS = 8.0
# %; there the pedal itself ends
PHYSICAL = 99.0
# of the standstills that are at the pedal's highest level where it is a ceiling
AT_TOP = 0.75
# times that a ceiling must have been reached
CEILING_TOUCHED = 3


class Holds(NamedTuple):
    """What was found."""

    effect: str  # "attention_gap", "act_and_wait", "pedal_ceiling"; "" for none
    episodes: tuple[tuple[int, int], ...]  # [start, stop) samples
    evidence: float
    level: float  # % of the ceiling, s of the rhythm; NaN otherwise


NONE = Holds("", (), 0.0, np.nan)


def ceiling(held: tuple[Holds, ...]) -> float:
    """Level of the ceiling among what was found; infinite where there is none."""
    return next((one.level for one in held if one.effect == "pedal_ceiling"), np.inf)


def away(held: tuple[Holds, ...]) -> tuple[tuple[int, int], ...]:
    """Episodes of looking away among what was found: [start, stop) samples."""
    return next((one.episodes for one in held if one.effect == "attention_gap"), ())


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


def look(data: DriverData, solved: Solved, before: tuple[Holds, ...] = ()) -> Holds:
    """Find episodes in what a model leaves.

    Args:
        data: what is explained; above a known ceiling nothing is looked for.
        solved: the model.
        before: what was found already: below a ceiling only looking away is left to be found, after that nothing.
    """
    if not data.pedal or any(one.effect != "pedal_ceiling" for one in before):
        return NONE  # an acceleration never stands still
    y, noise = data.output.y, solved.noise
    step = step_size(y[data.output.usable])
    held_sd = max(TREMBLE * step, 1e-3)
    free = data.output.usable & ~data.output.hidden
    # innovations also where rows do not count after a masked stretch: there the noise is as wide as it can be
    sd = noise.sd * noise.size
    e = np.where(solved.rows, solved.fitted.scored.e, 0.0)
    driving = -0.5 * e * e - np.log(np.maximum(sd, 0.5 * held_sd))
    moved = np.r_[np.inf, np.diff(y)]
    holding = -0.5 * np.minimum((moved / held_sd) ** 2, 400.0) - np.log(held_sd)
    # a foot that moves slowly rests on the sensor's steps now and then, and a density knows nothing of steps
    resting = -np.log(rests(moved, free, step, data.output.dt)) + 0.5 * (e * e - 1.0)
    gain = np.where(free & solved.rows, np.minimum(holding - driving, resting), -50.0)
    top = NONE if before else _ceiling(data, y, step)
    if top.effect:
        return top
    interval, beats = (0.0, 0.0) if before else _rhythm(y, free, step, data.output.dt)
    if beats > BEATS:
        moves = np.flatnonzero((np.abs(np.diff(y, prepend=y[0])) > 0.5 * step) & free)
        spans = tuple((int(a), int(b)) for a, b in pairwise(moves.tolist()))
        return Holds("act_and_wait", spans, beats * BEATS, interval)
    spans, evidence = episodes(gain, data.output.dt)
    if len(spans) < EPISODES or evidence < NEEDED:
        return NONE
    level = float(y[free].max())
    if not before and level < PHYSICAL and np.mean([y[a] >= level - 1.5 * step for a, _ in spans]) > AT_TOP:
        return Holds("pedal_ceiling", spans, evidence, level)
    return Holds("attention_gap", spans, evidence, np.nan)


def rests(moved: Array, free: Flags, step: float, dt: float) -> float:
    """Return the chance that a sample repeats the one before while the foot drives: from standstills under `SHORTEST`.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> moved = np.diff(np.round(rng.normal(0, 0.6, 3000)))
        >>> round(rests(moved, np.ones(2999, dtype=bool), 1.0, 0.1), 1)
        0.4
    """
    still = free & (np.abs(moved) < 0.5 * step)
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(np.int8))).reshape(-1, 2)
    runs = edges[:, 1] - edges[:, 0]
    short = int(runs[runs * dt < SHORTEST].sum())
    # of all samples that are no long standstill; one of each kind beforehand, so that no chance is 0 or 1
    return (short + 1) / (short + int(np.count_nonzero(free & ~still)) + 2)


def episodes(gain: Array, dt: float) -> tuple[tuple[tuple[int, int], ...], float]:
    """Most likely episodes, and twice the log likelihood that they gain.

    Args:
        gain: (n,) log likelihood of holding over driving.
        dt: s.

    Example:
        >>> episodes(np.r_[np.full(20, -3.0), np.full(20, 2.0), np.full(20, -3.0)], 0.1)[0]
        ((20, 40),)
    """
    enter, leave = np.log(BEGINS * dt), np.log(ENDS * dt)
    stay = np.log1p(-ENDS * dt) - np.log1p(-BEGINS * dt)
    drive, hold = 0.0, enter
    begun = np.zeros(gain.size, dtype=bool)  # best way into holding at t is from driving at t − 1
    ended = np.zeros(gain.size, dtype=bool)
    for t, g in enumerate(gain.tolist()):
        into, on = drive + enter, hold + stay
        out = hold + leave
        begun[t] = into >= on
        ended[t] = out > drive
        drive, hold = max(drive, out), max(into, on) + g
    spans = []
    state = hold > drive
    stop = gain.size
    for t in range(gain.size - 1, -1, -1):
        if state and begun[t]:
            spans.append((t, stop))
            state = False
        elif not state and ended[t]:
            state, stop = True, t
    out, total = [], 0.0
    for start, end in reversed(spans):
        won = float(gain[start:end].sum()) + enter + leave
        if (end - start) * dt >= SHORTEST - 1e-9 and won > 0:
            out.append((start, end))
            total += 2 * won
    return tuple(out), total


def standing(at: Flags, dt: float) -> tuple[tuple[int, int], ...]:
    """Stretches [start, stop) of at least 0.3 s.

    Example:
        >>> standing(np.array([True, False, True, True, True]), 0.1)
        ((2, 5),)
    """
    edges = np.flatnonzero(np.diff(np.r_[False, at, False].astype(np.int8)))
    return tuple((int(a), int(b)) for a, b in edges.reshape(-1, 2) if (b - a) * dt >= 0.3 - 1e-9)


def _ceiling(data: DriverData, y: Array, step: float) -> Holds:
    """A highest level at which the pedal stands far longer than just below it.

    A density falls towards its end; the seconds at the top against those at the levels below it are the evidence
    (twice the log likelihood ratio of two Poisson counts of seconds).
    """
    free = data.output.usable & ~data.output.below
    if not free.any():
        return NONE
    dt, level = data.output.dt, float(y[free].max())
    if level >= PHYSICAL:
        return NONE
    at = free & (y >= level - 0.5 * step)
    below = free & ~at & (y >= level - 3.5 * step)
    top, expected = float(at.sum()) * dt, max(float(below.sum()) * dt / 3, 1.0)
    if top <= expected:
        return NONE
    evidence = 2 * (top * float(np.log(top / expected)) - (top - expected))
    spans = standing(at, dt)
    if len(spans) < CEILING_TOUCHED or evidence < NEEDED:
        return NONE
    return Holds("pedal_ceiling", spans, evidence, level)


def _rhythm(y: Array, free: Flags, step: float, dt: float) -> tuple[float, float]:
    """Interval (s) of the rhythm in which the pedal moves, and the evidence for it; 0 where there is none.

    The moments at which it moves, as points on a circle of the rhythm's length, within half a minute each (Rayleigh).
    """
    moves = np.flatnonzero((np.abs(np.diff(y, prepend=y[0])) > 0.5 * step) & free)
    share = moves.size / max(int(free.sum()), 1)
    if moves.size < 20 or share > 1 - FULL:
        return 0.0, 0.0
    f = np.arange(0.25, 3.2, 0.01)
    window = moves // round(30 / dt)
    power = np.zeros(f.size)
    for w in np.unique(window):
        t = moves[window == w] * dt
        power += 2 * np.abs(np.exp(2j * np.pi * np.outer(f, t)).sum(axis=1)) ** 2 / t.size
    # every window adds a chi-squared with 2 degrees of freedom
    expected = 2.0 * np.unique(window).size
    k = int(np.argmax(power))
    return float(1 / f[k]), float(power[k] - expected) / max(np.sqrt(2 * expected), 1.0)
