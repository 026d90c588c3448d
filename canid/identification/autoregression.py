"""The colour of noise as an autoregression AR(p), fitted through gaps; p by Akaike's criterion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from canid.types import Array

# Share of the noise's variance that is treated as white. Where a signal was smoothed (an acceleration, a
# derivative) its noise has next to no content at high frequencies; unlimited whitening would multiply exactly
# those by thousands and fit K, tau and dead time there, to what the smoothing left over. With 0.3 % the
# weight of an empty band against a full one ends near 300. The noise of a person, an Ornstein-Uhlenbeck
# process of 1 s at 10 Hz, has 5 % at the highest frequency: it is changed by 6 % there.
FLOOR = 0.003


def whole(usable: npt.NDArray[np.bool_], p: int) -> npt.NDArray[np.bool_]:
    """Where the sample and its p predecessors are all usable.

    >>> whole(np.array([True, True, False, True, True, True]), 1)
    array([False,  True, False, False,  True,  True])
    """
    out = usable.copy()
    for i in range(1, p + 1):
        out[i:] &= usable[:-i]
    out[:p] = False
    return out


def lagged(r: Array, p: int) -> Array:
    """(n, p): r at lags 1 to p, zero before the beginning."""
    out = np.zeros((len(r), p))
    for i in range(1, p + 1):
        out[i:, i - 1] = r[:-i]
    return out


def whiten(x: Array, noise: Array, starts: Sequence[int] = ()) -> Array:
    """x_t - sum noise_i x_(t-i), along the last axis; before each start x is held at its value there."""
    out = x.copy()
    if not len(noise):
        return out
    n = x.shape[-1]
    edges = sorted({0, *starts, n})
    for a, b in pairwise(edges):
        if b <= a:
            continue
        piece = x[..., a:b]
        out[..., a:b] -= float(np.sum(noise)) * piece[..., :1]
        away = piece - piece[..., :1]
        for i, phi in enumerate(noise, 1):
            out[..., a + i : b] -= phi * away[..., : max(b - a - i, 0)]
    return out


def fit(r: Array, usable: npt.NDArray[np.bool_], most: int = 6, floor: float = FLOOR) -> Array:
    """Coefficients phi of r_t = sum phi_i r_(t-i) + e_t.

    Least squares over the samples whose `most` predecessors are usable too (so that all orders are compared
    on the same samples), order by AIC: BIC keeps AR(1) for a mixture of coloured and white noise, and then
    intervals cover too little.

    Args:
        r: (n,) residual; values where not usable are ignored.
        usable: (n,).
        most: highest order.
        floor: share of white variance added, see FLOOR.

    Returns:
        (p,), 0 <= p <= most; empty where there are too few samples.

    >>> rng = np.random.default_rng(1)
    >>> r = rng.normal(size=4000)
    >>> for k in range(1, 4000): r[k] += 0.8 * r[k - 1]
    >>> abs(fit(r, np.full(4000, True), most=1, floor=0.0)[0] - 0.8) < 0.03
    np.True_
    """
    r = np.where(usable, r, 0.0)
    rows = whole(usable, most)
    count = int(rows.sum())
    # ten samples per coefficient: fewer cannot tell a colour from chance
    if most < 1 or count < 10 * most:
        return np.zeros(0)
    X = lagged(r, most)[rows]
    y = r[rows]
    G = X.T @ X
    G[np.diag_indices(most)] *= 1.0 + floor
    h = X.T @ y
    yy = float(y @ y) * (1.0 + floor)
    if not yy > 0.0:
        return np.zeros(0)
    best: Array = np.zeros(0)
    best_score = count * np.log(yy)
    for p in range(1, most + 1):
        phi = np.linalg.solve(G[:p, :p], h[:p])
        score = count * np.log(max(yy - float(phi @ h[:p]), 1e-12 * yy)) + 2 * p
        if score < best_score:
            best, best_score = np.asarray(phi, float), score
    return _less_biased(best, count)


# Sum of coefficients up to which the bias correction may go: noise that remembers for 200 samples cannot be
# told from a wandering offset in a minute at 10 Hz.
SLOWEST = 0.995


def _less_biased(phi: Array, count: int) -> Array:
    """Add back the bias -(1 + 3 phi) / n of a fit with estimated mean (Marriott & Pope 1954).

    Small as it is, without it the noise looks too fast and slow gains too certain: K1 in a minute is covered
    2 to 5 % less often.
    """
    total = float(np.sum(phi))
    if len(phi) == 0 or not 0.0 < total < SLOWEST:
        return phi
    wanted = min(total + (1.0 + 3.0 * total) / count, SLOWEST)
    out = phi.copy()
    out[0] += wanted - total
    return out
