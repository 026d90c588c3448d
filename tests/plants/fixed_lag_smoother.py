"""The lead of a regular drive, smoothed as canid's lead.py and smoothing.py do it, all reports at once.

The filter runs report by report in plain floats; the smoothing, which starts anew at each report, runs over all
reports side by side. What is not regular (no target, a jump, another vehicle) is not done here: `None`.
"""

from __future__ import annotations

import numpy as np

from canid.signals.samples import report_noise, smoothing
from tests.plants.planted_drive import Array

# State, covariance and transition of the filter: gap, range rate, relative acceleration
_START = 1.0  # (m/s²)², variance of the relative acceleration at first, as in canid.signals.samples.smoothing


def smoothed(
    t: Array, gap: Array, rate: Array, own: Array, noise: report_noise.Noise
) -> tuple[Array, Array, Array, Array] | None:
    """Smooth a radar's reports with the fixed lag.

    Args:
        t: (m,) s.
        gap: (m,) m.
        rate: (m,) m/s.
        own: (m,) own speed, m/s.
        noise: that the vehicle file states of the radar; NaN: canid estimates it.

    Returns:
        for each report but the last few: gap (j,), range rate (j,), speed of the lead (j,) and the index (j,) of the
        report that completed it; None where anything is irregular.
    """
    if not (np.isfinite(gap).all() and np.isfinite(rate).all() and np.isfinite(own).all() and len(t) > 1):
        return None
    way = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (own[1:] + own[:-1]))])
    if (np.abs(np.diff(own)) > smoothing.MAX_RELATIVE_ACCEL * np.diff(t) + smoothing.MAX_OWN_STEP).any():
        return None
    filtered = _filter(t, gap + way, rate + own, own, way, noise)
    if filtered is None:
        return None
    X, P, jerk = filtered
    dt = np.diff(t)
    F, Q = _motion(dt)
    predicted = F @ P[:-1] @ F.transpose(0, 2, 1) + jerk[1:, None, None] * Q
    C = P[:-1] @ F.transpose(0, 2, 1) @ np.linalg.inv(predicted)  # Rauch, Tung & Striebel 1965
    done = _done(t)
    j = np.arange(len(done))
    x = X[done]
    for back in range(int((done - j).max(initial=0)), 0, -1):
        on = np.flatnonzero(done - j >= back)
        i = on + back - 1
        ahead = x[on] - np.einsum("nij,nj->ni", F[i], X[i])
        x[on] = X[i] + np.einsum("nij,nj->ni", C[i], ahead)
    return x[:, 0] - way[j], x[:, 1] - own[j], x[:, 1], done


def _done(t: Array) -> Array:
    """(j,) index of the report with which each is given out: several at once, never in less than the lag."""
    out: list[int] = []
    # half a nanosecond, as there: a report exactly the lag old is ready
    old = (t - smoothing.LEAD_LAG_S + 5e-10).tolist()
    times = t.tolist()
    for k, limit in enumerate(old):
        if times[len(out)] > limit - smoothing.TOGETHER_S:
            continue
        while times[len(out)] <= limit:
            out.append(k)
    return np.array(out, dtype=np.int64)


def _motion(dt: Array) -> tuple[Array, Array]:
    """Motion of white jerk of density one over each dt: F (n, 3, 3), Q (n, 3, 3) (Bar-Shalom 2001, eq. 6.2.3-7)."""
    F = np.tile(np.eye(3), (len(dt), 1, 1))
    F[:, 0, 1] = F[:, 1, 2] = dt
    F[:, 0, 2] = dt * dt / 2
    Q = np.empty_like(F)
    Q[:, 0, 0] = dt**5 / 20
    Q[:, 0, 1] = Q[:, 1, 0] = dt**4 / 8
    Q[:, 0, 2] = Q[:, 2, 0] = dt**3 / 6
    Q[:, 1, 1] = dt**3 / 3
    Q[:, 1, 2] = Q[:, 2, 1] = dt * dt / 2
    Q[:, 2, 2] = dt
    return F, Q


