"""An output that is slower than the samples: which of them are its own readings, and the drive at those alone.

What stands between two readings is a line or the last one, so those samples hold nothing of the driver. A line even holds
the next reading: its noise has no innovation, and gains came out up to four times too large. Readings at every second to
fifth sample are fitted as they are. Where they come at other instants, samples are taken as far apart as they are: each
then holds a new reading, in a mean with its neighbour that leaves the gains alone and not the delays. So does a pedal that
the driver holds between movements: at every sample each movement answers the last step of the input alone, and gains came
out at a tenth of the truth.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.estimators.speed_difference import MIN_ROWS, thinned
from canid.mathematics.identification.rounding import decimals_step, lattice_step
from canid.values.types import Array, SignalFinding, Trace

Flags = npt.NDArray[np.bool_]

# samples from one reading to the next, at most: K, tau and theta hold at 0.5 s, and nothing was tried beyond
MAX_EVERY = 5
# of the samples between readings, that must be where a line or the last reading is; and at most of the others
BETWEEN_SHARE, OWN_SHARE = 0.95, 0.6
# of all samples, likewise, where readings come at any instants, four samples apart or more
IRREGULAR_SHARE = 0.5
# s; of a wheel angle: a driver who steers answers after 0.12 s at the earliest (McRuer & Jex 1967: 0.1 to 0.2 s). In samples
# farther apart the offset holds what the wheel did since the last one, and at 0.5 s K held on 1 of 3 drives
MAX_STEERING_S = 0.2
# findings of signals/signal_checks/slow_signals.py: an output that is slower than the samples, one that its driver holds
SLOW, HELD = "output_slow", "output_held"
# of the largest value, what floats make of a line, and of times that differ by less than a nanosecond
FLOAT_ROUNDING = 1e-9


class Stamps(NamedTuple):
    """Which samples of an output are fitted."""

    first: int  # sample of the first one
    every: int  # samples from one to the next
    between: str  # what the samples between readings hold, "line" or "hold"
    own: bool = True  # each is a reading; else each holds a new one


def stamps(output: Array, usable: Flags, slow: bool = False) -> Stamps | None:
    """Find the samples that are the output's own readings; None: all are, or it is not known.

    Args:
        output: (n,) of a drive.
        usable: (n,) samples that are fitted.
        slow: the output is known to be slower than the samples: its readings may be at any instants.

    Example:
        >>> readings = np.random.default_rng(1).standard_normal(200)
        >>> joined = np.interp(np.arange(597), 3 * np.arange(200), readings)
        >>> stamps(joined, np.ones(597, bool)), stamps(readings, np.ones(200, bool))
        (Stamps(first=0, every=3, between='line', own=True), None)
        >>> joined = np.interp(np.arange(895), 4.5 * np.arange(200), readings)
        >>> stamps(joined, np.ones(895, bool)), stamps(joined, np.ones(895, bool), slow=True)
        (None, Stamps(first=0, every=5, between='line', own=False))
    """
    known = usable & np.isfinite(output)
    inner = known[1:-1] & known[:-2] & known[2:]
    if np.count_nonzero(inner) < MIN_ROWS:
        return None
    y = output[1:-1]
    rounding = FLOAT_ROUNDING * float(np.abs(output[known]).max())
    resolution = max(lattice_step(output[known]), decimals_step(output[known]))
    limits = {"line": 1.05 * resolution + rounding, "hold": rounding}
    expected = {"line": 0.5 * (output[:-2] + output[2:]), "hold": output[:-2]}
    there = {between: np.abs(y - expected[between]) <= limits[between] for between in limits}
    for between, flags in there.items():
        regular = _regular(flags, inner, between)
        if regular is not None:
            return regular if regular.every <= MAX_EVERY else None
    for between, flags in there.items() if slow else ():
        if float(flags[inner].mean()) >= IRREGULAR_SHARE:
            # a reading between two samples bends the line at both
            readings = int(np.count_nonzero(inner[1:] & flags[:-1] & ~flags[1:]))
            every = math.ceil(int(np.count_nonzero(inner)) / max(readings, 1))
            return Stamps(0, min(every, 2 * MAX_EVERY), between, own=False)
    return None


def _regular(there: Flags, inner: Flags, between: str) -> Stamps | None:
    """Readings at regular samples; `there` (n - 2,) is where a sample is between two, of those that are `inner`."""
    number = np.arange(1, len(there) + 1)[inner]
    # the longest that fits: readings at every tenth sample are among those at every fifth
    for every in range(2 * MAX_EVERY, 1, -1):
        phase = number % every
        total = np.bincount(phase, minlength=every)
        share = np.bincount(phase, there[inner], every) / np.maximum(total, 1.0)
        first = int(share.argmin())
        if share[first] <= OWN_SHARE and np.delete(share, first).min() >= BETWEEN_SHARE:
            return Stamps(first, every, between)
    return None


def of_trace(trace: Trace, usable: Flags, held: bool) -> Stamps | None:
    """Find the samples of a drive that are fitted; None: all.

    Args:
        trace: of a drive, with the findings on its signals.
        usable: (n,) samples that are fitted.
        held: movements of an output that the driver holds are taken for readings.
    """
    names = {SLOW, HELD} if held else {SLOW}
    return stamps(trace.output, usable, any(finding.name in names for finding in trace.findings))


def at_own_stamps(trace: Trace, usable: Flags, *, held: bool = False) -> tuple[Trace, Flags]:
    """Take the samples that are the output's own readings; a drive whose samples all are stays as it is.

    Args:
        trace: of a drive.
        usable: (n,) samples that are fitted.
        held: take one sample a movement where the driver holds the output; a model of the holds needs all.
    """
    slower = of_trace(trace, usable, held)
    if slower is None:
        return trace, usable
    return thinned(trace, slower.every, slower.first), usable[slower.first :: slower.every]


def standing(trace: Trace) -> tuple[SignalFinding, ...]:
    """Findings on a drive's signals but that of a slow output whose own readings alone are fitted.

    Args:
        trace: of a drive, as it was read.
    """
    if stamps(trace.output, trace.learn) is None:
        return trace.findings
    return tuple(finding for finding in trace.findings if finding.name != SLOW)


def too_slow_to_steer(trace: Trace) -> str:
    """Why a wheel angle shows no answer of a driver who keeps the lane; "": it may.

    Args:
        trace: of a drive, at its output's own readings where they are known.
    """
    slow = any(finding.name == SLOW for finding in trace.findings)
    # of a slow wheel whose readings are not known no sample is one
    if trace.dt <= MAX_STEERING_S + FLOAT_ROUNDING and (not slow or trace.dt > 0.75 * MAX_STEERING_S):
        return ""
    return "the wheel angle comes too rarely: a driver answers an offset within its steps; record it at 10 Hz or more"


def says(trace: Trace) -> str:
    """Say what stands between the output's own readings; "": all samples are.

    Args:
        trace: of a drive, as it was read.
    """
    slower = of_trace(trace, trace.learn, held=True)
    if slower is None:
        return ""
    how = "joined by lines" if slower.between == "line" else "held in between"
    if slower.own:
        return f"the output comes every {slower.every * trace.dt:.1f} s, {how}: its own readings alone are fitted"
    return f"the output changes at instants of its own, {how}: each sample that is fitted holds a new reading"
