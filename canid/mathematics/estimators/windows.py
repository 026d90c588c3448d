"""Sliding-window estimates along a recorded drive: as live, but made only where they are reported.

Live, every estimator makes an estimate twice a second. A report of a drive shows the first of every
`status.REPORT_EVERY_S`, and making the others as well would take twenty times as long. The reported ones are the same to
the last bit as live, because of three rules:

- An estimator takes samples with `advance` and makes the estimate that is due with `estimate`, so the estimates that
  nobody asks for are never made (`Pending`).
- The first estimate in each `REPORT_EVERY_S` owes nothing to the estimates between two such (`status.reported`): FOPDT
  starts its search from the whole box there, and from the last reported fit elsewhere.
- The estimators check each other (agreement.py). Only intervals that are disjoint now can contradict each other, and
  only since they last touched: `_checked` asks for pending estimates from the newest backwards, and stops where they
  touch.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

from canid.mathematics.estimators import agreement, status
from canid.mathematics.estimators.estimator import AnyRunning
from canid.values.types import NAN, Estimate, Sample

# s; an older estimate bears on no contradiction
HISTORY_S = agreement.PERSISTENCE_S + agreement.MAX_AGE_S + 1.0


class Pending(NamedTuple):
    """An estimate that is due, made when somebody asks for it, once."""

    name: str  # of the estimator
    t: float  # s
    make: Callable[[], tuple[Any, Estimate]]  # the estimator's state after it, and the estimate


def reported_estimates(
    running: Sequence[AnyRunning],
    samples: Iterable[Sample],
    forgotten_at: Mapping[float, float] | None = None,
) -> list[Estimate]:
    """Estimates along a drive, the first of each estimator in every `REPORT_EVERY_S` s: the same numbers as live.

    Args:
        running: the estimators.
        samples: of the drive.
        forgotten_at: s, of samples after which what was learned is forgotten -> s, before which; None: of none.
    """
    states = {estimator.name: estimator.init() for estimator in running}
    emitted = dict.fromkeys(states, NAN)  # s, the last estimate that was due
    recent: deque[list[Pending]] = deque()  # by instant, as far back as a contradiction may have begun
    out: list[Estimate] = []
    t = NAN
    for sample in samples:
        if forgotten_at and t in forgotten_at:
            since = forgotten_at[t]
            states = {each.name: each.forget(states[each.name], since) for each in running}
        t, now = sample.t, []
        for estimator in running:
            state, due = estimator.advance(states[estimator.name], sample)
            states[estimator.name] = state
            if due:
                now.append(
                    Pending(estimator.name, sample.t, cache(partial(estimator.estimate, state, sample)))
                )
        if not now:
            continue
        recent.append(now)
        while sample.t - recent[0][0].t > HISTORY_S:
            recent.popleft()
        reports = [p for p in now if status.reported(status.Pace(emitted=emitted[p.name]), sample.t)]
        emitted |= {p.name: sample.t for p in now}
        # the state after a reported estimate is what the estimates until the next report build on
        states |= {p.name: p.make()[0] for p in reports}
        if reports and sample.t >= status.REPORT_EVERY_S - status.TIME_ROUNDING_S:
            names = {p.name for p in reports}
            out += [estimate for estimate in _checked(recent) if estimate.estimator in names]
    return out


def _checked(recent: Sequence[list[Pending]]) -> tuple[Estimate, ...]:
    """Let the estimators check each other at the last of these instants."""
    first, t = len(recent) - 1, recent[-1][0].t
    apart = set(_agreement(_before(recent, first), recent[first])[0].apart)
    while apart and first and t - recent[first][0].t < agreement.PERSISTENCE_S - status.TIME_ROUNDING_S:
        first -= 1
        apart &= _agreement(_before(recent, first), recent[first])[0].apart.keys()
    state, estimates = _agreement(_before(recent, first), recent[first])
    for k in range(first + 1, len(recent)):
        state, estimates = _agreement(state, recent[k])
    return estimates


def _agreement(
    state: agreement.State, instant: list[Pending]
) -> tuple[agreement.State, tuple[Estimate, ...]]:
    return agreement.step(state, [pending.make()[1] for pending in instant])


def _before(recent: Sequence[list[Pending]], k: int) -> agreement.State:
    """Last estimates of those that have none at instant `k`, where they still count then."""
    now = recent[k]
    oldest = now[0].t - agreement.MAX_AGE_S - status.TIME_ROUNDING_S
    latest = {p.name: p for i in range(k) for p in recent[i] if p.t >= oldest}
    names = {p.name for p in now}
    return agreement.State(tuple(p.make()[1] for name, p in latest.items() if name not in names))
