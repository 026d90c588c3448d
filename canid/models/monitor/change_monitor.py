"""The monitor: one-step predictors of driver, vehicle and sensing, tested for change every two seconds.

A predictor learns rows that are a minute old, so that a misfit is tested before it is learnt, and learns nothing while
a change is likely but not yet reported. After the report learning goes on, and within minutes the model fits what the
drive has become.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from math import log
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.models.monitor import (
    alarm_hold,
    arx_model,
    driver_predictors,
    evalue_cusum,
    features,
    sensing_predictors,
    stuck_output,
    variance_cusum,
    vehicle_predictors,
)
from canid.models.monitor.predictor import Predictor
from canid.values.state_constraints import NOT_NEGATIVE, TIME
from canid.values.types import NAN, Array, BlockReport, BlockStatus, MonitorReport, Sample

# rows per batch; one test every 2 s. Half as many would cost twice as much: calls cost, not numbers
BATCH_ROWS = 10
# batches before a row is learnt: a minute, in which a change is detected if at all
LEARNING_DELAY_BATCHES = 30
# rows (5 min of usable data) after which what was learnt has faded to 1/e: a driver's habits change over minutes
# (Chen & Ulsoy 2001), and a gain must be known to some 10 %
MEMORY_ROWS = 1500.0
# rows (1 min) that must be learnt before the model is tested: an observation for each of 17 coefficients every 3 s,
# where the rows of 1 s hold nearly the same information
MIN_LEARNT_ROWS = 300.0
# h; mean time between false alarms of one block, by the bound of the e-values. Twice the required 20 h: the
# innovations of an estimated model are not quite new
FALSE_ALARM_INTERVAL_H = 40.0
# batches without one usable row, after which a block counts as unseen
MAX_UNSEEN_BATCHES = 15
# s; an unchanged report is repeated this often
REPORT_INTERVAL_S = 10.0
# s; half a millisecond against the rounding of t = k dt
TIME_ROUNDING_S = 5e-4
# in any unit of a row; a larger value is no measurement, and its square would swamp all else
MAX_FEATURE = 1e6

# Which block to suspect where several do not fit: sensors feed the models of both others, and a vehicle that responds
# differently moves its driver to where the driver's model has not been.
BLOCKS = ("sensing", "vehicle", "driver")


class PredictorState(NamedTuple):
    """What one predictor has learnt, and the evidence against it."""

    model: arx_model.State
    misfit: evalue_cusum.State
    variance: variance_cusum.State
    unseen: Annotated[int, NOT_NEGATIVE] = MAX_UNSEEN_BATCHES  # batches since the last usable row


class State(NamedTuple):
    """Everything that the next sample's meaning depends on."""

    features: features.State
    pending: tuple[tuple[float, ...], ...]  # rows since the last batch
    pending_since: Annotated[float, TIME]  # s, of the first of them
    batches: tuple[Array, ...]  # (BATCH_ROWS, columns) each, the newest last
    predictors: tuple[PredictorState, ...]
    stuck: stuck_output.State
    alarms: tuple[alarm_hold.State, ...] = (alarm_hold.State(),) * len(BLOCKS)
    fits: bool = True
    fits_since: Annotated[float, TIME] = NAN  # s, since when all fits again; NaN: no misfit so far
    reported: tuple[str, ...] = ()  # suspected block and states of the last report
    reported_at: Annotated[float, TIME] = NAN  # s


class Monitor(NamedTuple):
    """The monitor, as pure functions."""

    init: Callable[[], State]
    step: Callable[[State, Sample], tuple[State, MonitorReport | None]]
    check_state: Callable[[State], Iterable[str]]  # sentences about a restored state of another shape


Places = npt.NDArray[np.intp]


class LagPlaces(NamedTuple):
    """Where a predictor's columns are in the flattened rows of a window."""

    columns: Places  # (BATCH_ROWS, m - 1)
    segments: Places  # (BATCH_ROWS, lags + 1)
    outcome: Places  # (BATCH_ROWS,)


