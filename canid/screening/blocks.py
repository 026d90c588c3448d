"""The predictors: driver, vehicle, sensing."""

from __future__ import annotations

import numpy as np

from canid.screening import rows
from canid.screening.predictor import Misfit, Predictor
from canid.types import Array


def driver(names: tuple[str, ...], output: str) -> Predictor:
    """The driver's output from his inputs."""
    lagged = [(rows.ANSWER, k) for k in range(1, 6)]
    groups = []
    for i, name in enumerate(names):
        lags = (1, 3, 5, 7) if name == "headway_error" else range(1, 8)
        groups.append(range(len(lagged), len(lagged) + len(lags)))
        lagged += [(rows.FIRST_INPUT + i, k) for k in lags]
    def only(*which):
        def along(theta: Array) -> Array:
            out = np.zeros_like(theta)
            for g in which:
                out[g] = theta[g]
            return out
        return along
    def delay(g):
        def along(theta: Array) -> Array:
            out = np.zeros_like(theta)
            b = theta[g]
            out[g] = np.concatenate(([0.0], b[:-1])) - b
            out[g] /= rows.STEP
            return out
        return along
    words = [n.replace("_", " ") for n in names]
    misfits = [Misfit(f"gain {w}", only(list(g)), 0.2) for w, g in zip(words, groups)]
    if len(groups) > 1:
        misfits.append(Misfit("gain both", only(*[list(g) for g in groups]), 0.2))
        misfits.append(Misfit("delay", delay(list(groups[-1])), 0.1))
    return Predictor("answer", "driver", rows.ANSWER, tuple(lagged), tuple(range(len(lagged) + 1)), tuple(misfits))


def vehicle() -> Predictor:
    lagged = [(rows.ACCEL, k) for k in range(1, 5)] + [(rows.PULL, k) for k in range(1, 7)] + [(rows.DRAG, 1)]
    def along(theta):
        out = np.zeros_like(theta)
        out[4:10] = theta[4:10]
        return out
    return Predictor("accel", "vehicle", rows.ACCEL, tuple(lagged), tuple(range(12)), (Misfit("pull", along, 0.2),))


def range_scale() -> Predictor:
    na = 3
    lagged = [(rows.CREPT, k) for k in range(1, na + 1)] + [(rows.RAN, k) for k in range(na + 1)]
    def along(theta):
        out = np.zeros_like(theta)
        out[na] = 1.0
        out[na + 1 : 2 * na + 1] = -theta[:na]
        return out
    return Predictor("range", "sensing", rows.CREPT, tuple(lagged), (*range(na), 2 * na + 1), (Misfit("range rate scale", along, 0.15),))


def latency() -> Predictor:
    na = 5
    lagged = [(rows.LEAD, k) for k in range(1, na + 1)] + [(rows.OWN, k) for k in range(na + 2)]
    def along(theta):
        white = np.concatenate(([1.0], -theta[:na], [0.0]))
        out = np.zeros_like(theta)
        out[na : 2 * na + 2] = np.diff(white, prepend=0.0) / rows.STEP
        return out
    return Predictor("latency", "sensing", rows.LEAD, tuple(lagged), (*range(na), 2 * na + 2), (Misfit("latency", along, 0.1),))


def beside() -> Predictor:
    na = 2
    lagged = [(rows.BESIDE, 1), (rows.BESIDE, 2), (rows.ACCEL, 0), (rows.SPEED, 0), (rows.SPEED, 1), (rows.SPEED, 2)]
    def along(theta):
        out = np.zeros_like(theta)
        out[3] = 1.0
        out[4:6] = -theta[:2]
        return out
    return Predictor("gnss", "sensing", rows.BESIDE, tuple(lagged), (0, 1, 3, 6), (Misfit("speed scale", along, 0.03),))
