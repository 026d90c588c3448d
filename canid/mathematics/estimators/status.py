"""The status of an estimate: what it is worth, and the sentence with the reason. The same rules for every estimator.

Every status is decided in one of four places, in this order:

1. `by_gate`: the gate is closed: `no_driver`, `no_lead`, `stale`.
2. `by_data`: too few data: `converging`; the inputs hardly moved: `not_excited`.
3. `by_fit`: no gain can be estimated: `not_excited`; a gain of the wrong sign, or another reason of plausibility.py to
   refuse the model: `inconsistent`; else `ok`. ARMAX alone adds `inconsistent`, where the residual tests reject the
   model (mathematics/estimators/armax.py).
4. `agreement.step`: the intervals of two estimators stay disjoint: `inconsistent`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, NamedTuple

from canid.values.state_constraints import TIME
from canid.values.types import (
    NAN,
    TASK_INPUTS,
    Channel,
    Estimate,
    Identifiable,
    LearnGate,
    Sample,
    Status,
)

# s; a brake dab or a released pedal is part of following a vehicle: the window's estimate stays true meanwhile.
# Beyond this the sentence "K is ..." would be about somebody who no longer drives with the pedal.
BRIEF_CLOSURE_S = 5.0

# s; an estimate is repeated at least this often: twice a second is what an eye can follow.
ESTIMATE_EVERY_S = 0.5

# s; grid times are floats: sums of 0.1 s must not make every fifth sample the sixth, nor 5 s less than 5 s.
TIME_ROUNDING_S = 5e-4

# s; the first estimate in each such stretch owes nothing to the estimates before it, see windows.py
REPORT_EVERY_S = 10.0

# s of usable data below which nothing is estimated: the Cramér-Rao bound of K1 exceeds K1 itself below 20 s.
MIN_DATA_S = 20.0

_AT_ONCE = {
    LearnGate.CRUISE: Status.NO_DRIVER,
    LearnGate.ASSIST: Status.NO_DRIVER,
    LearnGate.NO_CRUISE: Status.NO_DRIVER,
    LearnGate.STANDSTILL: Status.NO_DRIVER,
    LearnGate.REVERSE: Status.NO_DRIVER,
    LearnGate.NO_LEAD: Status.NO_LEAD,
    LearnGate.FREE_DRIVING: Status.NO_LEAD,
    LearnGate.STALE: Status.STALE,
}
_AFTER_BRIEF_CLOSURE = {
    LearnGate.BRAKE: Status.NO_DRIVER,
    LearnGate.PEDAL_FLOOR: Status.NO_DRIVER,
    LearnGate.OUTPUT_LIMIT: Status.NO_DRIVER,
    LearnGate.TARGET_CHANGE: Status.NO_LEAD,
    LearnGate.LIMITED: Status.STALE,
}
_OF_GATE = (Status.NO_DRIVER, Status.NO_LEAD, Status.STALE)


# --- when ------------------------------------------------------------------------------------------


class Pace(NamedTuple):
    """How long the gate has been closed, and the last estimate."""

    since: float = NAN  # s, start of the present closure; NaN: open
    kind: Status | None = None  # of the last estimate
    emitted: Annotated[float, TIME] = NAN  # s, when


def due(pace: Pace, t: float, kind: Status, every: float = ESTIMATE_EVERY_S) -> bool:
    """Whether an estimate is to be emitted at `t` [s]: the kind is new, or the last one is `every` s old."""
    return kind is not pace.kind or not t - pace.emitted < every - TIME_ROUNDING_S


def due_from_data(pace: Pace, t: float, every: float = ESTIMATE_EVERY_S) -> bool:
    """Whether an estimate from data is due at `t` [s]: at once where the last one was the gate's, else by `every`."""
    return of_gate(pace) or not t - pace.emitted < every - TIME_ROUNDING_S


def emitted(pace: Pace, t: float, kind: Status) -> Pace:
    """Return the pace after an estimate of this kind at `t` [s]."""
    return pace._replace(kind=kind, emitted=t)


def of_gate(pace: Pace) -> bool:
    """Whether the last estimate had its status from the gate, not from the data."""
    return pace.kind in _OF_GATE


def reported(pace: Pace, t: float) -> bool:
    """Whether an estimate at `t` [s] is the first in its `REPORT_EVERY_S`.

    >>> reported(Pace(emitted=9.6), 10.1), reported(Pace(emitted=10.1), 10.6), reported(Pace(), 0.5)
    (True, False, True)
    """
    if pace.emitted != pace.emitted:
        return True
    last = pace.emitted + TIME_ROUNDING_S
    return (t + TIME_ROUNDING_S) // REPORT_EVERY_S > last // REPORT_EVERY_S


# --- which -----------------------------------------------------------------------------------------


def by_gate(pace: Pace, sample: Sample) -> tuple[Pace, Status | None]:
    """Follow the gate.

    Returns:
        The new pace, and the status that the gate alone forces; None where the data decide.

    >>> from canid.values.types import LearnGate, Sample
    >>> braking = Sample(0.0, 0.0, (0.0,), LearnGate.BRAKE, False, 0, {})
    >>> pace, forced = by_gate(Pace(), braking)
    >>> forced is None
    True
    >>> by_gate(pace, braking._replace(t=6.0))[1]
    <Status.NO_DRIVER: 'no_driver'>
    """
    if sample.gate is LearnGate.OPEN:
        return (pace if pace.since != pace.since else pace._replace(since=NAN)), None
    since = sample.t if pace.since != pace.since else pace.since
    forced = _AT_ONCE.get(sample.gate)
    if forced is None and sample.t - since >= BRIEF_CLOSURE_S - TIME_ROUNDING_S:
        forced = _AFTER_BRIEF_CLOSURE.get(sample.gate, Status.STALE)
    return pace._replace(since=since), forced


