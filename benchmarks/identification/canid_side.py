"""canid's own estimators, as the tables call them: every call into what is measured stands here, once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import canid
from canid.mathematics.estimators import ESTIMATORS
from canid.mathematics.estimators.armax import SECOND_START, ArmaxSettings
from canid.mathematics.estimators.fopdt import FopdtSettings
from canid.mathematics.identification import autoregression, feedback_bias, identifiability, innovation_law
from canid.mathematics.identification.armax import (
    armax_batch,
    armax_recursive,
    box_jenkins_recursive,
    forgetting_mixture,
    gain_and_delay,
)
from canid.mathematics.identification.armax.rates import per_sample, rates
from canid.mathematics.identification.fopdt import fopdt_residual, regression_rows
from canid.mathematics.identification.fopdt.fopdt_fit import Settings, fit_process, row_layout
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.fopdt.prior import Prior
from canid.values.types import (
    TASK_INPUTS,
    Channel,
    Estimate,
    Interval,
    LearnGate,
    OutputFilter,
    ResidualTests,
    Sample,
)
from tests.identification.innovation_density import log_density

ORDERS = armax_batch.Orders()
# as the estimator does live
START = round(ArmaxSettings().start / 0.1)  # samples of the batch start
LIVE = ArmaxSettings().forgetting
# outputs of the loops, where nothing else is said
UNFILTERED = OutputFilter("none")
# ends of the ranges of tau and dead time
BOX = FopdtSettings()


def without_offset(theta: np.ndarray) -> np.ndarray:
    """Return a1 a2 b1 b2 c1 of canid's a1 a2 b1 b2 c0 c1."""
    return np.asarray(theta, float)[[0, 1, 2, 3, 5]]


