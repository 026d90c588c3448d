"""The own motion in the range rate: its size gives the unit of the speed, its delay the age of the radar's reports.

    range_rate(t) = lead speed(t − δ) − speed(t − δ)/c + noise

With the right c and δ, range_rate(t) + speed(t − δ)/c is the lead's speed, in which nothing of the own motion is left. An
autoregression whitens it, and its innovations' variance gives the likelihood of c and δ (prediction errors; Ljung 1999,
ch. 7.4 and 13.4). All of them come from one matrix of covariances, so a second costs one product.

The lead's own motion, seen through noise, biases this: on 48 simulated drives of 6 min with right units and no delay, 1/c
came out at 0.28 to 1.2, so a unit is questioned only where headways are implausible as well. On 1,200 drives of 8 min with
leads of many kinds, radars of 0.01 to 0.25 m/s and a delay of 0 or 0.5 s, δ is stated on half; it held to two standard
deviations and 0.1 s on 97 and 95 % of those whose standard deviation is below 0.03 s, and needs 0.4 s for that on the
others. δ = 0 is less likely by 45 on 1 of 600 where it is right (by 15 on 14), and on 41 % with 0.5 s: a latency is a
finding only there.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.signals.signal_checks.blocks import GAP, RANGE_RATE, SPEED, Block
from canid.signals.signal_checks.check import Check, Found, unit_of
from canid.values.state_constraints import TIME
from canid.values.types import NAN, Array

# s; the own motion holds little above 2 Hz
STEP_S = 0.2
# steps of the autoregression, two seconds; and of delays, to the past and to the future
ORDER, OLDEST, YOUNGEST = 10, 7, 3
DELAYS = np.arange(-YOUNGEST, OLDEST + 1)
_REACH = OLDEST + ORDER
_SIZE = ORDER + 1 + YOUNGEST + _REACH + 1
# rows over which the covariances forget, ten minutes: a latency is a property of the radar
MEMORY_ROWS = 3000
# rows that are added at once, 5 s of them: one product costs as much as one of a single row
FRESH_ROWS = 25
# blocks between two judgements, and rows that are needed: 90 s
JUDGED_EVERY, NEEDED_ROWS = 20, 450
# natural logarithm of a likelihood ratio from which on the own motion stands out
EVIDENCE = 12.0
# the same for the ends of an interval: 3.7 standard deviations
SURE = 7.0
# the same, by which a δ must be likelier than 0, see above
LATE_EVIDENCE = 45.0
# s; bias by the lead's motion where the standard deviation is below the limit, and where it is not, see above
BIAS_S, PRECISE_SD_S, IMPRECISE_BIAS_S = 0.1, 0.03, 0.4
# s; what ages may be: reports of a 20 Hz radar are 0.05 s old, and dead times are quoted to 0.05 s
MAX_AGE_S = 0.05
# 1/c that are tried, from mph declared as m/s and worse up to the reverse
FACTORS = np.array([0.15, 0.2, 0.278, 0.36, 0.447, 0.55, 0.7, 0.85, 1.0, 1.2, 1.6, 2.24, 2.8, 3.6])
# 1/c outside which no right unit comes out, and medians of headway (s) that confirm it: drivers keep 1 to 3 s
LOW_FACTOR, HIGH_FACTOR = 0.4, 1.4
SHORT_HEADWAY_S, LONG_HEADWAY_S = 1.0, 3.5
# s; nobody keeps a shorter one for a minute: comfortable minima are 0.6 to 1 s (Taieb-Maimon & Shinar 2001). And m/s and s:
# 200 km/h at 0.7 s, which is a minimum of slow traffic; and 270 km/h
SHORTEST_HEADWAY_S, FAST, SHORT_IF_FAST_S, FASTEST = 0.35, 55.0, 0.7, 75.0
# headways that are kept, one a second, and needed
KEPT_HEADWAYS, NEEDED_HEADWAYS = 60, 40


class State(NamedTuple):
    """Covariances, and what the next rows need."""

    history: Array  # (n, 2) range rate and speed of the latest steps, m/s
    products: Array  # (_SIZE, _SIZE) sums of products of the differences, (m/s)²
    rows: float = 0.0  # that they hold
    blocks: int = 0  # since the last judgement
    begin: Annotated[float, TIME] = NAN  # s, of the first row
    headways: tuple[float, ...] = ()  # s
    speeds: tuple[float, ...] = ()  # m/s, with them
    # all headways since the first row, those shorter than SHORT_HEADWAY_S, and those longer than LONG_HEADWAY_S
    counted: tuple[int, int, int] = (0, 0, 0)
    age: tuple[float, float] = (NAN, NAN)  # s, δ and its standard deviation; NaN: not known
    late: float = NAN  # log likelihood of δ over that of no delay
    factor: tuple[float, float, float] = (NAN, NAN, NAN)  # 1/c and its interval
    found: Found | None = None  # at the last judgement


def init() -> State:
    """Return the state before the first block."""
    return State(np.zeros((0, 2)), np.zeros((_SIZE, _SIZE)))


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    if not block.follows:
        return (state._replace(history=np.zeros((0, 2))) if len(state.history) else state), state.found
    headway = block.mean[GAP] / block.mean[SPEED]
    headways = (*state.headways, headway)[-KEPT_HEADWAYS:]
    every, short, long = state.counted
    counted = (every + 1, short + (headway < SHORT_HEADWAY_S), long + (headway > LONG_HEADWAY_S))
    per_step = max(round(STEP_S / block.dt), 1)
    values = block.values[:, RANGE_RATE : SPEED + 1]
    n = len(values) // per_step
    means = np.add.reduce(values[: n * per_step].reshape(n, per_step, 2), axis=1) / per_step
    history = np.concatenate([state.history if block.joined else state.history[:0], means])
    begin = state.begin if state.begin == state.begin else max(block.t - 1.0, 0.0)
    speeds = (*state.speeds, block.mean[SPEED])[-KEPT_HEADWAYS:]
    state = state._replace(
        speeds=speeds,
        history=history,
        headways=headways,
        counted=counted,
        begin=begin,
        blocks=state.blocks + 1,
    )
    fresh = len(history) - 1 - _REACH - YOUNGEST
    if fresh >= FRESH_ROWS:
        keep = (1.0 - 1.0 / MEMORY_ROWS) ** fresh
        x = _rows(history[1:] - history[:-1], fresh)
        state = state._replace(
            products=keep * state.products + x.T @ x,
            rows=keep * state.rows + fresh,
            history=history[-(1 + _REACH + YOUNGEST) :],
        )
    if state.blocks >= JUDGED_EVERY:
        state = state._replace(blocks=0)
        if state.rows >= NEEDED_ROWS:
            state = _judged(state)
        state = state._replace(found=_found(state))
    return state, state.found


def _rows(d: Array, fresh: int) -> Array:
    """(fresh, _SIZE): differences of the range rate now and back, then of the speed from the future back."""
    now = np.arange(_REACH, _REACH + fresh)[:, None]
    rate = d[:, 0][now - np.arange(ORDER + 1)]
    speed = d[:, 1][now + YOUNGEST - np.arange(YOUNGEST + _REACH + 1)]
    return np.concatenate([rate, speed], axis=1)


_RATE = np.arange(ORDER + 1)


def _log_likelihoods(products: Array, rows: float, delays: npt.NDArray[np.int64], factors: Array) -> Array:
    """Of innovations of range rate + factor · speed(− delay), for each pair of a delay and a factor."""
    T = np.zeros((len(delays), ORDER + 1, _SIZE))
    for k, (delay, factor) in enumerate(zip(delays.tolist(), factors.tolist(), strict=True)):
        T[k, _RATE, _RATE] = 1.0
        T[k, _RATE, ORDER + 1 + YOUNGEST + delay + _RATE] = factor
    S = T @ products @ T.transpose(0, 2, 1)
    # a ridge: a signal without noise has no innovations
    S += 1e-9 * np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(ORDER + 1) + 1e-12 * np.eye(ORDER + 1)
    past = np.linalg.solve(S[:, 1:, 1:], S[:, 1:, :1])
    variance = S[:, 0, 0] - (S[:, :1, 1:] @ past)[:, 0, 0]
    out: Array = -0.5 * rows * np.log(np.maximum(variance, 1e-12))
    return out


def _judged(state: State) -> State:
    """Estimate δ with c = 1, then 1/c at the δ that is likeliest with it."""
    m, rows = state.products, state.rows
    n = len(DELAYS)
    log_l = _log_likelihoods(m, rows, np.append(DELAYS, 0), np.append(np.ones(n), 0.0))
    by_delay, without = log_l[:n], float(log_l[n])
    k = int(np.argmax(by_delay))
    age = (NAN, NAN)
    if 0 < k < n - 1 and by_delay[k] - without > EVIDENCE:
        left, top, right = by_delay[k - 1 : k + 2].tolist()
        curvature = left - 2.0 * top + right
        if curvature < 0.0:
            # a parabola through the three largest; its curvature is the information
            shift = 0.5 * (left - right) / curvature
            age = ((float(DELAYS[k]) + shift) * STEP_S, STEP_S / (-curvature) ** 0.5)
    late = float(by_delay[k] - by_delay[YOUNGEST])
    factor = (NAN, NAN, NAN)
    headway = _median(state.headways)
    if not (headway < SHORT_HEADWAY_S or headway > LONG_HEADWAY_S):  # nothing would confirm a wrong unit
        return state._replace(age=age, late=late, factor=factor)
    # the delay is free here, as a wrong unit hides it
    pairs = [(delay, factor) for delay in (-1, 0, 1, 2, 3) for factor in FACTORS.tolist()]
    delays, factors = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    profile = _log_likelihoods(m, rows, delays, factors).reshape(-1, len(FACTORS)).max(axis=0)
    if float(profile.max()) - without > EVIDENCE:
        inside = FACTORS[profile > profile.max() - SURE]
        factor = (float(FACTORS[int(np.argmax(profile))]), float(inside.min()), float(inside.max()))
    return state._replace(age=age, late=late, factor=factor)


def _found(state: State) -> Found | None:
    return _implausible(state) or _wrong_unit(state) or _late(state)


def _median(x: tuple[float, ...]) -> float:
    return sorted(x)[len(x) // 2] if len(x) >= NEEDED_HEADWAYS else NAN


def _mostly(state: State) -> tuple[bool, bool]:
    """Whether headways are short, and long, over all that a finding speaks of.

    A unit is that of the whole drive: a minute behind a lead that cut in says nothing against the quarter of an hour before.

    >>> _mostly(init()._replace(counted=(900, 60, 0))), _mostly(init()._replace(counted=(90, 60, 0)))
    ((False, False), (True, False))
    """
    every, short, long = state.counted
    return 2 * short > every, 2 * long > every


def _implausible(state: State) -> Found | None:
    headway, speed = _median(state.headways), _median(state.speeds)
    fast = speed > FASTEST or (speed > FAST and headway < SHORT_IF_FAST_S)
    if not ((headway < SHORTEST_HEADWAY_S and _mostly(state)[0]) or fast):
        return None
    says = (
        f"headways are implausible: medians of {headway:.2f} s and {speed:.0f} m/s ({3.6 * speed:.0f} km/h) over "
        f"{len(state.headways)} s"
    )
    remedy = "check the units of speed and gap (km/h declared as m/s?)"
    return Found("speed_unit", ("speed", "gap"), state.begin, says, remedy)


def _wrong_unit(state: State) -> Found | None:
    value, low, high = state.factor
    headway = _median(state.headways)
    mostly_short, mostly_long = _mostly(state)
    short = high < LOW_FACTOR and headway < SHORT_HEADWAY_S and mostly_short
    if not (short or (low > HIGH_FACTOR and headway > LONG_HEADWAY_S and mostly_long)):
        return None
    ratio, a, b = 1 / value, 1 / high, 1 / low
    unit = unit_of(ratio, a, b)
    says = (
        f"speed changes {ratio:.1f} [{a:.1f}, {b:.1f}] times as much as its own motion in range rate, and the median "
        f"headway is {headway:.1f} s"
    )
    return Found(
        "speed_unit",
        ("speed",),
        state.begin,
        says,
        f"check the unit of speed{f': {unit}?' if unit else ''}",
    )


def _late(state: State) -> Found | None:
    age, wide = interval(state)
    if not (age - wide > MAX_AGE_S and state.late > LATE_EVIDENCE):
        return None
    says = f"the radar's reports are {age:.2f} s [{age - wide:.2f}, {age + wide:.2f}] older than those of the own speed"
    remedy = "stamp them where they are measured; dead times are too short by as much"
    return Found("radar_latency", ("gap", "range_rate"), state.begin, says, remedy)


def interval(state: State) -> tuple[float, float]:
    """Return the age of the radar's reports and the half width of its 95 % interval, s; NaN: not known."""
    age, sd = state.age
    return age, NORMAL_QUANTILE * sd + (BIAS_S if sd < PRECISE_SD_S else IMPRECISE_BIAS_S)


def measured(state: State) -> str:
    """State the age of the radar's reports, where the own motion stands out; "": it does not."""
    age, wide = interval(state)
    if not wide < IMPRECISE_BIAS_S:
        return ""
    return (
        f"age of the radar's reports against the own speed: {age:.2f} s [{age - wide:.2f}, {age + wide:.2f}]"
    )


CHECK = Check("own_motion", init, step)