def make(names: Sequence[str]) -> Monitor:
    """Make the monitor for a driver with these inputs.

    Example:
        >>> from canid.values.types import LearnGate, Sample
        >>> monitor = make(("lateral_offset",))
        >>> state, reports = monitor.init(), []
        >>> for k in range(120):
        ...     sample = Sample(0.1 * k, 1.0, (0.1,), LearnGate.OPEN, True, 0, {"speed": 20.0})
        ...     state, report = monitor.step(state, sample)
        ...     reports += [report] if report is not None else []
        >>> print(reports[0].fits, reports[0].says)
        True learning: driver; unseen: sensing, vehicle
    """
    predictors = (
        *sensing_predictors.PREDICTORS,
        vehicle_predictors.PREDICTOR,
        driver_predictors.predictor(names),
    )
    width = features.FIRST_INPUT + len(names)
    max_lag = max(lag for p in predictors for _, lag in p.lagged)
    window = -(-max_lag // BATCH_ROWS) + 1  # batches
    places = tuple(_lag_places(p, window, width) for p in predictors)
    fitted = tuple(np.array(p.fitted, dtype=np.intp) for p in predictors)
    thresholds = {block: _threshold(block, predictors) for block in BLOCKS}

    def init() -> State:
        fresh = tuple(
            PredictorState(
                arx_model.init(len(p.lagged) + 1),
                evalue_cusum.init(len(p.misfits)),
                variance_cusum.init(),
            )
            for p in predictors
        )
        return State(features.State(), (), NAN, (), fresh, stuck_output.State())

    def step(state: State, sample: Sample) -> tuple[State, MonitorReport | None]:
        if not features.due(state.features, sample.t):
            return state, None
        after, row = features.step(state.features, sample)
        stuck = stuck_output.step(state.stuck, sample.t, row[features.OUTPUT], thresholds["driver"])
        since = state.pending_since if state.pending else sample.t
        pending = (*state.pending, row)
        reported_at = state.reported_at if state.reported_at == state.reported_at else sample.t
        state = state._replace(
            features=after, stuck=stuck, pending=pending, pending_since=since, reported_at=reported_at
        )
        if len(pending) < BATCH_ROWS:
            return state, None
        batches = (*state.batches, np.array(pending))[-(LEARNING_DELAY_BATCHES + window) :]
        state = state._replace(pending=(), batches=batches)
        if len(batches) < window:
            return state, None
        newest = np.concatenate(batches[-window:]).ravel()
        full = len(batches) == LEARNING_DELAY_BATCHES + window
        oldest = np.concatenate(batches[:window]).ravel() if full else None
        updated = tuple(
            _update(p, known, newest, oldest, at, columns, since, thresholds[p.block])
            for p, known, at, columns in zip(predictors, state.predictors, places, fitted, strict=True)
        )
        return _report(state._replace(predictors=updated), sample.t)

    def _report(state: State, t: float) -> tuple[State, MonitorReport | None]:
        """Report on all blocks where something has changed, and every `REPORT_INTERVAL_S`."""
        blocks = {block: _block_report(block, predictors, state, thresholds[block]) for block in BLOCKS}
        if state.stuck.level >= thresholds["driver"] and blocks["vehicle"].state is BlockStatus.MISFIT:
            # a resting pedal moves the vehicle as before
            says = "the driver's output is stuck, but the vehicle's motion no longer follows from it"
            blocks["sensing"] = BlockReport(
                BlockStatus.MISFIT, state.stuck.since, says, state.stuck.level, thresholds["driver"]
            )
        held = [
            alarm_hold.step(alarm, t, blocks[block])
            for block, alarm in zip(BLOCKS, state.alarms, strict=True)
        ]
        alarms = tuple(alarm for alarm, _ in held)
        blocks = dict(zip(BLOCKS, (report for _, report in held), strict=True))
        fits = not any(report.state is BlockStatus.MISFIT for report in blocks.values())
        fits_since = state.fits_since
        if fits and not state.fits:
            fits_since = max(alarm.t for alarm in alarms if alarm.t == alarm.t)
        state = state._replace(alarms=alarms, fits=fits, fits_since=fits_since)
        report = _summary(t, blocks, fits_since)
        key = (report.block, *(block.state.value for block in blocks.values()))
        # the first report waits: what was learnt changes by the second while it is little
        changed = key != state.reported and bool(state.reported)
        if not changed and t - state.reported_at < REPORT_INTERVAL_S - TIME_ROUNDING_S:
            return state, None
        return state._replace(reported=key, reported_at=t), report

    def check_state(state: State) -> Iterator[str]:
        return _shape_errors(state, init(), width)

    return Monitor(init, step, check_state)


def _shape_errors(state: State, fresh: State, width: int) -> Iterator[str]:
    """Sentences about a restored state whose shapes are not those of a fresh one."""
    if len(state.predictors) != len(fresh.predictors) or len(state.alarms) != len(fresh.alarms):
        yield "the monitor has other predictors"
    for restored, new in zip(state.predictors, fresh.predictors, strict=True):
        for part, usual in zip(
            (*restored.model, *restored.misfit, *restored.variance),
            (*new.model, *new.misfit, *new.variance),
            strict=True,
        ):
            if np.asarray(part).shape != np.asarray(usual).shape:
                yield "a predictor of the monitor has another shape"
    # a batch is made as soon as it is full; batches are kept until they are a minute old and a window has passed
    if (
        len(state.pending) >= BATCH_ROWS
        or any(len(row) != width for row in state.pending)
        or len(state.batches) > 2 * LEARNING_DELAY_BATCHES
    ):
        yield "the rows of the monitor have another shape"
    if any(batch.shape != (BATCH_ROWS, width) for batch in state.batches):
        yield "the batches of the monitor have another shape"


def _lag_places(p: Predictor, window: int, width: int) -> LagPlaces:
    """Index a predictor's columns in a window of so many batches."""
    newest = np.arange((window - 1) * BATCH_ROWS, window * BATCH_ROWS, dtype=np.intp)
    columns, lags = np.array(p.lagged, dtype=np.intp).T
    all_lags = np.arange(lags.max() + 1, dtype=np.intp)
    return LagPlaces(
        (newest[:, None] - lags) * width + columns,
        (newest[:, None] - all_lags) * width + features.SEGMENT,
        newest * width + p.outcome,
    )


def _threshold(block: str, predictors: Sequence[Predictor]) -> float:
    """Return the evidence that is a misfit: log of the number of CUSUMs times the tests between false alarms."""
    signs_and_stakes = 2 * len(evalue_cusum.STAKES)
    k = sum(
        len(p.misfits) * signs_and_stakes + len(variance_cusum.STAKES) for p in predictors if p.block == block
    )
    k += block == "driver"  # stuck output
    return log(FALSE_ALARM_INTERVAL_H * 3600.0 / (BATCH_ROWS * features.ROW_INTERVAL_S) * k)


def _regression(places: LagPlaces, window: Array) -> tuple[Array, Array]:
    """Return the complete rows of a batch: columns (n, m) with the constant, outcomes (n,)."""
    y = window[places.outcome]
    segment = window[places.segments]
    X = np.ones((BATCH_ROWS, places.columns.shape[1] + 1))
    X[:, :-1] = window[places.columns]
    # comparisons with NaN are false
    complete = (
        (segment == segment[:, :1]).all(axis=1)
        & (np.abs(X) < MAX_FEATURE).all(axis=1)
        & (np.abs(y) < MAX_FEATURE)
    )
    return X[complete], y[complete]


def _update(
    p: Predictor,
    state: PredictorState,
    newest: Array,
    oldest: Array | None,
    places: LagPlaces,
    fitted: Places,
    t: float,
    threshold: float,
) -> PredictorState:
    """Test the newest batch against a predictor, and let it learn the one that is a minute old."""
    X, y = _regression(places, newest)
    state = state._replace(unseen=0 if len(y) else min(state.unseen + 1, MAX_UNSEEN_BATCHES))
    model = state.model
    if len(y) and model.rows >= MIN_LEARNT_ROWS and model.variance > 0.0:
        e, extrapolation = arx_model.innovations(model, X, y), arx_model.extrapolation(model, X)
        # what the direction of a misfit adds is known before the innovation comes
        directions = np.array([m.direction(model.theta) for m in p.misfits])
        level = directions @ model.mean * np.array([m.centred for m in p.misfits])
        z = X @ directions.T - level
        margin = np.array([m.margin for m in p.misfits])
        uncertainty = np.column_stack([arx_model.gain_uncertainty(model, X, m.gains) for m in p.misfits])
        allowed = (margin * np.abs(z) + uncertainty) / model.variance**0.5 + extrapolation[:, None]
        expected = arx_model.expected_variance(model, X, p.noise_scales)
        state = state._replace(
            misfit=evalue_cusum.step(state.misfit, t, e, z, model.variance, allowed, threshold),
            variance=variance_cusum.step(state.variance, t, e, expected, threshold),
        )
    if oldest is None or 0.5 * threshold <= _level(state) < threshold:
        return state
    X, y = _regression(places, oldest)
    return state._replace(model=arx_model.learn(model, X, y, fitted, MEMORY_ROWS))


def _level(state: PredictorState) -> float:
    return max(float(state.misfit.level.max()), float(state.variance.level.max()))


def _block_report(block: str, predictors: Sequence[Predictor], state: State, threshold: float) -> BlockReport:
    """Report on one block by its present evidence."""
    of_block = [(p, known) for p, known in zip(predictors, state.predictors, strict=True) if p.block == block]
    seen = [(p, known) for p, known in of_block if known.unseen < MAX_UNSEEN_BATCHES]
    if not seen:
        needs = " or ".join(p.needs for p, _ in of_block)
        return BlockReport(BlockStatus.UNSEEN, NAN, f"needs {needs}", 0.0, threshold)
    p, strongest = max(seen, key=lambda pair: _level(pair[1]))
    level, since, says = _strongest_evidence(p, strongest, threshold)
    # a stuck output is the reason of any other misfit
    if block == "driver" and state.stuck.level >= min(level, threshold):
        level, since, says = state.stuck.level, state.stuck.since, "the driver's output is stuck"
    if level >= threshold:
        return BlockReport(BlockStatus.MISFIT, since, says, level, threshold)
    learnt = max(known.model.rows for _, known in seen)
    if learnt < MIN_LEARNT_ROWS:
        says = f"{100 * learnt / MIN_LEARNT_ROWS:.0f} % learnt"
        return BlockReport(BlockStatus.LEARNING, NAN, says, max(level, 0.0), threshold)
    return BlockReport(BlockStatus.FITS, NAN, "fits the learnt model", max(level, 0.0), threshold)


def _strongest_evidence(p: Predictor, state: PredictorState, threshold: float) -> tuple[float, float, str]:
    """Return the strongest evidence against a predictor: level, since when, in words."""
    strongest_misfit = evalue_cusum.strongest(state.misfit)
    at = int(state.variance.level.argmax())
    variance_level = float(state.variance.level[at])
    # a direction is more specific than variance, which any misfit increases once it is large
    if variance_level > strongest_misfit.level and strongest_misfit.level < 0.5 * threshold:
        says = f"{p.name} is predicted far worse than before"
        return variance_level, float(state.variance.since[at]), says
    return (
        max(strongest_misfit.level, variance_level),
        strongest_misfit.since,
        p.misfits[strongest_misfit.direction].says.format(more="more" if strongest_misfit.more else "less"),
    )


def _summary(t: float, blocks: dict[str, BlockReport], fits_since: float) -> MonitorReport:
    """Sum the blocks up."""
    for block, report in blocks.items():
        if report.state is BlockStatus.MISFIT:
            return MonitorReport(t, False, report.since, block, report.says, blocks)
    states = (BlockStatus.FITS, BlockStatus.LEARNING, BlockStatus.UNSEEN)
    named = {s: ", ".join(block for block, report in blocks.items() if report.state is s) for s in states}
    says = "; ".join(f"{state.value}: {names}" for state, names in named.items() if names)
    return MonitorReport(t, True, fits_since, "", says, blocks)
