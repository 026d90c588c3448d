"""Stretches in which no human answers, or no valid input arrives: recognised before anything is fitted."""

from __future__ import annotations

import numpy as np

from canid.effects import CATALOGUE
from canid.effects.cause import Drive
from canid.effects.runs import runs
from canid.findings import Flags, Masked
from canid.types import Gate, Trace

# s; two stretches of one cause with less between them are one for the reader
APART = 1.0
# the driver's output where a person gives it
PERSONAL = ("pedal", "steering_angle")


def recognise(trace: Trace) -> tuple[Flags, tuple[Masked, ...]]:
    """Find what masks each mask of the catalogue lays over a drive.

    Args:
        trace: of a drive.

    Returns:
        (n,) samples that no mask has taken, nor the time that the driver needs after it; and the stretches, in the
        order of their beginnings, without that time.

    What is missing, standing, braked, or hidden by the pedal's floor is the gate's and the likelihood's matter: those
    samples stay True unless a mask has taken them.
    """
    drive = view(trace)
    usable = np.ones(trace.t.size, dtype=bool)
    found: list[Masked] = []
    for effect in CATALOGUE:
        if effect.mask is None:
            continue
        flags = effect.mask(drive)
        if effect.id == "stale_signal":
            # what did not arrive at all was seen by the gate already
            flags = flags | np.array([gate is Gate.STALE for gate in trace.gate], dtype=bool)
        usable &= ~held(flags, round(effect.recovery / trace.dt))
        found += [Masked(effect.id, start, stop) for start, stop in stretches(flags, trace)]
    return usable, tuple(sorted(found, key=lambda masked: masked.start))


def view(trace: Trace) -> Drive:
    """Return what masks look at."""
    return Drive(
        trace.t, trace.dt, trace.signals, trace.segment.astype(np.float64), output_role(trace) in PERSONAL
    )


def output_role(trace: Trace) -> str:
    """Return the role that is the driver's output; "": none of the signals is.

    A trace holds the output as a column of its own: the role is the one whose column is the same.

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


def held(flags: Flags, samples: int) -> Flags:
    """Hold each True for so many samples more.

    Example:
        >>> held(np.array([False, True, False, False, False]), 2)
        array([False,  True,  True,  True, False])
    """
    index = np.arange(flags.size)
    last = np.maximum.accumulate(np.where(flags, index, -1 - samples))
    out: Flags = index - last <= samples
    return out


def stretches(flags: Flags, trace: Trace) -> list[tuple[float, float]]:
    """Return start and stop of each stretch, s; those with less than `APART` between them are one."""
    out: list[tuple[float, float]] = []
    for first, stop in runs(flags):
        start, end = float(trace.t[first]), float(trace.t[stop - 1] + trace.dt)
        if out and start - out[-1][1] < APART:
            out[-1] = (out[-1][0], end)
        else:
            out.append((start, end))
    return out
