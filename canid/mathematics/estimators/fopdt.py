"""First order plus dead time (FOPDT) over a sliding window, refitted every half second.

The mathematics is in mathematics/identification/fopdt/fopdt_fit.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field

from canid.mathematics.estimators import (
    agreement,
    bent_response,
    fopdt_whole_drive,
    plausibility,
    status,
    step_watch,
    wanted_gap_form,
)
from canid.mathematics.estimators.estimator import Estimator, WholeDrive
from canid.mathematics.identification import feedback_bias, lead_anticipation
from canid.mathematics.identification.fopdt import fopdt_fit, fopdt_residual, grid_search, regression_rows
from canid.mathematics.identification.fopdt.prior import CHANNELS, Prior, check_prior, incomplete, is_empty
from canid.mathematics.identification.identifiability import given_quoted, not_quotable
from canid.mathematics.identification.output_filter import DELAYS_HOLD_IT, is_unknown
from canid.values.state_constraints import TIME
from canid.values.types import (
    TASK_INPUTS,
    Array,
    Channel,
    Estimate,
    Latency,
    LearnGate,
    OutputFilter,
    Sample,
    Status,
    Trace,
)

NAME = "fopdt"

# Samples after which rows are made of them, asked for or not: as many as `rows.put` takes one by one, whatever the cut.
MAX_PENDING_SAMPLES = 64

# Share of its usual standard deviation (status.usual) that an input must move by in the window to be worth a fit. Less
# than ARMAX asks for (armax.MIN_MOVEMENT_TO_LEARN): a window forgets what it was fitted to, a recursion does not.
MIN_MOVEMENT_TO_FIT = 0.01


# --- settings --------------------------------------------------------------------------------------


def _stated(declared: Prior | None) -> Prior | None:
    """Both numbers of a distribution or neither, and at least one distribution."""
    if declared is None:
        return None
    by_channel = {name: given for name in CHANNELS if (given := getattr(declared, name)) is not None}
    wrong = list(incomplete(declared))
    wrong += [f"{name}: {says}" for name, given in by_channel.items() for says in incomplete(given)]
    wrong += [
        f"{name} is empty: state a belief, or leave it out"
        for name, given in by_channel.items()
        if is_empty(given)
    ]
    if is_empty(declared):
        wrong.append("is empty: state a belief, or leave the section out")
    if wrong:
        raise ValueError("; ".join(wrong))
    return declared


# s; the grid's step is the shortest lag that it can show, and what takes longer than 20 s is no reaction
Lag = Annotated[float, Field(ge=0.15, le=20.0, allow_inf_nan=False)]


class FopdtSettings(NamedTuple):
    """The sliding window and the physical box of the FOPDT fit."""

    # s; the windows' rows are kept in memory and fitted twice a second
    window: Annotated[float, Field(ge=1.0, le=600.0, allow_inf_nan=False)] = 60.0
    # s; what is refitted more often than the grid's step is not refitted more often
    refit: Annotated[float, Field(ge=0.05, le=600.0, allow_inf_nan=False)] = 0.5
    tau_max: Lag = 3.0  # s; a slower lag is not identifiable separately from an offset in a window of 60 s
    dead_time_max: Lag = 1.5  # s; human reaction times end well below
    prior: Annotated[Prior | None, AfterValidator(_stated)] = None  # none: the box alone
    # from [driver]: how the output was smoothed; None: nothing is known, and its spectrum decides
    output_filter: OutputFilter | None = None
    latency: Latency | None = None  # from [lead]: of the radar; added to dead times
    output: str = ""  # from [driver]: its role; of an acceleration the closed loop is known


class Setup(NamedTuple):
    """Inputs, grid and settings, and what follows from them."""

    input_names: tuple[str, ...]  # one or two
    dt: float  # s
    settings: FopdtSettings
    layout: regression_rows.Layout

    @property
    def settle(self) -> float:
        """Time in s after a break in which the unknown history still speaks, for the slowest answer."""
        return self.settings.tau_max + self.settings.dead_time_max

    @property
    def rows(self) -> int:
        """Rows of a window."""
        return max(round(self.settings.window / self.layout.step), 1)

    @property
    def seen(self) -> int:
        """Samples of which gap and lead are kept: of a window, before it, and those that wait for the next known input."""
        waiting = regression_rows.MAX_BRIDGED_GAP_S + self.layout.step
        return round((self.settings.window + lead_anticipation.BEFORE_S + waiting) / self.dt)

    @property
    def needed(self) -> float:
        """Data in s below which nothing is estimated."""
        # never more than half of a short window, or a window with one brake dab would never have an estimate
        return min(status.MIN_DATA_S, 0.5 * self.settings.window)


def configure(input_names: tuple[str, ...], dt: float, settings: FopdtSettings) -> Setup:
    """Check the settings and make the layout of the rows.

    Raises:
        ValueError: settings that make no sense.
    """
    m = len(input_names)
    if m not in (1, 2) or not dt > 0.0 or not settings.window >= 10 * dt or not settings.tau_max > dt:
        raise ValueError(
            f"inputs {input_names}, dt = {dt} s, {settings}: one or two inputs, dt > 0, window >= 10 dt"
        )
    if settings.prior is not None:
        check_prior(settings.prior)
    layout = fopdt_fit.row_layout(m, dt, settings.tau_max, settings.dead_time_max)
    return Setup(input_names, dt, settings, layout)


# --- state -----------------------------------------------------------------------------------------


class State(NamedTuple):
    """What the next step needs."""

    pace: status.Pace
    t: Annotated[float, TIME]  # s, of the last sample
    # samples that are no rows yet: output, learn, segment, inputs, gap in m, the lead's speed in m/s
    recent: tuple[tuple[float, ...], ...]
    making: regression_rows.State
    window: Array  # (n, width) rows, read only
    start: grid_search.Start | None  # where the last reported fit ended
    reported: bool = False  # the estimate that is due is a report's: its fit begins with the whole box
    watch: step_watch.Watch = step_watch.Watch()  # for steps of the gains
    seen: Array = np.zeros((0, 2))  # (k, 2) gap and the lead's speed at the samples of the window, and before
    bends: bent_response.Evidence = bent_response.Evidence()  # of causes that move K of relative speed


def init(setup: Setup) -> State:
    """Start without data."""
    empty = np.zeros((0, setup.layout.width))
    return State(status.Pace(), math.nan, (), regression_rows.State(), empty, None)


def check_state(setup: Setup, state: State) -> Iterator[str]:
    """Why a restored state is not of this setup."""
    if state.window.ndim != 2 or any(len(row) != 5 + len(setup.input_names) for row in state.recent):
        yield "the window of fopdt has another shape"
    nothing = bent_response.Evidence()
    shapes = [[x.shape for x in bends[:-1]] for bends in (state.bends, nothing)]
    if shapes[0] != shapes[1] or state.seen.shape[1:] != (2,):
        yield "the bends of fopdt have another shape"


# --- one sample ------------------------------------------------------------------------------------


def advance(setup: Setup, state: State, sample: Sample) -> tuple[State, bool]:
    """Take a sample; whether an estimate is due."""
    if not math.isfinite(sample.t) or sample.t <= state.t:
        return state, False
    hidden = not sample.learn and sample.bound == sample.bound
    side = regression_rows.AT_MOST if sample.bound >= sample.output else regression_rows.AT_LEAST
    output, known = (sample.bound, side) if hidden else (sample.output, float(sample.learn))
    row = (output, known, float(sample.segment), *sample.inputs, *_lead(setup, sample))
    recent = (*state.recent, *_missing(setup, state, sample), row)
    pace, forced = status.by_gate(state.pace, sample)
    state = state._replace(pace=pace, t=sample.t, recent=recent)
    state = _with_rows(setup, state) if len(recent) >= MAX_PENDING_SAMPLES else state
    if state.watch.new and state.pace.emitted < sample.t and state.pace.emitted >= state.watch.detected:
        state = state._replace(watch=state.watch._replace(new=False))
    if forced is None and step_watch.due(state.watch, sample.t):
        state = _checked(setup, state, sample.t)
    every = setup.settings.refit
    if forced is not None:
        if not status.due(pace, sample.t, forced, every):
            return state, False
    # a kind that is new because the gate has just opened is emitted at once, with a fit of its own
    elif not status.due_from_data(pace, sample.t, every) and state.watch.detected != sample.t:
        return state, False
    emitted = status.emitted(pace, sample.t, Status.OK if forced is None else forced)
    return state._replace(pace=emitted, reported=status.reported(pace, sample.t)), True


def estimate(setup: Setup, state: State, sample: Sample) -> tuple[State, Estimate]:
    """Make the estimate that is due."""
    forced = state.pace.kind
    if forced is not None and status.of_gate(state.pace):
        says = sample.gate.value
        return state, status.without_numbers(sample.t, NAME, forced, says, setup.input_names)
    state, made = _refit(setup, _with_rows(setup, state), sample)
    return state._replace(pace=status.emitted(state.pace, sample.t, made.status)), made


def _lead(setup: Setup, sample: Sample) -> tuple[float, float]:
    """Gap in m, and the lead's speed in m/s; NaN where they are not known."""
    if setup.input_names != TASK_INPUTS["car_following"]:
        return math.nan, math.nan
    speed = sample.signals.get("speed", math.nan)
    return sample.signals.get("headway", math.nan) * speed, speed + sample.inputs[1]


