"""The pedal that a driver with some causes in him would give, from what he saw: open loop, whole drives at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.known_response import WHITE, known_response
from canid.models.diagnosis.fitting.likelihood import Noise
from canid.models.diagnosis.fitting.model import RecentValues, box
from canid.models.effects.effect import Effect, Params, Seen, Value
from canid.models.effects.wanted_gap import Form, error
from canid.values.identified_model import DRIVER
from canid.values.types import Array

# of the baseline, in this order, before those of the causes
BASE = DRIVER
OFFSET, K1, K2, TAU1, TAU2, THETA1, THETA2, DESIRED, STANDSTILL, FREE_SPEED = range(10)
# physical box: gains of either sign, so that a sign error shows; lags and dead times as in FopdtSettings
LOW = (-300.0, -100.0, -100.0, 0.0, 0.0, 0.0, 0.0, 0.2, -5.0, 10.0)
HIGH = (300.0, 100.0, 100.0, 3.0, 3.0, 3.0, 1.6, 6.0, 30.0, 100.0)
# parameters that the fit of each form moves in addition to gains and delays. Of T, s0 and the offset only as many are
# identifiable as the form has ways to depend on the speed; an IDM driver does not accelerate at the wanted gap
OWN = {
    Form.TIME_HEADWAY: (OFFSET,),
    Form.GAP: (OFFSET, DESIRED),
    Form.FREE_SPEED: (DESIRED, STANDSTILL, FREE_SPEED),
}
# s; standard deviation of the difference of both answers' lags, and of their dead times. They share the same perception
# and the same pedal, and each is a second at most (reaction times in following: Grover 2021, Tables 1 and 2; Green 2000). A
# steady drive shows little of the headway's, and late there is the same as more of K2: error(t − δ) = error − δ·rate/v
TIE_SD_S = 0.5
# s; no lag. Far below the step of a derivative: a lag at its bound of 0 would not be seen to matter, and no fit left it
LEAST_LAG_S = 1e-9
# m/s; below it a headway means nothing
MIN_HEADWAY_SPEED = 1.0
# of a standard normal (Abramowitz & Stegun 1964, table 25.10, scaled)
NODES = ((-math.sqrt(3.0), 1 / 6), (0.0, 2 / 3), (math.sqrt(3.0), 1 / 6))
SCALE = (5.0, 2.0, 2.0, 0.3, 0.3, 0.3, 0.3, 0.5, 3.0, 10.0)

Counts = npt.NDArray[np.int64]
Bend = Callable[[Params, Value, Seen], Value]


class DriverModel(NamedTuple):
    """The baseline and some causes, as a function of their parameters."""

    effects: tuple[Effect, ...]
    low: Array  # (k,)
    high: Array
    scale: Array
    where: tuple[slice, ...]  # each effect's parameters in q
    form: Form = Form.TIME_HEADWAY
    begins: tuple[float, ...] = ()  # s, of each further drive: it has an offset of its own, after BASE
    tied: bool = True  # are lags and dead times of both answers alike?

    @property
    def delays(self) -> tuple[tuple[int, int], ...]:
        """Lag and dead time of each channel, the one that moves more first."""
        return ((TAU2, THETA2), (TAU1, THETA1))

    @property
    def one_signed(self) -> bool:
        """Strengths of drivers' effects have one sign each."""
        return True

    @property
    def centred(self) -> bool:
        """Is the desired headway itself visible?"""
        return self.form is not Form.TIME_HEADWAY or any(
            effect.shows_desired_headway for effect in self.effects
        )

    def with_effects(self, effects: Sequence[Effect]) -> DriverModel:
        """Return the driver with these effects."""
        return with_effects(effects, self.form, self.begins, self.tied)

    def free(self) -> tuple[int, ...]:
        """Parameters that a fit may move."""
        fixed = {
            k
            for effect, where in zip(self.effects, self.where, strict=True)
            for p, k in zip(effect.parameters, range(where.start, where.stop), strict=True)
            if p.fixed
        }
        constants = (OFFSET, DESIRED, STANDSTILL, FREE_SPEED)
        fixed |= {k for k in constants if k not in OWN[self.form] and (k != DESIRED or not self.centred)}
        return tuple(k for k in range(len(self.low)) if k not in fixed)

    def bind(self, data: DriverData, noise: Noise | None = None) -> Callable[[Array], Array]:
        """Return the simulated output as a function of the parameters alone."""
        recent, A = RecentValues(), WHITE if noise is None else noise.A
        return lambda q: pedal(self, data, q, recent, A)

    def ties(self, data: DriverData) -> Array | None:
        """Both answers share perception, pedal and car, so their lags and dead times are alike."""
        if not self.tied:
            return None
        out = np.zeros((2, self.low.size))
        for row, (first, other) in zip(out, ((TAU1, TAU2), (THETA1, THETA2)), strict=True):
            row[first], row[other] = 1 / TIE_SD_S, -1 / TIE_SD_S
        return out

    def noise_features(self, data: DriverData, simulated: Array) -> Array | None:
        """How much is answered, and how fast the car is; (n, 3), standardised."""
        free = data.output.usable & ~data.output.below

        def standard(x: Array) -> Array:
            sd = float(np.std(x[free]))
            out: Array = np.clip((x - np.mean(x[free])) / sd, -3, 3) if sd > 1e-9 else np.zeros_like(x)
            return out

        away = simulated - np.median(simulated[free])
        return np.stack([standard(np.abs(away)), standard(away), standard(data.seen.speed)], axis=1)


