"""Drives of the fitted driver on the recorded road, in closed loop with his own noise resampled.

The lateral offset answers the wheel as an autoregression with exogenous input that is fitted to the drive itself; what it
leaves (wind, the road, curves) is kept as it was recorded, as the lead vehicle is in car following. So with the recorded
angles the recorded offsets come out, and with the noise of a replicate another drive on the same road.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification import movement_rhythm
from canid.models.diagnosis.driver import held_out
from canid.models.diagnosis.driver.held_out import Fold
from canid.models.diagnosis.fitting import likelihood, log_score_gain
from canid.models.diagnosis.fitting.fitted_model import dropped, scaled_by_state, solve
from canid.models.diagnosis.fitting.likelihood import Output
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.lane import lane_search
from canid.models.diagnosis.lane.lane_fit import FittedLane
from canid.models.diagnosis.lane.lane_model import (
    KD,
    OFFSET,
    PRODUCT,
    TAU,
    THETA,
    WANTED,
    K,
    LaneData,
    LaneModel,
    polynomial,
)
from canid.models.diagnosis.lane.lane_search import LaneSearch
from canid.models.diagnosis.null import predictive_score, sequential
from canid.models.diagnosis.null.confirmed_search import Checked
from canid.models.diagnosis.null.noise_source import BLOCK_S, resampled
from canid.models.diagnosis.null.sequential import Statistics
from canid.models.effects.effect import Effect, Kind
from canid.values.findings import Flags
from canid.values.types import Array, Interval

# s of past offsets and angles that the next offset depends on: a car's yaw and slip, and the smoothing of a camera
CAR_MEMORY_S = 1.0
# m; a replicate that leaves the lane by so much more than the drive did is another driver
MAX_FACTOR = 3.0
# samples of past that a car is fitted to, at least, per coefficient
MIN_ROWS_PER_COEFFICIENT = 20


class Road(NamedTuple):
    """How the offset answers the wheel, and what else moves the car."""

    of_offset: Array  # (p,) of the last offsets, latest first
    of_angle: Array  # (p,) of the last angles
    rest: Array  # (n,) m, all that these do not explain


def road(data: LaneData) -> Road | None:
    """Fit the car by least squares; None: too little was measured."""
    p, y, u = round(CAR_MEMORY_S / data.output.dt), data.offset, data.output.y
    past = np.stack(
        [np.r_[np.full(k, x[0]), x[:-k]] for x in (y, u) for k in range(1, p + 1)] + [np.ones(y.size)], axis=1
    )
    rows = data.output.usable & np.r_[np.zeros(p, dtype=bool), np.ones(y.size - p, dtype=bool)]
    if int(rows.sum()) < MIN_ROWS_PER_COEFFICIENT * past.shape[1]:
        return None
    coefficients = np.linalg.lstsq(past[rows], y[rows], rcond=None)[0]
    coefficients[-1] = 0.0
    return Road(coefficients[:p], coefficients[p : 2 * p], y - past @ coefficients)


def simulated(data: LaneData, driver: FittedLane, on: Road, count: int, seed: list[int]) -> list[LaneData]:
    """Drive again, several times side by side: the baseline with its noise.

    Args:
        data: the recorded drive.
        driver: a baseline without effects.
        on: the car and the road.
        count: of replicates.
        seed: of the draws.

    Returns:
        those in which the driver keeps the lane.
    """
    n, dt, q, noise = data.t.size, data.output.dt, driver.q, driver.noise
    rng = np.random.default_rng(seed)
    pool = driver.fitted.scored.e[driver.rows & ~data.output.hidden]
    innovations = resampled(pool - pool.mean(), (n, count), max(round(BLOCK_S / dt), 1), rng)
    innovations *= noise.sd * noise.size[:, None]
    p, order = on.of_offset.size, noise.A.size - 1
    *a, gain = polynomial(float(q[TAU]), float(q[PRODUCT]), dt).tolist()
    back = float(q[THETA]) / dt
    whole, part = int(back), back - int(back)
    first = max(p, order, whole + 3)
    y, u = np.tile(data.offset[:, None], (1, count)), np.tile(data.output.y[:, None], (1, count))
    clean = np.tile(driver.fitted.model[:, None], (1, count))  # the answer without noise
    left = u - clean
    turn = np.stack([on.of_offset[::-1], on.of_angle[::-1]])
    A = noise.A[:0:-1]
    for k in range(first, n):
        y[k] = turn[0] @ y[k - p : k] + turn[1] @ u[k - p : k] + on.rest[k]
        # position and rate at the dead time, between two samples
        near, far, last = y[k - whole], y[k - whole - 1], y[k - whole - 2]
        position = (1 - part) * near + part * far - q[WANTED]
        rate = ((1 - part) * (near - far) + part * (far - last)) / dt
        demand = q[K] * position + q[KD] * rate
        aimed = clean[k - 1] - q[OFFSET], clean[k - 2] - q[OFFSET]
        clean[k] = q[OFFSET] + gain * demand - a[1] * aimed[0] - a[2] * aimed[1]
        left[k] = innovations[k] - A @ left[k - order : k]
        u[k] = np.clip(clean[k] + left[k], data.output.floor, data.output.ceiling)
    limit = MAX_FACTOR * float(np.abs(data.offset).max())
    return [
        data._replace(offset=y[:, m], output=_limited(data.output, u[:, m]))
        for m in range(count)
        if np.isfinite(u[:, m]).all() and float(np.abs(y[:, m]).max()) < limit
    ]


def _limited(output: Output, y: Array) -> Output:
    """Another output (n,) with the same limits."""
    below, above = output.usable & (y <= output.floor), output.usable & (y >= output.ceiling)
    return output._replace(y=y, below=below, above=above)


def refitted(replicate: LaneData, null: FittedLane) -> FittedLane | None:
    """Fit the null's model to a replicate; None: too few samples."""
    rows: Flags = likelihood.counted(replicate.output, null.noise.A.size - 1)
    if not rows.any():
        return None
    first = solve(replicate, null.model, null.q, null.noise, rows, joint=False)
    noise = scaled_by_state(replicate, null.model, first.fitted, null.noise, rows)
    return solve(replicate, null.model, first.q, noise, rows)


