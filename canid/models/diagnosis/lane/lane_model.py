"""The steering angle that a driver with some causes would give, from the lateral offset: open loop, whole drives at once.

The baseline is the driver of Chen & Ulsoy 2001, eq. 1 and 3, with a free dead time: position and rate of the offset through
two poles,

    angle = p0 + (K + Kd s) e^(−θs) / (1 + τ s + π s²) [offset − wanted position] + n,

discretised so that it holds their ARMAX(2,2,1) exactly: each s is a backward difference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from canid.models.diagnosis.driver.driver_data import at_limits, filled
from canid.models.diagnosis.driver.driver_model import delayed
from canid.models.diagnosis.fitting.likelihood import Noise, Output
from canid.models.diagnosis.fitting.model import box
from canid.models.diagnosis.masks import extended
from canid.models.effects.effect import Effect, Seen
from canid.values.findings import Flags
from canid.values.types import NAN, Array, LearnGate, Trace

# s; the longest memory of the driver that is modelled: dead time and lags
DRIVER_MEMORY_S = 2.5


class LaneData(NamedTuple):
    """Columns (n,) of one drive on its grid."""

    t: Array  # s since its first sample
    offset: Array  # m, from the middle of the lane, positive to the left; holes filled
    speed: Array  # m/s; zeros where it is not measured
    curvature: Array | None  # 1/m, of the road, positive to the left; None: not measured
    output: Output  # steering wheel angle, °

    @property
    def duration(self) -> float:
        """Of the whole drive, s."""
        return float(self.t[-1]) if self.t.size else 0.0

    def with_output(self, output: Output) -> LaneData:
        """Return the same drive with another output."""
        return self._replace(output=output)


def prepare(trace: Trace, usable: Flags) -> LaneData:
    """Lay out the columns.

    Args:
        trace: of a drive.
        usable: (n,) samples that no mask has taken.
    """
    n = trace.t.size
    offset = trace.inputs[:, 0] if n else np.zeros(0)
    known = np.isfinite(offset) & np.isfinite(trace.output)
    lower, upper = at_limits(trace)
    open_ = np.array([gate is LearnGate.OPEN for gate in trace.gate], dtype=bool) | lower.at | upper.at
    # where the samples' own history ends, the driver's memory is not known either
    begins = np.r_[True, np.diff(trace.segment) != 0] if n else np.zeros(0, dtype=bool)
    settled = ~extended(~(open_ & known & usable) | begins, round(DRIVER_MEMORY_S / trace.dt))
    below, above = lower.at & settled, upper.at & settled
    output = Output(filled(trace.output), settled, below, lower.bound, above, upper.bound, trace.dt)
    road = trace.signals.get("curvature")
    measured = road is not None and bool(np.isfinite(road[settled]).mean() > 0.5) if settled.any() else False
    return LaneData(
        trace.t - trace.t[0] if n else trace.t,
        filled(offset),
        filled(trace.signals.get("speed", np.zeros(n))),
        filled(road) if measured and road is not None else None,
        output,
    )


# of the baseline, in this order, before those of the causes
OFFSET, K, KD, TAU, PRODUCT, THETA, WANTED = range(7)
# °, ° per m, ° per m/s, s, s², s, m: gains of either sign, so that a sign error shows
LOW = (-90.0, -100.0, -200.0, 0.0, 0.0, 0.0, -3.0)
HIGH = (90.0, 100.0, 200.0, 3.0, 0.8, 1.6, 3.0)
SCALE = (1.0, 1.0, 4.0, 0.3, 0.05, 0.2, 0.3)


class LaneModel(NamedTuple):
    """The baseline and some causes, as a function of their parameters."""

    effects: tuple[Effect, ...]
    low: Array  # (k,)
    high: Array
    scale: Array
    where: tuple[slice, ...]  # each effect's parameters in q

    @property
    def delays(self) -> tuple[tuple[int, int], ...]:
        """Lag and dead time."""
        return ((TAU, THETA),)

    @property
    def one_signed(self) -> bool:
        """Strengths of drivers' effects have one sign each."""
        return True

    @property
    def centred(self) -> bool:
        """Is the wanted position itself visible?"""
        return any(effect.shows_desired_headway for effect in self.effects)

    def with_effects(self, effects: Sequence[Effect]) -> LaneModel:
        """Return the driver with these effects."""
        return with_effects(effects)

    def free(self) -> tuple[int, ...]:
        """Parameters that a fit may move."""
        return tuple(k for k in range(len(self.low)) if k != WANTED or self.centred)

    def bind(self, data: LaneData, noise: Noise | None = None) -> Callable[[Array], Array]:
        """Return the simulated output as a function of the parameters alone."""
        return lambda q: steered(self, data, q)

    def ties(self, data: LaneData) -> Array | None:
        """Nothing is known beforehand."""
        return None

    def noise_features(self, data: LaneData, simulated: Array) -> Array | None:
        """How much is steered, and how fast the car is; (n, 3), standardised."""
        free = data.output.usable

        def standard(x: Array) -> Array:
            sd = float(np.std(x[free]))
            out: Array = np.clip((x - np.mean(x[free])) / sd, -3, 3) if sd > 1e-9 else np.zeros_like(x)
            return out

        away = simulated - np.median(simulated[free])
        return np.stack([standard(np.abs(away)), standard(away), standard(data.speed)], axis=1)