def batch(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Fit ARMAX(2,2,1) to one input at once: a1 a2 b1 b2 c1, NaN where nothing was found."""
    fit = armax_batch.fit_armax(y, u[:, None], np.full(len(y), True), ORDERS)
    return without_offset(fit.theta) if fit is not None else np.full(5, np.nan)


def armax_channels(output: np.ndarray, inputs: np.ndarray, dt: float) -> list[Channel]:
    """Fit ARMAX(2,2,1) to all inputs at once and return what it reports of each."""
    names = tuple(map(str, range(inputs.shape[1])))
    fit = armax_batch.fit_armax(output, inputs, np.full(len(output), True), ORDERS)
    if fit is None:
        return [Channel() for _ in names]
    return list(gain_and_delay.channels(names, fit.A, fit.B, ORDERS.nk, fit.covariance, dt).values())


def recursion(
    y: np.ndarray, u: np.ndarray, forgetting: float | None, precision: type = np.float64
) -> Iterator[tuple[int, Any]]:
    """Start on the first 15 s, then go on sample by sample: yields k and the state.

    Args:
        y: (n,).
        u: (n,) one input.
        forgetting: per sample, this one alone; None: as the live estimator does.
        precision: `np.float32` runs the recursion in single precision.
    """
    fit = armax_batch.fit_armax(y[:START], u[:START, None], np.full(START, True), ORDERS)
    if fit is None:
        return
    state = armax_recursive.begin(fit, LIVE if forgetting is None else (forgetting,), precision)
    for k, (output, value) in enumerate(zip(y[START:].tolist(), u[START:].tolist(), strict=True), START):
        state, _ = armax_recursive.step(state, ORDERS, output, (value,))
        n = k + 1
        if forgetting is None and n == SECOND_START * START:  # live, a second batch fit takes its place
            fit = armax_batch.fit_armax(y[:n], u[:n, None], np.full(n, True), ORDERS)
            state = armax_recursive.begin(fit, LIVE, precision) if fit is not None else state
        yield k, state


def estimates(state: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return a1 a2 b1 b2 c1 of a recursion, and the (6, 6) covariance with the offset in it.

    The mean of the memories, and the covariance within and between them. A memory counts samples with exponential weights;
    the variance is that with squared weights, inflated by the autocorrelation of the innovations.
    """
    shares = np.array(forgetting_mixture.shares(state.trust))
    theta = state.theta[:, 0].astype(float)
    mean = shares @ theta
    w1, w2 = state.weights
    root = state.root.astype(float) * np.sqrt(shares * w2 / w1)[:, None, None]
    moving = state.score[1] > 0.0
    ratio = float(np.mean(state.score[0][moving] / state.score[1][moving])) if moving.any() else 1.0
    variance = state.noise.variance * state.law.inflation * max(1.0, ratio)
    covariance = (root @ root.swapaxes(1, 2)).sum(axis=0) * variance
    covariance += (shares[:, None] * (theta - mean)).T @ (theta - mean)
    return without_offset(mean), covariance


def process(
    output: np.ndarray,
    inputs: np.ndarray,
    dt: float,
    usable: np.ndarray | None = None,
    segment: np.ndarray | None = None,
    output_filter: OutputFilter | None = UNFILTERED,
    bound: np.ndarray | None = None,
) -> ProcessFit:
    """Fit first order plus dead time; the first 4.5 s are history only. Two inputs are those of car following."""
    usable = np.full(len(output), True) if usable is None else usable
    held = feedback_bias.held(TASK_INPUTS["car_following"]) if inputs.shape[1] == 2 else None
    return fit_process(
        output,
        inputs,
        usable,
        dt,
        Settings(output_filter=output_filter, held=held),
        segment=segment,
        bound=bound,
    )


def tested(
    output: np.ndarray,
    inputs: np.ndarray,
    usable: np.ndarray,
    segment: np.ndarray,
    dt: float,
    output_filter: OutputFilter | None,
) -> tuple[ProcessFit, ResidualTests | None]:
    """Fit first order plus dead time and test its residuals; None: there is no fit."""
    fit = process(output, inputs, dt, usable, segment, output_filter)
    if fit.start is None:
        return fit, None
    names = ("headway_error", "range_rate")
    samples = np.column_stack([output, usable, segment, inputs])
    layout = row_layout(len(names), dt, BOX.tau_max, BOX.dead_time_max)
    _, rows = regression_rows.put(layout, regression_rows.State(), samples, BOX.tau_max + BOX.dead_time_max)
    simulated = fopdt_residual.simulate_window(layout, rows, fit)
    return fit, fopdt_residual.run_tests(simulated, fit, names, output_filter)


# What a user might declare who has read the published drivers: centre and width of reference/identification.md, sec. 3.
# It is near the truth of both loops, but for tau1 - tau2 of loop A (0.28 s).
PRIOR = Prior(tau=0.35, tau_factor=2.0, dead_time=0.3, dead_time_sd=0.2, same_tau=0.25, same_dead_time=0.15)


def with_prior(
    output: np.ndarray, inputs: np.ndarray, dt: float, usable: np.ndarray, segment: np.ndarray
) -> ProcessFit:
    """Fit with a declared prior."""
    return fit_process(output, inputs, usable, dt, Settings(prior=PRIOR), segment=segment)


def live(
    name: str,
    names: tuple[str, ...],
    y: np.ndarray,
    u: np.ndarray,
    dt: float,
    every: float,
    usable: np.ndarray | None = None,
    segment: np.ndarray | None = None,
) -> Iterator[Estimate]:
    """Run one live estimator over (n,) outputs and (n, m) inputs; yields its last estimate every `every` s."""
    estimator = next(one for one in ESTIMATORS if one.name == name).make(names, dt)
    state, last, due = estimator.init(), None, every
    learn = [True] * len(y) if usable is None else usable.tolist()
    part = [0] * len(y) if segment is None else segment.tolist()
    for k, (output, inputs) in enumerate(zip(y.tolist(), u.tolist(), strict=True)):
        state, estimate = estimator.step(
            state, Sample(k * dt, output, tuple(inputs), LearnGate.OPEN, learn[k], int(part[k]), {})
        )
        last = estimate if estimate is not None else last
        if k * dt >= due - 1e-9 and last is not None:
            due += every
            yield last


def live_at(
    name: str,
    names: tuple[str, ...],
    y: np.ndarray,
    u: np.ndarray,
    dt: float,
    at: Sequence[float],
    output_filter: OutputFilter | None = None,
) -> list[Estimate | None]:
    """Run one live estimator over (n,) outputs and (n, m) inputs; its first estimate from each time `at` [s] on."""
    found = next(one for one in ESTIMATORS if one.name == name)
    settings = found.settings()
    if hasattr(settings, "output_filter"):
        settings = settings._replace(output_filter=output_filter)
    estimator = found.make(names, dt, settings)
    state, wanted = estimator.init(), list(at)
    out: list[Estimate | None] = []
    for k, (output, inputs) in enumerate(zip(y.tolist(), u.tolist(), strict=True)):
        sample = Sample(k * dt, output, tuple(inputs), LearnGate.OPEN, True, 0, {})
        state, due = estimator.advance(state, sample)
        if due and wanted and sample.t >= wanted[0] - 1e-9:
            out.append(estimator.estimate(state, sample)[1])
            wanted.pop(0)
    return [*out, *[None] * len(wanted)]


def quoted(channel: Channel, field: str) -> Interval:
    """Return an interval that may be quoted, or NaN."""
    interval: Interval = getattr(channel, field)
    return interval if identifiability.quotable(channel, field) else Interval()


def inside(channel: Channel, field: str, truth: float) -> bool | None:
    """Whether an interval holds the truth; None where it was not reported."""
    interval = getattr(channel, field)
    return bool(interval.low <= truth <= interval.high) if np.isfinite(interval.value) else None


class Score(NamedTuple):
    """Held-out one-step log scores in nats per minute."""

    gaussian: float
    law: float
    freedom: float
    dt: float  # s, rows apart


# s of a drive that the recursion's batch start takes
RECURSION_BEGINS_S = 60.0


def held_out(path: Path, vehicle: str, half: int) -> Score:
    """Fit one half of a log and score the other, by the noise's Gaussian autoregression and by canid's law.

    Args:
        path: of the log.
        vehicle: its file's name.
        half: 0 or 1, the one that is fitted.
    """
    trace = canid.read_trace(path, vehicle)
    n = len(trace.t)
    parts = slice(0, n // 2), slice(n // 2, n)
    fitted, judged = parts[half], parts[1 - half]
    fit = fit_process(
        trace.output[fitted],
        trace.inputs[fitted],
        trace.learn[fitted],
        trace.dt,
        segment=trace.segment[fitted],
        bound=None if trace.bound is None else trace.bound[fitted],
    )
    residuals = [_residual(fit, trace, part) for part in (fitted, judged)]
    scores = []
    for law in (False, True):
        total, rows = 0.0, 0
        for phase in range(fit.stride):
            own, other = ([column[phase :: fit.stride] for column in columns] for columns in residuals)
            ar = fit.noise if law else autoregression.fit(own[0], own[1] > 0.0, 5)
            density, usable = _density(ar, own, other, fit.stride * trace.dt, law)
            total, rows = total + float(density[usable].sum()), rows + int(usable.sum())
        scores.append(60.0 / (fit.stride * trace.dt) * total / max(rows, 1))
    freedom = fit.law.freedom if fit.law is not None else np.nan
    return Score(scores[0], scores[1], freedom, fit.stride * trace.dt)


def recursive(path: Path, vehicle: str, half: int) -> float:
    """Gain of canid's law over a Gaussian one on ARMAX's innovations, nats/min; NaN: the recursion does not begin.

    Each innovation is the error of the recursion's own prediction from what came before. Both laws are those that one half
    shows, judged on the other.

    Args:
        path: of the log.
        vehicle: its file's name.
        half: 0 or 1, whose innovations the laws are fitted to.
    """
    trace = canid.read_trace(path, vehicle)
    samples = np.column_stack([trace.output, trace.learn, trace.segment, trace.inputs])
    layout, stated = row_layout(2, trace.dt, 3.0, 1.5), rates(trace.dt)
    memories = per_sample(armax_recursive.FORGETTING, trace.dt)
    begin, settle = round(RECURSION_BEGINS_S / trace.dt), 4.5
    state = box_jenkins_recursive.begin(layout, samples[:begin], memories, None, settle)
    if state is None:
        return float("nan")
    kept = []
    for first in range(begin, len(samples) - stated.block, stated.block):
        before = state
        state = box_jenkins_recursive.step(
            layout, state, samples[first : first + stated.block], memories, None, settle
        )
        if state.blocks > before.blocks:
            kept.append(state.tested[-stated.block :, :2])
    e, y = np.concatenate(kept).T
    n = len(e) // 2
    halves = [(e[part][:: state.stride], y[part][:: state.stride]) for part in (slice(0, n), slice(n, None))]
    scores = []
    for law in (False, True):
        of = None
        for innovations, output in (halves[half], halves[1 - half]):
            known = np.isfinite(innovations)
            clean = np.where(known, innovations, 0.0)
            seen = np.isfinite(output)
            change = innovation_law.changes(np.where(seen, output, 0.0), seen)
            features = innovation_law.features(clean, known, change, 1.0 / (state.stride * trace.dt))
            if of is None:
                plain = innovation_law.equal(len(clean), float(clean[known].std()))
                of = innovation_law.fit(clean, known, features) if law else plain
                continue
            density = log_density(clean, innovation_law.applied(clean, of.law, features))
            scores.append(60.0 / (state.stride * trace.dt) * float(density[known].mean()))
    return scores[1] - scores[0]


def _residual(fit: ProcessFit, trace: canid.Trace, part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residual, whether usable, and output of one part."""
    layout = row_layout(2, trace.dt, 3.0, 1.5)
    samples = np.column_stack(
        [trace.output[part], trace.learn[part], trace.segment[part], trace.inputs[part]]
    )
    _, rows = regression_rows.put(layout, regression_rows.State(), samples, 4.5)
    simulated = fopdt_residual.simulate_window(layout, rows, fit)
    usable = simulated.usable
    residual = np.where(usable, simulated.output - simulated.answer - fit.point.offset, 0.0)
    return residual, usable.astype(float), np.where(usable, simulated.output, 0.0)


def _density(
    ar: np.ndarray, own: list[np.ndarray], other: list[np.ndarray], dt: float, law: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Log density of each innovation of `other` under the law that `own` shows, and where it counts."""
    found = None
    for residual, usable, y in (own, other):
        rows = autoregression.whole(usable > 0.0, max(len(ar), 2))
        e = autoregression.whiten(residual, ar)
        change = np.zeros(len(e))
        change[2:] = np.abs(y[1:-1] - y[:-2])
        of = innovation_law.features(e, rows, change, 1.0 / dt)
        if found is None:
            found = (
                innovation_law.fit(e, rows, of) if law else innovation_law.equal(len(e), float(e[rows].std()))
            )
            continue
        return log_density(e, innovation_law.applied(e, found.law, of)), rows
    raise AssertionError
