"""Dispersion of the intervals between the stamps of a message (squared coefficient of variation).

Frames that wait in a driver, an adapter or a logger are stamped late and in bursts: by up to the longest interval. Where
messages are lost, those that come are stamped rightly, at multiples of the shortest interval; where each is lost for itself
the intervals are geometric, with a standard deviation below their mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from canid.signals.samples.stamps import SPAN_S, StampIntervals
from canid.signals.signal_checks.blocks import Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME
from canid.values.types import NAN

# standard deviation of the intervals over their mean: a message that is lost now and then (one in five) has 0.5, a Poisson
# process 1; a burst of five 2
MAX_VARIATION = 0.7
# s; dead times are quoted to 0.05 s (mathematics/identification/identifiability.py)
MIN_DEVIATION_S = 0.05
# Lost messages: distance from multiples of the shortest interval, as a share of it (of stamps at any phase 0.29), and the
# largest share of them: of bursts stamped in whole milliseconds all are multiples of one; variation, that of bursts
# of three to four, which ten seconds of lost messages do not reach by chance
MAX_OFF_SHARE, MAX_LOST, MAX_LOST_VARIATION = 0.15, 0.9, 1.5
# spans of ten seconds in a row: one alone is a pause of the sender
NEEDED_SPANS = 2
# intervals of a span below which nothing is known
MIN_INTERVALS = 10


class Irregular(NamedTuple):
    """A message whose stamps are irregular."""

    since: Annotated[float, TIME]  # s
    t: Annotated[float, TIME]  # s, of the last span
    spans: int
    mean: float  # s
    sd: float  # s
    lost: float  # share of the messages that are missing between those that come; NaN: their stamps jitter


class State(NamedTuple):
    """By role, the messages with irregular stamps."""

    irregular: Mapping[str, Irregular] = {}


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    for intervals in block.stamps:
        role, t, number, mean, sd, *_ = intervals
        irregular = dict(state.irregular)
        before = irregular.pop(role, None)
        if number >= MIN_INTERVALS and sd > MIN_DEVIATION_S and sd > MAX_VARIATION * mean:
            since, spans = (before.since, before.spans) if before else (max(t - SPAN_S, 0.0), 0)
            # the stamps' own time, and the estimators' where they differ after a restart
            irregular[role] = Irregular(min(since, block.t), block.t, spans + 1, mean, sd, _lost(intervals))
        state = State(irregular)
    standing = {role: jitter for role, jitter in state.irregular.items() if jitter.spans >= NEEDED_SPANS}
    if not standing:
        return state, None
    wrong = {role: jitter for role, jitter in standing.items() if not jitter.lost >= 0.0}
    roles = tuple(wrong or standing)
    jitter = standing[roles[0]]
    if not wrong:
        says = (
            f"messages of {', '.join(roles)} are lost, {jitter.lost:.0%} of them: they come every "
            f"{jitter.mean * (1.0 - jitter.lost):.2g} s, and one every {jitter.mean:.2g} s is left"
        )
        remedy = "record all messages; delays are known to the intervals between those that are left"
        return state, Found("messages_lost", roles, jitter.since, says, remedy, delays_only=True)
    says = (
        f"the stamps of {', '.join(roles)} jitter: every {jitter.mean:.3g} s on average, with a standard deviation of "
        f"{jitter.sd:.2f} s"
    )
    remedy = "use stamps of the interface's hardware, or of its driver; dead times are off by as much"
    return state, Found("stamps_jitter", roles, jitter.since, says, remedy)


def _lost(intervals: StampIntervals) -> float:
    """Share of the messages that are lost; NaN: they are not at multiples of one interval.

    >>> round(_lost(StampIntervals("gap", 10.0, 50, 0.2, 0.14, 0.1, 0.002)), 2)
    0.5
    >>> _lost(StampIntervals("gap", 10.0, 50, 0.2, 0.14, 0.0001, 0.00003))
    nan
    """
    lost = 1.0 - intervals.shortest / intervals.mean
    regular = (
        intervals.off < MAX_OFF_SHARE * intervals.shortest
        and intervals.sd < MAX_LOST_VARIATION * intervals.mean
    )
    return lost if regular and 0.0 <= lost <= MAX_LOST else NAN


CHECK = Check("stamp_jitter", init, step)
