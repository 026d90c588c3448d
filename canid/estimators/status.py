"""What an estimator may say just now, from the gate alone: the same rules and words for every estimator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from canid.types import NAN, Channel, Estimate, Gate, Identifiable, Sample, Status

# s; a brake dab or a lifted foot is part of following a vehicle: the window's estimate stays true meanwhile.
# Beyond this the sentence "K is ..." would be about somebody who no longer drives with the pedal.
BRIEF = 5.0

# s; an estimate is repeated at least this often: twice a second is what an eye can follow.
EVERY = 0.5

# s; grid times are floats: sums of 0.1 s must not make every fifth sample the sixth, nor 5 s less than 5 s.
ROUNDING = 5e-4

# s; the first estimate in each such stretch owes nothing to the estimates before it: whoever needs only one in a while
# (a whole drive's windows) gets the same numbers without making the others.
MARK = 10.0

# s of usable data below which nothing is said: the Cramér-Rao bound of K1 exceeds K1 itself below 20 s.
ENOUGH = 20.0

_AT_ONCE = {
    Gate.CRUISE: Status.NO_DRIVER,
    Gate.NO_CRUISE: Status.NO_DRIVER,
    Gate.STANDSTILL: Status.NO_DRIVER,
    Gate.NO_LEAD: Status.NO_LEAD,
    Gate.STALE: Status.STALE,
}
_AFTER_A_WHILE = {
    Gate.BRAKE: Status.NO_DRIVER,
    Gate.PEDAL_FLOOR: Status.NO_DRIVER,
    Gate.TARGET_CHANGE: Status.NO_LEAD,
}


class Closed(NamedTuple):
    """How long the gate has been shut, and what was said last."""

    since: float = NAN  # s, start of the present closure; NaN: open
    kind: Status | None = None  # of the last emitted estimate
    emitted: float = NAN  # s, when


def step(state: Closed, sample: Sample) -> tuple[Closed, Status | None]:
    """Follow the gate.

    Returns:
        The new state, and the status that the gate alone forces; None where the data may speak.

    >>> from canid.types import Gate, Sample
    >>> braking = Sample(0.0, 0.0, (0.0,), Gate.BRAKE, False, 0, {})
    >>> state, forced = step(Closed(), braking)
    >>> forced is None
    True
    >>> step(state, braking._replace(t=6.0))[1]
    <Status.NO_DRIVER: 'no_driver'>
    """
    if sample.gate is Gate.OPEN:
        return (state if state.since != state.since else state._replace(since=NAN)), None
    since = sample.t if state.since != state.since else state.since
    forced = _AT_ONCE.get(sample.gate)
    if forced is None and sample.t - since >= BRIEF - ROUNDING:
        forced = _AFTER_A_WHILE.get(sample.gate, Status.STALE)
    return state._replace(since=since), forced


def due(state: Closed, t: float, kind: Status, every: float = EVERY) -> bool:
    """Whether an estimate is to be emitted at `t` [s]: the kind is new, or the last one is `every` s old."""
    return kind is not state.kind or not t - state.emitted < every - ROUNDING


def said(state: Closed, t: float, kind: Status) -> Closed:
    """Return the state after an estimate of this kind went out at `t` [s]."""
    return state._replace(kind=kind, emitted=t)


def told_by_gate(state: Closed) -> bool:
    """Whether the last estimate was the gate's word, not the data's."""
    return state.kind in (Status.NO_DRIVER, Status.NO_LEAD, Status.STALE)


def marked(state: Closed, t: float) -> bool:
    """Whether an estimate at `t` [s] is the first in its `MARK`.

    >>> marked(Closed(emitted=9.6), 10.1), marked(Closed(emitted=10.1), 10.6), marked(Closed(), 0.5)
    (True, False, True)
    """
    if state.emitted != state.emitted:
        return True
    return (t + ROUNDING) // MARK > (state.emitted + ROUNDING) // MARK


def silent(t: float, estimator: str, status: Status, says: str, names: Sequence[str]) -> Estimate:
    """Return an estimate that tells nothing of any channel."""
    return Estimate(t, estimator, status, says, {name: Channel() for name in names})


# What an input usually does in driving, and its unit: sd of the published studies (Grover 2021, Chen & Ulsoy
# 2001) and of the public car-following logs. Only used to name the input that moved least, and its unit.
_USUAL: dict[str, tuple[float, str]] = {
    "headway_error": (0.3, "s"),
    "range_rate": (1.0, "m/s"),
    "lateral_offset": (0.3, "m"),
}


def usual(name: str) -> float:
    """Return the usual standard deviation of an input in driving, in its unit; 1 for an unknown name."""
    return _USUAL.get(name, (1.0, ""))[0]


_TOLD = {
    Identifiable.OK: "K, tau and dead time",
    Identifiable.SUM_ONLY: "K, and tau and dead time only as a sum",
    Identifiable.GAIN_ONLY: "K only",
    Identifiable.NOT: "nothing yet",
}


def what_is_told(channels: Mapping[str, Channel]) -> str:
    """Say what these data tell of each input.

    >>> what_is_told({"range_rate": Channel(status=Identifiable.GAIN_ONLY)})
    'range rate: K only'
    """
    return "; ".join(f"{name.replace('_', ' ')}: {_TOLD[c.status]}" for name, c in channels.items())


def hardly_moved(excitation: Mapping[str, float]) -> str:
    """Say which input moved least, how much, and what to do.

    >>> hardly_moved({"headway_error": 0.4, "range_rate": 0.1})
    'range rate hardly moved (sd 0.10 m/s) in these data: drive with varying speed'
    """
    name = min(excitation, key=lambda n: excitation[n] / usual(n))
    if excitation[name] > usual(name):
        return "the inputs move, but other causes of the output hide the answer: drive with varying speed"
    unit = _USUAL.get(name, (1.0, ""))[1]
    remedy = "move within the lane" if name == "lateral_offset" else "drive with varying speed"
    amount = f"{excitation[name]:.2f} {unit}".strip()
    return f"{name.replace('_', ' ')} hardly moved (sd {amount}) in these data: {remedy}"
