"""An effect: its equations, how a diagnosis looks for it, and the strengths at which it is tested.

The driver (Grover 2021, eq. 2.1, 2.6-2.9), with the places at which an effect may act:

    headway error ──headway──▶ e′ ─┐
    range rate ─range_rate──▶ w′ ──┤ u = p0 + gain · (K1 e′ + K2 w′) + extra ─▶ 1/(1+τs) ─pedal──▶ pedal
    speed, gap, lead's accel. ─────┘

All inputs are delayed by the driver's dead time before they reach an effect; `dead_time` adds to that delay.
Hooks work on floats (one step of a simulation) and on columns (n,) (a fit) alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum, auto
from typing import Any, NamedTuple

import numpy as np

from canid.models.effects.redundancy import Redundancy
from canid.values.findings import Flags
from canid.values.types import NAN, Array, Interval

Value = Any  # float or (n,) array
Params = Sequence[float] | Array  # in the order of `Effect.parameters`

GRAVITY = 9.81  # m/s²
# s between the knots of a desired headway that follows a random walk: it changes within minutes, not seconds
KNOT_SPACING_S = 30.0


class Kind(Enum):
    """What form an effect has, and with it the method that looks for it."""

    PARAMETRIC = auto()  # a function of the inputs with some parameters: fitted jointly with the model
    EPISODES = auto()  # stretches of time in which the pedal does not follow the demand
    RANDOM_WALK = auto()  # a slow change without a form of its own: a variance component
    LINE = auto()  # a line in the spectrum
    MASK = auto()  # stretches without a driver, or without valid inputs: left out of every fit
    REDUNDANCY = auto()  # two measured signals that must agree do not
    REMNANT = auto()  # the distribution of the driver's noise: its innovations, not its mean


class Detector(Enum):
    """Detectors of the diagnosis that look for patterns in the residual or in the pedal itself."""

    PEDAL_CEILING = auto()  # the pedal stands at its highest level
    PEDAL_RHYTHM = auto()  # the pedal moves at regular intervals and stands still in between
    PEDAL_HOLDS = auto()  # the pedal stands still now and then
    INTERMITTENT_CONTROL = auto()  # the residual follows the demand's slope at regular intervals
    SPECTRAL_LINE = auto()  # a line in the residual's spectrum
    RANDOM_WALK = auto()  # a random walk of the desired headway


class Screening(Enum):
    """Which candidates are worth a full fit."""

    DETECTABLE = (
        auto()
    )  # a typical strength is detectable on this drive, and its direction explains something
    DIRECTION = auto()  # its direction explains something
    NONE = auto()  # always fitted


class ScaleFeature(Enum):
    """What the scale of the driver's noise may follow; each of the past alone, mean 0 and standard deviation 1."""

    OWN_ACCELERATION = auto()  # its absolute value; where it is not measured, that of the output's rate
    LEAD_ACCELERATION = auto()  # its absolute value
    PAST_INNOVATIONS = auto()  # log of their root mean square over 4 s


class Share(Enum):
    """Quantity of the simulated drive in whose shares a parameter of `found_at` and `silent_at` is given."""

    DURATION = auto()  # s, of the drive
    TOP_SPEED = auto()  # m/s, about the highest speed
    TOP_PEDAL = auto()  # %, about the highest level of the pedal


class Seen(NamedTuple):
    """The driver's inputs at an instant, or along a drive: floats or columns (n,)."""

    t: Value  # s since the drive's first sample; not delayed
    duration: float  # s, of the whole drive
    headway: Value  # s
    range_rate: Value  # m/s
    gap: Value  # m
    speed: Value  # m/s
    lead_accel: Value  # m/s²


class VehicleState(NamedTuple):
    """State of the vehicle, floats or columns (n,); NaN columns where it is not measured.

    The vehicle, with the places at which an effect may act:

        pedal ──pedal──▶ P′ ─1/(1+τs)─▶ D ──thrust──▶ D′,  a = Kp D′ − c0 − c2 v² + push
    """

    t: Value  # s since the drive's first sample
    pedal: Value  # %
    speed: Value  # m/s
    slope: Value  # measured slope of the road, mean 0 and standard deviation 1
    gear: Value
    lagged_pedal: Value  # %, D: what the engine gives (before `thrust`)
    strength: Value  # m/s² per %: Kp