def _filter(
    t: Array, gap: Array, rate: Array, own: Array, way: Array, noise: report_noise.Noise
) -> tuple[Array, Array, Array] | None:
    """Filter all reports: states (m, 3), covariances (m, 3, 3), jerk densities (m,); None where one does not fit."""
    shown = report_noise.State()
    first = report_noise.noise(shown, noise)
    R0, R1 = first.gap**2, first.range_rate**2
    _, Qs = _motion(np.diff(t, prepend=t[0]))
    # way and own speed at the report before: whether a report fits is judged by the relative motion
    went = np.diff(way, prepend=way[0]), np.concatenate([own[:1], own[:-1]]), own
    rows = zip(*(x.tolist() for x in (t, gap, rate, *went, Qs)), strict=True)
    before, g, w, *_ = next(rows)
    a, p, q, r, s, u, v = 0.0, R0, 0.0, 0.0, R1, 0.0, _START  # P = [[p, q, r], [q, s, u], [r, u, v]]
    states, parts, jerks = [(g, w, a)], [(p, q, r, s, u, v)], [shown.jerk]
    for now, z0, z1, further, speed, own_now, Q in rows:
        h = now - before
        before = now
        if h > smoothing.MAX_REPORT_AGE_S:
            return None
        expected, density = report_noise.noise(shown, noise), shown.jerk
        near = smoothing.MAX_GAP_ERROR + smoothing.MAX_ERROR_SIGMAS * expected.gap
        quick = smoothing.MAX_ERROR_SIGMAS * expected.range_rate
        moved = z0 - further - (g + (w - speed) * h)
        if abs(moved) > near or abs(z1 - own_now - (w - speed)) > smoothing.MAX_RELATIVE_ACCEL * h + quick:
            return None
        used = report_noise.for_filter(shown, noise)
        R0, R1 = used.gap**2, used.range_rate**2
        k = h * h / 2
        g, w = g + w * h + a * k, w + a * h
        # F P F' + Q, first row of F P: p + h q + k r, q + h s + k u, r + h u + k v
        f0, f1, f2 = p + h * q + k * r, q + h * s + k * u, r + h * u + k * v
        m1, m2 = s + h * u, u + h * v
        p, q, r = (
            f0 + h * f1 + k * f2 + density * Q[0][0],
            f1 + h * f2 + density * Q[0][1],
            f2 + density * Q[0][2],
        )
        s, u, v = m1 + h * m2 + density * Q[1][1], m2 + density * Q[1][2], v + density * Q[2][2]
        # gain P H' (H P H' + R)⁻¹ of a two-row H
        s00, s11 = p + R0, s + R1
        whole = s00 * s11 - q * q
        i00, i01, i11 = s11 / whole, -q / whole, s00 / whole
        k00, k01 = p * i00 + q * i01, p * i01 + q * i11
        k10, k11 = q * i00 + s * i01, q * i01 + s * i11
        k20, k21 = r * i00 + u * i01, r * i01 + u * i11
        y0, y1 = z0 - g, z1 - w
        # the range rate's innovation once the gap is known
        surprise = (y1 - q / s00 * y0) / (s11 - q * q / s00) ** 0.5
        shown = report_noise.step(shown, now, z0, z1, surprise, h)
        g, w, a = g + k00 * y0 + k01 * y1, w + k10 * y0 + k11 * y1, a + k20 * y0 + k21 * y1
        p, q, r, s, u, v = (
            p - k00 * p - k01 * q,
            q - k00 * q - k01 * s,
            r - k00 * r - k01 * u,
            s - k10 * q - k11 * s,
            u - k10 * r - k11 * u,
            v - k20 * r - k21 * u,
        )
        states.append((g, w, a))
        parts.append((p, q, r, s, u, v))
        jerks.append(density)
    P = np.array(parts)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    return np.array(states), P, np.array(jerks)
