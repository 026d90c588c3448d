"""Reports that are sent more than once, by a radar that is slower than its message.

The same gap and the same range rate again are no new measurement. Taken for one, they show a third of the noise that there
is and say twice as much each, so the smoother lets six times the noise through; and it is correlated with the smoothed
value: tau comes out too long and dead time too short by as much. Coarse reports that are equal by chance are new ones: then
the one number stays while the other changes as often as their shares say (odds ratio of the 2 x 2 table).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from canid.values.state_constraints import NOT_NEGATIVE
from canid.values.types import NAN

# s since the last new report: what stays for longer is a lead at rest, or a slow radar that is a finding
MAX_REPEAT_S = 0.25
# reports after which a share is forgotten, about: 10 s at 20 Hz
MEMORY = 200.0
# odds ratio from which on equal reports are repeats, and their least share
ODDS_RATIO, MIN_SHARE = 5.0, 0.1


class State(NamedTuple):
    """The last report, and shares of all reports; they outlast a target."""

    gap: float = NAN  # m, as it came
    rate: float = NAN  # m/s
    both: Annotated[float, NOT_NEGATIVE] = 0.0  # share in which both stay
    either: Annotated[float, NOT_NEGATIVE] = 0.5  # share in which one of them stays, and the other changes


def step(state: State, gap: float, rate: float, age: float) -> tuple[State, bool]:
    """Take one report; whether it repeats the last one.

    Args:
        state: so far.
        gap: m, NaN where it has none; such reports say nothing of repeats.
        rate: m/s, likewise; reports with 0, of a lead that may stand still, are not counted.
        age: s, since the last new report.

    >>> state, again = State(), []
    >>> for k in range(600):  # every number twice
    ...     state, same = step(state, 30.0 + 0.1 * (k // 2), 1.0 + 0.01 * (k // 2), 0.05)
    ...     again.append(same)
    >>> any(again[:80]), again[-4:]
    (False, [False, True, False, True])
    """
    same_gap, same_rate = gap == state.gap, rate == state.rate
    both, either = state.both, state.either
    if age < MAX_REPEAT_S and gap == gap and rate == rate and rate != 0.0:
        both += ((same_gap and same_rate) - both) / MEMORY
        either += ((same_gap != same_rate) - either) / MEMORY
    # of all tables with this share of `either` that with equal parts has the least odds ratio
    repeats = both > MIN_SHARE and both * (1.0 - both - either) > ODDS_RATIO * (0.5 * either) ** 2
    again = repeats and same_gap and same_rate and age < MAX_REPEAT_S
    return State(gap, rate, both, either), again