def _missing(setup: Setup, state: State, sample: Sample) -> tuple[tuple[float, ...], ...]:
    """Rows for grid times that never came."""
    if not math.isfinite(state.t):
        return ()
    longest = round((setup.settings.window + setup.settle) / setup.dt)
    nothing_measured = (math.nan, 0.0, math.nan, *([math.nan] * (2 + len(setup.input_names))))
    return (nothing_measured,) * min(round((sample.t - state.t) / setup.dt) - 1, longest)


def _with_rows(setup: Setup, state: State) -> State:
    """Make rows of the pending samples."""
    if not state.recent:
        return state
    samples = np.array(state.recent).reshape(-1, 5 + len(setup.input_names))
    making, more = regression_rows.put(setup.layout, state.making, samples[:, :-2], setup.settle)
    window = np.concatenate([state.window, more])[-setup.rows :]
    seen = np.concatenate([state.seen, samples[:, -2:]])[-setup.seen :]
    window.setflags(write=False)
    seen.setflags(write=False)
    return state._replace(making=making, window=window, seen=seen, recent=())


def _checked(setup: Setup, state: State, t: float) -> State:
    """Look for a step of the gains."""
    state = _with_rows(setup, state)
    watch = step_watch.check(state.watch, _window(setup, state), t)
    watch, rows = step_watch.trim(watch, _window(setup, state))
    return state._replace(watch=watch, window=rows)