def by_data(
    used: float, needed: float, excitation: Mapping[str, float], moved: bool
) -> tuple[Status, str] | None:
    """Status and sentence where the data do not suffice for a fit; None where they do.

    Args:
        used: s of usable data.
        needed: s.
        excitation: input name -> standard deviation over these data.
        moved: whether an input moved enough, by the estimator's own limit.

    >>> by_data(12.0, 20.0, {"lateral_offset": 0.2}, True)[1]
    '12 s of the 20 s of data that an estimate needs: keep driving within the lane'
    >>> by_data(60.0, 20.0, {"headway_error": 0.01, "range_rate": 0.1}, False)[1]
    'headway error hardly moved (sd 0.01 s) in these data: drive with varying speed'
    """
    if used < needed:
        go_on = "keep driving within the lane" if _keeps_lane(excitation) else "keep following"
        says = f"{used:.0f} s of the {needed:.0f} s of data that an estimate needs: {go_on}"
        return Status.CONVERGING, says
    if not moved:
        name, amount = _moved_least(excitation)
        return Status.NOT_EXCITED, f"{name} hardly moved (sd {amount}) in these data: {_remedy(excitation)}"
    return None


def by_fit(
    channels: Mapping[str, Channel],
    excitation: Mapping[str, float],
    refused: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> tuple[Status, str]:
    """Status and sentence of a fit.

    Args:
        channels: input name -> Channel.
        excitation: input name -> standard deviation over the data.
        refused: what else speaks against the model, see plausibility.py.
        remarks: what a reader of its numbers should know.

    >>> by_fit({"range_rate": Channel(status=Identifiable.GAIN_ONLY)}, {"range_rate": 1.0})
    (<Status.OK: 'ok'>, 'range rate: K only')
    >>> by_fit({"range_rate": Channel()}, {"range_rate": 0.1})[1]
    'no gain can be estimated from these data; range rate moved least (sd 0.10 m/s): drive with varying speed'
    """
    if all(channel.status is Identifiable.NOT for channel in channels.values()):
        return Status.NOT_EXCITED, _no_gain(excitation)
    wrong = "; ".join(refused) or implausible(channels)
    if wrong:
        return Status.INCONSISTENT, wrong
    words = (f"{name.replace('_', ' ')}: {_ESTIMATED[c.status]}" for name, c in channels.items())
    return Status.OK, "; ".join((*words, *remarks))


def implausible(channels: Mapping[str, Channel]) -> str:
    """Say which gain has the wrong sign; empty where none has.

    A driver who presses the pedal more the nearer or the faster the vehicle ahead comes would not follow it for long.

    >>> from canid.values.types import Interval
    >>> steers = Channel(Interval(-2.0, -3.0, -1.0), status=Identifiable.GAIN_ONLY)
    >>> implausible({"range_rate": steers}).partition(": check")[0]
    'range rate: K is negative, -2.00 [-3.00, -1.00]'
    >>> implausible({"lateral_offset": steers})
    ''
    """
    return "; ".join(
        f"{name.replace('_', ' ')}: K is negative, {c.K.value:.2f} [{c.K.low:.2f}, {c.K.high:.2f}]: check its sign in the "
        "vehicle file (canid check); else the model does not hold"
        for name, c in channels.items()
        if name in TASK_INPUTS["car_following"] and c.status is not Identifiable.NOT and c.K.high < 0.0
    )


# --- in which words --------------------------------------------------------------------------------

_ESTIMATED = {
    Identifiable.OK: "K, τ and θ",
    Identifiable.SUM_ONLY: "K, and τ and θ only as a sum",
    Identifiable.GAIN_ONLY: "K only",
    Identifiable.NOT: "nothing yet",
}

# Usual standard deviation of an input in driving, and its unit: of the published studies (Grover 2021, Chen & Ulsoy
# 2001) and of the public car-following logs.
_USUAL: dict[str, tuple[float, str]] = {
    "headway_error": (0.3, "s"),
    "range_rate": (1.0, "m/s"),
    "lateral_offset": (0.3, "m"),
}


def usual(name: str) -> float:
    """Return the usual standard deviation of an input in driving, in its unit; 1 for an unknown name."""
    return _USUAL.get(name, (1.0, ""))[0]


def without_numbers(t: float, estimator: str, status: Status, says: str, names: Sequence[str]) -> Estimate:
    """Return an estimate without a number for any channel."""
    return Estimate(t, estimator, status, says, {name: Channel() for name in names})


def _keeps_lane(names: Mapping[str, float]) -> bool:
    return "lateral_offset" in names


def _remedy(names: Mapping[str, float]) -> str:
    return "move within the lane" if _keeps_lane(names) else "drive with varying speed"


def _moved_least(excitation: Mapping[str, float]) -> tuple[str, str]:
    """Words and amount of the input that moved least, against what it usually does."""
    name = min(excitation, key=lambda n: excitation[n] / usual(n))
    return name.replace("_", " "), f"{excitation[name]:.2f} {_USUAL.get(name, (1.0, ''))[1]}".strip()


def _no_gain(excitation: Mapping[str, float]) -> str:
    if all(moved > usual(name) for name, moved in excitation.items()):
        return (
            "no gain can be estimated from these data: the inputs moved, but other causes of the output hide the "
            f"response to them: {_remedy(excitation)}"
        )
    name, amount = _moved_least(excitation)
    return (
        f"no gain can be estimated from these data; {name} moved least (sd {amount}): {_remedy(excitation)}"
    )
