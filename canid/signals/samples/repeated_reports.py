"""Reports that are sent more than once, by a radar that is slower than its message.

The same gap and the same range rate again are no new measurement. Taken for one, they show a third of the noise that there
is and say twice as much each, so the smoother lets six times the noise through; and it is correlated with the smoothed
value: tau comes out too long and dead time too short by as much. Coarse reports that are equal by chance are new ones: then
the one number stays while the other changes as often as their shares say (odds ratio of the 2 x 2 table).

Where gap and range rate are measured at different times, each repeats by itself. Of a value that is sent again no new one
follows a new one, or rarely (odds ratio of a reading and the one before). By chance it is no rarer than after a repeat;
where a coarse value rises steadily it is, but then by one step each time.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Annotated, NamedTuple

from canid.signals.vehicle.decoding_state import Decoded, RoleReadings
from canid.values.state_constraints import FINITE, NOT_NEGATIVE
from canid.values.types import NAN, Array

# s since the last new report: what stays for longer is a lead at rest, or a slow radar that is a finding
MAX_REPEAT_S = 0.25
# reports after which a share is forgotten, about: 10 s at 20 Hz
MEMORY = 200.0
# odds ratio from which on equal reports are repeats, and their least share
ODDS_RATIO, MIN_SHARE = 5.0, 0.1
# signals that may be sent again each by itself, and the odds ratio below which they are: 0, of coarse ones of 13 Hz in a
# file of 20 Hz 0.3. Of their readings so many are the same at least: with fewer hardly one follows another by chance. Of the
# changes of value so many are of more than a step; after so many one is forgotten
ROLES = frozenset(("gap", "range_rate"))
RARELY, MIN_SAME, MIN_JUMPS, CHANGES = 0.4, 0.25, 0.25, 50.0
# of the smallest change so far; and m or m/s, below which a change is the rounding of a conversion
JUMP, LEAST_CHANGE = 1.5, 1e-6


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


class Readings(NamedTuple):
    """The last reading of one signal, and shares of all its readings."""

    value: float = NAN  # as it came
    since: Annotated[float, FINITE] = 0.0  # s, of the first reading that has had it
    new: bool = False  # whether it was new
    twice: Annotated[float, NOT_NEGATIVE] = 0.25  # share in which a new value follows a new one
    once: Annotated[float, NOT_NEGATIVE] = 0.5  # share in which one of the two is new
    step: Annotated[float, NOT_NEGATIVE] = inf  # smallest change
    jumps: Annotated[float, NOT_NEGATIVE] = 0.0  # share of the changes that are larger

    @property
    def repeat(self) -> bool:
        """Whether what stays the same is sent again."""
        once = 0.5 * self.once
        never = 1.0 - self.twice - self.once
        same = 1.0 - self.twice - once > MIN_SAME
        return same and self.jumps > MIN_JUMPS and self.twice * never < RARELY * once * once


def separate(
    state: Mapping[str, Readings], decoded: Decoded, t: Array
) -> tuple[Mapping[str, Readings], Decoded]:
    """Leave out what a signal sends again by itself.

    Args:
        state: by role; {} before the first chunk.
        decoded: a chunk.
        t: (n,) s, of its frames.

    >>> import numpy as np
    >>> t = 0.02 * np.arange(1000)
    >>> gap = np.random.default_rng(1).standard_normal(300)[(t / 0.07 + 1e-6).astype(int)]
    >>> _, left = separate({}, Decoded((RoleReadings("gap", np.arange(1000), gap),), (), ()), t)
    >>> np.unique(np.diff(left.roles[0].row[-100:])).tolist()
    [3, 4]
    """
    after, roles = dict(state), []
    for readings in decoded.roles:
        role, row, value = readings
        if role in ROLES:
            new = []
            seen = after.get(role, Readings())
            for now, x in zip(t[row].tolist(), value.tolist(), strict=True):
                seen, again = _put(seen, now, x)
                new.append(not again)
            after[role] = seen
            if not all(new):
                readings = RoleReadings(role, row[new], value[new])
        roles.append(readings)
    return after, decoded._replace(roles=tuple(roles))


def _put(state: Readings, t: float, x: float) -> tuple[Readings, bool]:
    """Take one reading; whether it is the last one again."""
    if x != x:
        return state, False
    value, since, before, twice, once, step, jumps = state
    new, recent = x != value, t - since < MAX_REPEAT_S
    # 0 is the range rate of a lead that stands still
    if recent and x != 0.0:
        twice += ((new and before) - twice) / MEMORY
        once += ((new != before) - once) / MEMORY
        change = abs(x - value)
        if change > LEAST_CHANGE:
            step = min(step, change)
            jumps += ((change > JUMP * step) - jumps) / CHANGES
    again = recent and not new and state.repeat
    return Readings(x, t if new else since, new, twice, once, step, jumps), again
