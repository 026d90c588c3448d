"""Drives whose models have given parameters, without any drive."""

from __future__ import annotations

import numpy as np

from canid.analysis.sumo.driver_model import Candidate, DriverModel
from canid.analysis.sumo.driver_noise import DriverNoise
from canid.analysis.sumo.pooled_driver import Drive, PooledDriver, pooled
from canid.analysis.sumo.sumo_models import MODELS
from canid.values.findings import ClosedLoopError
from canid.values.types import Array, Interval


def drive(
    x: Array, variance: Array | float, seconds: float = 600.0, error: float = 0.1, sd: float = 0.3
) -> Drive:
    """A drive whose models all have these parameters on the unit cube (as many as each has)."""
    candidates = []
    for k, one in enumerate(MODELS):
        n = len(one.rival.parameters)
        at = np.resize(x, n)
        q = one.rival.physical(at[:, None])[:, 0]
        names = [p.name for p in one.rival.parameters]
        candidates.append(
            Candidate(
                one.name, "", {name: Interval(v, v, v) for name, v in zip(names, q.tolist(), strict=True)},
                dict.fromkeys(names, ""), tuple(at.tolist()),
                tuple(tuple(row) for row in np.diag(np.resize(np.asarray(variance, float), n)).tolist()),
                ClosedLoopError(error + 0.1 * k, 0.05), False,
                DriverNoise(Interval(sd, 0.9 * sd, 1.1 * sd), Interval(2.0, 1.0, 4.0), 2.0),
            )
        )  # fmt: skip
    quantiles = {"accel": (-2.0, 1.5), "speed": (0.0, 30.0)}
    return Drive("a.blf", DriverModel(MODELS[0].name, "", tuple(candidates), seconds, 30.0, quantiles))


X = np.array([0.8, 0.5, 0.4, 0.6, 0.5])


def driver(model: str, name: str = "a") -> PooledDriver:
    """A driver with this model."""
    return pooled(name, [Drive("a.blf", drive(X, 1e-3).model._replace(model=model))])
