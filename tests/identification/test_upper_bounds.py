"""FOPDT takes a demand that is at least so much as it takes one that is at most so much."""

from __future__ import annotations

import numpy as np
import pytest

from canid.mathematics.estimators import fopdt
from canid.mathematics.identification.first_order import scan
from canid.mathematics.identification.fopdt import fopdt_fit, regression_rows
from canid.values.types import Array, LearnGate, Sample

GAIN, LIMIT = 5.0, 3.0


def drive(seed: int, n: int = 2400) -> tuple[Array, Array]:
    """Input (n, 1), and the demand (n,) of a driver with a lag of 0.4 s and a dead time of 0.3 s."""
    rng = np.random.default_rng([seed, 5])
    u = scan(0.25 * rng.normal(size=n), np.array([0.9]))
    answer = GAIN * scan(0.22 * np.roll(u, 3), np.array([0.78]))
    noise = scan(0.4 * rng.normal(size=n), np.array([0.8]))
    return u[:, None], answer + noise


def fitted(y: Array, u: Array, limit: float, bounded: bool = True) -> fopdt_fit.ProcessFit:
    hidden = y >= limit if limit > 0.0 else y <= limit
    bound = np.where(hidden, np.nextafter(limit, -np.inf) if limit > 0.0 else limit, np.nan)
    return fopdt_fit.fit_process(y, u, ~hidden, 0.1, bound=bound if bounded else None)


def test_the_mirror_image_of_a_drive_gives_the_mirror_image_of_its_estimates(seed: int) -> None:
    u, demand = drive(seed)
    upper = fitted(np.minimum(demand, LIMIT), u, LIMIT).channels[0]
    lower = fitted(np.maximum(-demand, -LIMIT), u, -LIMIT).channels[0]
    assert (lower.K.value, lower.K.low, lower.K.high) == pytest.approx(
        (-upper.K.value, -upper.K.high, -upper.K.low), rel=1e-6
    )
    assert lower.tau_plus_dead_time == pytest.approx(upper.tau_plus_dead_time, rel=1e-6)


def test_an_upper_limit_biases_nothing() -> None:
    values, covered = [], 0
    for seed in range(6):
        u, demand = drive(100 + seed)
        K = fitted(np.minimum(demand, LIMIT), u, LIMIT).channels[0].K
        values.append(K.value)
        covered += K.low <= GAIN <= K.high
    assert np.mean(values) == pytest.approx(GAIN, rel=0.06)
    assert covered >= 5


def test_a_row_of_a_demand_at_least_and_one_at_most_so_much_says_nothing() -> None:
    layout = fopdt_fit.row_layout(1, 0.05, 3.0, 1.5)
    assert layout.per_row == 2
    marks = np.ones(400)
    marks[300:304] = regression_rows.AT_MOST
    marks[320:324] = regression_rows.AT_LEAST
    marks[340:342] = regression_rows.AT_MOST, regression_rows.AT_LEAST
    samples = np.column_stack([np.zeros(400), marks, np.zeros(400), np.arange(400.0) % 7])
    _, rows = regression_rows.put(layout, regression_rows.State(), samples, 1.0)
    assert rows[150:152, 1].tolist() == [regression_rows.AT_MOST] * 2
    assert rows[160:162, 1].tolist() == [regression_rows.AT_LEAST] * 2
    assert rows[170, 1] == 0.0


def test_live_and_whole_drive_take_the_same_rows() -> None:
    u, demand = drive(9, 700)
    y = np.minimum(demand, LIMIT)
    setup = fopdt.configure(("range_rate",), 0.1, fopdt.FopdtSettings(window=60.0))
    state = fopdt.init(setup)
    for k, (output, x) in enumerate(zip(y.tolist(), u[:, 0].tolist(), strict=True)):
        hidden = output >= LIMIT
        gate, bound = (
            (LearnGate.OUTPUT_LIMIT, np.nextafter(LIMIT, 0.0)) if hidden else (LearnGate.OPEN, np.nan)
        )
        state, _ = fopdt.advance(
            setup, state, Sample(0.1 * k, output, (x,), gate, not hidden, 0, {}, float(bound))
        )
    window = fopdt._with_rows(setup, state).window
    kinds = {-2.0: 0, 0.0: 0, 1.0: 0} | dict(zip(*np.unique(window[:, 1], return_counts=True), strict=True))
    assert kinds[regression_rows.AT_LEAST] == np.count_nonzero(y[-len(window) :] >= LIMIT)
    assert kinds[regression_rows.AT_LEAST] > 20
