"""Driving, behind a lead, usable: one definition for all verbs.

- driving: the person (or the controller, where that is identified) drives: no standstill, no reverse gear, no cruise control
  in the person's place, and the signals arrive;
- behind a lead: driving, and a vehicle ahead is followed, the seconds with the brake or a released pedal included;
- usable: the learning gate is open, its recovery is over, and no finding stands on a signal that the model needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from canid.mathematics.estimators import complementary_filter, output_stamps, speed_difference
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.types import Array, DriveTime, LearnGate, SignalFinding, Trace

# s; the estimators start with a batch of 15 s, of which 5 s may be what came before and behind the samples: less decides
# nothing, and does not show whether signals fit
FIRST_ESTIMATE_S = 10.0

Flags = npt.NDArray[np.bool_]

# gates with which somebody follows a lead
BEHIND_A_LEAD = frozenset(
    (LearnGate.OPEN, LearnGate.BRAKE, LearnGate.PEDAL_FLOOR, LearnGate.OUTPUT_LIMIT, LearnGate.LIMITED)
)
# gates with which nobody follows, but somebody drives
WITHOUT_A_LEAD = frozenset((LearnGate.NO_LEAD, LearnGate.TARGET_CHANGE, LearnGate.FREE_DRIVING))


def behind_a_lead(gates: Sequence[LearnGate]) -> Flags:
    """Where a vehicle ahead is followed, (n,).

    Example:
        >>> behind_a_lead([LearnGate.BRAKE, LearnGate.CRUISE])
        array([ True, False])
    """
    return np.array([gate in BEHIND_A_LEAD for gate in gates], dtype=bool)


def trusted(t: Array, findings: Iterable[SignalFinding]) -> Flags:
    """Where no finding on a signal that the model needs holds, (n,): from its onset, not from when it was known.

    Args:
        t: (n,) s.
        findings: of the drive.

    Example:
        >>> finding = SignalFinding("speed_unit", ("speed",), 1.0, 20.0, "", "", True, until=3.0)
        >>> trusted(np.arange(5.0), [finding])
        array([ True, False, False,  True,  True])
    """
    sound = np.ones(len(t), dtype=bool)
    for finding in findings:
        if finding.withholds:
            sound &= ~((t >= finding.since) & ~(t >= finding.until))
    return sound


def usable(trace: Trace) -> Flags:
    """Which samples may be learned from, (n,)."""
    return trace.learn & trusted(trace.t, trace.findings)


def fitted_trace(trace: Trace) -> Trace:
    """Return the drive as its driver is fitted.

    What a wrong signal has touched teaches nothing, and the limits of the output are those of the whole drive. Samples are
    the output's own readings, and as far apart as it spans as a difference of the recorded speed. A headway is that of a
    speed without steps, where the acceleration shows it.

    Args:
        trace: of the drive, with its findings.
    """
    trace = complementary_filter.with_fine_speed(with_limits(trace))
    used = usable(trace)
    if trace.findings and not used.all():
        bound = trace.bound
        if bound is not None:
            # what a wrong signal has touched bounds nothing either
            bound = np.where(trusted(trace.t, trace.findings), bound, math.nan)
        trace = trace._replace(learn=used, bound=bound)
    return speed_difference.without_common_noise(*output_stamps.at_own_stamps(trace, used, held=True))[0]


def drive_time(
    t: Array,
    gates: Sequence[LearnGate],
    learn: Flags,
    findings: Iterable[SignalFinding],
    dt: float,
    *,
    follows: bool = True,
) -> DriveTime:
    """Sum up a drive.

    Args:
        t: (n,) s.
        gates: (n,) of its samples.
        learn: (n,) of its samples.
        findings: on its signals.
        dt: s.
        follows: the task has a lead; without one (lane keeping) the time behind it is NaN.

    Example:
        >>> gates = [LearnGate.OPEN, LearnGate.BRAKE, LearnGate.NO_LEAD, LearnGate.CRUISE]
        >>> drive_time(np.arange(4.0), gates, np.array([True, False, False, False]), (), 1.0)
        DriveTime(total=4.0, driving=3.0, behind_lead=2.0, usable=1.0)
    """
    behind = behind_a_lead(gates)
    alone = np.array([gate in WITHOUT_A_LEAD for gate in gates], dtype=bool)
    counted = (behind | alone, behind, learn & trusted(t, findings))
    driving, following, used = (round(float(flags.sum()) * dt, 6) for flags in counted)
    return DriveTime(round(len(t) * dt, 6), driving, following if follows else math.nan, used)


def too_short(time: DriveTime) -> str:
    """Why no estimate can come of a log or a part of it that ends before the first one; "": it is long enough.

    Example:
        >>> too_short(DriveTime(2.0, 2.0, 2.0, 0.0))
        'the log, or the part of it that was read, is too short: an estimate takes 10 s or more'
    """
    if time.total >= FIRST_ESTIMATE_S:
        return ""
    # without its length: the first second and the last one have no samples
    return f"the log, or the part of it that was read, is too short: an estimate takes {FIRST_ESTIMATE_S:.0f} s or more"


def of_trace(trace: Trace) -> DriveTime:
    """Sum up a trace."""
    trace, follows = with_limits(trace), "lateral_offset" not in trace.input_names
    return drive_time(trace.t, trace.gate, trace.learn, trace.findings, trace.dt, follows=follows)
