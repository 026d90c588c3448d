"""Complementary filter (Higgins 1975) of a speed that comes in steps with the recorded acceleration.

Between two steps a rounded speed stands still while the car does not: its error is what the driver has done since, so it is
not independent of the output, and headway = gap/speed holds it. With steps of 1 m/s K of range rate came out 1 to 3 % too
large. The acceleration knows how the speed moves, and the rounded speed, averaged over some ten seconds, where it is.
"""

from __future__ import annotations

import numpy as np

from canid.mathematics.identification.rounding import lattice_step
from canid.values.runs import runs
from canid.values.types import Array, Trace

HELD, NEEDED = "headway_error", ("gap", "speed", "accel")
# m/s; rounding to less is below the noise of wheel speeds (signals/samples/own_speed.py)
MIN_STEP = 0.1
# of the samples, in which the value may change: one that changes more often shows its rounding as noise
MAX_CHANGES_SHARE = 0.3
# s, twice: a speed crosses steps of 1 m/s every 3 s in traffic, and an acceleration's offset of 0.1 m/s² changes nothing
WINDOW_S = 10.0
# of the samples, that must be within a step of what was recorded: else the acceleration is not that of this speed
WITHIN_SHARE = 0.95


def with_fine_speed(trace: Trace) -> Trace:
    """Take the headway error from a speed without steps, where its acceleration is recorded; else the drive as it is.

    Args:
        trace: of a drive, at the rate at which it was sampled.
    """
    signals = trace.signals
    if HELD not in trace.input_names or not all(role in signals for role in NEEDED):
        return trace
    gap, speed, accel = (signals[role] for role in NEEDED)
    fine = fine_speed(speed, accel, trace.t, trace.dt)
    if fine is None:
        return trace
    inputs, i = trace.inputs.copy(), trace.input_names.index(HELD)
    moving = np.isfinite(fine) & (np.minimum(fine, speed) > 0.0)
    inputs[moving, i] += gap[moving] / fine[moving] - gap[moving] / speed[moving]
    return trace._replace(inputs=inputs)


def fine_speed(speed: Array, accel: Array, t: Array, dt: float) -> Array | None:
    """Speed without its steps, (n,) m/s; NaN where the acceleration is not known; None: it is not coarse, or does not fit.

    Args:
        speed: (n,) m/s, NaN where not measured.
        accel: (n,) m/s², likewise.
        t: (n,) s.
        dt: s, between samples.

    Example:
        >>> t = 0.1 * np.arange(1200)
        >>> true = 20.0 + 3.0 * np.sin(0.2 * t)
        >>> fine = fine_speed(np.round(true), 0.6 * np.cos(0.2 * t), t, 0.1)
        >>> [round(float(np.std(x - true)), 2) for x in (np.round(true), fine)]
        [0.27, 0.04]
    """
    known = np.isfinite(speed)
    step = lattice_step(speed[known])
    changes = float(np.mean(np.diff(speed[known]) != 0.0)) if step >= MIN_STEP else 1.0
    if changes > MAX_CHANGES_SHARE:
        return None
    both = known & np.isfinite(accel)
    out = np.full(len(speed), np.nan)
    # not over a pause
    begins = np.flatnonzero(np.diff(t) > 1.5 * dt) + 1
    for piece in np.split(np.arange(len(t)), begins):
        for first, stop in runs(both[piece]):
            part = piece[first:stop]
            moved = np.concatenate([[0.0], np.cumsum(0.5 * dt * (accel[part][1:] + accel[part][:-1]))])
            out[part] = moved + _mean(_mean(speed[part] - moved, dt), dt)
    if not both.any() or float(np.mean(np.abs(out - speed)[both] <= step)) < WITHIN_SHARE:
        return None
    return out


def _mean(x: Array, dt: float) -> Array:
    """Moving average over `WINDOW_S`, (n,); over what there is of it at the ends, as far to either side."""
    sums = np.concatenate([[0.0], np.cumsum(x)])
    k = np.arange(len(x))
    reach = np.minimum(np.minimum(k, k[::-1]), round(0.5 * WINDOW_S / dt))
    out: Array = (sums[k + reach + 1] - sums[k - reach]) / (2 * reach + 1)
    return out
