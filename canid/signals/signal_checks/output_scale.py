"""Is 100 % of a pedal its full travel: what says so, or within which limits the scale is open.

K in % of a pedal is as wrong as the pedal's scale is. The scale is known by the vehicle file, by the range in the database,
or by a pedal that was pressed to its stop near 100 %. Else full travel is only known to be no less than the highest reading
and no more than what the signal's bits can hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from canid.signals.signal_checks.pedal_scale import FULL_TRAVEL_PERCENT
from canid.values.runs import runs
from canid.values.types import NAN, Array, FullScale, SignalFinding

# %; a pedal at its stop reads no less: its sensor is calibrated to about a percent
STOP_PERCENT = 97.0
# %, s; at the stop it stands still, and for longer than while it passes
STOP_SPREAD_PERCENT, STOP_S = 0.5, 0.5

_NOT_CONFIRMED = "the pedal's scale is not confirmed: nothing shows that 100 % is its full travel"
_REMEDY = "; press it to its stop once while recording, or state full_scale in the vehicle file"


class OutputScale(NamedTuple):
    """How the full travel of a pedal is known, in % as it is read."""

    confirmed: bool
    source: str  # a clause: what says so
    value: float  # %: what is taken as full travel
    low: float  # %: full travel is no less
    high: float  # %: and no more; NaN: not known
    says: str  # a sentence without its full stop


def output_scale(
    output: Array, dt: float, stated: FullScale | None, findings: Iterable[SignalFinding] = ()
) -> OutputScale | None:
    """Judge the scale of a pedal by what is stated and what a drive shows; None: the output is no pedal of a vehicle file.

    Args:
        output: (n,) %, on the grid; NaN: not measured.
        dt: s.
        stated: from the vehicle file and the database.
        findings: on the drive's signals.

    Example:
        >>> half = np.array([0.0, 20.0, 61.0, 30.0])
        >>> scale = output_scale(half, 0.1, FullScale("", 255.0))
        >>> scale.confirmed, scale.low, scale.high
        (False, 61.0, 255.0)
        >>> output_scale(half, 0.1, FullScale("its range in the database ends at 100 %")).says
        'the pedal is in % of its full travel: its range in the database ends at 100 %'
    """
    if stated is None:
        return None
    known = output[np.isfinite(output)]
    top = float(known.max()) if known.size else NAN
    wrong = next((finding for finding in findings if finding.name == "pedal_scale"), None)
    source = "" if wrong is not None else stated.source or _stop(output, top, dt)
    if source:
        return OutputScale(
            True, source, 100.0, 100.0, 100.0, f"the pedal is in % of its full travel: {source}"
        )
    high = stated.highest if math.isfinite(stated.highest) else NAN
    return OutputScale(False, "", 100.0, top, high, _open(top, high))


def before_a_drive(stated: FullScale | None) -> str:
    """What is to be said of a pedal's scale where estimates are shown before the drive is over; "": it is known.

    Example:
        >>> before_a_drive(None), before_a_drive(FullScale("its range in the database ends at 100 %"))
        ('', '')
        >>> before_a_drive(FullScale("", 255.0)).partition(":")[2].partition(";")[0]
        ' nothing shows that 100 % is its full travel'
    """
    return "" if stated is None or stated.source else f"{_NOT_CONFIRMED}{_REMEDY}"


def _stop(output: Array, top: float, dt: float) -> str:
    """Where the pedal stood at its stop; "": nowhere."""
    if not STOP_PERCENT <= top <= FULL_TRAVEL_PERCENT:
        return ""
    at_stop = output >= top - STOP_SPREAD_PERCENT  # NaN compares as false
    longest = float(max(stop - first for first, stop in runs(at_stop))) * dt
    return f"it stood at {top:.1f} % for {longest:.1f} s, as at its stop" if longest >= STOP_S else ""


def _open(top: float, high: float) -> str:
    """What is not known of the scale, and what would decide it."""
    limits = [
        *([f"the highest reading is {top:.0f} %"] if top == top else []),
        *([f"its bits reach {high:.0f} %"] if high == high else []),
    ]
    factors = (100.0 / high if high == high else NAN, 100.0 / top if top > 0.0 else NAN)
    so = ""
    if factors[0] == factors[0] and factors[1] == factors[1] and factors[0] < factors[1]:
        so = f", so the true K may be {factors[0]:.2g} to {factors[1]:.2g} times as much"
    return f"{_NOT_CONFIRMED}{'; ' if limits else ''}{' and '.join(limits)}{so}{_REMEDY}"
