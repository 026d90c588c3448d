"""What a cause is: one definition that plants it, simulates it and fits it.

The driver's chain (DESIGN: Grover eq. 2.1, 2.6-2.9, made whole), with the places at which a cause may change it:

    headway error ──headway──▶ e′ ─┐
    range rate ─range_rate──▶ w′ ──┤ u = p0 + gain · (K1 e′ + K2 w′) + extra ─▶ 1/(1+τs) ─foot──▶ pedal
    what he sees ──────────────────┘

Everything that the driver sees is delayed by his dead time before it gets here; `dead_time` adds to that.
Hooks work on floats (one step of a simulation) and on columns (n,) (a fit) alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from canid.findings import Flags
from canid.types import Array

Value = Any  # float or (n,) array
Params = Sequence[float] | Array  # in the order of `Effect.parameters`

GRAVITY = 9.81  # m/s²


class Seen(NamedTuple):
    """What the driver sees at an instant, or along a drive: floats or columns (n,)."""

    t: Value  # s since the drive's first sample; not delayed
    drive: float  # s, how long the drive lasts
    headway: Value  # s
    range_rate: Value  # m/s
    gap: Value  # m
    speed: Value  # m/s
    lead_accel: Value  # m/s²


class Drive(NamedTuple):
    """What a mask looks at: the columns of a drive on its grid."""

    t: Array  # (n,) s
    dt: float  # s
    signals: Mapping[str, Array]  # role -> (n,); NaN = not measured
    segment: Array  # (n,) grows where the inputs' history breaks, as by another vehicle ahead
    person: bool  # is the output a person's: a pedal, a steering wheel?


class Sensed(NamedTuple):
    """What the sensors say at an instant, or along a drive: floats or columns (n,)."""

    t: Value  # s since the drive's first sample
    drive: float  # s, how long the drive lasts
    gap: Value  # m
    range_rate: Value  # m/s
    speed: Value  # m/s
    age: Value  # s; how much older the radar's report is than its time stamp says


class CarSeen(NamedTuple):
    """What the car's engine and body feel, floats or columns (n,); NaN columns where nobody measures it.

    The car's chain, with the places at which a cause may change it:

        pedal ──pedal──▶ P′ ─1/(1+τs)─▶ D ──thrust──▶ D′,  a = Kp D′ − c0 − c2 v² + push
    """

    t: Value  # s since the drive's first sample
    pedal: Value  # %
    speed: Value  # m/s
    slope: Value  # measured slope of the road, mean 0 and standard deviation 1
    gear: Value
    drive: Value  # %, the lagged pedal: what the engine gives (before `thrust`)
    strength: Value  # m/s² per %: Kp


class Car(NamedTuple):
    """Where a cause acts on the car; each function gets the cause's parameters first."""

    pedal: Callable[[Params, Value], Value] | None = None  # P -> P′, %
    lag: Callable[[Params, CarSeen], Value] | None = None  # s, a further lag: 1/(1 + lag·s)
    thrust: Callable[[Params, Value, CarSeen], Value] | None = None  # D -> D′, %
    push: Callable[[Params, CarSeen], Value] | None = None  # m/s², onto the acceleration


class Parameter(NamedTuple):
    """One number of a cause."""

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...]  # where a fit begins: typical strengths, of either sign where both occur
    typical: float  # a strength at which it matters: what "can this drive show it?" is asked for
    held: bool = False  # it has a search of its own, and a fit leaves it where that ended
    moment: bool = False  # s along the drive at which something changes: its cost has many valleys


class Foot(NamedTuple):
    """A cause in time between the demand and the pedal: init(params, first) and step(params, state, demand, t)."""

    init: Callable[[Params, float], Any]
    step: Callable[[Params, Any, float, float], tuple[Any, float]]
    column: Callable[[Params, Array, float], Array] | None = (
        None  # the same over (n,) at step dt, where faster
    )


class Effect(NamedTuple):
    """One cause."""

    id: str
    says: str  # the sentence of the report; {parameter} is replaced by its interval
    where: str  # "driver", "vehicle", "sensing"
    kind: (
        str  # how it is looked for: "curve" (parametric), "episodes", "wander", "line", "mask", "redundancy"
    )
    parameters: tuple[Parameter, ...]
    needs: tuple[str, ...]  # roles
    source: str
    rivals: tuple[str, ...] = ()  # same form: can never be told apart without another signal
    absorbed: str = ""  # why a baseline hides it, for causes that mostly cannot be seen
    decides: str = ""  # the drive or the signal that would tell it
    leads: bool = False  # a baseline takes it for a shorter dead time: fits begin at longer ones too
    centred: bool = False  # it makes the desired headway itself visible: the fit frees it
    headway: Callable[[Params, Value, Seen], Value] | None = None  # e -> e′
    range_rate: Callable[[Params, Value, Seen], Value] | None = None  # w -> w′
    extra: Callable[[Params, Seen], Value] | None = None  # %, into the demand
    gain: Callable[[Params, Seen], Value] | None = None  # factor on both answers
    dead_time: Callable[[Params, Seen], Value] | None = None  # s, added to both dead times
    foot: Foot | None = None
    car: Car | None = None
    sense: Callable[[Params, Sensed], Sensed] | None = None  # what is -> what is measured
    mask: Callable[[Drive], Flags] | None = None  # (n,) samples that say nothing of the driver
    recovery: float = 0.0  # s after a mask until the driver's answer is his own again
    planted: tuple[tuple[float, ...], ...] = ()  # strengths at which a 10 to 60 min drive must show it
