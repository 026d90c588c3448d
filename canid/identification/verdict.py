"""What can be told of a channel: the limits on standard deviations, the same for every method."""

from __future__ import annotations

import math

from canid.types import NAN, Channel, Identifiable, Interval

# s. tau and dead time are told apart where each is known to half of what drivers differ by (tau 0.4-0.7 s, dead time
# 0.2-0.4 s; Grover 2021), and the intervals are then believed: radar noise that whitening lifts moves tau up and
# dead time down by up to 0.2 s at the same sum, which windows that tell them less sharply hide in their width.
# The sum is not moved.
TAU_SD = 0.10
DEAD_TIME_SD = 0.05
# s, half of what the sum differs by between drivers. Without a limit the physical box itself (sd 1 s) would be
# reported as if it were knowledge.
SUM_SD = 0.20

# A gain is told where it is three standard deviations from zero: then its sign and its size mean something.
GAIN_RATIO = 3.0


def judge(
    K: Interval, K_sd: float, tau_sd: float, dead_time_sd: float, sum_sd: float, free: bool = True
) -> Identifiable:
    """Give the verdict from standard deviations; NaN counts as unknown.

    Args:
        K: the gain.
        K_sd: in K's unit.
        tau_sd: s.
        dead_time_sd: s.
        sum_sd: s, of tau + dead_time.
        free: False where a limit of ours, not the data, ends the intervals of tau or dead time.

    >>> judge(Interval(5.0, 4.0, 6.0), 0.5, 0.3, 0.3, 0.05)
    <Identifiable.SUM_ONLY: 'sum_only'>
    """
    if not (abs(K.value) >= GAIN_RATIO * K_sd and K.low * K.high > 0.0):
        return Identifiable.NOT
    if not free:
        return Identifiable.GAIN_ONLY
    if tau_sd <= TAU_SD and dead_time_sd <= DEAD_TIME_SD:
        return Identifiable.OK
    return Identifiable.SUM_ONLY if sum_sd <= SUM_SD else Identifiable.GAIN_ONLY


def told(status: Identifiable, K: Interval, tau: Interval, dead_time: Interval, total: Interval) -> Channel:
    """Build the channel with NaN for what the verdict says cannot be told.

    >>> told(Identifiable.GAIN_ONLY, Interval(1, 0.9, 1.1), Interval(), Interval(), Interval()).K.value
    1
    """
    if not all(math.isfinite(x) for x in _needed(status, K, tau, dead_time, total)):
        status = Identifiable.NOT
    nothing = Interval(NAN, NAN, NAN)
    return Channel(
        K=nothing if status is Identifiable.NOT else K,
        tau=tau if status is Identifiable.OK else nothing,
        dead_time=dead_time if status is Identifiable.OK else nothing,
        tau_plus_dead_time=total if status in (Identifiable.OK, Identifiable.SUM_ONLY) else nothing,
        status=status,
    )


def _needed(
    status: Identifiable, K: Interval, tau: Interval, dead_time: Interval, total: Interval
) -> tuple[float, ...]:
    if status is Identifiable.OK:
        return (*K, *tau, *dead_time, *total)
    return (*K, *total) if status is Identifiable.SUM_ONLY else tuple(K)
