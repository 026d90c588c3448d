"""What the radar's reports show of their own noise, and of how lively the relative motion is.

A smoother that expects less noise than there is, or livelier motion, lets noise through that is not independent of the
smoothed value: the driver then seems to answer slower and sooner (measured: tau 3 standard deviations too long and dead
time 3 too short behind a radar of twice the usual noise). Noise: the differences of third order of the gap and of second
order of the range rate, in which a vehicle's motion leaves nothing. Motion: the density of the white jerk for which the
filter's innovations are white (Mehra 1970), by stochastic approximation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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
# of the spacing of the reports that a difference joins, at most, and s. One that is lost leaves twice the spacing; of
# stamps that are closer still one is wrong
MAX_UNEVEN, MAX_SPACING_S = 2.5, 0.3
# s between range rates whose noises have nothing in common: reports that a message repeats, and the rounding of a
# coarse one, last for less. Times the noise from one report to the next, from which on noise is not white
APART_S, WHITE_RATIO = 0.1, 1.3
# of that, from which on reports are so far apart: 14 Hz and slower are by themselves
LEAST_APART = 0.7

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
    # the last reports with a gap and with a range rate, newest first: a radar may send them at different times
    gap_reports: tuple[tuple[float, float], ...] = ()  # s and m
    rate_reports: tuple[tuple[float, float, float], ...] = ()  # s, m/s, innovation

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
    return state._replace(gap_reports=(), rate_reports=(), last=0.0, reported=NAN)


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
    now = min(max(innovation, -MAX_SD), MAX_SD)
    gap_square, gaps, gap_reports = state.gap_square, state.gaps, state.gap_reports
    rate_square, rates, rate_reports = state.rate_square, state.rates, state.rate_reports
    step, changes, apart_square = state.step, state.changes, state.apart_square
    # comparisons with NaN are false: what was not reported changes nothing
    if gap == gap:
        gap_reports = ((t, gap), *gap_reports[:3])
        if (square := third_difference(gap_reports)) == square:
            gaps = min(gaps + 1.0, MEMORY)
            gap_square += (min(square, MAX_SQUARE * gap_square) - gap_square) / gaps
    before, since = state.last, dt
    if rate == rate:
        first, second = _apart(t, rate_reports)
        rate_reports = ((t, rate, now), *rate_reports[: second or None])
        if (square := second_difference(rate_reports[:3])) == square:
            rates = min(rates + 1.0, MEMORY)
            rate_square += (min(square, MAX_SQUARE * rate_square) - rate_square) / rates
        if second == 2:
            apart_square = rate_square
        elif (
            second and (square := second_difference([rate_reports[k] for k in (0, first, second)])) == square
        ):
            known = max(apart_square, state.rate_square)
            apart_square = known + (min(square, MAX_SQUARE * known) - known) / state.rates
        if len(rate_reports) > 1:
            since = t - rate_reports[1][0]
            before = rate_reports[1 if state.white or not first else first][2]
    elif rate_reports:
        # a gap's innovation says little of the motion
        since = 0.0
    moved = abs(reported - state.reported)
    if moved > LEAST_CHANGE:
        step = min(step, moved)
    if moved == moved:
        changes += ((moved > LEAST_CHANGE) - changes) / gaps
    jerk = state.jerk * (1.0 + min(since / ADAPTATION_S, 0.05) * now * before)
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
        gap_reports,
        rate_reports,
    )


def third_difference(reports: Sequence[tuple[float, float]]) -> float:
    """Variance of white noise that four reports show: what no parabola through them explains; NaN: they do not.

    >>> third_difference([(3.0, 9.0), (1.5, 2.25), (1.0, 1.0), (0.0, 0.0)])
    nan
    >>> third_difference([(0.3, 0.0), (0.2, 1.0), (0.1, 0.0), (0.0, 0.0)])
    0.45
    """
    if len(reports) < 4:
        return NAN
    (t0, g0), (t1, g1), (t2, g2), (t3, g3) = reports
    a, b, c = t0 - t1, t1 - t2, t2 - t3
    if not (max(a, b, c) < MAX_UNEVEN * min(a, b, c) and a < MAX_SPACING_S):
        return NAN
    # of a divided difference, in units of the spacing in the middle
    a, c = a / b, c / b
    w0, w1 = 1.0 / (a * (a + 1.0) * (a + 1.0 + c)), -1.0 / (a * (1.0 + c))
    w2, w3 = 1.0 / ((a + 1.0) * c), -1.0 / ((a + 1.0 + c) * (1.0 + c) * c)
    left = w0 * (g0 - g1) + (w0 + w1) * (g1 - g2) - w3 * (g2 - g3)
    return left * left / (w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3)


def second_difference(reports: Sequence[tuple[float, float, float]]) -> float:
    """The same of three reports and the line through them.

    >>> second_difference([(0.2, 0.0, 0.0), (0.1, 1.0, 0.0), (0.0, 0.0, 0.0)])
    0.6666666666666666
    """
    if len(reports) < 3:
        return NAN
    (t0, r0, _), (t1, r1, _), (t2, r2, _) = reports
    a, b = t0 - t1, t1 - t2
    if not (max(a, b) < MAX_UNEVEN * min(a, b) and a < MAX_SPACING_S):
        return NAN
    share = a / (a + b)
    left = (1.0 - share) * (r0 - r1) - share * (r1 - r2)
    return left * left / (1.0 + (1.0 - share) ** 2 + share * share)


def _apart(t: float, reports: Sequence[tuple[float, float, float]]) -> tuple[int, int]:
    """Places that range rates `APART_S` and twice that before t have behind the one of t; 0: there is none.

    >>> [_apart(0.2, [(0.2 - (k + 1) / hz, 0.0, 0.0) for k in range(20)]) for hz in (10.0, 14.0, 20.0, 50.0)]
    [(1, 2), (1, 2), (2, 4), (4, 8)]
    """
    places, since = [0, 0], t
    first = 0
    for k, (at, *_) in enumerate(reports, 1):
        if since - at > LEAST_APART * APART_S:
            places[first], first, since = k, first + 1, at
            if first == 2:
                break
    return places[0], places[1]
