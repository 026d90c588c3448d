"""What speaks against a fitted model, beyond its intervals: sentences that refuse it, and remarks.

A model may be refused for four reasons: it explains no more than the mean; a gain has the wrong sign
(`status.implausible`); a delay is at the end of its range; the closed loop that it describes is unstable. A large part
of the response that is left over in the residuals of a whole drive speaks against its delays alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from canid.mathematics.estimators import status
from canid.mathematics.identification import closed_loop_stability
from canid.mathematics.identification.confidence import QUANTILES
from canid.mathematics.identification.fopdt.grid_search import Optimum
from canid.mathematics.identification.identifiability import QUOTABLE, apart
from canid.values.text.names import readable
from canid.values.text.numbers import number
from canid.values.types import TASK_INPUTS, Channel, Identifiable, Interval, ResidualTests

# What all estimators may give, its symbol, and its unit.
WORDS = {
    "K": ("K", ""),
    "tau": ("tau", " s"),
    "dead_time": ("dead time", " s"),
    "tau_plus_dead_time": ("tau + dead time", " s"),
}

# Share of a range beyond which half of what is believed of a delay lies at its end. On 2,700 channels of clean
# simulated drives with delays inside the range none was there.
EDGE_SHARE = 0.9
# Share of a range that an interval ends within where the range ends it.
TOUCHING_SHARE = 0.98

# Share of the intervals' content in the unstable region from which on the loop is called unstable: the bulk of a
# 95 % interval.
UNSTABLE_SHARE = QUANTILES[1]

# Left-over response over the model's own, in whitened rms, beyond which no delay of a whole drive may be quoted. What
# sensors add to the inputs leaves some too, so the 99 % test alone is failed by most clean drives of 10 minutes; below
# this the intervals of tau + dead time hold the truth as often as without, above it half as often, while those of K
# hold it as before (table `residuals` of docs/evidence/identification.md).
MAX_LEFT_OVER = 0.4
# The same beyond which the gain may not be quoted either: more of the response is left over than the model gives.
MAX_LEFT_OVER_OF_GAIN = 1.0

# Share of what is known of a parameter that a declared prior brought, from which on a reader is to know it: more than half.
MENTIONED_PRIOR_SHARE = 0.5

# Roles of an output that is the vehicle's acceleration: the loop then needs no model of the vehicle.
ACCELERATIONS = ("accel", "accel_command")


class Ranges(NamedTuple):
    """Ends of the ranges in s."""

    tau_max: float
    dead_time_max: float
    section: str = ""  # of the vehicle file that sets them; empty: nobody can


# Of a search without ranges: no delay is at their end.
UNLIMITED = Ranges(math.inf, math.inf)


class Following(NamedTuple):
    """About what the car-following loop is linearised."""

    speed: float  # m/s
    headway: float  # s


class Verdict(NamedTuple):
    """What was found against a model."""

    refused: tuple[str, ...]  # reasons not to report it
    remarks: tuple[str, ...]  # what a reader should know


def judge(
    channels: Mapping[str, Channel],
    fit_percent: float,
    ranges: Ranges,
    following: Following | None = None,
) -> Verdict:
    """Judge a fit whose channels may be quoted.

    Args:
        channels: input name -> Channel.
        fit_percent: of the simulated response; NaN: not known.
        ranges: of the search.
        following: the loop, where the output is an acceleration and the delays are the driver's; None: not known.

    >>> found = Channel(Interval(0.6, 0.5, 0.7), Interval(0.4, 0.3, 0.5), Interval(0.3, 0.2, 0.4))
    >>> right = {"range_rate": found._replace(status=Identifiable.OK)}
    >>> judge(right, 40.0, Ranges(3.0, 1.5))
    Verdict(refused=(), remarks=())
    >>> judge(right, -12.0, Ranges(3.0, 1.5)).refused[0].partition(" (")[0]
    'the model explains no more than the mean'
    """
    quoted = {name: c for name, c in channels.items() if c.status is not Identifiable.NOT}
    if not quoted:
        return Verdict((), ())
    refused, remarks = _at_ends(quoted, ranges)
    remarks += _of_prior(quoted)
    unstable, mentioned = _loop(channels, following)
    wrong = status.implausible(channels)
    every = (_mean(fit_percent), wrong, *refused, unstable)
    return Verdict(tuple(filter(None, every)), tuple(filter(None, (*remarks, mentioned))))


def _mean(fit_percent: float) -> str:
    if not fit_percent <= 0.0:
        return ""
    return (
        f"the model explains no more than the mean (fit {number(fit_percent, '%', 2)}): other causes of the output hide the "
        "response to the inputs"
    )


def _at_ends(channels: Mapping[str, Channel], ranges: Ranges) -> tuple[list[str], list[str]]:
    """Delays at the end of their range, and intervals that only end there."""
    refused, remarks = [], []
    for name, c in channels.items():
        delays: tuple[tuple[str, str, Interval, float], ...] = (
            ("tau", "tau_max", c.tau, ranges.tau_max),
            ("dead time", "dead_time_max", c.dead_time, ranges.dead_time_max),
        )
        for word, setting, delay, end in delays:
            where = f"{name.replace('_', ' ')}: "
            if delay.value > EDGE_SHARE * end:
                remedy = f"raise {setting} in [{ranges.section}], or " if ranges.section else ""
                refused.append(
                    f"{where}{word} is at the end of its range, {end:.1f} s: {remedy}the response is no reaction"
                )
            elif delay.high > TOUCHING_SHARE * end:
                remarks.append(f"{where}the interval of {word} ends with its range, {end:.1f} s")
    return refused, remarks


def _of_prior(channels: Mapping[str, Channel]) -> list[str]:
    """Say of which parameters more is known from a declared prior than from the data."""
    out = []
    for name, c in channels.items():
        shares = [
            f"{_WORDS[parameter]} ({100.0 * share:.0f} %)"
            for parameter, share in c.prior_weights.items()
            if parameter in QUOTABLE[c.status] and share >= MENTIONED_PRIOR_SHARE
        ]
        if shares:
            out.append(f"{name.replace('_', ' ')}: mostly from the declared prior: {', '.join(shares)}")
    return out


_WORDS = {"K": "K", "tau": "τ", "dead_time": "θ", "tau_plus_dead_time": "τ+θ"}


def _loop(channels: Mapping[str, Channel], following: Following | None) -> tuple[str, str]:
    """Sentence that refuses an unstable loop, and the remark where stable ones are in the intervals too."""
    if following is None or tuple(channels) != TASK_INPUTS["car_following"]:
        return "", ""
    both = tuple(channels.values())
    if not all(math.isfinite(x) for c in both for x in (*c.K, *c.tau, *c.dead_time)):
        return "", ""
    if not closed_loop_stability.is_unstable(both, *following):
        return "", ""
    at = f"at {following.speed:.0f} m/s"
    if closed_loop_stability.unstable_share(both, *following) >= UNSTABLE_SHARE:
        return (
            f"with these gains and delays the following would be unstable {at}: check units and signs in the "
            "vehicle file (canid check); else the model does not hold"
        ), ""
    # a gain that is not distinguishable from zero is as often of the wrong sign, which is unstable
    sure = all(c.status is not Identifiable.NOT for c in both)
    return (
        "",
        f"the estimates themselves would be unstable {at}; their intervals hold stable ones" if sure else "",
    )


def several_answers(names: Sequence[str], optima: Sequence[Optimum]) -> dict[str, str]:
    """Inputs whose gains are withheld since the data leave two answers that exclude each other, and what to say of each.

    Args:
        names: of the inputs.
        optima: the answers that fit about as well, the likeliest first.

    >>> one = Channel(Interval(0.4, 0.3, 0.5), status=Identifiable.GAIN_ONLY)
    >>> two = one._replace(K=Interval(1.7, 1.2, 2.2))
    >>> several_answers(["range_rate"], [Optimum((one,), 0.8), Optimum((two,), 0.2)])["range_rate"].partition(":")[0]
    'range rate'
    >>> several_answers(["range_rate"], [Optimum((one,), 0.8), Optimum((one,), 0.2)])
    {}
    """
    out = {}
    for i, name in enumerate(names):
        gains = [optimum.channels[i].K for optimum in optima]
        if gains and apart(gains):
            answers = " or ".join(f"{K.value:.2f} [{K.low:.2f}, {K.high:.2f}]" for K in gains)
            out[name] = (
                f"{name.replace('_', ' ')}: {len(gains)} answers fit this drive about as well, K {answers}, each with a "
                "noise of its own: none may be quoted; a longer drive, or a lead that moves more, decides"
            )
    return out


def large_left_over(tests: ResidualTests) -> list[tuple[str, float]]:
    """Inputs of which too much of a response is left over, with its share of the model's own.

    >>> tests = ResidualTests(True, 20.0, 41.6, ("range_rate",), (), True, {"range_rate": 18}, {"range_rate": 0.5})
    >>> large_left_over(tests)
    [('range_rate', 0.5)]
    """
    shares = ((name, tests.left_over_share.get(name, 0.0)) for name in tests.left_over)
    return [(name, share) for name, share in shares if share > MAX_LEFT_OVER]


# what to do about a gain that something else than its size keeps from being quoted
SEARCH = "search for the cause with `canid diagnose`"
# posterior probability that a parameter is outside of its interval of 95 %, by models with one cause more, from which on it
# is not quoted
OUTSIDE = 0.7


def average_over_cause(key: str, what: str = "K") -> str:
    """Why a parameter of an input is withheld that a cause moves, and what to do; the same words in every result.

    Example:
        >>> average_over_cause("range_rate").partition(":")[0]
        'K of range rate is probably an average over a cause that the model does not have'
    """
    symbol = WORDS[what][0]
    return (
        f"{symbol} of {readable(key)} is probably an average over a cause that the model does not have: with it the model "
        f"describes this drive better and has another {symbol}; {SEARCH}"
    )


def gains_left_over(tests: ResidualTests) -> dict[str, str]:
    """Inputs of which more of the response is left over than the model gives, and why their gain may not be quoted.

    >>> tests = ResidualTests(True, 20.0, 41.6, ("range_rate",), (), True, {"range_rate": 18}, {"range_rate": 1.2})
    >>> list(gains_left_over(tests)), gains_left_over(tests._replace(left_over_share={"range_rate": 0.8}))
    (['range_rate'], {})
    """
    return {
        name: f"{name.replace('_', ' ')}: the residuals still hold more of a response than the model gives "
        f"({100 * share:.0f} %): K may not be quoted; {SEARCH}"
        for name, share in large_left_over(tests)
        if share > MAX_LEFT_OVER_OF_GAIN
    }


def left_over(tests: ResidualTests) -> str:
    """Say that too much of a response is left over for delays to be quoted; empty: not so.

    >>> tests = ResidualTests(True, 20.0, 41.6, ("range_rate",), (), True, {"range_rate": 18}, {"range_rate": 0.5})
    >>> left_over(tests).partition(":")[0]
    'range rate'
    >>> left_over(tests._replace(left_over_share={"range_rate": 0.2}))
    ''
    """
    large = large_left_over(tests)
    if not large:
        return ""
    share = max(share for _, share in large)
    most = "up to " if len(large) > 1 else ""
    names = ", ".join(name for name, _ in large).replace("_", " ")
    return (
        f"{names}: the residuals still hold a response of {most}{100 * share:.0f} % of the "
        "model's own, which a first order with dead time does not give: τ and θ may not be quoted"
    )
