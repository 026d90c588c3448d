"""A suspicion lasts for a while: evidence comes and goes with what is driven, what it is about does not."""

from __future__ import annotations

from typing import NamedTuple

from canid.types import NAN, Watch, Watched

# s without evidence enough, after which a block is no longer suspected: as long as a misfit may take to be told
LASTS = 60.0


class State(NamedTuple):
    """What a block was last suspected of."""

    t: float = NAN  # s, when evidence was enough for the last time
    since: float = NAN  # s
    says: str = ""


def step(state: State, t: float, now: Watched) -> tuple[State, Watched]:
    """Take what is to be said of a block at t [s] by its present evidence.

    Example:
        >>> wrong = Watched(Watch.MISFIT, 80.0, "he answers less", 15.0, 14.0)
        >>> state, _ = step(State(), 90.0, wrong)
        >>> _, told = step(state, 120.0, Watched(Watch.FITS, NAN, "fits", 3.0, 14.0))
        >>> told.state.value, told.since, told.says
        ('misfit', 80.0, 'he answers less')
        >>> step(state, 140.0, wrong._replace(since=130.0))[1].since
        80.0
    """
    lasts = t - state.t < LASTS
    if now.state is Watch.MISFIT:
        # evidence that began anew since then is of the same misfit
        since = state.since if lasts and now.since > state.t else now.since
        return State(t, since, now.says), now._replace(since=since)
    if lasts and now.state is not Watch.UNSEEN:
        return state, now._replace(state=Watch.MISFIT, since=state.since, says=state.says)
    return state, now
