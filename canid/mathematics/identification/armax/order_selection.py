"""Which orders: a small set of ARMAX models compared on the same samples by AIC, BIC and FPE."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification.armax.armax_batch import ArmaxFit, Orders, fit_armax
from canid.mathematics.identification.armax.rates import STATED_S
from canid.values.types import NAN, Array

# Orders from one to three and dead times up to 0.4 s at 10 Hz: what Chen & Ulsoy 2001 (sec. 2.2) tried, less
# the high orders that the criteria like and that say nothing of a driver.
CANDIDATES = tuple(
    Orders(na, nb, nc, nk) for na, nb, nc in ((1, 1, 1), (2, 2, 1), (2, 2, 2), (3, 3, 2)) for nk in (1, 2, 4)
)


class Candidate(NamedTuple):
    """One model of the comparison; NaN where it could not be fitted."""

    orders: Orders
    aic: float  # Akaike 1974, per sample
    bic: float  # Schwarz 1978, per sample
    fpe: float  # Akaike 1969, in the output's unit squared (Chen & Ulsoy 2001, eq. 2)
    white: bool


def compare(
    output: Array,
    inputs: Array,
    usable: npt.NDArray[np.bool_],
    candidates: Sequence[Orders] = CANDIDATES,
    *,
    segment: npt.NDArray[np.int64] | None = None,
    dt: float = STATED_S,
) -> list[Candidate]:
    """Fit every candidate and rank by BIC, best first.

    Args:
        output: (N,).
        inputs: (N, m).
        usable: (N,).
        candidates: orders to try.
        segment: (N,), changes where the inputs' history breaks.
        dt: s, the grid's step.

    >>> rng = np.random.default_rng(0)
    >>> u, e, y = rng.normal(size=(500, 1)), 0.1 * rng.normal(size=500), np.zeros(500)
    >>> for t in range(2, 500): y[t] = 0.8 * y[t-1] + 0.5 * u[t-2, 0] + e[t] + 0.3 * e[t-1]
    >>> compare(y, u, np.full(500, True), [Orders(1, 1, 1, 1), Orders(1, 1, 1, 2)])[0].orders.nk
    2
    """
    # all on the samples that the longest can predict, or the criteria compare different data
    longest = max(o.lag() for o in candidates)
    fits = [(o, fit_armax(output, inputs, usable, o, segment=segment, dt=dt)) for o in candidates]
    common = np.full(len(output), True)
    for _, fit in fits:
        if fit is not None:
            common &= np.isfinite(fit.residual)
    common[:longest] = False
    return sorted((_score(o, fit, common) for o, fit in fits), key=lambda c: np.nan_to_num(c.bic, nan=np.inf))


def _score(o: Orders, fit: ArmaxFit | None, common: npt.NDArray[np.bool_]) -> Candidate:
    N = int(common.sum())
    if fit is None or len(fit.theta) >= N:
        return Candidate(o, NAN, NAN, NAN, False)
    V, d = float(np.mean(fit.residual[common] ** 2)), len(fit.theta)
    if not V > 0.0:
        return Candidate(o, NAN, NAN, NAN, False)
    aic, bic = np.log(V) + 2.0 * d / N, np.log(V) + np.log(N) * d / N
    return Candidate(o, float(aic), float(bic), (N + d) / (N - d) * V, fit.whiteness.white)
