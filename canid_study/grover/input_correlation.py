"""What one fit per input costs as a function of the correlation of the inputs, by simulation on the user's own drive.

The jointly identified driver is simulated on the recorded inputs of the episodes, with noise of the spectrum that the joint
fit leaves, and with the range rate turned towards or away from the headway error until their correlation is as wanted. A fit
of the headway error alone then gives K1 + K2 <x1, x2> / <x1, x1>, the bias of an omitted variable (Theil 1957), x being the
inputs behind lag and dead time; the joint fit, whitened as FOPDT is, gives K1 with the spread of its noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from canid.mathematics.identification import autoregression
from canid.mathematics.identification.confidence import QUANTILES
from canid.values.types import NAN, Array, Interval, Trace
from canid_study.grover import joint, reduction
from canid_study.grover.episodes import Episode, correlation, detrended
from canid_study.grover.joint import Joint
from canid_study.grover.reduction import FirstOrder
from canid_study.grover.settings import GroverSettings

# wanted correlations of headway error and range rate
CORRELATIONS = (-0.9, -0.7, -0.5, -0.3, -0.1, 0.0, 0.1, 0.3, 0.5, 0.7, 0.9)
# s; lags that each fit chooses from, as the truth is not known to it
LAGS = (0.0, 0.15, 0.3, 0.5, 0.75, 1.2, 2.0)
# episodes of a drive that are simulated on, the longest ones
MOST_EPISODES = 6
# s of noise that is drawn before a record, until its start is forgotten
WARM_UP_S = 30.0


class Case(NamedTuple):
    """Estimates of K1 over noise realizations: median, and the range of 95 % of them."""

    correlation: float  # of headway error and range rate, mean over the episodes
    per_record: Interval  # headway error alone, each episode on its own as the paper does
    per_input: Interval  # headway error alone, all episodes in one fit
    joint: Interval  # both inputs, all episodes in one fit
    expected: float  # per input without noise and at the true lag: the bias of the omitted variable added to the truth
    loop: bool = False  # the recorded inputs themselves


class Cost(NamedTuple):
    """What one fit per input costs on a drive."""

    K1: float  # the jointly identified gains, which are the truth of the simulation
    K2: float
    noise_sd: float  # output unit
    cases: tuple[Case, ...]  # that of the recorded inputs first
    gate_rejects: (
        float  # %: how often the true model's simulation fits less than the gate on the recorded inputs
    )

    @property
    def recorded(self) -> Case:
        """The case of the inputs as they were."""
        return self.cases[0]


def of_drive(
    trace: Trace, episodes: Sequence[Episode], fitted: Joint, gate: float, settings: GroverSettings
) -> Cost | None:
    """Simulate the jointly identified driver on the inputs of a drive.

    Args:
        trace: of the drive.
        episodes: of it.
        fitted: the joint fit of the drive.
        gate: %, below which the paper rejects a model.
        settings: number of draws and seed.

    Returns:
        None where there is no joint fit or no episode.
    """
    if not fitted.models or not episodes:
        return None
    longest = sorted(episodes, key=lambda e: (-e.length, e.first))[:MOST_EPISODES]
    records = [trace.inputs[e.part] for e in longest]
    outputs = [trace.output[e.part] for e in longest]
    residuals = []
    for y, u in zip(outputs, records, strict=True):
        y, u = detrended(y), detrended(u)
        residuals.append(y - joint.simulated(fitted, y, u, trace.dt))
    rng = np.random.default_rng(settings.seed)
    coefficients = _autoregression(residuals)
    noise = _noise(residuals, coefficients, settings.draws, trace.dt, rng)
    truth = fitted.models
    recorded = _case(records, noise, coefficients, truth, trace.dt, loop=True)
    turned = [
        _case([with_correlation(u, wanted) for u in records], noise, coefficients, truth, trace.dt)
        for wanted in CORRELATIONS
    ]
    fits = np.concatenate(
        [
            100.0
            * (
                1.0
                - np.linalg.norm(n, axis=0) / np.linalg.norm(_signal(u, truth, trace.dt)[:, None] + n, axis=0)
            )
            for u, n in zip(records, noise, strict=True)
        ]
    )
    sd = float(np.sqrt(np.mean(np.concatenate(residuals) ** 2)))
    return Cost(
        truth[0].K,
        truth[1].K,
        sd,
        (recorded, *turned),
        100.0 * float(np.mean(fits < gate)),
    )


def with_correlation(inputs: Array, wanted: float) -> Array:
    """Turn the second input until it has the wanted correlation with the first; both keep their standard deviations.

    Args:
        inputs: (n, 2).
        wanted: -1 to 1.

    >>> x = with_correlation(np.random.default_rng(0).standard_normal((500, 2)), 0.7)
    >>> round(float(np.corrcoef(x.T)[0, 1]), 9)
    0.7
    """
    x = detrended(inputs)
    first, second = x[:, 0], x[:, 1]
    across = second - first * float(first @ second) / max(float(first @ first), 1e-300)
    unit = first / max(float(first.std()), 1e-300), across / max(float(across.std()), 1e-300)
    turned = float(second.std()) * (wanted * unit[0] + np.sqrt(1.0 - wanted * wanted) * unit[1])
    return np.column_stack([first, turned])


def per_input_gain(
    outputs: Sequence[Array], inputs: Sequence[Array], dt: float, taus: Sequence[float], dead_time: float
) -> Array:
    """Gain of a first-order model of one input, by least squares at the lag that fits best: (r,).

    Args:
        outputs: (n, r) each, r noise realizations of a record, detrended.
        inputs: (n,) each, of these records.
        dt: s.
        taus: s, lags to choose from.
        dead_time: s.
    """
    count = outputs[0].shape[1]
    best, gain = np.full(count, -np.inf), np.full(count, NAN)
    for tau in taus:
        x = [detrended(reduction.response(u, tau, dead_time, dt)) for u in inputs]
        power = sum(float(a @ a) for a in x)
        if power <= 0.0:
            continue
        product = np.sum([a @ y for a, y in zip(x, outputs, strict=True)], axis=0)
        explained = product * product / power
        gain = np.where(explained > best, product / power, gain)
        best = np.maximum(best, explained)
    return gain


def joint_gain(
    outputs: Sequence[Array],
    inputs: Sequence[Array],
    dt: float,
    taus: Sequence[float],
    dead_times: Sequence[float],
    noise: Array,
) -> Array:
    """Gain of the first input of a first-order model of both, whitened, at the lags that fit best: (r,).

    Args:
        outputs: (n, r) each, r noise realizations of a record, detrended.
        inputs: (n, 2) each, of these records.
        dt: s.
        taus: s, lags to choose from, of each input.
        dead_times: (2,) s.
        noise: (p,) autoregression of the noise.
    """
    white = [_whitened(y, noise) for y in outputs]
    columns = [
        [[_whitened(reduction.response(u[:, i], tau, theta, dt), noise) for u in inputs] for tau in taus]
        for i, theta in enumerate(dead_times)
    ]
    products = [
        [np.sum([a @ y for a, y in zip(x, white, strict=True)], axis=0) for x in by_lag] for by_lag in columns
    ]
    count = white[0].shape[1]
    best, gain = np.full(count, -np.inf), np.full(count, NAN)
    for x1, y1 in zip(columns[0], products[0], strict=True):
        for x2, y2 in zip(columns[1], products[1], strict=True):
            aa, ab, bb = _sum(x1, x1), _sum(x1, x2), _sum(x2, x2)
            determinant = aa * bb - ab * ab
            # inputs that are one to eight digits have no two gains
            if determinant <= 1e-8 * aa * bb:
                continue
            first, second = (bb * y1 - ab * y2) / determinant, (aa * y2 - ab * y1) / determinant
            explained = first * y1 + second * y2
            gain = np.where(explained > best, first, gain)
            best = np.maximum(best, explained)
    return gain


def _sum(x: Sequence[Array], y: Sequence[Array]) -> float:
    return sum(float(a @ b) for a, b in zip(x, y, strict=True))


def _whitened(x: Array, noise: Array) -> Array:
    """Prediction errors of the autoregression along the first axis, less their line."""
    errors = lfilter(np.concatenate([[1.0], -noise]), [1.0], x, axis=0)
    return detrended(np.asarray(errors[len(noise) :], np.float64))


def omitted_variable(inputs: Sequence[Array], truth: Sequence[FirstOrder], dt: float) -> float:
    """K1 + K2 <x1, x2> / <x1, x1>: what a fit of the first input alone tends to (Theil 1957).

    Args:
        inputs: (n, 2) each, records that are fitted together.
        truth: of both inputs.
        dt: s.

    >>> u = np.random.default_rng(0).standard_normal(500)
    >>> truth = FirstOrder(5.0, 0.3, 0.2, 0.0), FirstOrder(6.0, 0.3, 0.2, 0.0)
    >>> round(omitted_variable([np.column_stack([u, 2.0 * u])], truth, 0.1), 9)  # the second input is twice the first
    17.0
    """
    x1, x2 = (
        [detrended(reduction.response(u[:, i], model.tau, model.dead_time, dt)) for u in inputs]
        for i, model in enumerate(truth)
    )
    return truth[0].K + truth[1].K * _sum(x1, x2) / max(_sum(x1, x1), 1e-300)


def _signal(inputs: Array, truth: Sequence[FirstOrder], dt: float) -> Array:
    responses = [
        model.K * reduction.response(u, model.tau, model.dead_time, dt)
        for u, model in zip(inputs.T, truth, strict=True)
    ]
    return detrended(responses[0] + responses[1])


def _case(
    records: Sequence[Array],
    noise: Sequence[Array],
    coefficients: Array,
    truth: Sequence[FirstOrder],
    dt: float,
    *,
    loop: bool = False,
) -> Case:
    outputs = [_signal(u, truth, dt)[:, None] + n for u, n in zip(records, noise, strict=True)]
    first, delays = [u[:, 0] for u in records], [model.dead_time for model in truth]
    alone = [per_input_gain([y], [u], dt, LAGS, delays[0]) for y, u in zip(outputs, first, strict=True)]
    return Case(
        float(np.mean([correlation(*detrended(u).T) for u in records])),
        _range(np.concatenate(alone)),
        _range(per_input_gain(outputs, first, dt, LAGS, delays[0])),
        _range(joint_gain(outputs, records, dt, LAGS, delays, coefficients)),
        omitted_variable(records, truth, dt),
        loop,
    )


def _range(x: Array) -> Interval:
    known = x[np.isfinite(x)]
    if not known.size:
        return Interval()
    low, middle, high = np.quantile(known, [QUANTILES[0], 0.5, QUANTILES[1]])
    return Interval(float(middle), float(low), float(high))


def _autoregression(residuals: Sequence[Array]) -> Array:
    """Coefficients (p,) of the noise model of all records together."""
    gap = 8  # samples between two records, above the largest order
    joined = np.concatenate([np.concatenate([r, np.full(gap, NAN)]) for r in residuals])
    usable = np.isfinite(joined)
    return autoregression.fit(np.where(usable, joined, 0.0), usable)


def _noise(
    residuals: Sequence[Array], coefficients: Array, draws: int, dt: float, rng: np.random.Generator
) -> list[Array]:
    """Draw noise of the residuals' autoregression and power for each record, detrended as they are: (n, draws) each."""
    warm = round(WARM_UP_S / dt)
    out = []
    for r in residuals:
        shocks = rng.standard_normal((warm + len(r), draws))
        n = detrended(lfilter([1.0], np.concatenate([[1.0], -coefficients]), shocks, axis=0)[warm:])
        out.append(n * float(np.sqrt(float(np.mean(r**2)) / max(float(np.mean(n**2)), 1e-300))))
    return out