def with_effects(
    effects: Sequence[Effect],
    form: Form = Form.TIME_HEADWAY,
    begins: tuple[float, ...] = (),
    tied: bool = True,
) -> DriverModel:
    """Return the driver with some effects, on a baseline of one form; on one drive, or on several one after the other."""
    low, high, scale = (values + (values[OFFSET],) * len(begins) for values in (LOW, HIGH, SCALE))
    return DriverModel(*box(effects, low, high, scale), form, begins, tied)


def offset(model: DriverModel, q: Array, t: Value) -> Value:
    """Output without an answer, at times t: that of the first drive, and by how much a further one's differs.

    Of q (k, m): at one time of each of m drivers.

    Example:
        >>> model = with_effects((), begins=(100.0,))
        >>> offset(model, np.r_[2.0, np.zeros(len(BASE) - 1), 0.5], np.array([50.0, 150.0])).tolist()
        [2.0, 2.5]
    """
    if not model.begins:
        return q[OFFSET]
    further = q[len(BASE) : len(BASE) + len(model.begins)]
    drive = np.searchsorted(model.begins, t, side="right")
    differs = np.concatenate([np.zeros_like(further[:1]), further])
    return q[OFFSET] + (differs[drive] if q.ndim == 1 else differs[drive, np.arange(q.shape[1])])


def _offsets(model: DriverModel, q: Array, samples: Counts) -> Value:
    """The same of drives with so many samples each, one after the other: of q (k,), 5 times as fast as by times."""
    out: Value = q[OFFSET]
    if not model.begins:
        return out
    return np.repeat(np.r_[out, out + q[len(BASE) : len(BASE) + len(model.begins)]], samples)


def _samples(model: DriverModel, t: Array) -> Counts:
    """Samples of each drive."""
    return np.diff(np.searchsorted(t, model.begins), prepend=0, append=t.size)


def delayed(x: Array, delay: float, dt: float) -> Array:
    """Return x(t − delay), straight between samples; before the first sample it stood still.

    Example:
        >>> delayed(np.array([0.0, 1.0, 2.0]), 0.15, 0.1)
        array([0. , 0. , 0.5])
    """
    steps = delay / dt
    whole = math.floor(steps)
    part = steps - whole
    out = np.full(x.size, part * x[0] + (1 - part) * x[0])
    late = x.size - whole - 1
    if late > 0:
        here = out[whole + 1 :]
        np.multiply(x[:late], part, out=here)
        here += (1 - part) * x[1 : late + 1]
    return out


