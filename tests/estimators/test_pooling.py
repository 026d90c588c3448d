"""Rows of a tenth of a second are means of whole groups of samples, live as over a drive."""

import math

import numpy as np

from canid.mathematics.estimators import pooling
from canid.values.types import LearnGate, Sample, Trace


def drive(dt, n=400):
    rng = np.random.default_rng(0)
    learn, segment = np.full(n, True), np.zeros(n, np.int64)
    learn[101] = False
    segment[233:] = 1
    keep = np.ones(n, bool)
    keep[300:307] = False
    t, y, u = dt * np.arange(n), rng.normal(size=n), rng.normal(size=(n, 2))
    gate = (LearnGate.OPEN,) * int(keep.sum())
    return Trace(dt, t[keep], y[keep], u[keep], ("a", "b"), gate, learn[keep], segment[keep], {})


def live(trace):
    state, rows = pooling.State(), []
    for t, y, u, learn, segment in zip(
        trace.t.tolist(),
        trace.output.tolist(),
        trace.inputs.tolist(),
        trace.learn,
        trace.segment,
        strict=True,
    ):
        now = Sample(t, y, tuple(u), LearnGate.OPEN, bool(learn), int(segment), {})
        state, row = pooling.step(state, now, trace.dt, pooling.per_row(trace.dt))
        if row is not None and math.isfinite(row.output):
            rows.append(row)
    return rows


def test_live_rows_are_those_of_the_drive():
    """Same times, means, and what may be learned from, through a gate, a new segment and a hole."""
    for dt in (0.02, 0.05):
        whole, rows = pooling.pooled(drive(dt)), live(drive(dt))
        assert np.allclose([row.t for row in rows], whole.t)
        assert np.allclose([row.output for row in rows], whole.output)
        assert np.allclose([row.inputs for row in rows], whole.inputs)
        assert [row.learn for row in rows] == whole.learn.tolist()
        assert [row.segment for row in rows] == whole.segment.tolist()
        assert not whole.learn.all()


def test_a_tenth_of_a_second_stays_as_it_is():
    """Not a bit of a drive at 10 Hz or slower is touched."""
    for dt in (0.1, 0.2):
        trace = drive(dt)
        assert pooling.pooled(trace) is trace
        assert len(live(trace)) == len(trace.t)