class MaskInput(NamedTuple):
    """What a mask is computed from: the columns of a drive on its grid."""

    t: Array  # (n,) s
    dt: float  # s
    signals: Mapping[str, Array]  # role -> (n,); NaN = not measured
    segment: Array  # (n,) grows where the inputs' history breaks, as by another vehicle ahead
    person: bool  # is the output a person's: a pedal, a steering wheel?
    missing: Flags = np.zeros(0, dtype=bool)  # (n,) a measured signal did not arrive; empty: not known


class SensorValues(NamedTuple):
    """Values of the sensors at an instant, or along a drive: floats or columns (n,)."""

    t: Value  # s since the drive's first sample
    duration: float  # s, of the whole drive
    gap: Value  # m
    range_rate: Value  # m/s
    speed: Value  # m/s
    age: Value  # s; how much older the radar's report is than its time stamp says


class DriveFeatures(NamedTuple):
    """Features of a drive that initial guesses and availability depend on; empty or NaN where not known."""

    duration: float = NAN  # s
    speed: Array = np.zeros(0)  # (m,) m/s, of the samples that are fitted
    output: Array = np.zeros(0)  # (m,) output unit
    power: Array = np.zeros(0)  # (m,) W/kg that the pedal asks for: strength · pedal · speed
    slope_sd: float = NAN  # %, standard deviation of the measured slope; NaN: not measured
    level: bool = False  # no slope of the road stands out of its sensor's noise
    gear_measured: bool = False
    gap: Array = np.zeros(0)  # (m,) m, of the samples that are fitted


class Unavailable(NamedTuple):
    """Why a drive cannot show an effect."""

    why: str
    ruled_out: bool = False  # the drive shows that it is not there: nothing is left to be decided


Initial = tuple[float, ...] | Callable[[DriveFeatures], tuple[float, ...]]


class Parameter(NamedTuple):
    """One parameter of an effect."""

    name: str
    unit: str
    low: float
    high: float
    initial: Initial  # initial guesses: typical strengths, of either sign where both occur; or from the drive
    typical: float  # a strength at which it matters: detectability is computed for it
    fixed: bool = False  # estimated by its detector; a joint fit leaves it there
    change_point: bool = False  # s along the drive at which something changes: its likelihood has many maxima
    share_of: Share | None = None  # `found_at` and `silent_at` give it as a share of this quantity

    def guesses(self, features: DriveFeatures) -> tuple[float, ...]:
        """Initial guesses on a drive.

        Example:
            >>> Parameter("time", "s", 0.0, 1e6, lambda drive: (0.5 * drive.duration,), 0.0).guesses(DriveFeatures(60.0))
            (30.0,)
        """
        return self.initial(features) if callable(self.initial) else self.initial


class PedalDynamics(NamedTuple):
    """Dynamics between demand and pedal: init(params, first) and step(params, state, demand, dt) -> state, pedal."""

    init: Callable[[Params, float], Any]
    step: Callable[[Params, Any, float, float], tuple[Any, float]]
    # (params, demand (n,), dt) -> (n,): the same along a drive, where that is faster
    column: Callable[[Params, Array, float], Array] | None = None


class VehicleHooks(NamedTuple):
    """Where an effect acts on the vehicle; each function gets the effect's parameters first."""

    pedal: Callable[[Params, Value], Value] | None = None  # P -> P′, %
    lag: Callable[[Params, VehicleState], Value] | None = None  # s, a further lag: 1/(1 + lag·s)
    thrust: Callable[[Params, Value, VehicleState], Value] | None = None  # D -> D′, %
    push: Callable[[Params, VehicleState], Value] | None = None  # m/s², onto the acceleration


class LaneHooks(NamedTuple):
    """Where an effect acts on a driver who keeps the lane; each function gets the effect's parameters first."""

    offset: Callable[[Params, Value], Value] | None = None  # m off the wanted position -> m acted upon
    # ° into the demand, from the road's curvature (1/m) as a function of the s that it is ahead
    curvature: Callable[[Params, Callable[[float], Value]], Value] | None = None


class Remnant(NamedTuple):
    """What an effect does to the innovations of the driver's noise."""

    heavy_tailed: bool = False  # Student's t; its degrees of freedom are the first parameter
    scale: tuple[ScaleFeature, ...] = ()  # log sd follows these; one slope each, the parameters in this order


class Drawn(NamedTuple):
    """One realisation of an effect that happens at random, for one simulated drive."""

    params: tuple[float, ...]  # what the hooks get
    episodes: tuple[tuple[float, float], ...] = ()  # s, [start, stop)