def _waiting(state: State) -> int:
    """Samples after the last row, which wait for the next known input."""
    making = state.making
    return len(making.pending) - (making.history is not None) + len(making.answered)


def _seen(setup: Setup, state: State) -> Array:
    """Gap in m and the lead's speed in m/s (2, k + n) at the rows of the window, and before it; NaN = not known."""
    layout = setup.layout
    rows = len(state.window) + round(lead_anticipation.BEFORE_S / layout.step)
    back = _waiting(state) + 1 + layout.per_row * np.arange(rows)[::-1]
    known = back <= len(state.seen)
    seen = np.full((2, rows), np.nan)
    seen[:, known] = state.seen[len(state.seen) - back[known]].T
    return seen


def _window(setup: Setup, state: State) -> step_watch.Window:
    """Return the rows with the time of the last."""
    return step_watch.Window(
        setup.layout,
        setup.input_names,
        state.window,
        state.t - _waiting(state) * setup.dt,
        setup.settings.window,
        setup.settings.output_filter,
    )


def _refit(setup: Setup, state: State, sample: Sample) -> tuple[State, Estimate]:
    names, window = setup.input_names, state.window
    usable = window[:, 1] > 0.0
    used = float(usable.sum()) * setup.layout.step
    if used < setup.needed:
        excitation = dict.fromkeys(names, math.nan)
        moved = True
    else:
        sd = window[:, 2 : 2 + len(names)][usable].std(axis=0)
        excitation = {name: float(s) for name, s in zip(names, sd, strict=True)}
        moved = not all(s < MIN_MOVEMENT_TO_FIT * status.usual(name) for name, s in excitation.items())

    def refused(kind: Status, says: str) -> Estimate:
        # brief gates: say why no more data come
        why = sample.gate.value if sample.gate is not LearnGate.OPEN else says
        plain = status.without_numbers(sample.t, NAME, kind, why, names)
        known = excitation if kind is not Status.CONVERGING else {}
        return plain._replace(used=used, excitation=known)

    weak = status.by_data(used, setup.needed, excitation, moved)
    if weak is not None:
        return state, refused(*weak)
    change = step_watch.shown(state.watch, sample.t)
    given = setup.settings
    if state.watch.cut == state.watch.cut:
        since = step_watch.since_step(state.watch, _window(setup, state))
        if since is not None:
            kind, says = status.by_fit(since, excitation)
            if kind is not Status.OK:
                return state, refused(kind, says)._replace(change=change)
            says = f"{says}; K since the driver changed, τ and θ from before"
            used = sample.t - state.watch.cut
            of_step = Estimate(
                sample.t, NAME, kind, says, since, excitation=excitation, used=used, change=change
            )
            return state, _judged(state, of_step)
    start = None if state.reported else state.start
    fit = fopdt_fit.fit_rows(
        setup.layout,
        window,
        fopdt_fit.Settings(
            held=feedback_bias.held(names), names=names, prior=given.prior, output_filter=given.output_filter
        ),
        continued=state.reported,
        start=start,
    )
    if state.reported:
        # from a fit that is not credible the next ones would begin where none of them can end
        credible = fit.fit_percent >= grid_search.MIN_FIT_PERCENT
        state = state._replace(start=fit.start if credible else None)
    channels: Mapping[str, Channel] = dict(zip(names, fit.channels, strict=True))
    if state.reported:
        window_now = _window(setup, state)
        watch = step_watch.learn(state.watch, fit, channels, window_now, sample.t)
        bends = bent_response.learn(state.bends, fit, window_now, _seen(setup, state))
        state = state._replace(watch=watch, bends=bends)
    channels = step_watch.with_steps(state.watch, channels, _window(setup, state))
    following = _following(given, sample.signals.get("speed"), sample.signals.get("headway"))
    verdict = plausibility.judge(channels, fit.fit_percent, _ranges(given), following)
    kind, says = status.by_fit(channels, excitation, *verdict)
    tests = None
    # half as long as a fit: only where it is reported
    if state.reported and fit.start is not None:
        simulated = fopdt_residual.simulate_window(setup.layout, window, fit)
        tests = fopdt_residual.run_tests(simulated, fit, names, given.output_filter)
    if kind is not Status.OK:
        made = refused(kind, says)._replace(change=change)
        # what was found against a model is the reason, whatever the gate says just now
        return state, made._replace(says=says, residual_tests=tests) if verdict.refused else made
    if is_unknown(given.output_filter):
        says = f"{says}; {DELAYS_HOLD_IT}"
    complete = Estimate(
        sample.t, NAME, kind, says, channels, fit.fit_percent, excitation, used, tests, change=change
    )
    return state, _judged(state, complete)


