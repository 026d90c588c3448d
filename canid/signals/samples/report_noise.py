"""What the radar's reports show of their own noise, and of how lively the relative motion is.

A smoother that expects less noise than there is, or livelier motion, lets noise through that is not independent of the
smoothed value: the driver then seems to answer slower and sooner (measured: tau 3 standard deviations too long and dead
time 3 too short behind a radar of twice the usual noise). Noise: the differences of third order of the gap and of second
order of the range rate, in which a vehicle's motion leaves nothing. Motion: the density of the white jerk for which the
filter's innovations are white (Mehra 1970), by stochastic approximation.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from canid.values.state_constraints import FINITE, NOT_NEGATIVE, POSITIVE
from canid.values.types import NAN


class Noise(NamedTuple):
    """Standard deviations of the radar's reports; NaN: to be estimated."""

    gap: float = NAN  # m
    range_rate: float = NAN  # m/s


# typical of 77 GHz automotive radar; what is assumed until the reports show more
USUAL = Noise(0.25, 0.12)
# reports' worth of belief in the usual noise
BELIEF = 5.0
# reports after which half is forgotten, about: a minute at 20 Hz
MEMORY = 1200.0
# one step of a fine resolution: a rounded signal that stands still shows no noise at all
LEAST = Noise(0.02, 0.005)
# m; a smaller change is the rounding of a conversion
LEAST_CHANGE = 1e-6
# squared differences beyond so many variances count as so many: another target is no noise
MAX_SQUARE = 9.0
# of the spacing of the reports that a difference joins, at most, and s
MAX_UNEVEN, MAX_SPACING_S = 1.5, 0.3
# s between range rates whose noises have nothing in common: reports that a message repeats, and the rounding of a
# coarse one, last for less. Times the noise from one report to the next, from which on noise is not white
APART_S, WHITE_RATIO = 0.1, 1.3
# variance of a difference of white noise: binomial coefficients (2m over m)
THIRD, SECOND = 20.0, 6.0

# (m/s³)²·s; where the jerk's density starts, and where it ends: a motorway at night, and emergency braking all the time
JERK_DENSITY, CALMEST, LIVELIEST = 1.0, 0.03, 6.0
# s in which the logarithm of the density moves by as much as neighbouring innovations correlate
ADAPTATION_S = 4.0
# an innovation beyond three sd counts as three
MAX_SD = 3.0


class State(NamedTuple):
    """Running estimates; they outlast a target."""

    gap_square: Annotated[float, POSITIVE] = USUAL.gap**2  # m², of the noise
    rate_square: Annotated[float, POSITIVE] = USUAL.range_rate**2  # (m/s)²
    gaps: Annotated[float, POSITIVE] = BELIEF  # differences behind the estimate, at most MEMORY
    rates: Annotated[float, POSITIVE] = BELIEF
    apart_square: Annotated[float, NOT_NEGATIVE] = 0.0  # (m/s)², by range rates `APART_S` apart; 0: not known
    jerk: Annotated[float, POSITIVE] = JERK_DENSITY  # (m/s³)²·s
    last: Annotated[float, FINITE] = 0.0  # innovation of the last report, in its sd
    step: Annotated[float, NOT_NEGATIVE] = math.inf  # m, smallest change of the gap so far
    changes: Annotated[float, FINITE] = 1.0  # of the gap, per report
    reported: float = NAN  # m, the last gap, without the own way
    # the last reports, newest first: time, gap, range rate, innovation
    recent: tuple[tuple[float, float, float, float], ...] = ()

    @property
    def white(self) -> bool:
        """Whether the range rate's noise is: that of one report says nothing of the next one's."""
        return not self.apart_square > WHITE_RATIO * self.rate_square


def noise(state: State, stated: Noise) -> Noise:
    """Return the noise to be expected: as stated, else as estimated.

    >>> noise(State(), Noise(range_rate=0.3))
    Noise(gap=0.25, range_rate=0.3)
    """
    gap = stated.gap if stated.gap == stated.gap else max(state.gap_square**0.5, LEAST.gap)
    rate = (
        stated.range_rate
        if stated.range_rate == stated.range_rate
        else max(state.rate_square**0.5, LEAST.range_rate)
    )
    return Noise(gap, rate)


