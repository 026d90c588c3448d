"""Gap and range rate as the driver could have known them: estimates of x(t − k) from reports up to t, nothing later.

A driver who answers with a dead time θ answers x(t − θ); by t there are reports of θ more seconds, and all of them may
be used. Anything later may not: the driver's own noise has by then moved the car, and the inputs with it. The estimate is a
conditional mean, so what it misses is uncorrelated with it (Berkson's case): it adds noise and bends no gain. An
unsmoothed report would.

Kalman filter on a white-jerk motion with fixed-lag smoothing for every lag at once (Bar-Shalom 2001, eq. 6.2.3-7;
Anderson & Moore 1979, ch. 7), with the gain that it settles to. The reports' noise is taken from the data. A lead's
acceleration may fade (Singer 1970): if it does, and the filter does not know, what is known at once is 8 % too large.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification import movement_rhythm
from canid.values.types import Array

# (m/s³)²·s; what lies between a calm motorway and brisk town traffic is tried, and the likeliest taken. In steps of 1.8: the
# response to an acceleration that is taken to be 1.8 times too lively or too calm came out up to 13 % wrong, and what is
# added to an answer to the range rate, which does nearly the same, by up to two thirds
JERKS = (0.03, 0.055, 0.1, 0.17, 0.3, 0.55, 1.0, 1.7, 3.0)
# s, in which an acceleration fades; tried for the lead
MEMORIES_S = (math.inf, 6.0, 2.0)
# samples that decide which
JERK_SAMPLES = 3000
# steps until the gain has settled, from anything; and change per step, relative, at which it has
SETTLING_STEPS, SETTLED_CHANGE = 400, 1e-12
# least noise: one step of a fine resolution
QUIETEST_GAP, QUIETEST_RATE = 0.02, 0.005
# m and m/s; differences below it are those of interpolating between equal readings
STILL = 1e-9
# m; the noise of a position that nobody reports
UNREPORTED_SD_M = 1e4


class Motion(NamedTuple):
    """How lively a motion is."""

    jerk: float  # (m/s³)²·s
    memory: float = math.inf  # s, in which its acceleration fades


# of the relative motion, and of the lead
RELATIVE = tuple(map(Motion, JERKS))
OF_LEAD = tuple(Motion(jerk, memory) for jerk in JERKS for memory in MEMORIES_S)


class Lagged(NamedTuple):
    """Column k holds x(t − k·dt), as known at t; the standard deviations are of the settled filter, one per lag."""

    gap: Array  # (n, lags) m
    range_rate: Array  # (n, lags) m/s
    lead_accel: Array  # (n, lags) m/s²
    gap_sd: Array  # (lags,) m
    range_rate_sd: Array  # (lags,) m/s
    motions: tuple[Motion, Motion]  # the relative one, and that of the lead
    lead_moved: (
        Array  # (n,) m/s², the lead's acceleration, each instant as known when the last lag has passed
    )


class Followed(NamedTuple):
    """A motion at each lag, and how well it is known."""

    x: Array  # (n, lags, 3): position, speed, acceleration
    sd: Array  # (lags, 3)
    motion: Motion


class Filter(NamedTuple):
    """A filter that has settled."""

    F: Array  # (3, 3)
    G: Array  # (3, 2) gain
    C: Array  # (3, 3) smoother's gain, one step back
    S: Array  # (2, 2) of the innovations
    P: Array  # (3, 3) covariance of the state after an update
    ahead: Array  # (3, 3) covariance of its prediction


def roughness(x: Array, order: int) -> float:
    """Standard deviation of the white noise on a smooth signal, from its differences of some order.

    The variance of a difference of order m of white noise is binom(2m, m) times its own; a smooth motion leaves
    nothing in it. Of a signal that mostly stands still between its steps it is that of rounding, a twelfth of the squared
    step (Widrow & Kollar 2008), which no median shows.

    Example:
        >>> x = np.random.default_rng(1).normal(0, 0.5, 20_000)
        >>> round(roughness(np.arange(20_000) * 0.3 + x, 3), 2)
        0.5
        >>> round(roughness(np.round(np.sin(np.arange(2000) / 100) * 10), 3), 2)
        0.29
    """
    d = np.diff(x, order)
    d = d[np.isfinite(d)]
    if d.size < 10:
        return 0.0
    if np.median(np.abs(d)) <= STILL:
        return movement_rhythm.step_size(x[np.isfinite(x)]) / math.sqrt(12.0)
    weight = {2: 6.0, 3: 20.0}[order]
    # the median: a jump to another target is no noise
    return float(np.median(np.abs(d)) / 0.6745 / np.sqrt(weight))


def settled(motion: Motion, gap_sd: float, rate_sd: float, dt: float) -> Filter:
    """Return the filter's steady state."""
    F = np.array([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    if math.isfinite(motion.memory):
        fades = math.exp(-dt / motion.memory)
        gained = motion.memory * (1.0 - fades)
        F[:, 2] = motion.memory * (dt - gained), gained, fades
    a, b, c = dt**5 / 20, dt**4 / 8, dt**3 / 6
    Q = motion.jerk * np.array([[a, b, c], [b, dt**3 / 3, dt * dt / 2], [c, dt * dt / 2, dt]])
    R = np.diag([gap_sd**2, rate_sd**2])
    H = np.eye(2, 3)
    P = np.diag([gap_sd**2, rate_sd**2, 1.0])
    G = np.zeros((3, 2))
    S, updated = np.eye(2), P
    # a position that nobody reports never settles, and nothing depends on it
    part = slice(1 if gap_sd >= UNREPORTED_SD_M else 0, 3)
    for _ in range(SETTLING_STEPS):
        before, P = P, F @ updated @ F.T + Q
        if (abs(P - before)[part, part] <= SETTLED_CHANGE * abs(P[part, part])).all():
            break
        S = H @ P @ H.T + R
        G = P @ H.T @ np.linalg.inv(S)
        updated = P - G @ H @ P
    return Filter(F, G, updated @ F.T @ np.linalg.inv(P), S, updated, P)


def run(
    settled: Filter, gap: Array, rate: Array, new: np.ndarray[tuple[int], np.dtype[np.bool_]]
) -> tuple[Array, Array]:
    """Filter.

    Args:
        settled: a settled filter.
        gap: (n,) m, NaN where nothing was reported.
        rate: (n,) m/s, NaN likewise.
        new: (n,) another target from here on.

    Returns:
        states (n, 3) and innovations (n, 2), the latter NaN where there are none.
    """
    (_, f01, f02), (_, _, f12), (_, _, f22) = settled.F.tolist()
    (g00, g01), (g10, g11), (g20, g21) = settled.G.tolist()
    out, innovations = [], []
    x = v = a = 0.0
    started, blind = False, not np.isfinite(gap).any()
    for z, w, fresh in zip(gap.tolist(), rate.tolist(), new.tolist(), strict=True):
        if fresh or not started:
            started = w == w and (z == z or blind)
            x, v, a = (0.0 if blind else z, w, 0.0) if started else (x, v, a)
            innovations.append((np.nan, np.nan))
        else:
            x, v, a = x + f01 * v + f02 * a, v + f12 * a, f22 * a
            i = z - x if z == z else 0.0
            j = w - v if w == w else 0.0
            innovations.append((z - x, w - v))
            x, v, a = x + g00 * i + g01 * j, v + g10 * i + g11 * j, a + g20 * i + g21 * j
        out.append((x, v, a))
    return np.array(out), np.array(innovations)


def unlikely(settled: Filter, innovations: Array) -> float:
    """−2 log likelihood of the innovations, of those columns that were ever measured."""
    measured = np.isfinite(innovations).any(axis=0)
    i, S = innovations[:, measured], settled.S[np.ix_(measured, measured)]
    i = i[np.isfinite(i).all(axis=1)]
    # what no Gaussian holds (a jump) must not choose the motion
    distance = np.minimum(np.einsum("ni,ij,nj->n", i, np.linalg.inv(S), i), 25.0)
    return float(distance.sum() + len(i) * np.log(np.linalg.det(S)))


def lagged(
    gap: Array,
    rate: Array,
    speed: Array,
    new: np.ndarray[tuple[int], np.dtype[np.bool_]],
    lags: int,
    dt: float,
    motions: tuple[Motion, Motion] | None = None,
) -> Lagged:
    """Estimate gap, range rate and the lead's acceleration at every lag.

    Args:
        gap: (n,) m as reported, NaN where nothing was.
        rate: (n,) m/s.
        speed: (n,) m/s, own.
        new: (n,) another target from here on.
        lags: so many, from 0 on.
        dt: s.
        motions: how lively both are; None: what is likeliest.
    """
    relative, of_lead = (RELATIVE, OF_LEAD) if motions is None else ((motion,) for motion in motions)
    pair = followed(gap, rate, new, lags, dt, relative)
    lead = followed(np.full_like(gap, np.nan), speed + rate, new, lags, dt, of_lead)
    gaps, rates, accels = (
        np.asfortranarray(smoothed.x[:, :, k].T) for smoothed, k in ((pair, 0), (pair, 1), (lead, 2))
    )
    motions = (pair.motion, lead.motion)
    return Lagged(gaps, rates, accels, pair.sd[:, 0], pair.sd[:, 1], motions, in_retrospect(accels, new))


def in_retrospect(lags: Array, new: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Array:
    """Return each instant as it is known at the last lag, or at the target's last report.

    Args:
        lags: (n, lags) column k holds x(t − k·dt), as known at t.
        new: (n,) another target from here on.

    Returns:
        (n,) in the unit of x.

    Example:
        >>> in_retrospect(np.arange(8.0).reshape(4, 2), np.array([True, False, True, False]))
        array([3., 2., 7., 6.])
    """
    n, count = lags.shape
    target, out = np.cumsum(new), lags[:, 0].copy()
    for k in range(1, min(count, n)):
        same = target[k:] == target[:-k]
        out[:-k][same] = lags[k:, k][same]
    return out


def followed(
    x: Array,
    v: Array,
    new: np.ndarray[tuple[int], np.dtype[np.bool_]],
    lags: int,
    dt: float,
    motions: tuple[Motion, ...] = RELATIVE,
) -> Followed:
    """Estimate a motion at every lag.

    Args:
        x: (n,) position as reported, m; NaN where nothing was. All NaN: only the speed is.
        v: (n,) speed, m/s.
        new: (n,) another motion from here on.
        lags: so many, from 0 on.
        dt: s.
        motions: of them the likeliest is taken.

    Returns:
        `x` (lags, n, 3).
    """
    blind = not np.isfinite(x).any()
    x_sd, v_sd = (
        UNREPORTED_SD_M if blind else max(roughness(x, 3), QUIETEST_GAP),
        max(roughness(v, 2), QUIETEST_RATE),
    )
    part = slice(0, JERK_SAMPLES)
    motion, chosen = motions[0], settled(motions[0], x_sd, v_sd, dt)
    if len(motions) > 1:
        filters = [(motion, settled(motion, x_sd, v_sd, dt)) for motion in motions]
        motion, chosen = min(filters, key=lambda f: unlikely(f[1], run(f[1], x[part], v[part], new[part])[1]))
    states, _ = run(chosen, x, v, new)
    n = len(states)
    first = np.maximum.accumulate(np.where(new, np.arange(n), 0))
    out = np.empty((lags, n, 3))
    out[0] = states
    P = chosen.P
    covariances = [P]
    for k in range(1, lags):
        # x(t−k | t) = x(t−k | t−k) + C (x(t−k+1 | t) − F x(t−k | t−k)), the same C at every step once settled
        then = np.maximum(np.arange(n) - k, first)
        filtered = states[then]
        later = out[k - 1]
        smoothed = filtered + (later - filtered @ chosen.F.T) @ chosen.C.T
        # before the target's first report it stood where that says
        out[k] = np.where((np.arange(n) - k >= first)[:, None], smoothed, out[k - 1])
        P = chosen.P + chosen.C @ (P - chosen.ahead) @ chosen.C.T
        covariances.append(P)
    sd = np.sqrt(np.maximum([np.diag(P) for P in covariances], 0.0))
    return Followed(out, sd, motion)
