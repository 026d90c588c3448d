"""`smoothing.step` for a run of reports of one target: the filter's numbers one by one, all else as columns.

Only x and P go on from report to report. What a report says of those before it depends on nothing else, so gains
and the way back are made for the whole run at once, with the same operations in the same order: the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid import smoothing
from canid.smoothing import LAG, ROUNDING, USUAL, Age, Filtered, Noise, State
from canid.types import NAN, Array

Ints = npt.NDArray[np.int64]


class Smoothed(NamedTuple):
    """Reports that a run has smoothed."""

    t: Array  # (m,) s
    gap: Array  # (m,) m
    range_rate: Array  # (m,) m/s
    by: Ints  # (m,) which report of the run gave it out


def step(
    state: State, t: Array, gap: Array, range_rate: Array, noise: Noise, age: Age = USUAL
) -> tuple[State, int, Smoothed | None]:
    """Take reports as far as they are ordinary: later than the one before, complete, of the same target.

    Args:
        state: of `smoothing`.
        t: (n,) s.
        gap: (n,) m, finite.
        range_rate: (n,) m/s, finite.
        noise: of the radar.
        age: that a gap and a range rate may have.

    Returns:
        The state after them, how many were taken, and what they smoothed; None where there is none.

    Example:
        >>> t = 0.05 * np.arange(20)
        >>> first, _, _ = smoothing.step(State(), 0.0, 30.0, 1.0, Noise())
        >>> state, taken, smoothed = step(first, t[1:], 30.0 + t[1:], np.ones(19), Noise())
        >>> taken, round(float(smoothed.t[-1]), 2), round(float(smoothed.gap[-1]), 2), int(smoothed.by[-1])
        (19, 0.75, 30.75, 18)
    """
    old = state.history
    if not old or any(a.t >= b.t for a, b in pairwise(old)):
        return state, 0, None
    bridge = age.bridge
    last_t, x, P = old[-1].t, old[-1].x, old[-1].P
    xs, Ps, priors, FPs, Ns = [], [], [], [], []
    for at, g, r in zip(t.tolist(), gap.tolist(), range_rate.tolist(), strict=True):
        dt = at - last_t
        if not dt > 0.0 or not smoothing.near(x, dt, g, r, noise, bridge):
            break
        prior = smoothing.expect(x, dt)
        FP, N = smoothing.spread(P, dt)
        x, P = smoothing.update(prior, N, g, r, noise)
        last_t = at
        xs.append(x)
        Ps.append(P)
        priors.append(prior)
        FPs.append(FP)
        Ns.append(N)
    n, before = len(xs), len(old)
    if not n:
        return state, 0, None
    back = np.array(smoothing.gain(_columns(FPs), _columns(Ns)))
    T = np.concatenate([[item.t for item in old], t[:n]])
    X = np.concatenate([np.array([item.x for item in old]).T, np.array(xs).T], axis=1)
    prior_X = np.concatenate([np.array([item.prior for item in old]).T, np.array(priors).T], axis=1)
    back = np.concatenate([np.array([item.back for item in old]).T, back], axis=1)
    # how many are old enough when each report comes, and which report gives out each of them
    ready = np.searchsorted(T, T[before:] - LAG + ROUNDING, side="right")
    end = int(ready[-1])
    out = np.arange(int(state.started), end)
    by = np.searchsorted(ready, out, side="right")
    smoothed = _back(X, prior_X, back, out, before + by) if len(out) else None
    first = max(end - 1, 0)
    kept = [
        Filtered(last, xs[k], Ps[k], priors[k], tuple(back[:, before + k].tolist()), last, last)
        for k, last in enumerate(t[:n].tolist())
        if k >= first - before
    ]
    after = State((*old[first:], *kept), 0, end > 0)
    if smoothed is None:
        return after, n, None
    # of the run itself every report has both; those before it may have gone on without
    for k in out[out < before].tolist():
        at = k - int(out[0])
        smoothed[0, at] = smoothed[0, at] if old[k].t - old[k].gap_at <= age.gap else NAN
        smoothed[1, at] = smoothed[1, at] if old[k].t - old[k].rate_at <= age.range_rate else NAN
    return after, n, Smoothed(T[out], smoothed[0], smoothed[1], by)


def _columns(rows: Sequence[tuple[float, ...]]) -> Any:
    """Numbers report by report as columns, for what is arithmetic alone."""
    return tuple(np.ascontiguousarray(np.array(rows).T))


def _back(X: Array, prior: Array, gain: Array, to: Ints, start: Ints) -> Array:
    """Go back from each report `start` to the earlier report `to`: see `smoothing._smooth`; (3, m)."""
    now, at = X[:, start], start.copy()
    while True:
        on = np.flatnonzero(at > to)
        if not len(on):
            return now
        later = at[on]
        d, e, f = now[:, on] - prior[:, later]
        g = gain[:, later]
        earlier = X[:, later - 1]
        now[0, on] = earlier[0] + (g[0] * d + g[1] * e + g[2] * f)
        now[1, on] = earlier[1] + (g[3] * d + g[4] * e + g[5] * f)
        now[2, on] = earlier[2] + (g[6] * d + g[7] * e + g[8] * f)
        at[on] = later - 1