def seen_late(data: DriverData, delay: float | Array) -> Seen:
    """What the driver acts on: everything but the clock is late by his dead time."""
    seen, known, dt = data.seen, data.known, data.output.dt
    columns = (known.gap, known.range_rate, known.lead_accel)
    if isinstance(delay, float):
        gap, rate, accel = (_recalled(column, delay, dt) for column in columns)
        speed = delayed(seen.speed, delay, dt)
    else:
        gap, rate, accel = (_recalled_at(column, delay, dt) for column in columns)
        speed = np.interp(seen.t - delay, seen.t, seen.speed)
    headway = gap / np.maximum(speed, MIN_HEADWAY_SPEED)
    return seen._replace(headway=headway, range_rate=rate, gap=gap, speed=speed, lead_accel=accel)


def _gap_late(data: DriverData, delay: float) -> Seen:
    """What the wanted gap depends on, where nothing else enters."""
    gap = _recalled(data.known.gap, delay, data.output.dt)
    speed = delayed(data.seen.speed, delay, data.output.dt)
    return data.seen._replace(headway=gap / np.maximum(speed, MIN_HEADWAY_SPEED), gap=gap, speed=speed)


def _doubt(sd: Array, delay: float | Array, dt: float) -> float:
    """Standard deviation of what is recalled; of a delay that changes, at its mean."""
    return float(np.interp(np.mean(delay) / dt, np.arange(sd.size), sd))


def _recalled(lags: Array, delay: float, dt: float) -> Array:
    """Return x(t − delay) as known at t: between two lags straight, beyond the last one delayed further."""
    last = lags.shape[1] - 1
    steps = delay / dt
    if steps >= last:
        return delayed(lags[:, last], delay - last * dt, dt)
    whole = math.floor(steps)
    part = steps - whole
    out: Array = (1 - part) * lags[:, whole] + part * lags[:, whole + 1]
    return out


def _recalled_at(lags: Array, delay: Array, dt: float) -> Array:
    """Return the same for a delay (n,) that changes."""
    steps = np.minimum(delay / dt, lags.shape[1] - 1.001)
    whole = steps.astype(np.int64)
    part = steps - whole
    rows = np.arange(len(lags))
    out: Array = (1 - part) * lags[rows, whole] + part * lags[rows, whole + 1]
    return out


def lagged(x: Array, tau: float, dt: float) -> Array:
    """Return x through 1/(1 + τs), exact for an x that is straight between samples; begins at rest.

    Example:
        >>> lagged(np.array([1.0, 1.0, 1.0]), 0.5, 0.1)
        array([1., 1., 1.])
    """
    if tau < LEAST_LAG_S:
        return x
    decay = math.exp(-dt / tau)
    ramp = tau / dt * (1 - decay)
    now, before = 1 - ramp, ramp - decay
    out: Array = lfilter([now, before], [1.0, -decay], x, zi=[(1 - now) * x[0]])[0]
    return out


def blurred(bend: Bend, p: Params, x: Array, seen: Seen, sd: Array | float) -> Array:
    """Return the mean of a bend over what the input may have been, (n,).

    The input is known as a conditional mean. A straight answer to it needs no more; the corner of a bent one is
    rounded by the uncertainty. Fitted without that, a dead zone comes out too small. Three-node Gauss-Hermite.

    Example:
        >>> seen = Seen(0.0, 600.0, 2.0, -1.0, 60.0, 33.0, 0.0)
        >>> blurred(lambda p, x, seen: abs(x), (), np.array([0.0, 3.0]), seen, 0.5).round(2)
        array([0.29, 3.  ])
    """
    out: Array = np.sum([weight * bend(p, x + node * sd, seen) for node, weight in NODES], axis=0)
    return out


class Parts(NamedTuple):
    """The demand before the lag, (n,) each."""

    e: Array  # s, acted upon
    w: Array  # m/s, acted upon
    gain: Array | float
    extra: Array | float


class Responses(NamedTuple):
    """Behind the lags, (n,) each, and what is added; the answers for gains of 1."""

    first: Array  # to headway
    second: Array  # to relative speed
    extra: Array | float


# of what depends on the model alone
NO_PARAMETERS = np.empty(0)


