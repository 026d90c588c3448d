"""Masks: stretches without a driver, or without valid inputs, left out of every fit."""

from __future__ import annotations

import numpy as np

from canid.effects import CATALOGUE
from canid.effects.effect import Effect, MaskInput
from canid.findings import Flags, Masked
from canid.runs import runs
from canid.types import LearnGate, Trace

# s; two stretches of one mask with less between them are reported as one
MIN_GAP_S = 1.0
# roles of the output that are a person's
PERSONAL = ("pedal", "steering_angle")


def recognise(trace: Trace, catalogue: tuple[Effect, ...] = CATALOGUE) -> tuple[Flags, tuple[Masked, ...]]:
    """Apply every mask of the catalogue to a drive.

    Args:
        trace: of a drive.
        catalogue: the effects; those without a mask are skipped.

    Returns:
        (n,) samples outside of every mask and of the driver's recovery after it; and the stretches, in the order of
        their starts, without recovery.

    Samples without a lead, at standstill, braked or hidden by the pedal's floor are handled by the learning gate and the
    likelihood: they stay True unless a mask covers them.
    """
    missing = np.array([gate is LearnGate.STALE for gate in trace.gate], dtype=bool)
    drive = mask_input(trace)._replace(missing=missing)
    usable = np.ones(trace.t.size, dtype=bool)
    found: list[Masked] = []
    for effect in catalogue:
        if effect.mask is None:
            continue
        flags = effect.mask(drive)
        usable &= ~extended(flags, round(effect.recovery / trace.dt))
        found += [Masked(effect.id, start, stop) for start, stop in stretches(flags, trace)]
    return usable, tuple(sorted(found, key=lambda masked: masked.start))


def mask_input(trace: Trace) -> MaskInput:
    """Return what masks are computed from."""
    return MaskInput(
        trace.t, trace.dt, trace.signals, trace.segment.astype(np.float64), output_role(trace) in PERSONAL
    )


def output_role(trace: Trace) -> str:
    """Return the role of the driver's output; "": none of the signals is it.

    A trace holds the output as a column of its own: the role is the one with the same column.

    Example:
        >>> import canid
        >>> output_role(canid.read_trace("replay_logs/following_urban.blf", "generic"))
        'pedal'
    """
    for role in ("pedal", "accel_command", "accel", "steering_angle"):
        column = trace.signals.get(role)
        if column is not None and np.array_equal(column, trace.output, equal_nan=True):
            return role
    return ""


def extended(flags: Flags, samples: int) -> Flags:
    """Extend each stretch of True by so many samples.

    Example:
        >>> extended(np.array([False, True, False, False, False]), 2)
        array([False,  True,  True,  True, False])
    """
    index = np.arange(flags.size)
    last = np.maximum.accumulate(np.where(flags, index, -1 - samples))
    out: Flags = index - last <= samples
    return out


def stretches(flags: Flags, trace: Trace) -> list[tuple[float, float]]:
    """Return start and stop of each stretch, s; those with less than `MIN_GAP_S` between them are one."""
    out: list[tuple[float, float]] = []
    for first, stop in runs(flags):
        start, end = float(trace.t[first]), float(trace.t[stop - 1] + trace.dt)
        if out and start - out[-1][1] < MIN_GAP_S:
            out[-1] = (out[-1][0], end)
        else:
            out.append((start, end))
    return out
