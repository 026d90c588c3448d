"""Identifiability of a channel: which of K, tau, dead time and their sum may be quoted. The only place that decides it.

Every method (FOPDT, ARMAX, the diagnosis) judges with its own standard deviations, by the same limits. They are those of
the Cramér-Rao bound at the fitted point, not of the posterior: a narrow parameter box would make anything look identifiable.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from statistics import NormalDist

from canid.mathematics.identification.confidence import NORMAL_QUANTILE, TAIL
from canid.values.types import NAN, Channel, Identifiable, Interval, Progress

# s. tau and dead time are quoted separately where each is known to half of what drivers differ by (tau 0.4-0.7 s, dead
# time 0.2-0.4 s; Grover 2021), and the intervals are then believed: radar noise that whitening amplifies moves tau up
# and dead time down by up to 0.2 s at the same sum, which windows with less information hide in their width.
# The sum is not moved.
TAU_SD = 0.10
DEAD_TIME_SD = 0.05
# s, half of what the sum differs by between drivers. Without a limit the physical box itself (sd 1 s) would be
# reported as if it were knowledge.
SUM_SD = 0.20

# A gain is quoted where it is three standard deviations from zero: then its sign and its size mean something.
GAIN_RATIO = 3.0
# From so many on, that only large ones are quoted moves no end of an interval by a hundredth of its width.
SURE_RATIO = 6.5

# The parameters of a `Channel`.
PARAMETERS = ("K", "tau", "dead_time", "tau_plus_dead_time")

# Fields of a `Channel` that may be quoted.
QUOTABLE: Mapping[Identifiable, tuple[str, ...]] = {
    Identifiable.OK: ("K", "tau", "dead_time", "tau_plus_dead_time"),
    Identifiable.SUM_ONLY: ("K", "tau_plus_dead_time"),
    Identifiable.GAIN_ONLY: ("K",),
    Identifiable.NOT: (),
}


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
        free: False where a limit of the search, not the data, ends the intervals of tau or dead time.

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


def apart(intervals: Sequence[Interval]) -> bool:
    """Whether some two intervals have no point in common.

    >>> apart([Interval(1.0, 0.0, 2.0), Interval(2.0, 1.0, 3.0)]), apart([Interval(1, 0, 2), Interval(4, 3, 5)])
    (False, True)
    """
    return any(a.low > b.high or b.low > a.high for a, b in combinations(intervals, 2))


# s; what would take longer than a day more is not worth a number
MAX_SECONDS = 86_400.0

# s. Information comes in bursts, one with each manoeuvre of the lead, and an sd depends on the estimate, which moves. On
# simulated drives the log of the total time over that of a constant rate has an sd of 0.53 after 65 s, 0.30 after 185 s
# and 0.16 after 620 s: sqrt(17 s / t). Close to the goal the time with the highest probability of being within a factor
# of 2 is 1.3 times the median, which is the median of 30 s.
BURST_S = 30.0

_NORMAL = NormalDist()


def progress(
    status: Identifiable,
    K: Interval,
    sd: Sequence[float],
    box_sd: Sequence[float],
    used: float,
    free: bool = True,
) -> Progress | None:
    """Say what keeps a channel from the next verdict, and how much more such driving would do.

    Information grows with the time; that of the box is there from the beginning. The seconds are the median of the
    predictive distribution, given that the next verdict is not reached yet.

    Args:
        status: the verdict.
        K: the gain.
        sd: of K, tau, dead time and their sum, what the data and the box know them to.
        box_sd: of the same, by the box alone; infinite for K.
        used: s of data.
        free: False where a limit of the search ends the intervals; the gain does not depend on it.

    >>> sd, box = (0.5, 0.2, 0.1, 0.05), (math.inf, math.inf, math.inf, math.inf)
    >>> missing = progress(Identifiable.SUM_ONLY, Interval(5.0, 4.0, 6.0), sd, box, 60.0)
    >>> missing.parameter, missing.needed, round(missing.seconds)
    ('tau', 0.1, 185)
    """
    needed = dict(zip(PARAMETERS, (abs(K.value) / GAIN_RATIO, TAU_SD, DEAD_TIME_SD, SUM_SD), strict=True))
    next_verdict = {
        Identifiable.NOT: ("K",),
        Identifiable.GAIN_ONLY: ("tau_plus_dead_time",),
        Identifiable.SUM_ONLY: ("tau", "dead_time"),
        Identifiable.OK: (),
    }[status]
    known = dict(zip(PARAMETERS, zip(sd, box_sd, strict=True), strict=True))
    out: list[Progress] = []
    for name in next_verdict:
        now, box = known[name]
        if not (math.isfinite(now) and now > 0.0 and needed[name] > 0.0):
            continue
        goal = needed[name] if name != "K" else _of_one_sign(abs(K.value), now) / GAIN_RATIO
        of_data = now**-2 - box**-2
        ratio = (goal**-2 - box**-2) / of_data if of_data > 0.0 else NAN
        possible = (free or name == "K") and ratio > 0.0
        seconds = used * (median_of_total(ratio, used) - 1.0) if possible else NAN
        out.append(Progress(name, now, needed[name], seconds if seconds <= MAX_SECONDS else NAN))
    return max(out, key=lambda p: p.sd / p.needed) if out else None


def _of_one_sign(value: float, sd: float) -> float:
    """Mean of a Gaussian given that it is positive: the sign of a gain is known before its size is."""
    z = value / sd
    return value + sd * _NORMAL.pdf(z) / _NORMAL.cdf(z)


def median_of_total(ratio: float, used: float) -> float:
    """Median time at which the information suffices, in shares of the time used.

    The log of it is normal about the log of `ratio` with variance BURST_S / used, and positive: it was not enough yet.

    Args:
        ratio: the information needed over that gained.
        used: s of data.

    >>> round(median_of_total(4.0, 600.0), 2), round(median_of_total(1.0, 60.0), 2)
    (4.0, 1.61)
    """
    spread = math.sqrt(BURST_S / used)
    centre = max(math.log(ratio), 0.0)
    return math.exp(centre - spread * _NORMAL.inv_cdf(0.5 * _NORMAL.cdf(centre / spread)))


def channel(
    status: Identifiable, K: Interval, tau: Interval, dead_time: Interval, total: Interval
) -> Channel:
    """Build the channel: every interval for what it is worth; the status says which may be quoted.

    NaN only for what was not estimated. Where the status asks for more than was estimated, nothing may be quoted.

    >>> channel(Identifiable.GAIN_ONLY, Interval(1, 0.9, 1.1), Interval(0.7, 0.0, 1.9), Interval(), Interval()).tau
    Interval(value=0.7, low=0.0, high=1.9)
    """
    estimated = Channel(K, tau, dead_time, total, status)
    if not all(math.isfinite(x) for name in QUOTABLE[status] for x in getattr(estimated, name)):
        return estimated._replace(status=Identifiable.NOT)
    return estimated


def gain_only(channel: Channel, why: str = "") -> Channel:
    """Leave at most the gain to be quoted, for a reason: what is not the driver's is in the delays.

    >>> gain_only(Channel(status=Identifiable.SUM_ONLY)).status
    <Identifiable.GAIN_ONLY: 'gain_only'>
    """
    delayed = channel.status in (Identifiable.OK, Identifiable.SUM_ONLY)
    return _left(channel, Identifiable.GAIN_ONLY, why) if delayed else channel


def sum_only(channel: Channel, why: str = "") -> Channel:
    """Leave at most the gain and tau + dead time to be quoted, for a reason.

    >>> sum_only(Channel(status=Identifiable.OK)).status
    <Identifiable.SUM_ONLY: 'sum_only'>
    """
    apart = channel.status is Identifiable.OK
    return _left(channel, Identifiable.SUM_ONLY, why) if apart else channel


def not_quotable(channel: Channel, why: str = "") -> Channel:
    """Leave nothing to be quoted, for a reason.

    >>> not_quotable(Channel(status=Identifiable.OK), "the gains changed")
    Channel(not_identifiable, the gains changed)
    """
    return _left(channel, Identifiable.NOT, why)


def _left(channel: Channel, status: Identifiable, why: str) -> Channel:
    return channel._replace(status=status, progress=None, withheld=why or channel.withheld)


def with_gain(channel: Channel, K: Interval) -> Channel:
    """Give a channel another gain; where that may be zero, nothing may be quoted.

    >>> with_gain(Channel(status=Identifiable.OK), Interval(1.0, -0.5, 2.5)).status
    <Identifiable.NOT: 'not_identifiable'>
    """
    changed = channel._replace(K=K)
    return changed if K.low * K.high > 0.0 else not_quotable(changed)


def given_quoted(channels: Mapping[str, Channel]) -> dict[str, Channel]:
    """Channels whose gains reach down to what a gain that was quoted by chance may be (Zhong & Prentice 2008).

    Of gains that are one or two standard deviations from zero, those alone are quoted that noise has made too large. The end
    next to zero is that of a normal distribution without what is below `GAIN_RATIO`.

    >>> known = {f"{x}": Channel(Interval(x, x - 2.0, x + 2.0), status=Identifiable.GAIN_ONLY) for x in (3, 4.5, 7)}
    >>> [round(channel.K.low, 2) for channel in given_quoted(known).values()]
    [0.0, 1.47, 5.0]
    """
    return {name: _given_quoted(c) if quotable(c, "K") else c for name, c in channels.items()}


def _given_quoted(channel: Channel) -> Channel:
    value, low, high = channel.K
    half = value - low if value > 0.0 else high - value
    z = NORMAL_QUANTILE * abs(value) / half if half > 0.0 else math.inf
    if z > SURE_RATIO:
        return channel
    near, far = 0.0, max(z - NORMAL_QUANTILE, 0.0)
    while near < (mean := 0.5 * (near + far)) < far and far - near > 1e-9:
        # a gain that comes out so large, of those that come out large enough to be quoted
        certain = math.erfc((z - mean) * 0.5**0.5) > TAIL * math.erfc((GAIN_RATIO - mean) * 0.5**0.5)
        near, far = (near, mean) if certain else (mean, far)
    end = math.copysign(near * abs(value) / z, value)
    return channel._replace(K=Interval(value, end, high) if value > 0.0 else Interval(value, low, end))


def quotable(channel: Channel, name: str) -> bool:
    """Whether a field of a channel may be quoted.

    >>> quotable(Channel(status=Identifiable.SUM_ONLY), "tau")
    False
    """
    return name in QUOTABLE[channel.status]
