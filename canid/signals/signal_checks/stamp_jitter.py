"""Dispersion of the intervals between the stamps of a message (squared coefficient of variation).

Frames that wait in a driver, an adapter or a logger are stamped late and in bursts: by up to the longest interval.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from canid.signals.samples.stamps import SPAN_S
from canid.signals.signal_checks.blocks import Block
from canid.signals.signal_checks.check import Check, Found
from canid.values.state_constraints import TIME

# standard deviation of the intervals over their mean: a message that is lost now and then (one in five) has 0.5, a Poisson
# process 1; a burst of five 2
MAX_VARIATION = 0.7
# s; dead times are quoted to 0.05 s (mathematics/identification/identifiability.py)
MIN_DEVIATION_S = 0.05
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


class State(NamedTuple):
    """By role, the messages with irregular stamps."""

    irregular: Mapping[str, Irregular] = {}


def init() -> State:
    """Return the state before the first block."""
    return State()


def step(state: State, block: Block) -> tuple[State, Found | None]:
    """Take a block."""
    for role, t, number, mean, sd in block.stamps:
        irregular = dict(state.irregular)
        before = irregular.pop(role, None)
        if number >= MIN_INTERVALS and sd > MIN_DEVIATION_S and sd > MAX_VARIATION * mean:
            since, spans = (before.since, before.spans) if before else (max(t - SPAN_S, 0.0), 0)
            # the stamps' own time, and the estimators' where they differ after a restart
            irregular[role] = Irregular(min(since, block.t), block.t, spans + 1, mean, sd)
        state = State(irregular)
    standing = {role: jitter for role, jitter in state.irregular.items() if jitter.spans >= NEEDED_SPANS}
    if not standing:
        return state, None
    role, jitter = next(iter(standing.items()))
    roles = tuple(standing)
    says = (
        f"the stamps of {', '.join(roles)} jitter: every {jitter.mean:.3g} s on average, with a standard deviation of "
        f"{jitter.sd:.2f} s"
    )
    remedy = "use stamps of the interface's hardware, or of its driver; dead times are off by as much"
    return state, Found("stamps_jitter", roles, jitter.since, says, remedy)


CHECK = Check("stamp_jitter", init, step)
