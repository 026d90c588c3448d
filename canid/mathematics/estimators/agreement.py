"""The estimators check each other, and one of them carries the headline estimate.

Both estimate the same driver through different models and memories: where their intervals stay disjoint, at least one
of the models does not hold, and neither number is to be used.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from canid.mathematics.estimators import plausibility
from canid.mathematics.estimators.plausibility import WORDS
from canid.mathematics.estimators.status import TIME_ROUNDING_S
from canid.mathematics.identification import model_average
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.identification.identifiability import apart, not_quotable, quotable, with_gain
from canid.values.text.names import method
from canid.values.types import Channel, Estimate, Identifiable, Interval, OtherGain, Status

# Whose number is the headline. FOPDT's parameters are K, tau and dead time themselves; ARMAX's K and tau + dead time
# are worked out from shared poles. An estimator that is not named here comes after these.
HEADLINE_ORDER = ("fopdt", "armax")
# Steering is of second order (Chen & Ulsoy 2001, table 1): of one lag and one dead time neither the gain nor the delay
# is right, so FOPDT carries no headline there and contradicts nobody.
STEERING = "lateral_offset"
WRONG_FOR_STEERING = frozenset({"fopdt"})

# s; an older estimate is about another time. Estimates come twice a second.
MAX_AGE_S = 2.0

# s; for so long must intervals stay disjoint: a burst or the first seconds of another manner of driving, which reach
# the two memories at different speeds, are no contradiction.
PERSISTENCE_S = 5.0

# Share of what is known of a parameter that a declared prior brought, from which on it is no measurement that another
# estimator could contradict: only FOPDT has the prior. Below, the estimate of a driver who is 4 sd from the prior is off by
# at most 2 of the sd that the data alone would give it, and the two intervals reach 3.3 of it.
MAX_PRIOR_SHARE = 0.5

# Compared live: noise of the radar moves tau up and dead time down at the same sum, for minutes.
LIVE = ("K", "tau_plus_dead_time")


class State(NamedTuple):
    """What the next estimates are compared with."""

    latest: tuple[Estimate, ...] = ()  # of each estimator, the last one, before this check
    # (one estimator, the other, channel, parameter) -> s, since when the intervals have been disjoint
    apart: Mapping[tuple[str, str, str, str], float] = {}


def step(state: State, estimates: Sequence[Estimate]) -> tuple[State, tuple[Estimate, ...]]:
    """Compare the estimates of one instant.

    Args:
        state: as left by the instant before.
        estimates: of the same time, at most one of each estimator; none is no news.

    Returns:
        The new state, and the estimates: `inconsistent` where one stays disjoint from another, else with `headline`
        on the one to read.

    >>> from canid.values.types import Identifiable
    >>> def of(t, name, low, high):
    ...     K = Interval((low + high) / 2, low, high)
    ...     return Estimate(t, name, Status.OK, "K", {"range_rate": Channel(K, status=Identifiable.GAIN_ONLY)})
    >>> state, checked = step(State(), [of(0.0, "armax", 4.0, 6.0), of(0.0, "fopdt", 5.0, 6.0)])
    >>> [e.headline for e in checked]
    [False, True]
    >>> for t in range(1, 7):
    ...     state, checked = step(state, [of(t, "armax", 7.0, 8.0), of(t, "fopdt", 5.0, 6.0)])
    >>> print(checked[1].status.value, checked[1].says.partition(":")[0])
    inconsistent range rate
    """
    if not estimates:
        return state, ()
    t = estimates[0].t
    newest = {e.estimator: e for e in (*state.latest, *estimates)}
    latest = tuple(e for e in newest.values() if t - e.t <= MAX_AGE_S + TIME_ROUNDING_S)
    order, wrong = headline_order(estimates[0].channels), wrong_for(estimates[0].channels)
    valid = sorted((e for e in latest if e.status is Status.OK), key=lambda e: _rank(e.estimator, order))
    disjoint = {
        (a.estimator, b.estimator, *where): (a, b)
        for a, b in combinations(valid, 2)
        for where in disjoint_parameters(a.channels, b.channels)
    }
    apart = {key: state.apart.get(key, t) for key in disjoint}
    why: dict[str, str] = {}
    for key, since in apart.items():
        if t - since >= PERSISTENCE_S - TIME_ROUNDING_S:
            a, b, *_ = key
            if (a in wrong) != (b in wrong):
                right, other = (b, a) if a in wrong else (a, b)
                why.setdefault(other, _wrong_order(key, *disjoint[key], right))
                continue
            says = _contradiction(key, *disjoint[key])
            why.setdefault(a, says)
            why.setdefault(b, says)
    readable = [e.estimator for e in valid if e.estimator not in wrong]
    first = readable[0] if readable and not why.keys() - wrong else ""
    # of a gain that one withholds as an average over a cause, the others' is one too
    averages = {
        name: channel.withheld
        for e in latest
        for name, channel in e.channels.items()
        if channel.withheld and channel.status is Identifiable.NOT
    }
    # and the models by which one is averaged count for the others
    others = {name: models for e in latest for name, models in e.other_gains.items()}
    given = (e if e.other_gains else averaged(e, others) for e in estimates)
    return State(latest, apart), tuple(
        _checked(without_gains(e, averages) if e.estimator not in wrong else e, first, why) for e in given
    )


def averaged(e: Estimate, others: Mapping[str, tuple[OtherGain, ...]] | None = None) -> Estimate:
    """Average gains over models of the driver with a cause (Hoeting et al. 1999), or withhold them.

    An interval is widened until it holds 95 % by all models. A gain that is outside of its own interval with 70 % is an
    average over a cause.

    Args:
        e: an estimate.
        others: input -> gains by these models, which count as over the drive; None: the estimate's own, of its window.

    >>> from canid.values.types import Identifiable
    >>> known = {"range_rate": Channel(Interval(4.0, 3.6, 4.4), status=Identifiable.GAIN_ONLY)}
    >>> e = Estimate(60.0, "fopdt", Status.OK, "range rate: K only", known)
    >>> print(averaged(e, {"range_rate": (OtherGain(0.3, 0.9, 0.1, 0.8, 0.05),)}).channels["range_rate"].K)
    4.0 [2.8, 4.4]
    >>> averaged(e, {"range_rate": (OtherGain(20.0, 0.9, 0.1, 0.8, 0.05),)}).says.partition(":")[0]
    'K of range rate is probably an average over a cause that the model does not have'
    """
    for name, others_of in (e.other_gains if others is None else others).items():
        channel = e.channels.get(name, Channel())
        if e.status is not Status.OK or not others_of or not quotable(channel, "K"):
            continue
        K, columns = channel.K, [0, 1, 2] if others is None else [0, 3, 4]
        odds, gain, more = np.array(others_of).T[columns]
        means, sds = K.value * gain, np.hypot((K.high - K.low) / (2.0 * NORMAL_QUANTILE), K.value * more)
        models = [NormalDist(*model) for model in zip(means.tolist(), sds.tolist(), strict=True)]
        outside = [1.0 - model.cdf(K.high) + model.cdf(K.low) for model in models]
        if float(odds @ outside) >= plausibility.OUTSIDE * (1.0 + odds.sum()):
            e = without_gains(e, {name: plausibility.average_over_cause(name)})
            continue
        wide = model_average.widened(K, means, sds, odds)
        # an end that was lowered to zero stays there
        if not K.low * K.high > 0.0:
            wide = wide._replace(low=K.low) if K.value > 0.0 else wide._replace(high=K.high)
            channel = channel._replace(K=wide)
        else:
            channel = with_gain(channel, wide)
        e = e._replace(channels={**e.channels, name: channel})
    return e


def without_gains(e: Estimate, why: Mapping[str, str]) -> Estimate:
    """Withhold gains, and what goes with them; `inconsistent` where nothing is left to be quoted.

    Args:
        e: an estimate.
        why: input -> reason, in one line.

    >>> from canid.values.types import Identifiable
    >>> e = Estimate(1.0, "armax", Status.OK, "range rate: K only", {"range_rate": Channel(status=Identifiable.GAIN_ONLY)})
    >>> without_gains(e, {"range_rate": "K is an average"}).status.value, without_gains(e, {}) == e
    ('inconsistent', True)
    """
    moved = [name for name in why if quotable(e.channels.get(name, Channel()), "K")]
    if not moved or e.status is not Status.OK:
        return e
    channels = {n: not_quotable(c, why[n]) if n in moved else c for n, c in e.channels.items()}
    says = "; ".join(why[name] for name in moved)
    if any(c.status is not Identifiable.NOT for c in channels.values()):
        return e._replace(channels=channels, says=f"{e.says}; {says}")
    return e._replace(channels=channels, says=says, status=Status.INCONSISTENT)


def _checked(e: Estimate, first: str, why: Mapping[str, str]) -> Estimate:
    if e.status is not Status.OK:
        return e
    if e.estimator in why:
        return e._replace(status=Status.INCONSISTENT, says=why[e.estimator])
    return e._replace(headline=e.estimator == first)


def headline_order(inputs: Collection[str]) -> tuple[str, ...]:
    """Estimators by who carries the headline, for a task with these inputs.

    >>> headline_order(("headway_error", "range_rate")), headline_order(("lateral_offset",))
    (('fopdt', 'armax'), ('armax', 'fopdt'))
    """
    wrong = wrong_for(inputs)
    return tuple(sorted(HEADLINE_ORDER, key=lambda name: name in wrong))


def wrong_for(inputs: Collection[str]) -> frozenset[str]:
    """Estimators whose model cannot be right for these inputs.

    >>> wrong_for(("lateral_offset",)), wrong_for(("range_rate",))
    (frozenset({'fopdt'}), frozenset())
    """
    return WRONG_FOR_STEERING if STEERING in inputs else frozenset()


def by_headline(names: Collection[str], inputs: Collection[str]) -> list[str]:
    """Sort estimators by who carries the headline.

    >>> by_headline({"third", "armax", "fopdt"}, ("range_rate",))
    ['fopdt', 'armax', 'third']
    """
    order = headline_order(inputs)
    return sorted(names, key=lambda name: _rank(name, order))


def _rank(name: str, order: tuple[str, ...]) -> tuple[int, str]:
    return (order.index(name) if name in order else len(order), name)


def disjoint_parameters(
    first: Mapping[str, Channel],
    other: Mapping[str, Channel],
    compared: Sequence[str] = LIVE,
) -> list[tuple[str, str]]:
    """Return (channel, parameter) that both may quote, with intervals that have no point in common.

    Args:
        first: input -> Channel, of one estimator.
        other: of another.
        compared: parameters.

    >>> from canid.values.types import Identifiable
    >>> a, b = (Channel(Interval(K, K - 1, K + 1), status=Identifiable.GAIN_ONLY) for K in (2.0, 5.0))
    >>> disjoint_parameters({"range_rate": a}, {"range_rate": b}), disjoint_parameters({"x": a}, {"x": a})
    ([('range_rate', 'K')], [])
    """
    return [
        (name, what)
        for name in first
        if name in other
        for what in compared
        if _measured(first[name], what)
        and _measured(other[name], what)
        and apart([getattr(first[name], what), getattr(other[name], what)])
    ]


def _measured(channel: Channel, what: str) -> bool:
    """Whether a parameter may be quoted, and rests on the data more than on a declared prior.

    >>> from canid.values.types import Identifiable
    >>> known = Channel(status=Identifiable.GAIN_ONLY)
    >>> _measured(known, "K"), _measured(known._replace(prior_weights={"K": 0.7}), "K")
    (True, False)
    """
    return quotable(channel, what) and channel.prior_weights.get(what, 0.0) < MAX_PRIOR_SHARE


def _contradiction(key: tuple[str, str, str, str], a: Estimate, b: Estimate) -> str:
    go_on = "keep driving" if STEERING in a.channels else "keep following"
    return (
        f"{both(key, a.channels, b.channels)}; the driver may have changed within the "
        f"last minutes, or does not respond in proportion: use neither number, and {go_on}"
    )


def _wrong_order(key: tuple[str, str, str, str], a: Estimate, b: Estimate, right: str) -> str:
    says = both(key, a.channels, b.channels)
    return f"{says}; steering is of higher order than one lag and a dead time: use {method(right)}'s"


def both(
    key: tuple[str, str, str, str], of_first: Mapping[str, Channel], other: Mapping[str, Channel]
) -> str:
    """Word what two estimators say of a parameter.

    Args:
        key: one estimator, the other, the channel, the parameter.
        of_first: the channels of the first.
        other: the channels of the second.

    >>> known = {"range_rate": Channel(Interval(2.0, 1.0, 3.0))}
    >>> both(("fopdt", "armax", "range_rate", "K"), known, known)
    'range rate: K is 2.00 [1.00, 3.00] by FOPDT but 2.00 [1.00, 3.00] by ARMAX'
    """
    first, second, name, what = key
    word, unit = WORDS[what]

    def number(channels: Mapping[str, Channel], estimator: str) -> str:
        iv: Interval = getattr(channels[name], what)
        return f"{iv.value:.2f} [{iv.low:.2f}, {iv.high:.2f}]{unit} by {method(estimator)}"

    a, b = number(of_first, first), number(other, second)
    return f"{name.replace('_', ' ')}: {word} is {a} but {b}"
