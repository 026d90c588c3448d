"""Detection of a step of the gains in the FOPDT estimator's window, every two seconds (Shiryaev-Roberts).

The mathematics is in mathematics/identification/fopdt/gain_step.py. Lags, dead times, noise model and its scale are those of
the last reported fit before the evidence grew (`Watch.reference`): a fit of the window over the step itself would take the
misfit for noise. Below the threshold of an alarm the gains of a window are a mixture over "no step" and a step at each
second; from the alarm on the gains are those since the step, and once `BRIDGE_S` of data have come since, the window begins
there.

It runs in `advance` at even seconds and depends on reported fits only, so live and batch detect the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from canid.mathematics.estimators.status import TIME_ROUNDING_S
from canid.mathematics.identification import identifiability
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.fopdt import answer_columns, earlier_rows, gain_step
from canid.mathematics.identification.fopdt.answer_columns import Columns, Reference
from canid.mathematics.identification.fopdt.earlier_rows import Earlier
from canid.mathematics.identification.fopdt.gain_step import CANDIDATE_S, Steps
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.fopdt.regression_rows import Layout
from canid.values.state_constraints import TIME
from canid.values.types import NAN, Array, Channel, GainChange, Identifiable, Interval, OutputFilter

# s between two checks: a check takes a third of a refit
CHECK_EVERY_S = 2.0
# h; mean time between false alarms of a constant driver by the bound of the statistic, which takes the noise law as known.
# One in 10 h is what is wanted of drives whose noise has heavy tails, or is resonant, as well
FALSE_ALARM_INTERVAL_H = 100.0
# log of the Shiryaev-Roberts statistic from which on a step is reported
ALARM = math.log(FALSE_ALARM_INTERVAL_H * 3600.0 / CANDIDATE_S)
# log of it below which a step is not worth a second pass
SECOND_PASS = 4.0
# log of it from which on the reference is kept as it is: with nothing changed, a window of a minute has log 60 = 4.1
HOLD = 5.0
# s that a reference is kept at most while the evidence neither grows to an alarm nor goes
MAX_HELD_S = 60.0
# s of usable data that a reference needs: gains of the first 20 s may be off by their own size
MIN_REFERENCE_S = 40.0
# s after which a reference no longer stands for the driver now
MAX_REFERENCE_AGE_S = 2.0 * MAX_HELD_S
# Steps a second, before the data: two an hour. It weighs the steps in the mixture below the alarm.
STEP_RATE = 2.0 / 3600.0
# Weight of all steps together below which they move no 95 % interval
MIN_STEP_WEIGHT = 0.02
# s of usable data after a step from which on they are a window of their own; before, K alone is estimated from them
BRIDGE_S = 30.0
# s for which a step is given along with the estimates
SHOWN_S = 60.0
# relative sd of a change of gain that was detected: its size is left to the data
DETECTED_SD = 2.0


# share of the window in which a step is looked for; what is older counts as before it, and its first rows, of which no
# history is known, are never used
SEARCHED_SHARE = 0.75


class Watch(NamedTuple):
    """What the next check needs."""

    reference: Reference | None = None
    reference_t: Annotated[float, TIME] = NAN  # s
    channels: Mapping[str, Channel] = {}  # of the reference
    evidence: float = 0.0  # log, at the last check
    checked: Annotated[float, TIME] = NAN  # s
    change: GainChange | None = None  # the last one
    detected: Annotated[float, TIME] = NAN  # s, when
    cut: Annotated[float, TIME] = NAN  # s, the window's rows before are of other gains; NaN: none
    new: bool = False  # the change has not been reported yet
    earlier: Earlier = Earlier()  # rows from before the step that is looked for


class Window(NamedTuple):
    """Rows of a window with the time of the last."""

    layout: Layout
    names: tuple[str, ...]
    rows: Array  # (n, width)
    t: float  # s, of the last row
    seconds: float  # that the window is long when it is full
    output_filter: OutputFilter | None

    def row_at(self, t: float) -> int:
        """Return the first row from t [s] on."""
        return max(len(self.rows) - 1 - round((self.t - t) / self.layout.step), 0)

    def time_of(self, row: float) -> float:
        """Time of a row in s."""
        return self.t - (len(self.rows) - 1 - row) * self.layout.step

    @property
    def block(self) -> int:
        """Rows between two candidates."""
        return max(round(CANDIDATE_S / self.layout.step), 1)


def due(watch: Watch, t: float) -> bool:
    """Whether a check is due at t [s]: the first sample in each `CHECK_EVERY_S`."""
    if watch.checked != watch.checked:
        return True
    last = watch.checked + TIME_ROUNDING_S
    return (t + TIME_ROUNDING_S) // CHECK_EVERY_S > last // CHECK_EVERY_S


def check(watch: Watch, window: Window, t: float) -> Watch:
    """Look for a step at time t [s]; a new one has `new` set."""
    watch = watch._replace(checked=t)
    if watch.reference is None or watch.cut == watch.cut or len(window.rows) < 3 * window.block:
        return watch
    if t - watch.reference_t > MAX_REFERENCE_AGE_S:
        return watch._replace(reference=None, evidence=0.0)
    if not (window.rows[-window.block :, 1] > 0.0).any():
        return watch
    tested = _steps(watch.reference, window, watch.earlier)
    if tested is None:
        return watch._replace(evidence=0.0)
    made, steps = tested
    if steps.evidence < ALARM:
        earlier = _absorbed(watch, watch.reference, window, made) if steps.evidence < HOLD else watch.earlier
        return watch._replace(evidence=steps.evidence, earlier=earlier)
    first, low, high = (window.time_of(row) for row in gain_step.when(steps))
    # over all times at which it may have been
    weight = np.exp(steps.log_bayes - steps.log_bayes.max())
    before, after = (
        {name: gain_step.mixture(K[:, i], sd[:, i], weight) for i, name in enumerate(window.names)}
        for K, sd in ((steps.before, steps.before_sd), (steps.after, steps.after_sd))
    )
    # a step between two candidates is found at either
    change = GainChange(Interval(first, low - CANDIDATE_S, high + CANDIDATE_S), before, after, steps.evidence)
    return watch._replace(evidence=0.0, change=change, detected=t, cut=first, new=True)


def trim(watch: Watch, window: Window) -> tuple[Watch, Array]:
    """Let the window begin at the last step, once enough data have come since."""
    if watch.cut != watch.cut:
        return watch, window.rows
    after = window.rows[window.row_at(watch.cut) :]
    if float((after[:, 1] > 0.0).sum()) * window.layout.step < BRIDGE_S and window.time_of(0) <= watch.cut:
        return watch, window.rows
    after = after.copy()
    after.setflags(write=False)
    return watch._replace(cut=NAN, reference=None, earlier=Earlier()), after


def learn(watch: Watch, fit: ProcessFit, channels: Mapping[str, Channel], window: Window, t: float) -> Watch:
    """Take a reported fit as the reference, unless there is evidence that it holds a step."""
    kept = watch.reference is not None and watch.evidence >= HOLD
    used = float((window.rows[:, 1] > 0.0).sum()) * window.layout.step
    if watch.cut == watch.cut or used < MIN_REFERENCE_S or (kept and t - watch.reference_t < MAX_HELD_S):
        return watch
    # of a gain that is not known nobody can say that it changed
    known = any(identifiability.quotable(channel, "K") for channel in channels.values())
    at = answer_columns.reference(fit) if known else None
    made = _columns(at, window) if at is not None else None
    if at is None or made is None:
        return watch
    return watch._replace(reference=at._replace(scale=made.scale), reference_t=t, channels=dict(channels))


def with_steps(watch: Watch, channels: Mapping[str, Channel], window: Window) -> Mapping[str, Channel]:
    """Gains as the mixture over no step and a step at each second of the window."""
    if watch.reference is None or watch.evidence + math.log(STEP_RATE) < math.log(MIN_STEP_WEIGHT):
        return channels
    tested = _steps(watch.reference, window, watch.earlier)
    if tested is None:
        return channels
    _, steps = tested
    weight = np.concatenate([[1.0], STEP_RATE * CANDIDATE_S * np.exp(np.minimum(steps.log_bayes, 50.0))])
    weight /= weight.sum()
    if weight[0] > 1.0 - MIN_STEP_WEIGHT:
        return channels
    out = {}
    for i, (name, channel) in enumerate(channels.items()):
        K = channel.K
        half = (K.high - K.low) / (2.0 * NORMAL_QUANTILE)
        value = np.concatenate([[0.5 * (K.low + K.high)], steps.after[:, i]])
        mixed = gain_step.mixture(value, np.concatenate([[half], steps.after_sd[:, i]]), weight)
        usable = math.isfinite(half) and channel.status is not Identifiable.NOT
        out[name] = identifiability.with_gain(channel, mixed) if usable else channel
    return out


def since_step(watch: Watch, window: Window) -> Mapping[str, Channel] | None:
    """Gains since a step that was detected, with lags and dead times from before; None where too little is known."""
    if watch.reference is None:
        return None
    made = _columns(watch.reference, window, watch.earlier)
    if made is None:
        return None
    first = window.row_at(watch.cut)
    parts = gain_step.grams(made, 1)
    two = np.array([parts[:first].sum(axis=0), parts[first:].sum(axis=0)])
    rows = np.array([0.0, first])
    before = earlier_rows.products(watch.earlier, window.layout, watch.reference)
    steps = gain_step.of_grams(two, made, watch.reference.size, rows, before, DETECTED_SD)
    gains = _intervals(window.names, steps.after[0], steps.after_sd[0])
    out = {}
    for (name, K), sd in zip(gains.items(), steps.after_sd[0], strict=True):
        channel = watch.channels[name]
        known = identifiability.judge(K, float(sd), math.inf, math.inf, math.inf)
        status = channel.status if known is not Identifiable.NOT else Identifiable.NOT
        # a driver who has just changed is given no prior: these gains are of the data alone
        weights = {key: of_prior for key, of_prior in channel.prior_weights.items() if key != "K"}
        out[name] = channel._replace(K=K, status=status, progress=None, prior_weights=weights)
    return out


def shown(watch: Watch, t: float) -> GainChange | None:
    """Return the change that goes along with an estimate at t [s]."""
    if watch.change is None or not t - watch.detected < SHOWN_S:
        return None
    return watch.change._replace(new=watch.new)


def _columns(at: Reference, window: Window, earlier: Earlier | None = None) -> Columns | None:
    """Whiten the window; rows that `earlier` holds are not usable."""
    raw, usable = answer_columns.raw(window.layout, window.rows, at)
    made = answer_columns.whitened(window.layout, raw, usable, at, window.output_filter)
    if made is None or earlier is None or earlier.until != earlier.until:
        return made
    new = np.arange(len(window.rows)) > window.row_at(earlier.until)
    return made._replace(values=made.values * new, weight=made.weight * new, usable=made.usable & new)


def _steps(at: Reference, window: Window, earlier: Earlier) -> tuple[Columns, Steps] | None:
    """Test each second; on the scale of the noise before, or of the residual with the likeliest step where it is larger."""
    made = _columns(at, window, earlier)
    if made is None:
        return None
    before = earlier_rows.products(earlier, window.layout, at)
    steps = gain_step.steps(made, at.size, window.block, before)
    if steps.evidence < SECOND_PASS:
        return made, steps
    m = made.inputs
    after = np.arange(made.values.shape[1]) >= steps.rows[steps.best]
    e = answer_columns.residual(made, made.values[: m + 1] * after)
    made = answer_columns.weighed(made, e, at, made.values.shape[1], at.scale)
    return made, gain_step.steps(made, at.size, window.block, before)


def _absorbed(watch: Watch, at: Reference, window: Window, made: Columns) -> Earlier:
    """Take in the rows that are too old to be searched."""
    until = window.t - SEARCHED_SHARE * window.seconds
    if window.time_of(0) >= until:
        return watch.earlier
    first = window.row_at(watch.earlier.until) + 1 if watch.earlier.until == watch.earlier.until else 0
    last = window.row_at(until)
    if last < first:
        return watch.earlier
    part = slice(first, last + 1)
    return earlier_rows.absorb(
        watch.earlier,
        window.layout,
        window.rows,
        made,
        at,
        part,
        window.time_of(last),
        window.output_filter,
    )


def _intervals(names: tuple[str, ...], value: Array, sd: Array) -> dict[str, Interval]:
    return {
        name: Interval(float(v), float(v - NORMAL_QUANTILE * s), float(v + NORMAL_QUANTILE * s))
        for name, v, s in zip(names, value, sd, strict=True)
    }


def says(change: GainChange) -> str:
    """The sentence for the user.

    >>> K = {"range_rate": Interval(5.6, 5.2, 6.0)}, {"range_rate": Interval(8.4, 7.0, 9.8)}
    >>> says(GainChange(Interval(190.0, 188.0, 191.0), *K, 14.0))
    'the driver changed at 3:10 (3:08 to 3:11): range rate K 5.60 [5.20, 6.00] -> 8.40 [7.00, 9.80]'
    """
    first, low, high = map(_clock, change.t)
    known = [
        name for name in change.before if _is_known(change.before[name]) or _is_known(change.after[name])
    ]
    gains = ", ".join(
        f"{name.replace('_', ' ')} K {_gain(change.before[name])} -> {_gain(change.after[name])}"
        for name in known or change.before
    )
    return f"the driver changed at {first} ({low} to {high}): {gains}"


def _clock(t: float) -> str:
    minutes, seconds = divmod(round(max(t, 0.0)), 60)
    return f"{minutes}:{seconds:02d}"


def _is_known(K: Interval) -> bool:
    """Whether a gain differs from zero, as its quotation asks for."""
    half = (K.high - K.low) / (2.0 * NORMAL_QUANTILE)
    return abs(K.value) >= identifiability.GAIN_RATIO * half


def _gain(K: Interval) -> str:
    return f"{K.value:.2f} [{K.low:.2f}, {K.high:.2f}]"
