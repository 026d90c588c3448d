"""Columns of the driver's block: inputs and output without holes, and which samples are usable."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.models.diagnosis.causal_smoothing import Lagged, Motion, lagged
from canid.models.diagnosis.fitting.likelihood import Output
from canid.models.effects.effect import Seen
from canid.values.findings import Flags
from canid.values.types import Array, LearnGate, Trace

# %; one step of an 8-bit pedal sensor: at or below it the pedal may be released (as `canid.learning_gate`)
PEDAL_FLOOR_PERCENT = 0.5
# %; there the pedal itself ends
PEDAL_END_PERCENT = 99.0
# s from the brake back to the pedal
BRAKE_TO_PEDAL_S = 1.0
# s; dead times up to here use all that was reported until now
KNOWN_LAGS_S = 1.5
# s; the longest memory of the driver that is modelled: dead time and three lags
DRIVER_MEMORY_S = 2.5


class DriverData(NamedTuple):
    """Columns (n,) of one drive on its grid."""

    seen: Seen  # undelayed; holes filled
    known: Lagged  # gap and range rate at each lag, from what was reported until now
    output: Output
    pedal: bool  # is the output a pedal, with a floor?
    begins: tuple[float, ...] = ()  # s, of each further drive
    sideways: Array | None = None  # (n,) m/s², size of the lateral acceleration in bends; None: not measured

    @property
    def t(self) -> Array:
        """(n,) s since the first sample."""
        return np.asarray(self.seen.t)

    def with_output(self, output: Output) -> DriverData:
        """Return the same drive with another output."""
        return self._replace(output=output)


def filled(x: Array) -> Array:
    """Fill holes: straight across, held at the ends; all missing: 0.

    Example:
        >>> filled(np.array([np.nan, 1.0, np.nan, 3.0]))
        array([1., 1., 2., 3.])
    """
    known = np.isfinite(x)
    if not known.any():
        return np.zeros_like(x)
    index = np.arange(x.size)
    return np.interp(index, index[known], x[known])


def braking(trace: Trace) -> Flags:
    """Samples (n,) with the brake pressed; nowhere, where it is not measured."""
    out: Flags = np.nan_to_num(trace.signals.get("brake", np.zeros(trace.t.size))) > 0.5
    return out


def prepare(
    trace: Trace,
    usable: Flags,
    begins: tuple[float, ...] = (),
    motions: tuple[Motion, Motion] | None = None,
) -> DriverData:
    """Lay out the columns.

    Args:
        trace: of a drive.
        usable: (n,) samples that no mask has taken.
        begins: s, of each further drive on the trace.
        motions: those that the driver follows; None: estimated.
    """
    signals, n = trace.signals, trace.t.size
    speed, gap = signals.get("speed", np.full(n, np.nan)), signals.get("gap", np.full(n, np.nan))
    rate = signals.get("range_rate", np.full(n, np.nan))
    with np.errstate(divide="ignore", invalid="ignore"):
        headway = np.where(speed > 1.0, gap / speed, np.nan)
    known = np.isfinite(headway) & np.isfinite(rate) & np.isfinite(trace.output)
    pedal = trace.signals.get("pedal") is not None and bool(
        np.allclose(np.nan_to_num(trace.output), np.nan_to_num(trace.signals["pedal"]))
    )
    below = pedal & (trace.output <= PEDAL_FLOOR_PERCENT)
    # the floor hides the demand, and so does the brake while the pedal is up: both are "below", not lost
    hidden = np.array([gate in (LearnGate.PEDAL_FLOOR, LearnGate.BRAKE) for gate in trace.gate], dtype=bool)
    lower, upper = at_limits(trace, pedal)
    below, hidden = below | lower.at, hidden | lower.at | upper.at
    shown = (LearnGate.OPEN, LearnGate.OUTPUT_LIMIT)
    open_ = np.array([gate in shown for gate in trace.gate], dtype=bool) & ~(lower.at | upper.at)
    brake = braking(trace)
    back = _within(brake, BRAKE_TO_PEDAL_S, trace.dt) & ~below
    settled = ~_within(~(open_ | hidden) | ~known, DRIVER_MEMORY_S, trace.dt)
    fine = usable & known & settled & ~back & (open_ | (hidden & (below | upper.at)))
    filled_speed = filled(speed)
    reports = [filled(signals[role]) for role in ("gap", "range_rate")]
    for k, role in enumerate(("gap_reported", "range_rate_reported")):
        if role in signals and np.isfinite(signals[role]).mean() > 0.5 * np.isfinite(reports[k]).mean():
            reports[k] = signals[role]
    new = np.r_[True, np.diff(trace.segment) != 0] if n else np.zeros(0, dtype=bool)
    lags = round(KNOWN_LAGS_S / trace.dt)
    known_then = lagged(reports[0], reports[1], filled_speed, new, lags, trace.dt, motions)
    t = trace.t - trace.t[0] if n else trace.t
    seen = Seen(
        t,
        float(t[-1]) if n else 0.0,
        filled(headway),
        filled(rate),
        filled(gap),
        filled_speed,
        known_then.lead_accel[:, 0],
    )
    floor = max(lower.bound, PEDAL_FLOOR_PERCENT) if pedal else lower.bound
    output = Output(filled(trace.output), fine, below & fine, floor, upper.at & fine, upper.bound, trace.dt)
    return DriverData(seen, known_then, output, pedal, begins, sideways(trace))


def sideways(trace: Trace) -> Array | None:
    """Size of the lateral acceleration, (n,) m/s²: of the yaw rate or the curvature, where one is measured."""
    n = trace.t.size
    speed, turn, bend = (
        trace.signals.get(role, np.full(n, np.nan)) for role in ("speed", "yaw_rate", "curvature")
    )
    measured = speed * turn if np.isfinite(turn).any() else speed * speed * bend
    return filled(np.abs(measured)) if np.isfinite(measured).any() else None


class AtLimit(NamedTuple):
    """Samples at one limit of the output."""

    at: Flags  # (n,)
    bound: float  # of the demand there; infinite where there are none


def at_limits(trace: Trace, pedal: bool = False) -> tuple[AtLimit, AtLimit]:
    """Samples at the lower and at the upper limit of the output, a pedal at 0 % apart.

    A pedal that is never pressed beyond less than its travel is a cause that the diagnosis may name: no limit here.
    """
    at = np.array([gate is LearnGate.OUTPUT_LIMIT for gate in trace.gate], dtype=bool)
    bound = np.full(at.size, np.nan) if trace.bound is None else trace.bound
    low, high = at & (trace.output <= bound), at & (trace.output > bound)
    if pedal:
        high &= bound >= PEDAL_END_PERCENT
    return (
        AtLimit(low, float(np.max(bound[low], initial=-np.inf))),
        AtLimit(high, float(np.min(bound[high], initial=np.inf))),
    )


def _within(flags: Flags, span: float, dt: float) -> Flags:
    """True for `span` s after each flag."""
    index = np.arange(flags.size)
    last = np.maximum.accumulate(np.where(flags, index, -(10**9)))
    return index - last <= round(span / dt)
