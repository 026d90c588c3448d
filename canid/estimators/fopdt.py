"""First, simple fopdt estimator: static gains by least squares over the last 60 s (to be replaced)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.estimators import status
from canid.types import (
    AnyEstimator,
    FopdtSettings,
    Channel,
    Estimate,
    Estimator,
    Identifiable,
    Interval,
    Sample,
    Status,
)


class State(NamedTuple):
    closed: status.Closed = status.Closed()
    rows: tuple[tuple[float, ...], ...] = ()


def make(input_names: tuple[str, ...], dt: float, settings: FopdtSettings = FopdtSettings()) -> AnyEstimator:
    """An estimator."""

    def step(state: State, sample: Sample) -> tuple[State, Estimate | None]:
        closed, forced = status.step(state.closed, sample)
        row = (sample.output, *sample.inputs)
        rows = state.rows
        if sample.learn and all(np.isfinite(row)):
            rows = (*rows, row)[-int(60 / dt) :]
        kind = forced or (Status.CONVERGING if len(rows) * dt < status.ENOUGH else Status.OK)
        if not status.due(closed, sample.t, kind):
            return State(closed, rows), None
        state = State(status.said(closed, sample.t, kind), rows)
        if forced:
            return state, status.silent(sample.t, "fopdt", kind, sample.gate.value, input_names)
        if kind is Status.CONVERGING:
            says = f"{len(rows) * dt:.0f} s of {status.ENOUGH:.0f} s of data"
            return state, status.silent(sample.t, "fopdt", kind, says, input_names)
        a = np.array(rows)
        X = np.c_[a[:, 1:], np.ones(len(a))]
        k = np.linalg.lstsq(X, a[:, 0], rcond=None)[0]
        channels = {
            n: Channel(Interval(float(v), float(v) - 1, float(v) + 1), status=Identifiable.GAIN_ONLY)
            for n, v in zip(input_names, k[:-1], strict=True)
        }
        return state, Estimate(sample.t, "fopdt", kind, "gains only", channels)

    return Estimator("fopdt", State, step)
