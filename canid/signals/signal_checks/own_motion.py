"""The own motion in the range rate: its size gives the unit of the speed, its delay the age of the radar's reports.

    range_rate(t) = lead speed(t − δ) − speed(t − δ)/c + noise

With the right c and δ, range_rate(t) + speed(t − δ)/c is the lead's speed, in which nothing of the own motion is left: of
all c and δ its spectrum S is the smallest, and −Σ ln S over frequencies is the likelihood (Whittle 1953). Spectra are means
over segments of 13 s (Welch 1967), so that one more candidate costs a sum over 24 frequencies.

The own motion also answers the lead's, which looks like a delay of the radar (closed-loop identification: Ljung 1999,
ch. 13.4). Below 0.15 Hz, where drivers follow, nothing is used; what is left above is a bias that grows where the radar is
noisy. On drives of 5 and 10 min with random drivers, leads and radars of 0.02 to 0.2 m/s (`benchmarks radar_age`, seed
1600900):

- the interval holds δ on 99 % of 1,792 where drivers have a dead time of 0.2 to 0.8 s, on 92 % of 1,645 without one;
- δ = 0 is less likely by 57 and outside on 0 of 640 where it is right and drivers have a dead time, on 4 of 640 without;
  with δ = 0.5 s on 192 and 457, with 0.2 s on 9 and 58.

1/c is biased likewise, so a unit is questioned only where headways are implausible as well.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from canid.signals.signal_checks.blocks import GAP, RANGE_RATE, SPEED, Block
from canid.signals.signal_checks.check import Check, Found, unit_of
from canid.values.state_constraints import TIME
from canid.values.types import NAN, Array

# s; the own motion holds little above 2 Hz
STEP_S = 0.2
# steps of a segment, and new ones in each: they overlap by half, so that half of the values are new
SEGMENT, FRESH, NEW_SHARE = 64, 32, 0.5
# Hz; below it drivers follow, above it the own motion holds little
LOWEST_HZ, HIGHEST_HZ = 0.15, 2.0
_HZ = np.fft.rfftfreq(SEGMENT, STEP_S)
_USED = (_HZ >= LOWEST_HZ) & (_HZ <= HIGHEST_HZ)
_OMEGA = 2.0 * np.pi * _HZ[_USED]
_TAPER = np.hanning(SEGMENT)[:, None]
# s, of δ: between two, the first and the last
DELAY_STEP_S, EARLIEST_S, LATEST_S = 0.05, -0.6, 1.4
DELAYS = EARLIEST_S + DELAY_STEP_S * np.arange(round((LATEST_S - EARLIEST_S) / DELAY_STEP_S) + 1)
_AT_ONCE = round(-EARLIEST_S / DELAY_STEP_S)
# segments over which the spectra forget, ten minutes: a latency is a property of the radar
MEMORY_SEGMENTS = 94
# blocks between two judgements, and segments that are needed: 90 s
JUDGED_EVERY, NEEDED_SEGMENTS = 20, 13
# natural logarithm of a likelihood ratio from which on the own motion stands out
EVIDENCE = 17.0
# the same for the ends of an interval: 3.7 standard deviations
SURE = 7.0
# the same, by which a δ must be likelier than 0, see above
LATE_EVIDENCE = 57.0
# half of the interval of δ: in its standard deviations, and at least and at most so many s, for the lead's motion; see above
WIDE_SD, LEAST_WIDE_S, MOST_WIDE_S = 18.0, 0.1, 0.45
# s; what ages may be: reports of a 20 Hz radar are 0.05 s old, and dead times are quoted to 0.05 s
MAX_AGE_S = 0.05
# s, of δ that are tried with each 1/c, as a wrong unit hides it
_WITH_FACTOR = np.arange(-0.2, 0.7, 0.2)
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
    """Spectra, and what the next segment needs."""

    history: Array  # (n, 2) range rate and speed of the latest steps, m/s
    spectra: Array  # (4, frequencies) sums over segments: of range rate, of speed, real and imaginary part of both, (m/s)²
    segments: float = 0.0  # that they hold
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
    return State(np.zeros((0, 2)), np.zeros((4, len(_OMEGA))))


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
    while len(state.history) > SEGMENT:
        keep = 1.0 - 1.0 / MEMORY_SEGMENTS
        state = state._replace(
            spectra=keep * state.spectra + _spectra(state.history[: SEGMENT + 1]),
            segments=keep * state.segments + 1.0,
            history=state.history[FRESH:],
        )
    if state.blocks >= JUDGED_EVERY:
        state = state._replace(blocks=0)
        if state.segments >= NEEDED_SEGMENTS:
            state = _judged(state)
        state = state._replace(found=_found(state))
    return state, state.found


def _spectra(rows: Array) -> Array:
    """(4, frequencies) of a segment, (SEGMENT + 1, 2): of its differences, so that no slow motion leaks."""
    rate, speed = np.fft.rfft(_TAPER * (rows[1:] - rows[:-1]), axis=0)[_USED].T
    both = rate * speed.conj()
    return np.stack([np.abs(rate) ** 2, np.abs(speed) ** 2, both.real, both.imag])


def _log_likelihoods(spectra: Array, segments: float, delays: Array, factors: Array) -> Array:
    """Of the spectrum of range rate + factor · speed(− delay), for each pair of a delay and a factor."""
    rate, speed, real, imaginary = spectra
    phase = np.multiply.outer(delays, _OMEGA)
    both = real * np.cos(phase) - imaginary * np.sin(phase)
    c = factors[:, None]
    S = rate + c**2 * speed + 2.0 * c * both
    # a floor: a signal without noise leaves nothing
    S = np.maximum(S, 1e-6 * rate + 1e-12)
    log_l: Array = -NEW_SHARE * segments * np.log(S).sum(axis=1)
    return log_l


def _judged(state: State) -> State:
    """Estimate δ with c = 1, then 1/c at the δ that is likeliest with it."""
    spectra = state.spectra, state.segments
    n = len(DELAYS)
    log_l = _log_likelihoods(*spectra, np.append(DELAYS, 0.0), np.append(np.ones(n), 0.0))
    by_delay, without = log_l[:n], float(log_l[n])
    k = int(np.argmax(by_delay))
    age = (NAN, NAN)
    if 0 < k < n - 1 and by_delay[k] - without > EVIDENCE:
        left, top, right = by_delay[k - 1 : k + 2].tolist()
        curvature = left - 2.0 * top + right
        if curvature < 0.0:
            # a parabola through the three largest; its curvature is the information
            shift = 0.5 * (left - right) / curvature
            age = (float(DELAYS[k]) + shift * DELAY_STEP_S, DELAY_STEP_S / (-curvature) ** 0.5)
    late = float(by_delay[k] - by_delay[_AT_ONCE])
    factor = (NAN, NAN, NAN)
    headway = _median(state.headways)
    if not (headway < SHORT_HEADWAY_S or headway > LONG_HEADWAY_S):  # nothing would confirm a wrong unit
        return state._replace(age=age, late=late, factor=factor)
    delays, factors = np.repeat(_WITH_FACTOR, len(FACTORS)), np.tile(FACTORS, len(_WITH_FACTOR))
    profile = _log_likelihoods(*spectra, delays, factors).reshape(-1, len(FACTORS)).max(axis=0)
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
    return age, min(max(WIDE_SD * sd, LEAST_WIDE_S), MOST_WIDE_S) if sd == sd else NAN


def measured(state: State) -> str:
    """State the age of the radar's reports, where the own motion stands out; "": it does not."""
    age, wide = interval(state)
    if not wide < MOST_WIDE_S:
        return ""
    return (
        f"age of the radar's reports against the own speed: {age:.2f} s [{age - wide:.2f}, {age + wide:.2f}]"
    )


CHECK = Check("own_motion", init, step)
