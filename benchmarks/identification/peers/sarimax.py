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
    with warnings.catch_warnings():  # statsmodels warns where a fit ends before its tolerance
        warnings.simplefilter("ignore")
        model = SARIMAX(seen, exog=X, order=(ORDER, 0, 0), trend="c")
        found = model.fit(disp=False, maxiter=100)
    names = model.param_names
    x = [names.index(f"x{i}") for i in (1, 2, 5, 6)]
    value = np.asarray(found.params)[x]
    C = np.asarray(found.cov_params())[np.ix_(x, x)]
    total = q[2] + q[3] + value[2] + value[3]
    sd = np.sqrt([C[0, 0], C[1, 1], C[2:, 2:].sum()])
    return gls.Answer(np.array([value[0], value[1], total]), sd)