class _Inputs(NamedTuple):
    """Parameters that each part depends on, as indices into q."""

    e: Counts
    w: Counts
    gain: Counts
    extra: Counts
    first: Counts
    second: Counts
    behind: Counts
    offsets: Counts
    # are gap and speed alone used after the first dead time, and the relative speed alone after the second?
    gap_alone: bool
    rate_alone: bool


def _inputs(model: DriverModel) -> _Inputs:
    e, w, gain, extra = [THETA1, DESIRED, STANDSTILL, FREE_SPEED], [THETA2], list[int](), list[int]()
    for effect, where in zip(model.effects, model.where, strict=True):
        indices = range(where.start, where.stop)
        if effect.headway is not None or effect.dead_time is not None:
            e += indices
        if effect.range_rate is not None or effect.dead_time is not None:
            w += indices
        if effect.gain is not None:
            gain += indices
        if effect.extra is not None:
            extra += indices
    # both act on what is seen after the second dead time
    late = [k for effect, k in zip(model.effects, model.where, strict=True) if effect.dead_time is not None]
    seen = [THETA2, *(k for where in late for k in range(where.start, where.stop))]
    gain, extra = gain + seen if gain else [], extra + seen if extra else []
    drives = range(len(BASE), len(BASE) + len(model.begins))

    def at(*indices: int) -> Counts:
        return np.array(indices, dtype=np.int64)

    return _Inputs(
        at(*e), at(*w), at(*gain), at(*extra),
        at(TAU1, *e, *gain), at(TAU2, *w, *gain), at(TAU2, *extra), at(OFFSET, *drives),
        gap_alone=not late and all(effect.headway is None for effect in model.effects),
        rate_alone=not (late or gain or extra) and all(effect.range_rate is None for effect in model.effects),
    )  # fmt: skip


def _dead_times(model: DriverModel, data: DriverData, q: Array) -> tuple[float | Array, float | Array]:
    theta1: float | Array = float(q[THETA1])
    theta2: float | Array = float(q[THETA2])
    for effect, where in zip(model.effects, model.where, strict=True):
        if effect.dead_time is not None:
            added = effect.dead_time(q[where], data.seen)
            theta1, theta2 = np.maximum(theta1 + added, 0.0), np.maximum(theta2 + added, 0.0)
    return theta1, theta2


def parts(model: DriverModel, data: DriverData, q: Array, recent: RecentValues | None = None) -> Parts:
    """What enters the lag.

    Args:
        model: which causes.
        data: what he saw.
        q: (k,) parameters.
        recent: parts computed before; a derivative by another parameter needs them again.
    """
    kept = recent or RecentValues()
    theta1, theta2 = _dead_times(model, data, q)
    inputs = kept.value("inputs", NO_PARAMETERS, lambda: _inputs(model))
    acting = [(effect, q[where]) for effect, where in zip(model.effects, model.where, strict=True)]

    def seen(delay: float | Array) -> Seen:
        if isinstance(delay, float):
            return kept.value("seen", np.array([delay]), lambda: seen_late(data, delay))
        return seen_late(data, delay)

    def e() -> Array:
        first = _gap_late(data, theta1) if inputs.gap_alone and isinstance(theta1, float) else seen(theta1)
        out: Array = error(model.form, q[DESIRED], q[STANDSTILL], q[FREE_SPEED], first)
        for effect, p in acting:
            if effect.headway is not None:
                sd = _doubt(data.known.gap_sd, theta1, data.output.dt)
                out = blurred(effect.headway, p, out, first, sd / np.maximum(first.speed, MIN_HEADWAY_SPEED))
        return out

    def w() -> Array:
        if inputs.rate_alone and isinstance(theta2, float):
            return _recalled(data.known.range_rate, theta2, data.output.dt)
        second = seen(theta2)
        out: Array = second.range_rate
        for effect, p in acting:
            if effect.range_rate is not None:
                sd = _doubt(data.known.range_rate_sd, theta2, data.output.dt)
                out = blurred(effect.range_rate, p, out, second, sd)
        return out

    def gain() -> Array | float:
        out: Array | float = 1.0
        for effect, p in acting:
            if effect.gain is not None:
                out = out * effect.gain(p, seen(theta2))
        return out

    def extra() -> Array | float:
        out: Array | float = 0.0
        for effect, p in acting:
            if effect.extra is not None:
                out = out + effect.extra(p, seen(theta2))
        return out

    return Parts(
        kept.value("e", q[inputs.e], e),
        kept.value("w", q[inputs.w], w),
        kept.value("gain", q[inputs.gain], gain),
        kept.value("extra", q[inputs.extra], extra),
    )


