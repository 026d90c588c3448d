"""First order plus dead time over a sliding window, refitted every half second.

The mathematics is in identification/process_fit.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from canid.estimators import status
from canid.identification import belief, process_fit, rows
from canid.types import (
    AnyEstimator,
    Array,
    Estimate,
    Estimator,
    FopdtSettings,
    Gate,
    Identifiable,
    Sample,
    Status,
)

NAME = "fopdt"

# Samples after which rows are made of them, asked for or not: as many as `rows.put` takes one by one, whatever the cut.
FOLD = 64

# An input that moves less than this share of what it usually does (status.usual) is not worth a fit.
STILL = 0.01


class State(NamedTuple):
    """What the next step needs."""

    closed: status.Closed
    t: float  # s, of the last sample
    recent: tuple[tuple[float, ...], ...]  # samples that are no rows yet: output, learn, segment, inputs
    making: rows.State
    window: Array  # (n, width) rows, read only
    start: process_fit.Start | None  # where the fit of the last mark lay
    marked: bool = False  # the estimate that is due is a mark's: its fit begins with the whole box


def make(
    input_names: tuple[str, ...],
    dt: float,
    settings: FopdtSettings = FopdtSettings(),
) -> AnyEstimator:
    """Build the FOPDT estimator.

    Args:
        input_names: one or two, in the order of `Sample.inputs`.
        dt: s, the grid of the samples.
        settings: window, pace and box.

    Raises:
        ValueError: settings that make no sense.

    >>> estimator = make(("range_rate",), 0.1)
    >>> state, estimate = estimator.step(estimator.init(), Sample(0.0, 20.0, (0.1,), Gate.OPEN, True, 0, {}))
    >>> estimate.says
    '0 s of 20 s of data: keep following'
    """
    m = len(input_names)
    if m not in (1, 2) or not dt > 0.0 or not settings.window >= 10 * dt or not settings.tau_max > dt:
        raise ValueError(
            f"inputs {input_names}, dt = {dt} s, {settings}: one or two inputs, dt > 0, window >= 10 dt"
        )
    if settings.prior is not None:
        belief.check(settings.prior)
    lay = process_fit.layout(m, dt, settings.tau_max, settings.dead_time_max)
    # after a break the unknown history speaks for the slowest answer; the window has it in its rows ever after
    settle = settings.tau_max + settings.dead_time_max
    keep = max(round(settings.window / lay.step), 1)
    longest_gap = round((settings.window + settle) / dt)
    # never more than half of a short window, or a window with one brake dab would never speak
    enough = min(status.ENOUGH, 0.5 * settings.window)
    empty = np.zeros((0, lay.width))
    nothing_measured = (math.nan, 0.0, math.nan, *([math.nan] * m))

    def init() -> State:
        return State(status.Closed(), math.nan, (), rows.State(), empty, None)

    def step(state: State, sample: Sample) -> tuple[State, Estimate | None]:
        state, due = advance(state, sample)
        return tell(state, sample) if due else (state, None)

    def advance(state: State, sample: Sample) -> tuple[State, bool]:
        if not math.isfinite(sample.t) or sample.t <= state.t:
            return state, False
        recent = (*state.recent, *_missing(state, sample), _row(sample))
        closed, forced = status.step(state.closed, sample)
        state = state._replace(closed=closed, t=sample.t, recent=recent)
        state = _fold(state) if len(recent) >= FOLD else state
        if forced is not None:
            if not status.due(closed, sample.t, forced, settings.refit):
                return state, False
        # a kind that is new because the gate has just opened is emitted at once, with a fit of its own
        elif not status.told_by_gate(closed) and sample.t - closed.emitted < settings.refit - status.ROUNDING:
            return state, False
        said = status.said(closed, sample.t, Status.OK if forced is None else forced)
        return state._replace(closed=said, marked=status.marked(closed, sample.t)), True

    def tell(state: State, sample: Sample) -> tuple[State, Estimate]:
        forced = state.closed.kind
        if forced is not None and status.told_by_gate(state.closed):
            return state, status.silent(sample.t, NAME, forced, sample.gate.value, input_names)
        state, estimate = _refit(_fold(state), sample)
        return state._replace(closed=status.said(state.closed, sample.t, estimate.status)), estimate

    def _missing(state: State, sample: Sample) -> tuple[tuple[float, ...], ...]:
        """Rows for grid times that never came."""
        if not math.isfinite(state.t):
            return ()
        return (nothing_measured,) * min(round((sample.t - state.t) / dt) - 1, longest_gap)

    def _row(sample: Sample) -> tuple[float, ...]:
        return (sample.output, float(sample.learn), float(sample.segment), *sample.inputs)

    def _fold(state: State) -> State:
        making, more = rows.put(lay, state.making, np.array(state.recent).reshape(-1, 3 + m), settle)
        window = np.concatenate([state.window, more])[-keep:]
        window.setflags(write=False)
        return state._replace(making=making, window=window, recent=())

    def _refit(state: State, sample: Sample) -> tuple[State, Estimate]:
        w = state.window
        usable = w[:, 1] > 0.0
        used = float(usable.sum()) * lay.step
        if used < enough:
            says = f"{used:.0f} s of {enough:.0f} s of data: keep following"
            return _told(state, sample, Status.CONVERGING, says, used)
        inputs = w[:, 2 : 2 + m]
        spread = inputs[usable].std(axis=0)
        excitation = {name: float(s) for name, s in zip(input_names, spread, strict=True)}
        if all(s < STILL * status.usual(name) for name, s in excitation.items()):
            return _told(state, sample, Status.NOT_EXCITED, status.hardly_moved(excitation), used, excitation)
        fit = process_fit.fit_rows(lay, w, None if state.marked else state.start, settings.prior)
        if state.marked:
            state = state._replace(start=fit.start)
        channels = dict(zip(input_names, fit.channels, strict=True))
        if all(c.status is Identifiable.NOT for c in fit.channels):
            return _told(state, sample, Status.NOT_EXCITED, status.hardly_moved(excitation), used, excitation)
        says = status.what_is_told(channels)
        return state, Estimate(sample.t, NAME, Status.OK, says, channels, fit.fit_percent, excitation, used)

    def _told(
        state: State,
        sample: Sample,
        kind: Status,
        says: str,
        used: float,
        excitation: dict[str, float] | None = None,
    ) -> tuple[State, Estimate]:
        # brief gates: say why no more data come
        why = sample.gate.value if sample.gate is not Gate.OPEN else says
        estimate = status.silent(sample.t, NAME, kind, why, input_names)
        return state, estimate._replace(used=used, excitation=excitation or {})

    return Estimator(NAME, init, step, advance, tell)
