"""When an output is updated: the instants at which it takes a new value or a new slope, from its readings.

A driver model at 10 Hz, or a control unit that sends at 50 Hz what it computes at 10 Hz, changes its output at instants
of its own. Joined by lines and read at other instants, each sample holds a share of the next decision, and ARMAX is
biased by it however long the drive is: 10 ms of 100 put a1 of Chen & Ulsoy's driver off by 0.04. So the grid has its
points at the instants, block by block, and follows the sender's clock.

The phase of the instants is that of the spline of least residual: piecewise constant (`hold`) or piecewise linear
(`line`). Where neither stands out, the readings themselves are the grid if their period divides the step (`reading`),
and else they are joined by lines (`none`).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from canid.mathematics.identification import rounding
from canid.signals.samples import local_polynomial
from canid.signals.samples.local_polynomial import Fitted
from canid.values.runs import runs
from canid.values.types import NAN, Array

# s; readings from which one phase is determined. 50 decisions at 10 Hz know it to 1 ms with a wheel angle in steps of 0.1°
BLOCK_S = 5.0
# s; the last part of a block that is not used: what is not there when the next block's first point is due
SETTLE_S = 1.0
# Of the residual of the median phase, below which the best phase stands out: a smooth signal has 0.9 and more
MAX_RESIDUAL_SHARE = 0.5
# phases of a step that are tried first, and their fine steps around the best
COARSE, FINE = 20, 5
# share of the difference by which a phase follows the next block's
FOLLOW = 0.3
# of the step; a phase that differs by more is another sender, and the samples' history ends
SAME_PHASE = 0.1
# length of the mean phase vector from which on readings count as uniform: a jitter of 7 % of their period
UNIFORM = 0.9
# of the step; a reading so far from its instant is another one's
MAX_JITTER = 0.1
# standard deviations by which what rounding leaves must differ between phases for one to stand out
SURE_SD = 4.0
# variance of the square of a rounding error, in steps^4 / 144: 1/80 - 1/144 of a uniform one
ROUNDING_KURTOSIS = 0.8
# steps; an output that stays at the highest or lowest value of a block for longer may be at its limit. The corners where it
# comes there and leaves are at any time between two decisions, and where they are few one phase stands out for them
MAX_AT_END = 2.0
# residuals below this share of the signal's power are rounding
EXACT_SHARE = 1e-12


class Instants(NamedTuple):
    """Grid from `start` on: at k dt + phase."""

    start: float  # s
    kind: Literal["hold", "line", "reading", "none"]
    phase: float  # s
    fresh: bool  # the phase has nothing to do with that before


class State(NamedTuple):
    """Readings of the present block, and the grid of the blocks before, oldest first."""

    t: tuple[Array, ...] = ()  # s
    value: tuple[Array, ...] = ()
    block: int = 0
    grid: tuple[Instants, ...] = ()


def init() -> State:
    """Start without readings.

    >>> init().grid
    ()
    """
    return State()


def step(state: State, t: Array, value: Array, arrived: Array, latest: float, dt: float) -> State:
    """Take some readings; decide every block that has ended.

    Args:
        state: from `init()` or the step before.
        t: (n,) s, ascending.
        value: (n,) of the output.
        arrived: (n,) s, session time of the newest frame when each came.
        latest: s, session time of the newest frame now.
        dt: the grid's step, s.

    >>> t = np.arange(0.013, 11.0, 0.02)
    >>> held = np.random.default_rng(0).normal(size=200)[((t - 0.03) / 0.1).astype(int)]
    >>> grid = step(init(), t, held, t, 11.0, 0.1).grid
    >>> [(block.start, block.kind, round(block.phase, 2)) for block in grid]
    [(5.0, 'hold', 0.02), (10.0, 'hold', 0.02)]
    """
    parts, values = (*state.t, t), (*state.value, value)
    while latest >= (end := (state.block + 1) * BLOCK_S - SETTLE_S):
        count = int(np.searchsorted(arrived, end))
        known_t = np.concatenate([*parts[:-1], t[:count]])
        known = np.concatenate([*values[:-1], value[:count]])
        t, value, arrived = t[count:], value[count:], arrived[count:]
        parts, values = (t,), (value,)
        grid, block = state.grid, state.block + 1
        if len(known_t) or not grid:
            instants = _decided(known_t, known, dt, grid[-1] if grid else None)
            grid = (*grid, instants._replace(start=block * BLOCK_S))
        else:
            # nothing came: the grid stays, however long
            coming = float(arrived[0]) if len(arrived) else latest
            block = max(block, int((coming + SETTLE_S) / BLOCK_S))
        state = state._replace(block=block, grid=grid)
    return state._replace(t=parts, value=values)


def trimmed(state: State, t: float) -> State:
    """Drop the grids that end before t [s]."""
    past = sum(instants.start <= t for instants in state.grid) - 1
    return state._replace(grid=state.grid[past:]) if past > 0 else state


def _decided(t: Array, value: Array, dt: float, before: Instants | None) -> Instants:
    """The instants of one block; those before where it does not show any."""
    finite = np.isfinite(value)
    order = np.argsort(t[finite], kind="stable")
    t, value = t[finite][order], value[finite][order]
    kept = Instants(0.0, "none", 0.0, False) if before is None else before._replace(fresh=False)
    if len(t) < 2.0 * (BLOCK_S - SETTLE_S) or not np.ptp(value) > 0.0:
        return kept
    per_step = dt / max(float(np.median(np.diff(t))), 1e-6)
    if per_step > 1.5:
        corners = _corners(t, value - value.mean(), dt, kept)
        if corners is not None and (kept.kind in ("hold", "line") or not _stays_at_end(t, value, dt)):
            return _followed(corners, kept, dt)
        if kept.kind in ("hold", "line"):
            return kept
    whole = round(per_step)
    period = dt / max(whole, 1)
    mean = complex(np.exp(2j * np.pi * t / period).mean())
    if whole < 1 or abs(mean) < UNIFORM:
        return Instants(0.0, "none", 0.0, kept.kind != "none")
    phase = float(np.angle(mean)) * period / (2.0 * np.pi)
    # the reading's phase next to the one before: with several readings a step any of them serves
    turns = round((kept.phase - phase) / period)
    return _followed(Instants(0.0, "reading", phase + turns * period, False), kept, dt)


def _stays_at_end(t: Array, value: Array, dt: float) -> bool:
    stays = [stay for end in (value.max(), value.min()) for stay in runs(value == end)]
    return any(t[stop - 1] - t[first] > MAX_AT_END * dt for first, stop in stays)


def _followed(instants: Instants, kept: Instants, dt: float) -> Instants:
    phase = instants.phase + dt * round((kept.phase - instants.phase) / dt)
    moved = phase - kept.phase
    if kept.kind == instants.kind and abs(moved) <= SAME_PHASE * dt:
        return instants._replace(phase=kept.phase + FOLLOW * moved, fresh=False)
    # within half a step of the grid without any phase
    return instants._replace(phase=instants.phase - dt * round(instants.phase / dt), fresh=True)


def _corners(t: Array, value: Array, dt: float, kept: Instants) -> Instants | None:
    """Kind and phase of the spline of least residual; None where none stands out."""
    floor = EXACT_SHARE * float(value @ value)
    # what rounding leaves whatever the phase, and how much that varies: it must not hide that a phase stands out
    variance = rounding.variance(value)
    rounded, chance = variance * len(t), SURE_SD * variance * (ROUNDING_KURTOSIS * len(t)) ** 0.5
    best: tuple[float, Instants] | None = None
    coarse = np.arange(COARSE) * dt / COARSE
    held = np.array([_hold(t, value, dt, phase) for phase in coarse])
    for kind, residuals in (("hold", held), ("line", _line(t, value, dt, coarse))):
        usual = float(np.median(residuals)) + floor
        k = int(residuals.argmin())
        # means of a few rounded values hit the lattice by chance: only a line is compared without its rounding
        off = rounded if kind == "line" and usual - residuals[k] > chance else 0.0
        shown = max(float(residuals[k]) - off, 0.0) <= MAX_RESIDUAL_SHARE * (usual - off)
        if not shown or (best is not None and residuals[k] >= best[0]):
            continue
        near = float(coarse[k])
        phase = _middle(residuals, near, usual, dt) if kind == "hold" else _finest(t, value, dt, near)
        best = float(residuals[k]), Instants(0.0, kind, phase, False)  # type: ignore[arg-type]
    return None if best is None else best[1]


def _middle(residuals: Array, phase: float, usual: float, dt: float) -> float:
    """Middle of the phases that separate the same readings, next to the best."""
    step, limit = dt / COARSE, max(2.0 * float(residuals.min()), 0.05 * usual)
    k = int(residuals.argmin())
    low = high = 0
    while high < COARSE and residuals[(k + high + 1) % COARSE] <= limit:
        high += 1
    while low < COARSE and residuals[k - low - 1] <= limit:
        low += 1
    return phase + 0.5 * (high - low) * step


def _finest(t: Array, value: Array, dt: float, phase: float) -> float:
    """Least residual near a phase, by parabolas through three."""
    width = dt / COARSE
    for _ in range(FINE):
        a, b, c = _line(t, value, dt, phase + width * np.array([-1.0, 0.0, 1.0])).tolist()
        bend = a - 2.0 * b + c
        if not bend > 0.0:
            return phase
        phase += min(max(0.5 * (a - c) / bend, -1.0), 1.0) * width
        width *= 0.4
    return phase


def _hold(t: Array, value: Array, dt: float, phase: float) -> float:
    """Sum of squares left by the means between instants."""
    k = np.floor((t - phase) / dt).astype(int)
    k -= k[0]
    count = np.maximum(np.bincount(k), 1)
    mean = np.bincount(k, value) / count
    return float(np.square(value - mean[k]).sum())


def _line(t: Array, value: Array, dt: float, phase: Array) -> Array:
    """Sums of squares left by the linear splines with knots at the instants of each phase."""
    left: Array = np.square(line_residuals(t, value, np.full(len(phase), dt), phase)).sum(axis=1)
    return left


def line_residuals(t: Array, value: Array, dt: Array, phase: Array) -> Array:
    """(m, n) residuals of m linear splines of least squares, with knots every `dt` s, one at `phase`.

    Args:
        t: (n,) s, ascending.
        value: (n,).
        dt: (m,) s.
        phase: (m,) s.

    Example:
        >>> t = 0.1 * np.arange(30)
        >>> lines = np.interp(t, [0.0, 1.0, 2.0, 3.0], [0.0, 2.0, 1.0, 4.0])
        >>> left = np.abs(line_residuals(t, lines, np.array([1.0, 1.0]), np.array([0.0, 0.4]))).max(axis=1)
        >>> bool(left[0] < 1e-6), bool(left[1] > 0.1)
        (True, True)
    """
    x = (t - phase[:, np.newaxis]) / dt[:, np.newaxis]
    k = np.floor(x).astype(int)
    w = x - k
    k -= k[:, :1]
    m, n = len(dt), int(k[:, -1].max()) + 2
    before = k + n * np.arange(m)[:, np.newaxis]
    at, after = before.ravel(), before.ravel() + 1

    def summed(first: Array, second: Array) -> Array:
        total = np.bincount(at, first.ravel(), m * n) + np.bincount(after, second.ravel(), m * n)
        return np.ascontiguousarray(total.reshape(m, n).T)

    # the normal equations of knots are tridiagonal; a segment without readings leaves its knots free
    diagonal = summed(np.square(1.0 - w), np.square(w)) + 1e-9
    coupling = np.ascontiguousarray(np.bincount(at, (w * (1.0 - w)).ravel(), m * n).reshape(m, n).T)
    knots = summed((1.0 - w) * value, w * value)
    for i in range(1, n):
        share = coupling[i - 1] / diagonal[i - 1]
        diagonal[i] -= share * coupling[i - 1]
        knots[i] -= share * knots[i - 1]
    knots[-1] /= diagonal[-1]
    for i in range(n - 2, -1, -1):
        knots[i] = (knots[i] - coupling[i] * knots[i + 1]) / diagonal[i]
    values = np.ascontiguousarray(knots.T).ravel()
    left: Array = value - (1.0 - w) * values[before] - w * values[before + 1]
    return left


def value_at(t: Array, value: Array, at: float, kind: str, dt: float) -> Fitted:
    """Value of the output at one instant, and its variance; NaN where its readings do not show it.

    Args:
        t: (n,) s, readings within a step of `at`.
        value: (n,).
        at: s.
        kind: of the instants.
        dt: the grid's step, s.

    >>> t = np.array([0.91, 0.93, 0.95, 0.97, 0.99, 1.01, 1.03, 1.05, 1.07, 1.09])
    >>> corner = np.where(t < 1.0, 2.0, 2.0 + 5.0 * (t - 1.0))
    >>> round(value_at(t, corner, 1.0, "line", 0.1).value, 9), round(float(np.interp(1.0, t, corner)), 9)
    (2.0, 2.025)
    """
    times, values = t.tolist(), value.tolist()
    if kind == "hold":
        return Fitted(next((y for x, y in zip(times, values, strict=True) if at <= x < at + dt), NAN))
    if kind == "reading":
        near = min(
            zip(times, values, strict=True), key=lambda reading: abs(reading[0] - at), default=(NAN, NAN)
        )
        return Fitted(near[1] if abs(near[0] - at) <= MAX_JITTER * dt else NAN)
    middle = next((i for i, x in enumerate(times) if x >= at), len(times))
    x = [time - at for time in times]
    before = local_polynomial.line(x[:middle], values[:middle])
    after = local_polynomial.line(x[middle:], values[middle:])
    return Fitted(0.5 * (before.value + after.value), 0.25 * (before.variance + after.variance))
