"""An output that is slower than the samples: which of them are its own readings, and the drive at those alone.

What stands between two readings is a line or the last one, so half of its samples hold nothing of the driver. A line even
holds the next reading: its noise has no innovation, and gains came out up to four times too large.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.estimators.speed_difference import MIN_ROWS, thinned
from canid.mathematics.identification.rounding import lattice_step
from canid.values.types import Array, SignalFinding, Trace

Flags = npt.NDArray[np.bool_]

# samples between readings; at three, 0.3 s, delays are not identified (signals/signal_checks/slow_signals.py)
EVERY = 2
# of the samples between readings, that must be where a line or the last reading is; and at most of the others
BETWEEN_SHARE, OWN_SHARE = 0.95, 0.6
# finding of an output that is slower than the samples (signals/signal_checks/slow_signals.py)
SLOW = "output_slow"
# of the largest value, what floats make of a line, and of times that differ by less than a nanosecond
FLOAT_ROUNDING = 1e-9


class Stamps(NamedTuple):
    """Where an output has its own readings."""

    first: int  # sample of the first one; they are every `EVERY`
    between: str  # what the samples between them hold, "line" or "hold"


def stamps(output: Array, usable: Flags) -> Stamps | None:
    """Find the samples that are the output's own readings; None: all are, or it is not known.

    Args:
        output: (n,) of a drive.
        usable: (n,) samples that are fitted.

    Example:
        >>> readings = np.random.default_rng(1).standard_normal(200)
        >>> joined = np.interp(np.arange(398), 2 * np.arange(200), readings)
        >>> stamps(joined, np.ones(398, bool)), stamps(readings, np.ones(200, bool))
        (Stamps(first=0, between='line'), None)
    """
    known = usable & np.isfinite(output)
    inner = known[1:-1] & known[:-2] & known[2:]
    if np.count_nonzero(inner) < MIN_ROWS:
        return None
    y = output[1:-1]
    rounding = FLOAT_ROUNDING * float(np.abs(output[known]).max())
    limits = {"line": 1.05 * lattice_step(output[known]) + rounding, "hold": rounding}
    odd = np.arange(1, len(output) - 1) % EVERY == 1
    for between, expected in (("line", 0.5 * (output[:-2] + output[2:])), ("hold", output[:-2])):
        there = np.abs(y - expected) <= limits[between]
        shares = [
            float(there[inner & (odd == k)].mean()) if (inner & (odd == k)).any() else 0.0 for k in (0, 1)
        ]
        low, high = sorted(shares)
        if high >= BETWEEN_SHARE and low <= OWN_SHARE:
            # samples of an odd number hold nothing of their own where theirs is the larger share
            return Stamps(0 if shares[1] == high else 1, between)
    return None


def at_own_stamps(trace: Trace, usable: Flags) -> tuple[Trace, Flags]:
    """Take the samples that are the output's own readings; a drive whose samples all are stays as it is.

    Args:
        trace: of a drive.
        usable: (n,) samples that are fitted.
    """
    slower = stamps(trace.output, usable)
    if slower is None:
        return trace, usable
    return thinned(trace, EVERY, slower.first), usable[slower.first :: EVERY]


def standing(trace: Trace) -> tuple[SignalFinding, ...]:
    """Findings on a drive's signals but that of a slow output whose own readings alone are fitted.

    Args:
        trace: of a drive, as it was read.
    """
    if stamps(trace.output, trace.learn) is None:
        return trace.findings
    return tuple(finding for finding in trace.findings if finding.name != SLOW)


def says(trace: Trace) -> str:
    """Say what stands between the output's own readings; "": all samples are.

    Args:
        trace: of a drive, as it was read.
    """
    slower = stamps(trace.output, trace.learn)
    if slower is None:
        return ""
    how = "joined by lines" if slower.between == "line" else "held in between"
    return f"the output comes every {EVERY * trace.dt:.1f} s, {how}: its own readings alone are fitted"
