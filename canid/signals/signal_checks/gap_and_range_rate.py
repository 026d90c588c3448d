"""Change of the gap against the integral of the range rate, over windows of five seconds (redundant measurements).

The difference of two block means of the gap is a weighted integral of the range rate (mean_difference.py), whatever moves:
no derivative of a noisy gap is needed. What the two differ by is compared with the noise that both show and with their own
movement, by the lower limit of a variance (chi-square).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from canid.signals.signal_checks.blocks import BLOCK_S, GAP, RANGE_RATE, Block
from canid.signals.signal_checks.check import Check, Found, unit_of
from canid.signals.signal_checks.mean_difference import integrals
from canid.values.state_constraints import TIME
from canid.values.types import NAN, Array, Interval

# blocks of one window: 5 s, in which a gap changes by metres
WINDOW_BLOCKS = 5
# windows that are kept, two minutes of following; the shorter spans find what has just begun
KEPT_WINDOWS = 24
SPANS = (3, 6, 12, KEPT_WINDOWS)
# times the noise that both show: outliers of a radar triple its variance, and interpolation onto the grid hides a part
NOISE_FACTOR = 3.0
# m/s; a radar's point on the car ahead moves by 0.25 m, and reports come in steps of 0.1 to 0.25 m/s
MIN_DISAGREEMENT = 0.1
# of the rms movement of both: a disagreement below it flattens no gain by more than a fifth (errors in variables)
MATERIAL_SHARE = 0.5
# 0.9999 quantile of chi-square over its degrees of freedom, by Wilson & Hilferty 1931
_QUANTILE = 3.719
# correlation beyond which the two are one quantity up to its sign or scale
ONE_QUANTITY = 0.9
# ratios of range rate to the gap's change that are no wrong scale: Doppler radars are good to 1 %, and a point that moves
# on the car ahead is not
RIGHT_SCALE = (0.85, 1.15)
# windows that a ratio needs, and standard deviations of its interval
MIN_SCALE_WINDOWS, SCALE_SIGMAS = 8, 3.7
# windows below which a correlation is chance, so that a contradiction is not called a sign or a scale
MIN_NAMED_WINDOWS = 6
CONTRADICTION = "gap_contradicts_range_rate"
# of their movement: what a wrong scale may leave once it is corrected
MAX_SCALED_REST = 0.2


class Window(NamedTuple):
    """Five seconds behind one lead."""

    begin: Annotated[float, TIME]  # s
    change: float  # m, of the gap
    integral: float  # m, of the range rate
    noise: float  # m², variance that the reports' own noise gives to their difference


class State(NamedTuple):
    """Windows, and the one that is being filled."""

    last_gap: float = NAN  # m, mean of the block before; NaN: nothing to go on from
    last_rise: float = 0.0  # m, integral of its range rate with the weight that rises
    blocks: int = 0  # pairs of blocks in the window
    begin: Annotated[float, TIME] = NAN
    change: float = 0.0
    integral: float = 0.0
    noise: float = 0.0
    windows: tuple[Window, ...] = ()
    found: Found | None = None  # by the latest windows


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    if not block.follows:
        return (
            state if state.last_gap != state.last_gap else state._replace(last_gap=NAN, blocks=0)
        ), state.found
    gap, rate = block.values[:, GAP], block.values[:, RANGE_RATE]
    rise, fall = integrals(rate, block.dt)
    mean = block.mean[GAP]
    if block.joined and state.last_gap == state.last_gap:
        noise = _noise(gap, rate, len(gap), block.dt)
        state = _pair(state, block, mean - state.last_gap, state.last_rise + fall, noise)
    else:
        state = state._replace(blocks=0)
    return state._replace(last_gap=mean, last_rise=rise), state.found


def _noise(gap: Array, rate: Array, n: int, dt: float) -> float:
    """Variance per pair that the noise of both gives, m²: by differences, in which no motion is left."""
    third = gap[3:] - 3 * gap[2:-1] + 3 * gap[1:-2] - gap[:-3]
    second = rate[2:] - 2 * rate[1:-1] + rate[:-2]
    of_gap = float(third @ third) / (20.0 * len(third))
    of_rate = float(second @ second) / (6.0 * len(second))
    # a window has the noise of two block means of the gap and of 50 samples of the range rate
    return (2.0 * of_gap / n) / WINDOW_BLOCKS + of_rate * n * dt * dt


def _pair(state: State, block: Block, change: float, integral: float, noise: float) -> State:
    """Add the step from one block to the next."""
    first = state.blocks == 0
    begin = block.t - 2 * BLOCK_S if first else state.begin
    state = state._replace(
        blocks=state.blocks + 1,
        begin=max(begin, 0.0),
        change=change + (0.0 if first else state.change),
        integral=integral + (0.0 if first else state.integral),
        noise=noise + (0.0 if first else state.noise),
    )
    if state.blocks < WINDOW_BLOCKS:
        return state
    window = Window(state.begin, state.change, state.integral, state.noise)
    windows = (*state.windows, window)[-KEPT_WINDOWS:]
    state = state._replace(blocks=0, windows=windows)
    return state._replace(found=_latest(state.found, _judge(windows)))


def _judge(windows: tuple[Window, ...]) -> Found | None:
    """What the latest windows show: by the longest span that has a name, else by the longest that contradicts itself."""
    unnamed = None
    for span in reversed(SPANS):
        part = windows[-span:]
        if len(part) < span:
            continue
        x, y, noise = (np.array(column) for column in list(zip(*part, strict=True))[1:])
        if not _contradict(x, y, noise):
            continue
        verdict = _named(part, x, y, noise)
        if verdict.name != CONTRADICTION:
            return verdict
        unnamed = unnamed or verdict
    if unnamed is None and len(windows) >= MIN_SCALE_WINDOWS:
        x, y, noise = (np.array(column) for column in list(zip(*windows, strict=True))[1:])
        return _named(windows, x, y, noise) if _scaled(x, y, noise) is not None else None
    return unnamed


def _latest(before: Found | None, now: Found | None) -> Found | None:
    """A name stays while the contradiction does, and what is renamed began when it was first found."""
    if before is None or now is None:
        return now
    if now.name == CONTRADICTION and before.name != CONTRADICTION:
        return before
    return now._replace(since=min(now.since, before.since))


def _median(x: Array) -> float:
    # numpy's takes ten times as long
    ordered = sorted(x.tolist())
    return float(ordered[len(ordered) // 2])


def _limit(x: Array, y: Array, noise: Array) -> float:
    """Square of the rms difference that is no contradiction, m²."""
    floor = (MIN_DISAGREEMENT * WINDOW_BLOCKS * BLOCK_S) ** 2
    moved = 0.5 * float(x @ x + y @ y) / len(x)
    return max(NOISE_FACTOR**2 * _median(noise), floor, MATERIAL_SHARE**2 * moved)


def _contradict(x: Array, y: Array, noise: Array) -> bool:
    e, n = y - x, len(x)
    limit = _limit(x, y, noise)
    k = 2.0 / (9.0 * n)
    quantile = (1.0 - k + _QUANTILE * math.sqrt(k)) ** 3
    # at least three windows, so that no single jump to another vehicle makes a contradiction
    return float(e @ e) / n > quantile * limit and int((e * e > limit).sum()) >= 3


class _Scale(NamedTuple):
    ratio: float
    low: float
    high: float


def _scaled(x: Array, y: Array, noise: Array) -> _Scale | None:
    """Ratio of range rate to the gap's change where it is surely wrong; None: it may be right, or is not known."""
    n = len(x)
    xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
    if n < MIN_SCALE_WINDOWS or not xx * yy > 0.0 or not min(xx, yy) / n > 25.0 * _median(noise):
        return None
    scale = _ratio(xx, yy, xy, n)
    rest = 1.0 - xy * xy / (xx * yy)
    if rest > MAX_SCALED_REST**2 or (RIGHT_SCALE[0] <= scale.high and scale.low <= RIGHT_SCALE[1]):
        return None
    return scale