def responses(
    model: DriverModel, data: DriverData, q: Array, recent: RecentValues | None = None, A: Array = WHITE
) -> Responses:
    """Answers behind the lags; arguments as in `pedal`."""
    kept, dt = recent or RecentValues(), data.output.dt
    used = kept.value("inputs", NO_PARAMETERS, lambda: _inputs(model))
    entering, zeros = parts(model, data, q, kept), np.zeros(data.seen.t.size)

    def behind(name: str, x: Callable[[], Array | float], tau: int, inputs: Counts) -> Array:
        return kept.value(name, q[inputs], lambda: lagged(x() + zeros, float(q[tau]), dt))

    return Responses(
        behind("first", lambda: entering.gain * entering.e, TAU1, used.first),
        behind("second", lambda: entering.gain * entering.w, TAU2, used.second),
        behind("behind", lambda: entering.extra, TAU2, used.behind) + _of_lead(model, data, q, kept, A)
        if used.extra.size
        else 0.0,
    )


def _of_lead(model: DriverModel, data: DriverData, q: Array, kept: RecentValues, A: Array) -> Array | float:
    """What the lead's acceleration adds behind the lag beyond that of `parts`, where it is known better since."""
    out: Array | float = 0.0
    for effect, where in zip(model.effects, model.where, strict=True):
        theta, tau = _dead_times(model, data, q)[1], float(q[TAU2])
        if effect.extra is None or not effect.shortens_dead_time or not isinstance(theta, float):
            continue

        def known(theta: float = theta, tau: float = tau) -> Array:
            dt = data.output.dt
            response = known_response(data.known.lead_accel, theta, tau if tau >= LEAST_LAG_S else 0.0, dt, A)
            before = lagged(_recalled(data.known.lead_accel, theta, dt), tau, dt)
            return np.zeros_like(before) if response is None else response - before

        differs = kept.value("of_lead", np.array([theta, tau]), known)
        out = out + effect.extra(q[where], data.seen._replace(lead_accel=differs))
    return out


def pedal(
    model: DriverModel, data: DriverData, q: Array, recent: RecentValues | None = None, A: Array = WHITE
) -> Array:
    """Return the output that the driver would give, without noise and before its limits.

    Args:
        model: which causes.
        data: what he saw.
        q: (k,) parameters, in the order of `BASE` and then the causes'.
        recent: as in `parts`; of one `A`.
        A: the noise model that the output is fitted with (`known_response.py`).

    Returns:
        (n,) output unit.
    """
    kept, dt = recent or RecentValues(), data.output.dt
    answers = responses(model, data, q, kept, A)
    level = q[OFFSET]
    if model.begins:
        used = kept.value("inputs", NO_PARAMETERS, lambda: _inputs(model))
        samples = kept.value("samples", NO_PARAMETERS, lambda: _samples(model, data.seen.t))
        level = kept.value("level", q[used.offsets], lambda: _offsets(model, q, samples))
    out: Array = q[K1] * answers.first
    # no more arrays than one: they are what a sum of some costs
    out += level
    out += q[K2] * answers.second
    out += answers.extra
    for effect, where in zip(model.effects, model.where, strict=True):
        if effect.pedal is None:
            continue
        p = q[where]
        if effect.pedal.column is not None:
            out = effect.pedal.column(p, out, dt)
        else:
            state = effect.pedal.init(p, float(out[0]))
            step, moved = effect.pedal.step, []
            for demand in out.tolist():
                state, y = step(p, state, demand, dt)
                moved.append(y)
            out = np.array(moved)
    return out
