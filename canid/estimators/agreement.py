"""The estimators check each other, and one of them carries the number to read.

Both hear the same driver through different models and memories: where their intervals stay apart, at least one of
the models does not hold, and no number is worth more than the sentence that says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

from canid.estimators.status import ROUNDING
from canid.types import Channel, Estimate, Interval, Status

# Whose number is read first. FOPDT's parameters are K, tau and dead time themselves; ARMAX's K and tau + dead time
# are worked out from shared poles. An estimator that is not named here comes after these.
FIRST = ("fopdt", "armax")

# s; an estimate that is older speaks for another moment. Estimates come twice a second.
FRESH = 2.0

# s; for so long must intervals stay apart: a burst or the first seconds of another manner of driving, which reach
# the two memories at different speeds, are no contradiction.
PERSISTENT = 5.0

# What both can tell, the word for it, and its unit.
COMPARED = (("K", "K", ""), ("tau_plus_dead_time", "tau + dead time", " s"))


class State(NamedTuple):
    """What the next estimates are held against."""

    latest: tuple[Estimate, ...] = ()  # of each estimator, the last one, as it said it
    # (one estimator, the other, channel, parameter) -> s, since when the intervals have been apart
    apart: Mapping[tuple[str, str, str, str], float] = {}


def init() -> State:
    """Start with nothing heard."""
    return State()


def step(state: State, estimates: Sequence[Estimate]) -> tuple[State, tuple[Estimate, ...]]:
    """Take in what the estimators say at one instant.

    Args:
        state: as left by the instant before.
        estimates: of the same time, at most one of each estimator; none is no news.

    Returns:
        The new state, and the estimates: `inconsistent` where one stays apart from another, else with `headline`
        on the one to read.

    >>> from canid.types import Identifiable
    >>> def says(t, name, low, high):
    ...     K = Interval((low + high) / 2, low, high)
    ...     return Estimate(t, name, Status.OK, "told", {"range_rate": Channel(K, status=Identifiable.GAIN_ONLY)})
    >>> state, told = step(init(), [says(0.0, "armax", 4.0, 6.0), says(0.0, "fopdt", 5.0, 6.0)])
    >>> [e.headline for e in told]
    [False, True]
    >>> for t in range(1, 7):
    ...     state, told = step(state, [says(t, "armax", 7.0, 8.0), says(t, "fopdt", 5.0, 6.0)])
    >>> print(told[1].status.value, told[1].says.partition(":")[0])
    inconsistent range rate
    """
    if not estimates:
        return state, ()
    t = estimates[0].t
    spoken = {e.estimator: e for e in (*state.latest, *estimates)}
    latest = tuple(e for e in spoken.values() if t - e.t <= FRESH + ROUNDING)
    told = sorted((e for e in latest if e.status is Status.OK), key=_rank)
    seen = {
        (a.estimator, b.estimator, *where): (a, b)
        for a, b in combinations(told, 2)
        for where in _apart(a.channels, b.channels)
    }
    apart = {key: state.apart.get(key, t) for key in seen}
    why: dict[str, str] = {}
    for key, since in apart.items():
        if t - since >= PERSISTENT - ROUNDING:
            a, b, *_ = key
            says = _contradiction(key, *seen[key])
            why.setdefault(a, says)
            why.setdefault(b, says)
    first = told[0].estimator if told and not why else ""
    return State(latest, apart), tuple(_judged(e, first, why) for e in estimates)


def _judged(e: Estimate, first: str, why: Mapping[str, str]) -> Estimate:
    if e.status is not Status.OK:
        return e
    if e.estimator in why:
        return e._replace(status=Status.INCONSISTENT, says=why[e.estimator])
    return e._replace(headline=e.estimator == first)


def _rank(e: Estimate) -> tuple[int, str]:
    return (FIRST.index(e.estimator) if e.estimator in FIRST else len(FIRST), e.estimator)


def _apart(one: Mapping[str, Channel], other: Mapping[str, Channel]) -> list[tuple[str, str]]:
    """(channel, parameter) whose two intervals have no point in common."""
    return [
        (name, what)
        for name in one
        if name in other
        for what, _, _ in COMPARED
        if _disjoint(getattr(one[name], what), getattr(other[name], what))
    ]


def _disjoint(a: Interval, b: Interval) -> bool:
    # comparisons with NaN are false: what cannot be told contradicts nothing
    return a.low > b.high or b.low > a.high


def _contradiction(key: tuple[str, str, str, str], a: Estimate, b: Estimate) -> str:
    _, _, name, what = key
    word, unit = next((word, unit) for attribute, word, unit in COMPARED if attribute == what)

    def told(e: Estimate) -> str:
        iv: Interval = getattr(e.channels[name], what)
        return f"{iv.value:.2f} [{iv.low:.2f}, {iv.high:.2f}]{unit} by {e.estimator}"

    return (
        f"{name.replace('_', ' ')}: {word} is {told(a)} but {told(b)}; the driver may have changed within the last "
        "minutes, or answers otherwise than in proportion: read neither, and keep following"
    )