def for_filter(state: State, stated: Noise) -> Noise:
    """Return the noise of independent reports that say as much: a gap's error of rounding lasts until it changes.

    Of a range rate that is repeated, or rounded, the noise lasts for a report or more. Second differences show
    6 c0 - 8 c1 + 2 c2 of its covariances, six times `rate_square`, and c0 where they are apart: c0 + 2 c1 counts.

    >>> coarse = State(gap_square=0.01, step=2.0, changes=0.05)
    >>> [round(of(coarse, Noise()).gap, 2) for of in (noise, for_filter)]
    [0.1, 2.52]
    """
    seen = noise(state, stated)
    if not state.white and stated.range_rate != stated.range_rate:
        lasting = 2.5 * (state.apart_square - state.rate_square)
        seen = seen._replace(range_rate=math.sqrt(state.rate_square + lasting))
    if not math.isfinite(state.step):
        return seen
    # a gap that changes with every report shows its rounding as noise
    stays = 1.0 / max(state.changes, 1.0 / MEMORY) - 1.0
    rounding = state.step * state.step / 12.0 * max(stays, 0.0)
    return seen._replace(gap=max(seen.gap, rounding**0.5))


def another_target(state: State) -> State:
    """Keep what is known of the radar; its next reports are of something else."""
    return state._replace(recent=(), last=0.0, reported=NAN)


def step(
    state: State, t: float, gap: float, rate: float, innovation: float, dt: float, reported: float = NAN
) -> State:
    """Take one report.

    Args:
        state: so far.
        t: s.
        gap: m, NaN where it has none.
        rate: m/s, NaN where it has none.
        innovation: of the filter, of the range rate or, where there is none, of the gap, in its standard deviation.
        dt: s since the report before.
        reported: m, the gap as it came, without the own way.

    >>> import random
    >>> draw, state = random.Random(1), State()
    >>> for k in range(4000):
    ...     state = step(state, 0.05 * k, draw.gauss(30.0, 0.5), draw.gauss(0.0, 0.03), 0.0, 0.05)
    >>> [round(x, 1) for x in (noise(state, Noise()).gap, 10.0 * noise(state, Noise()).range_rate)]
    [0.5, 0.3]
    """
    apart = max(round(APART_S / dt), 1) if dt > 0.0 else 1
    now = min(max(innovation, -MAX_SD), MAX_SD)
    recent = ((t, gap, rate, now), *state.recent[: max(2 * apart, 3)])
    apart_square = _apart(state, recent, apart)
    gap_square, gaps, rate_square, rates = state.gap_square, state.gaps, state.rate_square, state.rates
    step, changes = state.step, state.changes
    if len(recent) > 3:
        (t0, g0, r0, _), (t1, g1, r1, _), (t2, g2, r2, _), (t3, g3, *_) = recent[:4]
        a, b, c = t0 - t1, t1 - t2, t2 - t3
        if max(a, b, c) < MAX_UNEVEN * min(a, b, c) and a < MAX_SPACING_S:
            third, second = g0 - 3.0 * (g1 - g2) - g3, r0 - 2.0 * r1 + r2
            # comparisons with NaN are false: what was not reported changes nothing
            if third == third:
                gaps = min(gaps + 1.0, MEMORY)
                gap_square += (min(third * third / THIRD, MAX_SQUARE * gap_square) - gap_square) / gaps
            if second == second:
                rates = min(rates + 1.0, MEMORY)
                rate_square += (min(second * second / SECOND, MAX_SQUARE * rate_square) - rate_square) / rates
    moved = abs(reported - state.reported)
    if moved > LEAST_CHANGE:
        step = min(step, moved)
    if moved == moved:
        changes += ((moved > LEAST_CHANGE) - changes) / gaps
    before = state.last if state.white or len(recent) <= apart else recent[apart][3]
    jerk = state.jerk * (1.0 + min(dt / ADAPTATION_S, 0.05) * now * before)
    return State(
        max(gap_square, LEAST.gap**2),
        max(rate_square, LEAST.range_rate**2),
        gaps,
        rates,
        apart_square,
        min(max(jerk, CALMEST), LIVELIEST),
        now,
        step,
        changes,
        reported if reported == reported else state.reported,
        recent,
    )


def _apart(state: State, recent: tuple[tuple[float, float, float, float], ...], apart: int) -> float:
    """Take second differences of range rates `apart` reports apart; those of neighbours say the same where that is 1."""
    if apart < 2 or len(recent) <= 2 * apart:
        return state.apart_square
    (t0, _, r0, _), (t1, _, r1, _), (t2, _, r2, _) = recent[0], recent[apart], recent[2 * apart]
    a, b = t0 - t1, t1 - t2
    second = r0 - 2.0 * r1 + r2
    if not (max(a, b) < MAX_UNEVEN * min(a, b) and a < MAX_SPACING_S and second == second):
        return state.apart_square
    known = max(state.apart_square, state.rate_square)
    return known + (min(second * second / SECOND, MAX_SQUARE * known) - known) / state.rates
