"""Cramér-Rao bounds: what no unbiased estimator can beat, by numerical derivatives of the exact answer.

Open loop: the noise model is known exactly, and its estimation costs nothing to first order. Closed loop:
conditional on the inputs that came, which is the bound of the prediction-error method.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from benchmarks.identification import open_loop
from benchmarks.identification.noise_models import NoiseModel, whiten
from canid.mathematics.identification import identifiability
from canid.values.types import Identifiable, Interval
from tests.plants.first_order_lag import answer


class Bound(NamedTuple):
    """Standard deviations that one channel's parameters cannot be known better than."""

    K: float
    tau: float  # s
    dead_time: float  # s
    total: float  # s, of tau + dead_time


class Lag(NamedTuple):
    """The truth of one channel."""

    K: float
    tau: float  # s
    dead_time: float  # s


# s; the answer is smooth over 0.1 ms, and rounding is still far away
STEP = 1e-4


def process(
    inputs: Sequence[np.ndarray],
    truth: Sequence[Lag],
    dt: float,
    sigma: float,
    noise: NoiseModel,
    settle: int,
    every: int = 1,
    usable: np.ndarray | None = None,
    known: Sequence[int] = (),
    box: tuple[float, float] | None = None,
) -> list[Bound]:
    """Bound each channel of y = b + sum K_i G_i u_i + noise.

    Args:
        inputs: (n,) each, at `dt`.
        truth: of each channel.
        dt: s.
        sigma: of the noise.
        noise: its model.
        settle: samples at the start that are history only.
        every: the output is seen at every so many samples.
        usable: (n,) samples that are seen at all; None: every one.
        known: channels whose tau and dead time are known.
        box: s, where tau and dead time are known to end: they then hold as much information as a uniform of that side does
            (van Trees 1968, eq. 2.4-231). None: nothing is known.
    """
    columns = []
    for u, (K, tau, dead_time) in zip(inputs, truth, strict=True):
        columns.append(answer(u, dt, tau, dead_time))
        up, down = answer(u, dt, tau + STEP, dead_time), answer(u, dt, tau - STEP, dead_time)
        columns.append(K * (up - down) / (2.0 * STEP))
        # to both sides by whole samples: inside one sample the answer of sampled data has no kink
        up, down = answer(u, dt, tau, dead_time + dt), answer(u, dt, tau, dead_time - dt)
        columns.append(K * (up - down) / (2.0 * dt))
    rows = np.s_[settle::every]
    J = np.column_stack([*columns, np.ones(len(inputs[0]))])[rows]
    W = whiten(J, noise, dt * every, None if usable is None else usable[rows]) / sigma
    free = [i for i in range(W.shape[1]) if not (i % 3 and i // 3 in known)]
    scale = np.linalg.norm(W, axis=0)
    information = (W / scale).T @ (W / scale)
    if box is not None:
        ends = np.array([np.inf, *box] * len(truth) + [np.inf])
        information += np.diag(12.0 / ends**2 / scale**2)
    covariance = np.zeros((W.shape[1], W.shape[1]))
    covariance[np.ix_(free, free)] = np.linalg.inv(information[np.ix_(free, free)])
    covariance /= np.outer(scale, scale)
    out = []
    for i in range(len(truth)):
        P = covariance[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        out.append(Bound(*(float(x) ** 0.5 for x in (P[0, 0], P[1, 1], P[2, 2], P[1:, 1:].sum()))))
    return out


def of(run: open_loop.Process) -> Bound:
    """Bound one open-loop run."""
    truth = Lag(run.K, run.tau, run.dead_time)
    return process([run.u], [truth], run.dt, run.sigma, run.noise, run.settle)[0]


def says(truth: Lag, bound: Bound) -> Identifiable:
    """Give the bound's own verdict, by the limits that canid uses."""
    K = Interval(truth.K, truth.K - 1.96 * bound.K, truth.K + 1.96 * bound.K)
    return identifiability.judge(K, bound.K, bound.tau, bound.dead_time, bound.total)


def table1(first_seed: int, n: int, decibel: float, runs: int = 20) -> np.ndarray:
    """Bound a1 a2 b1 b2 c1 of Chen & Ulsoy's driver: Fisher's information averaged over runs.

    The gradient of the prediction is the regressor filtered by 1/C (Ljung 1999, eq. 10.21); no offset is estimated.
    """
    information = np.zeros((5, 5))
    before = 100  # samples in which the unknown start is forgotten
    for seed in range(first_seed, first_seed + runs):
        run = open_loop.table1(seed, n + before, decibel)
        e = lfilter(open_loop.A, open_loop.C, run.y) - lfilter(open_loop.B, open_loop.C, run.u)
        e[:50] = 0.0  # half of them for the transient of e itself, half for its gradient
        phi = [-_lagged(run.y, 1), -_lagged(run.y, 2), _lagged(run.u, 1), _lagged(run.u, 2), _lagged(e, 1)]
        psi = np.array([lfilter([1.0], open_loop.C, x) for x in phi])[:, before + 2 :]
        information += psi @ psi.T / run.sigma**2 / runs
    return np.sqrt(np.diag(np.linalg.inv(information)))


def _lagged(x: np.ndarray, k: int) -> np.ndarray:
    return np.concatenate([np.zeros(k), x[:-k]])
