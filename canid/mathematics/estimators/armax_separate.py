"""ARMAX live with several inputs: a Box-Jenkins model, each input and the noise with poles of its own, block by block.

The mathematics is in mathematics/identification/armax/box_jenkins_recursive.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from canid.mathematics.estimators import plausibility, status
from canid.mathematics.estimators.armax_state import Setup, State, is_excited, moved, unconfirmed, with_sample
from canid.mathematics.identification import feedback_bias, identifiability, residual_tests
from canid.mathematics.identification.armax import (
    box_jenkins_posterior,
    box_jenkins_recursive,
    box_jenkins_state,
    gain_and_delay,
)
from canid.mathematics.identification.armax.rates import rates
from canid.mathematics.identification.fopdt.regression_rows import Layout
from canid.mathematics.identification.output_filter import DELAYS_HOLD_IT, is_unknown
from canid.values.types import Estimate, Identifiable, ResidualTests, Sample, Status

NAME = "armax"

# The batch fit that the recursion begins with is made anew whenever the data are twice as many, so often: the noise's poles
# and its band then rest on four minutes to begin with.
STARTS = 5

# s of residuals below which they are not tested
MIN_TESTED_S = 25.0


def settle_s(layout: Layout) -> float:
    """S after a break in which the unknown history still speaks, for the slowest answer."""
    return layout.basis.box.tau_max + layout.basis.box.dead_time_max


def advance(setup: Setup, layout: Layout, state: State, sample: Sample) -> tuple[State, bool]:
    """Take a row; whether an estimate is due."""
    known = all(map(math.isfinite, sample.inputs))
    usable = sample.learn and known and math.isfinite(sample.output)
    movement = moved(setup, state.movement, sample.inputs) if known and sample.learn else state.movement
    # before the recursion begins every usable sample counts; its batch fit waits for movement
    learns = usable and (state.separate is None or is_excited(setup, movement))
    learnt = with_sample(setup, state.learnt, sample.t) if learns else state.learnt
    pace, forced = status.by_gate(state.pace, sample)
    row = (sample.output, float(learns), float(sample.segment), *sample.inputs)
    recent = (*state.recent, *_missing(setup, state, sample), row)
    state = state._replace(
        pace=pace, t=sample.t, segment=sample.segment, recent=recent, movement=movement, learnt=learnt
    )
    if len(recent) >= rates(setup.dt).block:
        state = _absorbed(setup, layout, state)
    if forced is not None:
        if not status.due(pace, sample.t, forced):
            return state, False
        return state._replace(pace=status.emitted(pace, sample.t, forced)), True
    if not status.due_from_data(pace, sample.t):
        return state, False
    return state._replace(pace=status.emitted(pace, sample.t, Status.OK)), True


def _missing(setup: Setup, state: State, sample: Sample) -> tuple[tuple[float, ...], ...]:
    """Rows for grid times that never came; beyond a minute none of them matters."""
    if not math.isfinite(state.t):
        return ()
    count = min(round((sample.t - state.t) / setup.dt) - 1, round(box_jenkins_recursive.TESTED_S / setup.dt))
    nothing_measured = (math.nan, 0.0, math.nan, *([math.nan] * len(setup.input_names)))
    return (nothing_measured,) * count


def _absorbed(setup: Setup, layout: Layout, state: State) -> State:
    """Step the recursion by the rows that wait, and begin it anew where a batch fit is due."""
    rows = np.array(state.recent).reshape(-1, setup.width)
    model, due, forgetting, settle = state.separate, state.due, setup.forgetting, settle_s(layout)
    past = np.concatenate([state.past, rows])[-2 * due :] if due else state.past[:0]
    state = state._replace(recent=())
    if model is not None:
        before = model.restarts
        model = box_jenkins_recursive.step(layout, model, rows, forgetting, setup.output_filter, settle)
        if model.restarts > before:
            # what came before is of another driver, or another manner: collect anew for a fit of the new one
            past, due = rows[:0], 2 * setup.start
    if due and int((past[:, 1] > 0.0).sum()) >= due and is_excited(setup, state.movement):
        begun = box_jenkins_recursive.begin(
            layout, past, forgetting, setup.output_filter, settle, 0 if model is None else model.restarts
        )
        model = model if begun is None else begun
        if model is not None:
            due = 2 * due if due < setup.start * 2 ** (STARTS - 1) else 0
    past = past if due else past[:0]
    past.setflags(write=False)
    return state._replace(past=past, due=due, separate=model)


def estimate(
    setup: Setup,
    layout: Layout,
    state: State,
    sample: Sample,
    excitation: Mapping[str, float],
    refused: Callable[[Status, str], Estimate],
) -> Estimate:
    """Make the estimate that is due, where the data suffice."""
    model, names = state.separate, setup.input_names
    if model is None:
        return refused(*status.by_fit({}, excitation))
    tests = _residual_tests(setup, model)
    of_inputs = zip(names, box_jenkins_posterior.channels(layout, model), strict=True)
    channels = feedback_bias.without_all(dict(of_inputs))
    known_s = box_jenkins_recursive.seconds(layout, model)
    channels = {
        name: c._replace(K_anytime=gain_and_delay.anytime(c.K, known_s))
        if c.status is not Identifiable.NOT
        else c
        for name, c in channels.items()
    }
    unknown = is_unknown(setup.output_filter)
    if unknown:
        channels = {name: identifiability.gain_only(c) for name, c in channels.items()}
    fit = model.quality.fit_percent
    ranges = plausibility.Ranges(layout.basis.box.tau_max, layout.basis.box.dead_time_max)
    verdict = plausibility.judge(channels, fit, ranges)
    kind, says = status.by_fit(channels, excitation, *verdict)
    if kind is not Status.OK:
        made = refused(kind, says)
        # what was found against a model is the reason, whatever the gate says just now
        return made._replace(says=says, residual_tests=tests) if verdict.refused else made
    says += unconfirmed(setup, state.learnt) + (f"; {DELAYS_HOLD_IT}" if unknown else "")
    channels = identifiability.given_quoted(channels)
    return Estimate(
        sample.t, NAME, Status.OK, says, channels, fit, dict(excitation), state.learnt.used, tests
    )


def _residual_tests(setup: Setup, model: box_jenkins_state.State) -> ResidualTests | None:
    e = model.tested[:, 0]
    if np.isfinite(e).sum() * setup.dt < MIN_TESTED_S:
        return None
    return residual_tests.run_tests(e, model.tested[:, 2:], setup.input_names, len(model.ar), model.stride)