def scale_ratio(change: Array, integral: Array) -> Interval | None:
    """Ratio of the integral of the range rate to the change of the gap over (n,) windows, where they are one quantity.

    >>> x = 5.0 * np.sin(np.arange(40.0))
    >>> round(scale_ratio(x, 1.05 * x).value, 3), scale_ratio(x, np.cos(np.arange(40.0)))
    (1.05, None)
    """
    n, xx, yy, xy = len(change), float(change @ change), float(integral @ integral), float(change @ integral)
    if n < MIN_SCALE_WINDOWS or not xy > math.sqrt(1.0 - MAX_SCALED_REST**2) * math.sqrt(xx * yy):
        return None
    scale = _ratio(xx, yy, xy, n)
    return Interval(scale.ratio, scale.low, scale.high)


def _ratio(xx: float, yy: float, xy: float, n: int) -> _Scale:
    """Regression both ways, as either is noisy: the truth lies between, and the interval holds those of both."""
    a, b = sorted((xy / xx, yy / xy if xy else math.inf))
    rest = max(1.0 - xy * xy / (xx * yy), 0.0)
    wide = SCALE_SIGMAS * math.sqrt(rest / max(n - 1, 1)) * math.sqrt(yy / xx)
    ratio = math.copysign(math.sqrt(yy / xx), xy)
    return _Scale(ratio, a - wide, b + wide)


