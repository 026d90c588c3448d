"""Episodes in which the pedal stands still although the fitted model would move it.

Two explanations of every sample are compared: the driver drives (model plus autocorrelated noise), or the pedal is
held (the sample before, to within the sensor's step). The most likely path through both (Viterbi 1967) gives the
episodes and their evidence. The pattern of the episodes names the cause: always at the same top level - a ceiling;
nearly all the time and with a rhythm - act and wait; now and then - looking away.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification import movement_rhythm
from canid.models.diagnosis.driver.driver_data import PEDAL_END_PERCENT, DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.fitting.fitted_model import FittedModel, M
from canid.models.diagnosis.fitting.likelihood import Output
from canid.models.effects.effect import Detector
from canid.values.findings import Flags
from canid.values.runs import runs
from canid.values.types import Array

# s; a shorter standstill is the turning point of a movement
MIN_HOLD_S = 1.3
# 1/s; an episode begins once a minute, and lasts some three seconds (Boer 2001; glances: Klauer et al. 2006)
BEGIN_RATE_HZ, END_RATE_HZ = 1 / 60.0, 1 / 3.0
# sensor steps, standard deviation of a held pedal; rounding alone gives 0.29, and no driver holds perfectly still
TREMBLE_STEPS = 0.35
# 2 Δ log likelihood that all episodes together must have above what each costs: a pedal at rest between two motions
# reached 12 on clean drives
NEEDED_EVIDENCE = 30.0
# and so many episodes, as a single one may be a rest
MIN_EPISODES = 2
# log likelihood of a sample at most: a jump of twenty sensor steps says no more against holding than a larger one
MAX_SQUARED_JUMP = 400.0
# log likelihood of holding where the demand is hidden or a row does not count: never
NEVER_LOG_LIKELIHOOD = -50.0
# sensor steps; nearer than this the pedal is at its highest level, and so many levels below it are the comparison
TOP_STEPS, BELOW_STEPS = 0.5, 3
# of the standstills that are at the pedal's highest level where it is a ceiling
MIN_TOP_SHARE = 0.75
# times that a ceiling must have been reached
MIN_TOUCHES = 3
# s at the top that count as one time: a shorter one is the sensor's rounding
MIN_TOUCH_S = 0.3


class Holds(NamedTuple):
    """What was found."""

    pattern: Detector | None  # PEDAL_CEILING, PEDAL_RHYTHM or PEDAL_HOLDS; None: nothing
    episodes: tuple[tuple[int, int], ...]  # [start, stop) samples
    evidence: float  # 2 Δ log likelihood
    level: float  # % of the ceiling, s of the rhythm; NaN otherwise
    needed: float = NEEDED_EVIDENCE  # evidence that chance does not reach


NONE = Holds(None, (), 0.0, np.nan)


def ceiling(held: tuple[Holds, ...]) -> float:
    """Level of the ceiling among what was found; infinite where there is none."""
    return next((holds.level for holds in held if holds.pattern is Detector.PEDAL_CEILING), np.inf)


def away(held: tuple[Holds, ...]) -> tuple[tuple[int, int], ...]:
    """Episodes of looking away among what was found: [start, stop) samples."""
    return next((holds.episodes for holds in held if holds.pattern is Detector.PEDAL_HOLDS), ())


def detect(data: DriverData, solved: FittedDriver, before: tuple[Holds, ...] = ()) -> Holds:
    """Find episodes in what a model leaves.

    Args:
        data: what is explained; nothing is searched above a known ceiling.
        solved: the model.
        before: what was found already. With a ceiling only episodes of looking away can follow; after those, nothing.
    """
    if not data.pedal or any(holds.pattern is not Detector.PEDAL_CEILING for holds in before):
        return NONE  # an acceleration never stands still
    y = data.output.y
    step = movement_rhythm.step_size(y[data.output.usable])
    free = data.output.usable & ~data.output.hidden
    gain = holding(data.output, solved, step)
    top = NONE if before else _ceiling(data, y, step)
    if top.pattern is not None:
        return top
    interval, beats, bound = (
        (0.0, 0.0, np.inf) if before else movement_rhythm.rhythm(y, free, step, data.output.dt)
    )
    if beats > bound:
        moves = np.flatnonzero(movement_rhythm.moving(y, step) & free)
        spans = tuple((int(a), int(b)) for a, b in pairwise(moves.tolist()))
        return Holds(Detector.PEDAL_RHYTHM, spans, beats, interval, bound)
    spans, evidence = episodes(gain, data.output.dt)
    if len(spans) < MIN_EPISODES or evidence < NEEDED_EVIDENCE:
        return NONE
    level = float(y[free].max())
    if (
        not before
        and level < PEDAL_END_PERCENT
        and np.mean([y[a] >= level - 1.5 * step for a, _ in spans]) > MIN_TOP_SHARE
    ):
        return Holds(Detector.PEDAL_CEILING, spans, evidence, level)
    return Holds(Detector.PEDAL_HOLDS, spans, evidence, np.nan)


def holding(output: Output, solved: FittedModel[M], step: float) -> Array:
    """Log likelihood (n,) that the output is held, over that it is driven.

    Args:
        output: as measured.
        solved: the model of the driving.
        step: of the sensor.
    """
    held_sd = max(TREMBLE_STEPS * step, 1e-3)
    free = output.usable & ~output.hidden
    # innovations also where rows do not count after a masked stretch: there the noise is as wide as it can be
    sd = solved.noise.sd * solved.noise.size
    e = np.where(solved.rows, solved.fitted.scored.e, 0.0)
    driving = -0.5 * e * e - np.log(np.maximum(sd, 0.5 * held_sd))
    moved = np.r_[np.inf, np.diff(output.y)]
    still = -0.5 * np.minimum((moved / held_sd) ** 2, MAX_SQUARED_JUMP) - np.log(held_sd)
    # a pedal that moves slowly repeats a level of the sensor now and then; a continuous density does not allow for that
    resting = -np.log(rests(moved, free, step, output.dt)) + 0.5 * (e * e - 1.0)
    out: Array = np.where(free & solved.rows, np.minimum(still - driving, resting), NEVER_LOG_LIKELIHOOD)
    return out


def rests(moved: Array, free: Flags, step: float, dt: float) -> float:
    """Probability that a sample repeats the one before while the pedal moves, from standstills under `MIN_HOLD_S`.

    Example:
        >>> rng = np.random.default_rng(1)
        >>> moved = np.diff(np.round(rng.normal(0, 0.6, 3000)))
        >>> round(rests(moved, np.ones(2999, dtype=bool), 1.0, 0.1), 1)
        0.4
    """
    still = free & (np.abs(moved) < 0.5 * step)
    lengths = [stop - start for start, stop in runs(still)]
    short = sum(length for length in lengths if length * dt < MIN_HOLD_S)
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
    enter, leave = np.log(BEGIN_RATE_HZ * dt), np.log(END_RATE_HZ * dt)
    stay = np.log1p(-END_RATE_HZ * dt) - np.log1p(-BEGIN_RATE_HZ * dt)
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
        if (end - start) * dt >= MIN_HOLD_S - 1e-9 and won > 0:
            out.append((start, end))
            total += 2 * won
    return tuple(out), total


def standing(at: Flags, dt: float) -> tuple[tuple[int, int], ...]:
    """Stretches [start, stop) of at least `MIN_TOUCH_S`.

    Example:
        >>> standing(np.array([True, False, True, True, True]), 0.1)
        ((2, 5),)
    """
    return tuple((a, b) for a, b in runs(at) if (b - a) * dt >= MIN_TOUCH_S - 1e-9)


def _ceiling(data: DriverData, y: Array, step: float) -> Holds:
    """A highest level at which the pedal stands far longer than just below it.

    A density falls towards its end; the seconds at the top against those at the levels below it are the evidence
    (twice the log likelihood ratio of two Poisson counts of seconds).
    """
    free = data.output.usable & ~data.output.hidden
    # the output's own limit is no habit, and nothing below it stops the pedal
    if data.output.above.any() or not free.any():
        return NONE
    dt, level = data.output.dt, float(y[free].max())
    if level >= PEDAL_END_PERCENT:
        return NONE
    at = free & (y >= level - TOP_STEPS * step)
    below = free & ~at & (y >= level - (BELOW_STEPS + TOP_STEPS) * step)
    top, expected = float(at.sum()) * dt, max(float(below.sum()) * dt / BELOW_STEPS, 1.0)
    if top <= expected:
        return NONE
    evidence = 2 * (top * float(np.log(top / expected)) - (top - expected))
    spans = standing(at, dt)
    if len(spans) < MIN_TOUCHES or evidence < NEEDED_EVIDENCE:
        return NONE
    return Holds(Detector.PEDAL_CEILING, spans, evidence, level)
