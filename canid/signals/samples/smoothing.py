"""Fixed-lag smoother (Rauch, Tung & Striebel 1965) of the lead's motion from noisy radar reports.

State: the lead's position, speed and acceleration; the own way and speed are known inputs (`own_speed.py`). Where they
are not, it is gap, range rate and relative acceleration, which hold the driver's own response: the lag lets the next few
reports correct an estimate then, and no more than that, as what is smoothed with all of the future carries the response
back into the input and biases everything that is identified from it.

Of the lead's motion more of the future may be used, and has to be: the error of a fixed-lag estimate is uncorrelated
with all estimates before it, and not with those in the next few tenths of a second, which know more. A dead time would
come out too short by that.

Three states are written out in plain floats: a report costs a sixth of what calls of numpy or filterpy on arrays of
three cost, and an hour of a 20 Hz radar has 72,000. tests/test_smoothing.py holds it against filterpy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from canid.signals.samples import repeated_reports, report_noise
from canid.signals.samples.report_noise import Noise
from canid.values.types import NAN

# s, of the relative motion; after 0.5 s more reports of a good radar say next to nothing, and what the driver has done
# since then has moved the car by millimetres: he answers after 0.2 s or more, and the rest has to pass the engine and two
# integrals
LAG_S = 0.5
# m/s, noise of the range rate for which that is so. A filter's time constant grows with its square root; behind a radar four
# times as noisy a lag of 0.5 s leaves errors that later estimates know: tau came out 0.08 s too long, 0.03 s with 1 s
GOOD_RATE_NOISE = 0.05
# s, of the lead's own motion: three time constants of the filter behind a coarse radar. Intervals of 95 % held tau and
# dead time of 24 drives of 20 min on 0.88 and 0.83 of them with 0.5 s, 0.92 and 0.88 with 1 s, 0.96 and 0.96 with 1.5 s
LEAD_LAG_S = 1.5
# s; so many reports are smoothed at once, as each time goes back over the whole lag
TOGETHER_S = 0.2
# s; times are whole nanoseconds: half of one keeps a report that is exactly LAG_S old on this side
ROUNDING_S = 5e-10
# s; longer than this without a report and the target may be another one
MAX_REPORT_AGE_S = 0.5
# m; another vehicle is at least a short car's length nearer or further. Less than that is the sensor: real gaps
# (data/openacc) drift against their own range rate by 1 m/s, so no test in units of the stated noise can hold
MAX_GAP_ERROR = 2.0
# m/s²; no vehicle changes the range rate faster (emergency braking of one of the two)
MAX_RELATIVE_ACCEL = 10.0
# standard deviations of the report's own noise on top of both: one false alarm in 2 million reports
MAX_ERROR_SIGMAS = 5.0
# m/s; an own speed that jumps by more than this, and more than a vehicle can, is no motion
MAX_OWN_STEP = 0.5
# reports in a row that do not fit, before the target is another one: a single one is an outlier
MIN_MISFITTING_REPORTS = 3


class Age(NamedTuple):
    """How old a report may be and still count: s; older than this is not measured any more."""

    gap: float = MAX_REPORT_AGE_S
    range_rate: float = MAX_REPORT_AGE_S

    @property
    def bridge(self) -> float:
        """For so long may the gap be missing while the target is still the same one, s."""
        return max(MAX_REPORT_AGE_S, self.gap)


DEFAULT_AGE = Age()
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]  # 00, 01, 02, 11, 12, 22 of a (3, 3)
Square = tuple[float, float, float, float, float, float, float, float, float]  # a (3, 3), row by row


class Filtered(NamedTuple):
    """The filter right after one report."""

    t: float
    x: Vector
    P: Symmetric
    prior: Vector  # x as the report before expected it
    back: Square  # the smoother's gain, from this report to the one before
    gap_at: float  # s, of the latest report until now that had a gap
    rate_at: float  # s, of the latest report until now that had a range rate
    own: float = NAN  # m/s, own speed; NaN: the motion is relative
    way: float = 0.0  # m, own way since the target came

    @property
    def relative(self) -> tuple[float, float]:
        """Gap and range rate, m and m/s."""
        x = self.x
        return (x[0] - self.way, x[1] - self.own) if self.own == self.own else (x[0], x[1])


class Smoothed(NamedTuple):
    """One report, smoothed."""

    t: float
    gap: float  # m; NaN: not measured for longer than it may be old
    range_rate: float  # m/s; NaN likewise
    lead_speed: float = NAN  # m/s; NaN likewise, and where the own speed is not known


class State(NamedTuple):
    """Reports whose smoothing is not over; the last one is the newest."""

    history: tuple[Filtered, ...] = ()
    misfits: int = 0  # reports in a row that did not fit
    started: bool = False  # has history[0] been given out?
    shown: report_noise.State = report_noise.State()  # what the reports show of the radar
    repeats: repeated_reports.State = repeated_reports.State()


def expect(x: Vector, dt: float) -> Vector:
    """Let the motion go on for dt."""
    gap, rate, accel = x
    return gap + dt * rate + dt * dt / 2 * accel, rate + dt * accel, accel


def propagated_covariance(P: Symmetric, dt: float, jerk: float) -> tuple[Square, Symmetric]:
    """Propagate the covariance of a motion of white jerk of a density by dt (Bar-Shalom 2001, eq. 6.2.3-7).

    Returns:
        F P, and F P F' + Q.
    """
    p00, p01, p02, p11, p12, p22 = P
    half = dt * dt / 2
    # F = [1, dt, half; 0, 1, dt; 0, 0, 1]; the last row of F P is P's
    f00, f01, f02 = p00 + dt * p01 + half * p02, p01 + dt * p11 + half * p12, p02 + dt * p12 + half * p22
    f10, f11, f12 = p01 + dt * p02, p11 + dt * p12, p12 + dt * p22
    cubed = dt * half * jerk
    N = (
        f00 + dt * f01 + half * f02 + cubed * dt * dt / 10,
        f01 + dt * f02 + cubed * dt / 4,
        f02 + cubed / 3,
        f11 + dt * f12 + cubed * 2 / 3,
        f12 + half * jerk,
        p22 + dt * jerk,
    )
    return (f00, f01, f02, f10, f11, f12, p02, p12, p22), N


def gain(FP: Square, N: Symmetric) -> Square:
    """Return P F' inv(N), the smoother's gain (Rauch, Tung & Striebel 1965)."""
    f00, f01, f02, f10, f11, f12, p02, p12, p22 = FP
    n00, n01, n02, n11, n12, n22 = N
    # the inverse by cofactors: the covariance of three quantities that every report distinguishes
    c00, c01, c02 = n11 * n22 - n12 * n12, n02 * n12 - n01 * n22, n01 * n12 - n02 * n11
    c11, c12, c22 = n00 * n22 - n02 * n02, n01 * n02 - n00 * n12, n00 * n11 - n01 * n01
    d = 1.0 / (n00 * c00 + n01 * c01 + n02 * c02)
    return (
        (f00 * c00 + f10 * c01 + p02 * c02) * d,
        (f00 * c01 + f10 * c11 + p02 * c12) * d,
        (f00 * c02 + f10 * c12 + p02 * c22) * d,
        (f01 * c00 + f11 * c01 + p12 * c02) * d,
        (f01 * c01 + f11 * c11 + p12 * c12) * d,
        (f01 * c02 + f11 * c12 + p12 * c22) * d,
        (f02 * c00 + f12 * c01 + p22 * c02) * d,
        (f02 * c01 + f12 * c11 + p22 * c12) * d,
        (f02 * c02 + f12 * c12 + p22 * c22) * d,
    )


def update(
    x: Vector, P: Symmetric, gap: float, range_rate: float, noise: Noise
) -> tuple[Vector, Symmetric, float]:
    """Take in what a report has, one number after the other: their noises have nothing in common.

    Returns:
        state, covariance, and the innovation of the last number in its standard deviation.
    """
    innovation = 0.0
    x0, x1, x2 = x
    p00, p01, p02, p11, p12, p22 = P
    if gap == gap:
        s = p00 + noise.gap * noise.gap
        k0, k1, k2, e = p00 / s, p01 / s, p02 / s, gap - x0
        innovation = e / s**0.5
        x0, x1, x2 = x0 + k0 * e, x1 + k1 * e, x2 + k2 * e
        p11, p12, p22 = p11 - k1 * p01, p12 - k1 * p02, p22 - k2 * p02
        # 1 - k0 = R / s: no difference of what is nearly the same
        left = noise.gap * noise.gap / s
        p00, p01, p02 = left * p00, left * p01, left * p02
    if range_rate == range_rate:
        s = p11 + noise.range_rate * noise.range_rate
        k0, k1, k2, e = p01 / s, p11 / s, p12 / s, range_rate - x1
        innovation = e / s**0.5
        x0, x1, x2 = x0 + k0 * e, x1 + k1 * e, x2 + k2 * e
        p00, p02, p22 = p00 - k0 * p01, p02 - k0 * p12, p22 - k2 * p12
        left = noise.range_rate * noise.range_rate / s
        p01, p11, p12 = left * p01, left * p11, left * p12
    return (x0, x1, x2), (p00, p01, p02, p11, p12, p22), innovation


_NOTHING: Square = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def fresh(state: State) -> State:
    """Return the state without a target; what is known of the radar stays."""
    return State(shown=report_noise.another_target(state.shown), repeats=state.repeats)


def _start(
    state: State, t: float, gap: float, range_rate: float, own_speed: float, noise: Noise, rate_at: float
) -> State:
    """Begin with a target; a range rate that has not come yet may take as long as one that has stopped."""
    rate_known = range_rate == range_rate
    if own_speed == own_speed:
        range_rate += own_speed
    # an unknown range rate is within ±20 m/s; relative accelerations stay within ±2 m/s²
    P = (noise.gap**2, 0.0, 0.0, noise.range_rate**2 if rate_known else 100.0, 0.0, 1.0)
    x = (gap, range_rate if rate_known else own_speed if own_speed == own_speed else 0.0, 0.0)
    first = Filtered(t, x, P, x, _NOTHING, t, t if rate_known else rate_at, own_speed)
    return fresh(state)._replace(history=(first,))


def fits(state: State, t: float, gap: float, range_rate: float, noise: Noise, age: Age = DEFAULT_AGE) -> bool:
    """Could this report be of the object that is being followed?"""
    if not state.history:
        return False
    last = state.history[-1]
    expected = report_noise.noise(state.shown, noise)
    return matches(last.relative, t - last.t, gap, range_rate, expected, age.bridge)


def matches(
    x: tuple[float, float],
    dt: float,
    gap: float,
    range_rate: float,
    noise: Noise,
    bridge: float = MAX_REPORT_AGE_S,
) -> bool:
    """Could a report be of the object that was at `x` (gap, range rate) dt ago?"""
    if dt > bridge:
        return False
    # comparisons with NaN are false: what the report does not say does not speak against it
    if abs(gap - (x[0] + x[1] * dt)) > MAX_GAP_ERROR + MAX_ERROR_SIGMAS * noise.gap:
        return False
    return not abs(range_rate - x[1]) > MAX_RELATIVE_ACCEL * dt + MAX_ERROR_SIGMAS * noise.range_rate


def step(
    state: State,
    t: float,
    gap: float,
    range_rate: float,
    noise: Noise,
    age: Age = DEFAULT_AGE,
    own_speed: float = NAN,
) -> tuple[State, list[Smoothed], bool]:
    """Take one report.

    Args:
        state: from `State()` or the step before.
        t: time of the report in s, not before the last one's.
        gap: m; NaN if the report has none.
        range_rate: m/s; NaN if the report has none.
        noise: of the radar; what is NaN in it is estimated.
        age: that a gap and a range rate may have.
        own_speed: own speed at t, m/s; NaN: not known, and the relative motion is smoothed.

    Returns:
        the next state, the reports that are now smoothed with a lag of `LEAD_LAG_S` (relative motion: `lag`), and
        whether the target has changed (then `flush` was applied to the old one before).

    Example:
        >>> state = State()
        >>> for k in range(20):
        ...     state, smoothed, changed = step(state, k * 0.05, 30.0 + k * 0.05, 1.0, Noise())
        >>> round(smoothed[0].gap, 2), round(smoothed[0].range_rate, 2), changed
        (30.4, 1.0, False)
    """
    if gap != gap and (range_rate != range_rate or not state.history):
        return state, [], False
    expected = report_noise.noise(state.shown, noise)
    if not state.history:
        return _start(state, t, gap, range_rate, own_speed, expected, t), [], False
    if not fits(state, t, gap, range_rate, noise, age):
        gone = t - state.history[-1].t > age.bridge
        if gap != gap or (not gone and state.misfits + 1 < MIN_MISFITTING_REPORTS):
            return state._replace(misfits=state.misfits + 1), [], False
        again = _start(state, t, gap, range_rate, own_speed, expected, state.history[-1].rate_at)
        return again, flush(state, age), True
    last = state.history[-1]
    dt = t - last.t
    if (own_speed == own_speed) != (last.own == last.own) or abs(
        own_speed - last.own
    ) > MAX_RELATIVE_ACCEL * dt + MAX_OWN_STEP:
        # the own speed has come, gone or jumped: the same target in other coordinates
        if gap != gap:
            return state, [], False
        return _start(state, t, gap, range_rate, own_speed, expected, last.rate_at), flush(state, age), False
    repeats, repeated = repeated_reports.step(state.repeats, gap, range_rate, dt)
    if repeated:
        return State(state.history, 0, state.started, state.shown, repeats), [], False
    way, reported = 0.0, gap
    if own_speed == own_speed:
        way = last.way + 0.5 * dt * (last.own + own_speed)
        gap, range_rate = gap + way, range_rate + own_speed
    # Rauch, Tung & Striebel 1965, eq. 3.29: what this report will say of the one before depends on no later one
    prior, (FP, N) = expect(last.x, dt), propagated_covariance(last.P, dt, state.shown.jerk)
    x, P, innovation = update(prior, N, gap, range_rate, report_noise.for_filter(state.shown, noise))
    shown = report_noise.step(state.shown, t, gap, range_rate, innovation, dt, reported)
    gap_at = t if gap == gap else last.gap_at
    rate_at = t if range_rate == range_rate else last.rate_at
    now = Filtered(t, x, P, prior, gain(FP, N), gap_at, rate_at, own_speed, way)
    history = (*state.history, now)
    old = t - (LEAD_LAG_S if own_speed == own_speed else lag(expected)) + ROUNDING_S
    if own_speed == own_speed and history[state.started].t > old - TOGETHER_S:
        return State(history, 0, state.started, shown, repeats), [], False
    ready = int(state.started)
    while history[ready].t <= old:
        ready += 1
    out = _smooth(history, int(state.started), ready, age) if ready > state.started else []
    # one report that was given out stays in front: it is where the next stretch begins
    kept = history[max(ready - 1, 0) :]
    return State(kept, 0, ready > 0, shown, repeats), out, False


def lag(noise: Noise) -> float:
    """For so long reports of the relative motion count after one, s.

    >>> [lag(Noise(0.1, sd)) for sd in (0.01, 0.05, 0.2, 2.0)]
    [0.5, 0.5, 1.0, 1.5]
    """
    return min(LAG_S * math.sqrt(max(noise.range_rate / GOOD_RATE_NOISE, 1.0)), LEAD_LAG_S)


def early(state: State, t: float, age: Age = DEFAULT_AGE) -> tuple[State, list[Smoothed]]:
    """Give out what is being smoothed where no report has come until t for half a second; the target stays.

    >>> state = step(step(State(), 0.0, 30.0, 0.0, Noise())[0], 0.05, 30.0, 0.0, Noise())[0]
    >>> [len(early(state, t)[1]) for t in (0.1, 0.6)]
    [0, 2]
    """
    history = state.history
    if not (len(history) > state.started and t - history[-1].t > MAX_REPORT_AGE_S):
        return state, []
    return state._replace(history=history[-1:], started=True), flush(state, age)


def flush(state: State, age: Age = DEFAULT_AGE) -> list[Smoothed]:
    """Return the rest, smoothed with what there is: the target is gone."""
    return _smooth(state.history, int(state.started), len(state.history), age)


def _smooth(history: tuple[Filtered, ...], first: int, end: int, age: Age) -> list[Smoothed]:
    """Go back from the newest report; give out those from `first` to before `end`."""
    if end <= first:
        return []
    gap, rate, accel = history[-1].x
    out = [_given(history[-1], gap, rate, age)] if end == len(history) else []
    for k in range(len(history) - 2, first - 1, -1):
        item, later = history[k], history[k + 1]
        p, q, r = later.prior
        d, e, f = gap - p, rate - q, accel - r
        g = later.back
        gap, rate, accel = item.x
        gap += g[0] * d + g[1] * e + g[2] * f
        rate += g[3] * d + g[4] * e + g[5] * f
        accel += g[6] * d + g[7] * e + g[8] * f
        if k < end:
            out.append(_given(item, gap, rate, age))
    out.reverse()
    return out


def _given(item: Filtered, gap: float, rate: float, age: Age) -> Smoothed:
    """Leave out what the filter alone has carried on for longer than it may be old."""
    t, lead = item.t, NAN
    if t - item.rate_at > age.range_rate:
        rate = NAN
    if item.own == item.own:
        lead, rate, gap = rate, rate - item.own, gap - item.way
    return Smoothed(t, gap if t - item.gap_at <= age.gap else NAN, rate, lead)
