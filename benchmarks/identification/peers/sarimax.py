"""Exact maximum likelihood with AR noise through gaps: statsmodels' SARIMAX, masked samples given as missing.

SARIMAX is linear in its inputs: they are the two answers at the delays of the masked least squares (gls.py) and their
derivatives by lag and dead time, so that one fit is a step of Gauss and Newton from there, with intervals of all.
"""

from __future__ import annotations

import warnings

import numpy as np

from benchmarks.identification.peers import gls
from benchmarks.identification.peers.rows import Rows

ORDER = 2  # of the noise; the remnant of the table is AR(1)
STEP = 1e-3  # s, of the derivatives


def fit(rows: Rows, settle: float = 4.5) -> gls.Answer:
    """Fit all rows at once."""
    from statsmodels.tsa.statespace.sarimax import SARIMAX

    y, u, dt = rows.output, rows.inputs, rows.dt
    K, q, _ = gls.parameters(y, u, dt, settle, rows.usable)
    at = [gls.answer(u[:, k], dt, q[2 * k], q[2 * k + 1]) for k in range(2)]
    slopes = []
    for k in range(2):
        for by in ((STEP, 0.0), (0.0, STEP)):
            moved = gls.answer(u[:, k], dt, q[2 * k] + by[0], q[2 * k + 1] + by[1])
            slopes.append(K[1 + k] * (moved - at[k]) / STEP)
    first = round(settle / dt)
    X = np.column_stack([*at, *slopes])[first:]
    seen = np.where(rows.usable, y, np.nan)[first:]
    # one size of all columns, means taken out: the optimiser knows no scales
    size = X.std(axis=0)
    middle = float(np.nanmean(seen))
    start = gls.autoregression(y - K[0] - np.column_stack(at) @ K[1:], ORDER, rows.usable)
    with warnings.catch_warnings():  # statsmodels warns where a fit ends before its tolerance
        warnings.simplefilter("ignore")
        model = SARIMAX(seen - middle, exog=(X - X.mean(axis=0)) / size, order=(ORDER, 0, 0), trend="c")
        found = model.fit([0.0, *(K[1:] * size[:2]), *np.zeros(4), *start], disp=False, maxiter=20)
    names = model.param_names
    x = [names.index(f"x{i}") for i in (1, 2, 5, 6)]
    scale = size[[0, 1, 4, 5]]
    value = np.asarray(found.params)[x] / scale
    C = np.asarray(found.cov_params())[np.ix_(x, x)] / np.outer(scale, scale)
    total = q[2] + q[3] + value[2] + value[3]
    sd = np.sqrt([C[0, 0], C[1, 1], C[2:, 2:].sum()])
    return gls.Answer(np.array([value[0], value[1], total]), sd)
