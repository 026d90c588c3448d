"""Alarm hold: a block stays suspected for a while, because evidence depends on how the vehicle is being driven."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from canid.values.state_constraints import TIME
from canid.values.types import NAN, BlockReport, BlockStatus

# s without sufficient evidence after which a block is no longer suspected: as long as a misfit may take to be detected
ALARM_HOLD_S = 60.0


class State(NamedTuple):
    """The last alarm of a block."""

    t: Annotated[float, TIME] = NAN  # s, when evidence was last sufficient
    since: float = NAN  # s
    says: str = ""


def step(state: State, t: float, now: BlockReport) -> tuple[State, BlockReport]:
    """Hold the alarm of a block at t [s], given the report by its present evidence.

    Example:
        >>> misfit = BlockReport(BlockStatus.MISFIT, 80.0, "the vehicle responds less", 15.0, 14.0)
        >>> state, _ = step(State(), 90.0, misfit)
        >>> _, report = step(state, 120.0, BlockReport(BlockStatus.FITS, NAN, "fits", 3.0, 14.0))
        >>> report.state.value, report.since, report.says
        ('misfit', 80.0, 'the vehicle responds less')
        >>> step(state, 140.0, misfit._replace(since=130.0))[1].since
        80.0
    """
    lasts = t - state.t < ALARM_HOLD_S
    if now.state is BlockStatus.MISFIT:
        # evidence that began anew since then is of the same misfit
        since = state.since if lasts and now.since > state.t else now.since
        return State(t, since, now.says), now._replace(since=since)
    if lasts and now.state is not BlockStatus.UNSEEN:
        return state, now._replace(state=BlockStatus.MISFIT, since=state.since, says=state.says)
    return state, now