def gain(replicate: LaneData, base: FittedLane, named: Sequence[Named]) -> float:
    """Gain of the simulation on held-out data, of effects that are fitted one after the other."""
    extended = base
    for cause in named:
        extended = lane_search.again(cause.effect, replicate, extended)
    if extended is base:
        return 0.0
    search = LaneSearch(base, replicate, extended, tuple(named))
    errors = held_out.errors(replicate, search, held_out.folds(replicate, search, lane_search.again))
    return held_out.gain(*errors, replicate.output.dt).value


class Keeping:
    """A driver who keeps the lane: `confirmed_search.Block`.

    Args:
        data: the recorded drive.
        fitted: the baseline.
        effects: all that are searched for.
        seed: of the draws.
    """

    where = "on this road"

    def __init__(self, data: LaneData, fitted: FittedLane, effects: tuple[Effect, ...], seed: int) -> None:
        self._data, self._fitted, self._effects, self._seed = data, fitted, effects, seed

    def search(self, effects: tuple[Effect, ...]) -> Checked[LaneData, LaneModel]:
        """Search, without cross-validation: every name is held against held-out data by its log score."""
        search = lane_search.search_causes(self._data, effects, self._fitted)
        if not search.named:
            return Checked(search, (), Interval())
        folds = held_out.folds(self._data, search, lane_search.again)
        return Checked(search, folds, held_out.simulation_gain(self._data, search, folds))

    def scores(
        self, search: LaneSearch, folds: Sequence[Fold[LaneModel]]
    ) -> tuple[Interval, Mapping[str, Interval]]:
        """Gain in one-step log score; what standstills are worth is apart from that of all fitted causes."""
        each = {cause.effect.id: _predicted(self._data, search, folds, cause) for cause in search.named}
        whole = _predicted_by_all(search, folds) if len(search.named) > 1 else next(iter(each.values()))
        return whole, each

    def replicates(self, search: LaneSearch, tested: Sequence[Named]) -> Iterator[Statistics]:
        """Simulate the baseline's driver again."""
        data, driver, on = self._data, search.baseline, road(self._data)
        if on is None:
            return
        for batch, count in enumerate(sequential.BATCHES):
            for drive in simulated(data, driver, on, count, [self._seed, batch]):
                base = refitted(drive, driver)
                if base is not None:
                    margin = lane_search.largest_margin(drive, base, self._effects, len(search.among))
                    yield Statistics(margin, partial(gain, drive, base, tested))

    def testable(self, effect: Effect) -> bool:
        """Is it fitted to an offset that the loop feeds back?"""
        return effect.kind is Kind.PARAMETRIC


def _predicted(
    data: LaneData, search: LaneSearch, folds: Sequence[Fold[LaneModel]], cause: Named
) -> Interval:
    """Gain of one cause in log score on held-out data, nats/min."""
    if cause.effect.kind is not Kind.PARAMETRIC:
        return _held(data)
    left = dropped(search.data, search.solved, cause.effect.id)
    return _gain(search, folds, left)


def _predicted_by_all(search: LaneSearch, folds: Sequence[Fold[LaneModel]]) -> Interval:
    """Gain of all fitted causes; that of standstills is apart."""
    ids = [effect.id for effect in search.solved.model.effects]
    return _gain(search, folds, dropped(search.data, search.solved, *ids)) if ids else Interval()


def _gain(search: LaneSearch, folds: Sequence[Fold[LaneModel]], left: FittedLane) -> Interval:
    rows, size = search.solved.rows & left.rows, left.noise.size
    without = held_out.models(search.data, left, lane_search.again)
    both = without, [fold.extended for fold in folds]
    base, extended = (predictive_score.by_fold(search.data, fits, rows, size) for fits in both)
    return log_score_gain.gain(predictive_score.difference(base, extended, rows), rows, search.data.output.dt)


def _held(data: LaneData) -> Interval:
    """What a wheel that has stood for some time predicts of the next sample, as `predictive_score` has it of pedals."""
    output = data.output
    step = movement_rhythm.step_size(output.y[output.usable])
    still = np.abs(np.diff(output.y, prepend=np.nan)) < 0.5 * step
    stood = predictive_score.run_length(still)
    plain = (stood > 0).astype(np.int64)
    fine = np.digitize(stood, predictive_score.RESTS)
    free = output.usable & ~output.hidden
    counted = free & np.r_[False, free[:-1]]
    out = predictive_score.of_standstills(still, plain, fine, counted, held_out.dealt(data))
    return log_score_gain.gain(out, counted, output.dt)