def _judged(state: State, made: Estimate) -> Estimate:
    """Widen what may be quoted; an end that is lowered to zero is no gain of unknown sign, and comes last."""
    others = bent_response.others(state.bends)
    if others:
        made = agreement.averaged(made._replace(other_gains=others))
    return made._replace(channels=given_quoted(made.channels))


def _ranges(given: FopdtSettings) -> plausibility.Ranges:
    return plausibility.Ranges(given.tau_max, given.dead_time_max, NAME)


def _following(
    given: FopdtSettings, speed: float | None, headway: float | None
) -> plausibility.Following | None:
    """About what the loop is linearised; None: the output is no acceleration, or its delays are not the driver's."""
    if given.output not in plausibility.ACCELERATIONS or is_unknown(given.output_filter):
        return None
    if speed is None or headway is None or not (speed > 0.0 and headway > 0.0):
        return None
    return plausibility.Following(speed, headway)


# --- a whole drive ---------------------------------------------------------------------------------


def identify(trace: Trace, settings: FopdtSettings) -> WholeDrive:
    """Fit all usable samples of a drive at once, and find what changes during it.

    What is left over in the residuals is said here; what it withholds is the arbiter's (whole_drive_agreement.py).
    """
    how = fopdt_whole_drive.Fitting(
        settings.tau_max, settings.dead_time_max, settings.prior, settings.output_filter
    )
    form = wanted_gap_form.choose(trace, how.fit)
    trace, fit = form.trace, form.fit
    channels = dict(zip(trace.input_names, fit.channels, strict=True))
    tests, left = None, ""
    if fit.start is not None:
        setup = configure(trace.input_names, trace.dt, settings)
        simulated = fopdt_residual.simulate_drive(setup.layout, trace, fit, setup.settle)
        tests = fopdt_residual.run_tests(simulated, fit, trace.input_names, settings.output_filter)
        left = plausibility.left_over(tests)
    following = _following(settings, _mean(trace, "speed"), _mean(trace, "headway"))
    verdict = plausibility.judge(channels, fit.fit_percent, _ranges(settings), following)
    several = plausibility.several_answers(trace.input_names, fit.optima)
    for name in several:
        channels[name] = channels[name]._replace(withheld=channels[name].withheld or several[name])
    if verdict.refused:
        channels = dict.fromkeys(channels, not_quotable(Channel(), "; ".join(verdict.refused)))
    unknown = DELAYS_HOLD_IT if is_unknown(settings.output_filter) else ""
    lines = tuple(
        filter(None, (*verdict.refused, *several.values(), *verdict.remarks, form.says, left, unknown))
    )
    details = {
        "says": "; ".join(lines),
        "standstill": form.standstill,
        "standstill_share": form.share,
        "form_open": form.open,
        "form_spread": form.spread,
    }
    drive = WholeDrive(channels, fit, fit.fit_percent, tests, details=details, lines=lines)
    if verdict.refused:
        return fopdt_whole_drive.with_changes(drive, fopdt_whole_drive.OverTime((), (), ()))
    return fopdt_whole_drive.with_changes(drive, fopdt_whole_drive.over_time(trace, fit, how))


def _mean(trace: Trace, role: str) -> float | None:
    """Mean of a signal where the drive may be learnt from."""
    if role not in trace.signals:
        return None
    known = trace.signals[role][trace.learn]
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else None


def forget(setup: Setup, state: State, since: float) -> State:
    """Begin anew where the window reaches back to before `since` [s]; when the next estimate is due stays."""
    if state.t - setup.settings.window >= since - status.TIME_ROUNDING_S:
        return state
    return init(setup)._replace(pace=state.pace, t=state.t)


FOPDT = Estimator(
    NAME, FopdtSettings, configure, init, advance, estimate, identify, check_state=check_state, forget=forget
)