def everywhere(features: DriveFeatures) -> None:
    """Every drive can show it."""


def more_than(size: float) -> Callable[[Interval, DriveFeatures], bool]:
    """Make a test: is the first parameter surely larger than this, with either sign?

    Example:
        >>> more_than(0.2)(Interval(-0.4, -0.5, -0.3), DriveFeatures())
        True
    """
    return lambda estimate, features: max(estimate.low, -estimate.high) > size


class Effect(NamedTuple):
    """One effect: what it is, where it acts, how it is found, and at which strengths that is tested."""

    # what it is
    id: str
    says: str  # the sentence of the report; {parameter} is replaced by its estimate and interval
    where: str  # "driver", "vehicle", "sensing", "remnant"
    kind: Kind
    parameters: tuple[Parameter, ...]
    needs: tuple[str, ...]  # roles
    source: str

    # where it acts
    headway: Callable[[Params, Value, Seen], Value] | None = None  # e -> e′
    range_rate: Callable[[Params, Value, Seen], Value] | None = None  # w -> w′
    extra: Callable[[Params, Seen], Value] | None = None  # %, into the demand
    gain: Callable[[Params, Seen], Value] | None = None  # factor on both answers
    dead_time: Callable[[Params, Seen], Value] | None = None  # s, added to both dead times
    pedal: PedalDynamics | None = None
    vehicle: VehicleHooks | None = None
    lane: LaneHooks | None = None
    sense: Callable[[Params, SensorValues], SensorValues] | None = None  # true -> measured
    remnant: Remnant | None = None  # innovations of the driver's noise
    mask: Callable[[MaskInput], Flags] | None = None  # (n,) samples to be left out
    has_threshold: bool = False  # is its first parameter one, of `headway` or `range_rate`?
    recovery: float = 0.0  # s after a mask until the driver's answer is undisturbed again

    # what limits its identification
    identifiable: bool = True  # False: no drive on a road can show it; reported as not testable, never fitted
    unavailable: Callable[[DriveFeatures], Unavailable | None] = everywhere  # why this drive cannot show it
    rivals: tuple[str, ...] = ()  # of the same form: not distinguishable without another signal
    absorbed: str = ""  # which parameters of a baseline take it up
    decides: str = ""  # the drive or the signal that would decide
    # is the estimate of its first parameter more than every car and road has?
    unusual: Callable[[Interval, DriveFeatures], bool] = more_than(0.0)

    # how it is looked for
    detectors: tuple[Detector, ...] = ()
    screening: Screening = Screening.DETECTABLE
    shortens_dead_time: bool = (
        False  # a baseline takes it for a shorter dead time: fits start at longer ones too
    )
    shows_desired_headway: bool = (
        False  # with it the desired headway itself is identifiable: the fit frees it
    )
    # of the same freedom, given to the operating point instead of the time: what these explain as well is not named
    timeless: tuple[Effect, ...] = ()
    wanted_gap: bool = (
        False  # a gap wanted at a speed: the forms of the baseline compete with it, and hold it
    )
    intermittent: bool = False  # the demand is followed at some instants only: nothing finer can be estimated
    redundancy: Redundancy | None = None  # what two measured signals show of it
    # (estimates, signals) -> the signals that it changed, corrected
    correct: Callable[[Params, Mapping[str, Array]], dict[str, Array]] | None = None
    # findings of the signal checks on the same fault, which this effect, where it is named, corrects
    findings: tuple[str, ...] = ()
    judges: tuple[str, ...] = ()  # findings that its own test over the whole drive replaces
    breaks_redundancy: bool = False  # a mask where gap, range rate and speed do not belong together

    # how it is simulated and tested
    draw: Callable[[Params, float, np.random.Generator], Drawn] | None = (
        None  # (parameters, s, random numbers)
    )
    slope_sd: Callable[[Params], float] | None = None  # %, of the simulated road's slope; stands for `push`
    # (columns, [first, stop), numbers) changes the columns to what is recorded in an episode of a mask
    imitate: Callable[[dict[str, Array], slice, Params], None] | None = None
    found_at: tuple[tuple[float, ...], ...] = ()  # strengths at which it must be named; of a mask: (s, ...)
    found_in: float = 6.0  # min; a drive of so long must show it at these strengths
    silent_at: tuple[tuple[float, ...], ...] = ()  # strengths at which nothing may be named
    in_demo: bool = False  # `canid demo` hides this one