def with_effects(effects: Sequence[Effect]) -> LaneModel:
    """Return the driver with some effects."""
    return LaneModel(*box(effects, LOW, HIGH, SCALE))


def polynomial(tau: float, product: float, dt: float) -> Array:
    """Coefficients of 1 + τ s + π s² with s = (1 − q⁻¹)/dt (Euler's implicit rule), the first one 1, and their sum.

    Every stable A(q) of two real poles above 0, and every one of two slow complex poles, is one of these; and the mean delay
    is τ for every step.

    Example:
        >>> polynomial(0.4867, 0.0344, 0.1).round(2)  # the means of Chen & Ulsoy 2001, table 1
        array([ 1.  , -1.26,  0.37,  0.11])
    """
    first, second = tau / dt, product / (dt * dt)
    out: Array = np.array([1.0 + first + second, -first - 2.0 * second, second, 1.0]) / (1.0 + first + second)
    return out


def second_order(x: Array, tau: float, product: float, dt: float) -> Array:
    """Return x through 1/(1 + τ s + π s²), at rest before.

    Example:
        >>> second_order(np.ones(3), 0.5, 0.05, 0.1).round(9)
        array([1., 1., 1.])
    """
    *a, gain = polynomial(tau, product, dt).tolist()
    # at rest y = x[0]; transposed direct form II
    state = np.array([x[0] * (1.0 - gain), -x[0] * a[2]])
    out: Array = lfilter([gain], a, x, zi=state)[0]
    return out


class Parts(NamedTuple):
    """The demand before the poles, (n,) each."""

    position: Array  # m, off the wanted position, acted upon
    rate: Array  # m/s, of it
    gain: Array | float
    added: Array | float  # °


def seen(data: LaneData) -> Seen:
    """What an effect sees that depends on the time or the speed: there is no lead."""
    return Seen(data.t, data.duration, NAN, NAN, NAN, data.speed, NAN)


def parts(model: LaneModel, data: LaneData, q: Array) -> Parts:
    """What enters the poles.

    Args:
        model: which causes.
        data: what the driver saw.
        q: (k,) parameters.
    """
    dt, here = data.output.dt, seen(data)
    y = data.offset - q[WANTED]
    gain: Array | float = 1.0
    added: Array | float = 0.0
    later: Array | float = 0.0
    for effect, where in zip(model.effects, model.where, strict=True):
        p = q[where]
        if effect.lane is not None and effect.lane.offset is not None:
            y = effect.lane.offset(p, y)
        if effect.lane is not None and effect.lane.curvature is not None and data.curvature is not None:
            added = added + effect.lane.curvature(p, partial(_ahead, data.t, data.curvature))
        if effect.gain is not None:
            gain = gain * effect.gain(p, here)
        if effect.dead_time is not None:
            later = later + effect.dead_time(p, here)
    rate = np.diff(y, prepend=y[0]) / dt
    if isinstance(later, float):
        theta = float(q[THETA])
        return Parts(delayed(y, theta, dt), delayed(rate, theta, dt), gain, added)
    at = data.t - np.maximum(q[THETA] + later, 0.0)
    return Parts(np.interp(at, data.t, y), np.interp(at, data.t, rate), gain, added)


def _ahead(t: Array, road: Array, ahead: float) -> Array:
    return np.interp(t + ahead, t, road)


def steered(model: LaneModel, data: LaneData, q: Array) -> Array:
    """Return the angle that the driver would give, without noise.

    Args:
        model: which causes.
        data: what the driver saw.
        q: (k,) parameters: those of the baseline, then the causes'.

    Returns:
        (n,) °.
    """
    dt, entering = data.output.dt, parts(model, data, q)
    demand = entering.gain * (q[K] * entering.position + q[KD] * entering.rate) + entering.added
    out: Array = q[OFFSET] + second_order(demand, float(q[TAU]), float(q[PRODUCT]), dt)
    for effect, where in zip(model.effects, model.where, strict=True):
        if effect.pedal is not None and effect.pedal.column is not None:
            out = effect.pedal.column(q[where], out, dt)
    return out
