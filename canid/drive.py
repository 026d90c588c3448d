"""A drive's parameters: over sliding windows, as the estimators tell them live, and over the whole drive."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.estimators import ESTIMATORS, agreement, status
from canid.identification import moments, orders, residuals
from canid.identification.armax_batch import ArmaxFit, Orders, fit_armax
from canid.identification.orders import Candidate
from canid.identification.process_fit import fit_process
from canid.types import (
    NAN,
    AnyEstimator,
    ArmaxSettings,
    Channel,
    Estimate,
    FopdtSettings,
    ResidualTests,
    Sample,
    Trace,
)

# s between two windows that are reported: a sixth of the window, so that they overlap and nothing is missed
EVERY = status.MARK
# s; an older estimate bears on no contradiction
BACK = agreement.PERSISTENT + agreement.FRESH + 1.0


class ArmaxDrive(NamedTuple):
    """The ARMAX model of the whole drive."""

    fit: ArmaxFit
    channels: dict[str, Channel]
    residual_tests: ResidualTests


class Identified(NamedTuple):
    """What one drive tells of its driver."""

    duration: float  # s
    driver_time: float  # s in which a person drove and followed
    windows: tuple[Estimate, ...]
    channels: dict[str, Channel]  # FOPDT over the whole drive
    fit_percent: float
    armax: ArmaxDrive | None  # None: too few data, or no stable model
    orders: tuple[Candidate, ...]  # compared on this drive, best first


def identify(
    trace: Trace,
    *,
    armax: ArmaxSettings = ArmaxSettings(),
    fopdt: FopdtSettings = FopdtSettings(),
    select_orders: bool = True,
) -> Identified:
    """Identify the driver of a whole drive.

    Args:
        trace: from `read_trace`.
        armax: orders of the ARMAX model.
        fopdt: window and box of the FOPDT fit.
        select_orders: compare other orders as well.

    Returns:
        an `Identified`; what the drive cannot tell is NaN, never an exception.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> told = canid.identify(drive, select_orders=False)
        >>> told.channels["range_rate"].K.low < 5.62 < told.channels["range_rate"].K.high  # its truth
        True
    """
    names = trace.input_names
    usable = trace.learn & np.isfinite(trace.output) & np.isfinite(trace.inputs).all(axis=1)
    duration = float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0
    whole = fit_process(
        trace.output,
        trace.inputs,
        trace.learn,
        trace.dt,
        segment=trace.segment,
        tau_max=fopdt.tau_max,
        dead_time_max=fopdt.dead_time_max,
        prior=fopdt.prior,
    )
    return Identified(
        duration=duration,
        driver_time=float(usable.sum() * trace.dt),
        windows=tuple(windows(trace, armax, fopdt)),
        channels=dict(zip(names, whole.channels, strict=True)),
        fit_percent=whole.fit_percent,
        armax=_armax(trace, usable, armax),
        orders=tuple(
            orders.compare(trace.output, trace.inputs, usable, segment=trace.segment) if select_orders else ()
        ),
    )


# rows that are made samples at once: a whole drive's would take 20 MB an hour
AT_ONCE = 1024


def samples(trace: Trace) -> Iterator[Sample]:
    """The trace row by row, as the estimators take it."""
    for a in range(0, len(trace.t), AT_ONCE):
        part = slice(a, a + AT_ONCE)
        numbers = (trace.t, trace.output, trace.inputs, trace.learn, trace.segment)
        rows = zip(*(column[part].tolist() for column in numbers), trace.gate[part], strict=True)
        for t, y, u, learn, segment, gate in rows:
            yield Sample(t, y, tuple(u), gate, learn, segment, {})


def windows(trace: Trace, armax: ArmaxSettings, fopdt: FopdtSettings) -> list[Estimate]:
    """What each estimator said along the drive, every `EVERY` s: the same numbers as live."""
    settings: dict[str, Any] = {"armax": armax, "fopdt": fopdt}
    running = [make(trace.input_names, trace.dt, settings[name]) for name, make in ESTIMATORS]
    states = {estimator.name: estimator.init() for estimator in running}
    emitted = dict.fromkeys(states, NAN)
    recent: deque[list[_Due]] = deque()  # what was due at each instant that a contradiction may have begun at
    out = []
    for sample in samples(trace):
        now = []
        for estimator in running:
            states[estimator.name], due = _advance(estimator, states[estimator.name], sample)
            now += [due] if due is not None else []
        if not now:
            continue
        recent.append(now)
        while sample.t - recent[0][0].sample.t > BACK:
            recent.popleft()
        marked = [due for due in now if status.marked(status.Closed(emitted=emitted[due.name]), sample.t)]
        emitted |= {due.name: sample.t for due in now}
        # what telling these leaves in the state is all that the estimates until the next mark build on
        states |= {due.name: due.tell()[0] for due in marked}
        if marked and sample.t >= EVERY - status.ROUNDING:
            names = {due.name for due in marked}
            out += [estimate for estimate in _judged(recent) if estimate.estimator in names]
    return out


class _Due:
    """An estimate that is made when somebody asks for it, once."""

    def __init__(self, name: str, sample: Sample, tell: Callable[[], tuple[Any, Estimate]]):
        self.name = name
        self.sample = sample
        self._tell = tell
        self._told: tuple[Any, Estimate] | None = None

    def tell(self) -> tuple[Any, Estimate]:
        """Return what `Estimator.tell` does."""
        if self._told is None:
            self._told = self._tell()
        return self._told


def _advance(estimator: AnyEstimator, state: Any, sample: Sample) -> tuple[Any, _Due | None]:
    """Take one sample; the estimate that is due comes later, where the estimator can."""
    if estimator.advance is None or estimator.tell is None:
        state, estimate = estimator.step(state, sample)
        if estimate is None:
            return state, None
        told = state, estimate
        return state, _Due(estimator.name, sample, lambda: told)
    state, due = estimator.advance(state, sample)
    return state, _Due(estimator.name, sample, partial(estimator.tell, state, sample)) if due else None


def _judged(recent: Sequence[list[_Due]]) -> tuple[Estimate, ...]:
    """Let the estimators check each other at the last of these instants.

    Only intervals that are apart then can contradict each other, and only what has been since they last touched
    matters, no further back than it takes to persist: so far back estimates are made, from the newest, and no further.
    """
    first, t = len(recent) - 1, recent[-1][0].sample.t
    apart = set(_check(_before(recent, first), recent[first])[0].apart)
    while apart and first and t - recent[first][0].sample.t < agreement.PERSISTENT - status.ROUNDING:
        first -= 1
        apart &= _check(_before(recent, first), recent[first])[0].apart.keys()
    state, told = _check(_before(recent, first), recent[first])
    for k in range(first + 1, len(recent)):
        state, told = _check(state, recent[k])
    return told


def _check(state: agreement.State, instant: list[_Due]) -> tuple[agreement.State, tuple[Estimate, ...]]:
    return agreement.step(state, [due.tell()[1] for due in instant])


def _before(recent: Sequence[list[_Due]], k: int) -> agreement.State:
    """What those said last that say nothing at instant `k`, if it still counts then."""
    now = recent[k]
    oldest = now[0].sample.t - agreement.FRESH - status.ROUNDING
    latest = {due.name: due for i in range(k) for due in recent[i] if due.sample.t >= oldest}
    spoken = {due.name for due in now}
    return agreement.State(tuple(due.tell()[1] for name, due in latest.items() if name not in spoken))


def _armax(trace: Trace, usable: npt.NDArray[np.bool_], settings: ArmaxSettings) -> ArmaxDrive | None:
    chosen = Orders(settings.na, settings.nb, settings.nc, settings.nk)
    fit = fit_armax(trace.output, trace.inputs, usable, chosen, segment=trace.segment)
    if fit is None:
        return None
    tests = residuals.look(fit.residual, trace.inputs, trace.input_names, chosen.na + chosen.nc)
    covariance = residuals.doubt(tests) * fit.covariance
    channels = moments.channels(trace.input_names, fit.A, fit.B, chosen.nk, covariance, trace.dt)
    return ArmaxDrive(fit, channels, tests)
