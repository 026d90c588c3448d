"""Car following by batch and online estimators, on rows that are aligned and masked alike (rows.py)."""

from __future__ import annotations

import numpy as np

from benchmarks.identification.peers import cth_rv, dual_ukf, gls, process, sarimax
from benchmarks.identification.peers.gls import Answer
from benchmarks.identification.peers.peer import Peer
from benchmarks.identification.peers.rows import Rows

SETTLE = 4.5  # s of history only, as canid has it


def masked_gls(rows: Rows) -> Answer:
    return gls.fit(rows.output, rows.inputs, rows.dt, SETTLE, rows.usable)


def output_error(rows: Rows) -> Answer:
    first = round(SETTLE / rows.dt)
    found, C = process.joint(rows.output, list(rows.inputs.T), rows.dt, first, rows.usable)
    sd = np.sqrt([C[0, 0], C[3, 3], C[4:6, 4:6].sum()])
    return Answer(np.array([found[0], found[3], found[4] + found[5]]), sd)


# functions of rows that return an answer
BATCH = (
    Peer("generalised least squares, AR(5) (scipy)", masked_gls),
    Peer("SARIMAX, AR(2), missing samples (statsmodels)", sarimax.fit, "statsmodels"),
    Peer("output error (scipy curve_fit)", output_error),
)
# generators over rows of k and an answer
ONLINE = (
    Peer("CTH-RV, recursive least squares of the speed", cth_rv.speed_steps),
    Peer("CTH-RV, recursive least squares of the output", cth_rv.output_steps),
    Peer("CTH-RV, particle filter", cth_rv.particle_steps),
    Peer("CTH, dual unscented filter (filterpy)", dual_ukf.steps, "filterpy"),
)
