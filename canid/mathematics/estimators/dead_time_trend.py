"""Linear drift of the dead time over a drive, by a score test at the fit of the whole drive (Rao 1948).

A clock of the output that runs off moves the dead times of all inputs alike, by the same time in each second. With x the
slope of the answer by dead time and s the time, the drift is the coefficient of s x, next to all parameters and linear
trends of the gains and the offset, in products over seconds of the whitened answer. Where its variance over clusters of
30 s (Liang & Zeger 1986) exceeds that of the noise model, as of a driver who varies, that counts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Array

# standard deviations from 0: 1 of 10,000 drives without a drift. Over 10 min one is 100 to 200 ppm
SIGMAS = 3.9
# s of a cluster: a driver varies within seconds; and clusters below which their variance is not known
CLUSTER_S, MIN_CLUSTERS = 30.0, 10
# ridge that is added to what is not known at all, of the products' diagonal
RIDGE = 1e-9


class DeadTimeTrend(NamedTuple):
    """Growth of the dead time."""

    rate: float  # s/s
    sd: float  # s/s

    @property
    def found(self) -> bool:
        """Whether it is no chance."""
        return abs(self.rate) > SIGMAS * self.sd


def fit(parts: Array, inputs: int, t: Array) -> DeadTimeTrend | None:
    """Estimate the drift that all inputs have in common; None: the drive is too short.

    Args:
        parts: (b, 3 m + 2, 3 m + 2) products of one block each, of the whitened slopes of the answer by gains (m), offset,
            taus (m) and dead times (m), and of the output.
        inputs: m.
        t: (b,) s, of each block.

    Example:
        >>> rng, t = np.random.default_rng(1), np.arange(600.0)
        >>> x = rng.standard_normal((600, 50, 4))  # gain, offset, tau, dead time
        >>> output = 5 * x[:, :, 0] + (3e-4 * t)[:, None] * x[:, :, 3] + rng.standard_normal((600, 50))
        >>> x = np.concatenate([x, output[..., None]], axis=2)
        >>> drift = fit(x.transpose(0, 2, 1) @ x, 1, t)
        >>> drift.found, abs(drift.rate - 3e-4) < 3 * drift.sd
        (True, True)
    """
    G, r = parts[:, :-1, :-1], parts[:, :-1, -1]
    known = G[:, -inputs:, -inputs:].trace(axis1=1, axis2=2)
    counted = known > 0.0
    clusters = np.floor((t - t[0]) / CLUSTER_S).astype(int)
    if len(np.unique(clusters[counted])) < MIN_CLUSTERS:
        return None
    span = float(np.ptp(t))
    s = (t - float(known @ t) / float(known.sum())) / span
    c = G.shape[1]
    trends = np.eye(c)[:, : inputs + 2]
    trends[:, -1] = np.arange(c) >= c - inputs
    columns = np.concatenate([np.broadcast_to(np.eye(c), G.shape), s[:, None, None] * trends], axis=2)
    turned = columns.transpose(0, 2, 1)
    M, v = turned @ G @ columns, (turned @ r[:, :, None])[:, :, 0]
    total = M.sum(axis=0)
    C = np.linalg.inv(total + np.diag(RIDGE * np.diag(total) + 1e-12))
    value = C @ v.sum(axis=0)
    # what each cluster adds to the last coefficient
    added = np.bincount(clusters, (v - M @ value) @ C[-1])
    sd = max(float(C[-1, -1]), float(added @ added)) ** 0.5
    return DeadTimeTrend(float(value[-1]) / span, sd / span)


def says(drift: DeadTimeTrend | None) -> str:
    """The drift in words; "": none is found.

    >>> says(DeadTimeTrend(1e-3, 1e-4)).partition(":")[0]
    'the dead times grow by 1000 ppm [804, 1196] of the time or more'
    """
    if drift is None or not drift.found:
        return ""
    wide = NORMAL_QUANTILE * drift.sd
    value, low, high = (1e6 * x for x in (abs(drift.rate), abs(drift.rate) - wide, abs(drift.rate) + wide))
    # the answer bends with the dead time: the slopes at its mean make the drift too small by a quarter at 1000 ppm
    return (
        f"the dead times {'grow' if drift.rate > 0.0 else 'fall'} by {value:.0f} ppm [{low:.0f}, {high:.0f}] of the time or "
        "more: no one dead time holds for all of the drive; stamp output and inputs by one clock"
    )