def _named(windows: tuple[Window, ...], x: Array, y: Array, noise: Array) -> Found:
    """Name what these windows show."""
    e = y - x
    limit = _limit(x, y, noise)
    wrong = np.flatnonzero(e * e > limit)
    since = windows[int(wrong[0]) if wrong.size else 0].begin
    rms_x, rms_e = (float(np.sqrt(np.mean(z * z))) for z in (x, e))
    both = ("gap", "range_rate")
    span = f"over {WINDOW_BLOCKS} s"
    if float(np.ptp(y)) < 1e-6:
        rate = float(y.mean()) / WINDOW_BLOCKS
        says = f"range rate is constant at {rate:.2f} m/s while the gap changes by {rms_x:.1f} m rms {span}"
        return Found("range_rate_dead", ("range_rate",), since, says, "check which signal range_rate maps")
    if float(np.ptp(x)) < 1e-6:
        says = f"the gap is constant while range rate says that it changes by {rms_e:.1f} m rms {span}"
        return Found("gap_dead", ("gap",), since, says, "check which signal gap maps")
    xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
    if len(windows) >= MIN_NAMED_WINDOWS and abs(xy) > ONE_QUANTITY * math.sqrt(xx * yy):
        scale = _ratio(xx, yy, xy, len(x))
        numbers = f"{scale.ratio:.2f} [{scale.low:.2f}, {scale.high:.2f}]"
        if xy < 0.0:
            says = f"range rate falls while the gap grows: it is {numbers} times the gap's change"
            remedy = "positive must be opening: set scale = -1 (rate_sign = -1 for radar tracks)"
            return Found("range_rate_sign", ("range_rate",), since, says, remedy)
        unit = unit_of(scale.ratio, scale.low, scale.high)
        says = f"range rate is {numbers} times the gap's change"
        meaning = f": range_rate as if {unit}, or gap the reverse" if unit else ""
        remedy = f"check the units of gap and range_rate{meaning}"
        return Found("range_rate_scale", both, since, says, remedy)
    says = (
        f"gap and range rate contradict each other: {span} they differ by {rms_e:.1f} m rms while the gap changes by "
        f"{rms_x:.1f} m (their noise explains {math.sqrt(_median(noise)):.1f} m)"
    )
    remedy = "they may be of two objects or estimates of a camera: map a radar's, or leave this drive out"
    return Found(CONTRADICTION, both, since, says, remedy)


CHECK = Check("gap_and_range_rate", init, step)
