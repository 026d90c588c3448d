"""Data types: what flows through canid, from a frame on the bus to an estimate with its interval.

Times are seconds since the log's first frame; its UTC start is kept once, in `LogStart`.
Values are SI (canid/values/roles.py states the few exceptions). NaN means not measured, nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, IntFlag
from typing import Annotated, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.interval_text import interval_text
from canid.values.presentation import Shown, Tabled
from canid.values.state_constraints import TIME

Array = npt.NDArray[np.float64]
NAN = float("nan")


# --- the bus ---------------------------------------------------------------------------------------


class Flag(IntFlag):
    """How a frame differs from a received classic data frame with an 11-bit id."""

    NONE = 0
    EXTENDED = 1  # 29-bit id
    REMOTE = 2
    ERROR = 4
    FD = 8
    BRS = 16  # bit-rate switch
    ESI = 32  # error-state indicator
    TX = 64  # sent by the recording device


class Frame(NamedTuple):
    """One CAN frame."""

    t: float  # s since the log's first frame
    bus: int  # 0, 1, ...
    id: int
    data: bytes
    flags: int = 0  # of `Flag`; a plain int, for speed
    length: int = -1  # bytes that a remote frame asks for; -1: len(data)


class Columns(NamedTuple):
    """Frames as columns, in the order of the log: one row is one frame.

    Bytes behind `length` are zero; a remote frame has no data, its `length` is what it asks for.
    """

    t: Array  # (n,) s since the log's first frame
    bus: npt.NDArray[np.uint16]  # (n,)
    id: npt.NDArray[np.uint32]  # (n,)
    flags: npt.NDArray[np.uint8]  # (n,) of `Flag`
    length: npt.NDArray[np.uint8]  # (n,) bytes
    data: npt.NDArray[np.uint8]  # (n, 8), or (n, 64) where one of them is longer than 8


class Damage(NamedTuple):
    """What a reader could not read. `says` is one line for the user: what, where, how much was lost."""

    says: str
    read: int  # objects (frames, lines) that were read
    total: int  # objects that the file should hold; -1 where nobody knows
    # first and last byte of what is damaged, as far as that is known; of a gzipped log: of what it holds
    spans: tuple[tuple[int, int], ...] = ()


# --- decoded ---------------------------------------------------------------------------------------


class Reading(NamedTuple):
    """One value of one role, at the time that its frame had."""

    t: float
    role: str
    value: float  # in the role's unit; NaN: the frame said that there is none


class TrackReading(NamedTuple):
    """One radar track's report."""

    t: float
    track: int
    distance: float  # m
    rate: float  # m/s, positive = opening
    lateral: float  # m from the own axis
    valid: bool
    new: bool  # the radar says that this track number now names another object


# `what` of an event that is the diagnosis of the drive so far
DIAGNOSIS = "diagnosis"


class Event(NamedTuple):
    """Something that happened once and that the user should know of."""

    t: float
    what: str  # "target_change", "clock_step", "ambiguous_bus", "estimator_restarted", ...
    says: str


class LearnGate(Enum):
    """Why the estimators may not learn from a sample. The value is the sentence that the user reads."""

    OPEN = ""
    NO_LEAD = "no vehicle ahead: follow one to be identified"
    FREE_DRIVING = "free driving: the vehicle ahead is too far away to be followed; close up to be identified"
    TARGET_CHANGE = "the vehicle ahead has just changed"
    CRUISE = "cruise control drives: the pedal says nothing about the person"
    NO_CRUISE = "cruise control is off: there is no controller to identify"
    BRAKE = "the brake is pressed: the pedal does not carry the driver's answer"
    PEDAL_FLOOR = "pedal at 0 %: the driver's answer is below what a pedal can show"
    STANDSTILL = "the vehicle stands or creeps"
    REVERSE = "reverse gear: nobody is followed"
    STALE = "a signal that the model needs does not arrive"
    ASSIST = "an assistant steers: the wheel says nothing about the person"
    OUTPUT_LIMIT = "the output is at its limit: the driver's answer is beyond what it can show"
    LIMITED = "a signal is at its limit: what it measures is beyond"


class Sample(NamedTuple):
    """All roles at one instant of the uniform grid."""

    t: float
    output: float  # the driver's output, in its unit (pedal %, accel m/s², ...)
    inputs: tuple[float, ...]  # in the order of TASK_INPUTS[task]
    gate: LearnGate  # what is wrong just now
    learn: bool  # gate open, and the recovery time over
    segment: int  # grows by one where the inputs' history breaks (another target, another driver)
    signals: Mapping[str, float]  # every role, and derived `headway`; NaN = not measured
    # Of the driver's demand at a limit of the output: at most this where the output is not above it (a pedal at its floor),
    # at least this where it is. Of a sample that may be learned from: the limit was within reach. NaN: neither
    bound: float = NAN
    # of the measurement noise of output and inputs, where several readings make a sample; (): not known
    variance: tuple[float, ...] = ()


TASK_INPUTS: dict[str, tuple[str, ...]] = {
    "car_following": ("headway_error", "range_rate"),
    "lane_keeping": ("lateral_offset",),
}


class OutputFilter(NamedTuple):
    """How the output was smoothed before it was recorded.

    `savitzky_golay`: derivative of a local polynomial of second order through measured speeds, centred;
    `moving_average`: centred; `first_order`: causal, `width` is its time constant; `none`: not at all; `unknown`.
    """

    kind: Literal["savitzky_golay", "moving_average", "first_order", "none", "unknown"]
    width: float = 0.0  # s


class Latency(NamedTuple):
    """How long after what it shows a radar's report comes."""

    value: float  # s
    sd: float = 0.0  # s, what is not known of it


class FullScale(NamedTuple):
    """What says that 100 % of a pedal is its full travel, before a drive is seen."""

    source: str = ""  # a clause; "": nothing says so
    highest: float = NAN  # %: what its bits can hold


class _Trace(NamedTuple):
    dt: float
    t: Array  # (n,) s
    output: Array  # (n,)
    inputs: Array  # (n, m)
    input_names: tuple[str, ...]
    gate: tuple[LearnGate, ...]  # (n,)
    learn: npt.NDArray[np.bool_]  # (n,)
    segment: npt.NDArray[np.int64]  # (n,)
    signals: dict[str, Array]  # role -> (n,)
    output_filter: OutputFilter | None = None  # that the output has passed; None: nothing is said of one
    bound: Array | None = None  # (n,) see Sample; None: nowhere
    variance: Array | None = None  # (n, 1 + m) of the measurement noise of output and inputs; None: not known
    findings: tuple[SignalFinding, ...] = ()  # about the signals, by the time at which each was raised
    latency: Latency | None = None  # of the radar; None: not stated
    full_scale: FullScale | None = None  # of a pedal as output; None: nothing was read of one

    def __repr__(self) -> str:
        n, span = len(self.t), float(self.t[-1] - self.t[0]) if len(self.t) else 0.0
        size = f"{span:.1f} s at {self.dt:g} s, {n} samples, {int(self.learn.sum())} to learn from"
        return f"Trace({size}; inputs {', '.join(self.input_names)}; signals {', '.join(self.signals)})"


class Trace(_Trace, Tabled):
    """Samples as columns."""

    __slots__ = ()


class DriveTime(NamedTuple):
    """What a drive holds, s; defined in `signals.signal_checks.drive_time`, for all verbs."""

    total: float
    driving: float
    behind_lead: float  # NaN where the task has no lead
    usable: float


class Signal(NamedTuple):
    """One role as it came, unsampled."""

    t: Array  # (n,) s
    value: Array  # (n,)

    def __repr__(self) -> str:
        n = len(self.t)
        return f"Signal({n} values{f' from {self.t[0]:.1f} to {self.t[-1]:.1f} s' if n else ''})"


# --- estimated -------------------------------------------------------------------------------------


class _Interval(NamedTuple):
    value: float = NAN
    low: float = NAN
    high: float = NAN

    def __str__(self) -> str:
        return interval_text(*self)


class Interval(_Interval, Shown):
    """A number with its 95 % interval. NaN: not identifiable.

    `repr` has all digits, `str` those that the interval supports:

    >>> print(Interval(5.6213, 5.3342, 5.9187))
    5.62 [5.33, 5.92]
    """

    __slots__ = ()


class Status(Enum):
    """What an estimate is worth. The member's value is its public name."""

    OK = "ok"
    CONVERGING = "converging"
    NOT_EXCITED = "not_excited"
    NO_LEAD = "no_lead"
    NO_DRIVER = "no_driver"
    STALE = "stale"
    INCONSISTENT = "inconsistent"


class Identifiable(Enum):
    """Which parameters of one channel are identifiable from these data."""

    OK = "ok"  # K, tau and dead time each
    SUM_ONLY = "sum_only"  # K and the sum tau + dead time
    GAIN_ONLY = "gain_only"
    NOT = "not_identifiable"


class Progress(NamedTuple):
    """What is missing until more may be quoted of a channel."""

    parameter: str  # the one that keeps it: K, tau, dead_time or tau_plus_dead_time
    sd: float  # in its unit, what the data know it to
    needed: float  # in its unit, the sd from which on it is quoted
    seconds: float  # s of driving as in these data that are missing; NaN: more of these data will not do


class _Channel(NamedTuple):
    K: Interval = Interval()  # output unit per input unit
    tau: Interval = Interval()  # s
    dead_time: Interval = Interval()  # s
    tau_plus_dead_time: Interval = Interval()  # s
    status: Identifiable = Identifiable.NOT
    K_anytime: Interval = (
        Interval()
    )  # holds at all times simultaneously, where the estimator can promise that
    prior_weight: float = NAN  # the largest of `prior_weights` of what a declared prior is about, 0 to 1
    progress: Progress | None = None  # None: all may be quoted, or nothing is known of what is missing
    # parameter -> share of what is known of it that a declared prior brought, 0 to 1; none: no prior is declared
    prior_weights: Mapping[str, float] = {}
    # why a parameter that the data show may not be quoted, and what to do; "": none is withheld
    withheld: str = ""

    def __repr__(self) -> str:
        known = [f"{name}={getattr(self, name)}" for name in QUOTED[self.status]]
        said = [*known, self.status.value, *filter(None, (self.withheld,))]
        return f"Channel({', '.join(said)})"


class Channel(_Channel, Shown):
    """One input's answer: K e^(-dead_time s) / (1 + tau s)."""

    __slots__ = ()


# the parameters of a channel that may be quoted, by its status
QUOTED: Mapping[Identifiable, tuple[str, ...]] = {
    Identifiable.OK: ("K", "tau", "dead_time"),
    Identifiable.SUM_ONLY: ("K", "tau_plus_dead_time"),
    Identifiable.GAIN_ONLY: ("K",),
    Identifiable.NOT: (),
}


class ResidualTests(NamedTuple):
    """Residual tests over the data used, of ARMAX over the last minute; see `mathematics.identification.residual_tests`."""

    white: bool  # Ljung-Box, 99 %
    statistic: float
    bound: float
    left_over: tuple[str, ...]  # inputs whose answer is not all in the model
    feedback: tuple[str, ...]  # inputs that the output moves: the loop is closed
    stationary: bool  # reverse arrangements, 99 %
    excitation_order: Mapping[str, int]  # per input, how many parameters it can excite
    # per input, rms of what is left over against that of the model's response; none: the method does not say
    left_over_share: Mapping[str, float] = {}


class GainChange(NamedTuple):
    """A step of the driver's gains."""

    t: Interval  # s, when
    before: Mapping[str, Interval]  # input name -> K
    after: Mapping[str, Interval]
    evidence: float  # log of the Shiryaev-Roberts statistic
    new: bool = False  # on the first estimate after it was detected


class OtherGain(NamedTuple):
    """A gain by a model of the driver with one cause that the estimator has not, in shares of the estimator's."""

    odds: float  # of the model against that without the cause
    gain: float
    sd: float  # of the gain, besides the estimator's own
    drive_gain: float  # both over the drive so far, for an estimator with a longer memory
    drive_sd: float


class _Estimate(NamedTuple):
    t: Annotated[float, TIME]  # s
    estimator: str
    status: Status
    says: str
    channels: Mapping[str, Channel]  # input name -> Channel
    fit_percent: float = NAN  # 100 (1 - |y - simulated| / |y - mean|) over the data used
    excitation: Mapping[str, float] = {}  # input name -> its standard deviation over the data used
    used: float = NAN  # s of data that the estimate rests on
    residual_tests: ResidualTests | None = None
    headline: bool = False  # the headline estimate, by the rule in mathematics/estimators/agreement.py
    change: GainChange | None = None  # the last step of the gains, for a minute after it was detected
    # input name -> gains by models with a cause, over which the gains of all estimators are averaged
    other_gains: Mapping[str, tuple[OtherGain, ...]] = {}

    def __repr__(self) -> str:
        mark = ", headline" if self.headline else ""
        lines = [f"Estimate({self.t:.1f} s, {self.estimator}, {self.status.value}{mark}: {self.says}"]
        if self.status is Status.OK:
            lines += [f"  {name}: {channel!r}" for name, channel in self.channels.items()]
        return "\n".join(lines) + ")"


class Estimate(_Estimate, Shown):
    """An estimator's result at time t."""

    __slots__ = ()


# --- monitored -------------------------------------------------------------------------------------


class BlockStatus(Enum):
    """The monitor's verdict on one block of the loop. The member's value is its public name."""

    FITS = "fits"
    MISFIT = "misfit"
    LEARNING = "learning"  # too little was learnt to test it
    UNSEEN = "unseen"  # its signals are not measured just now


class BlockReport(NamedTuple):
    """One block of the loop: does its model still fit?"""

    state: BlockStatus
    since: float  # s, since when it does not; NaN: it does, or is not known
    says: str
    evidence: float  # log of the strongest evidence against it
    needed: float  # log, the threshold of a misfit


class MonitorReport(NamedTuple):
    """Whether the models that were learnt over the last minutes still fit, and since when not."""

    t: float
    fits: bool  # no block is a misfit; true also while nothing is known, see `blocks`
    since: float  # s, since when they do not, or do again; NaN: no misfit so far; < 0: before this session
    block: str  # the suspected one: "driver", "vehicle" or "sensing"; "": none
    says: str
    blocks: Mapping[str, BlockReport]


# --- the signals themselves ------------------------------------------------------------------------


class SignalFinding(NamedTuple):
    """What is wrong with a signal, as the signal checks found it."""

    name: str  # of the fault
    roles: tuple[str, ...]  # that may be wrong
    since: Annotated[float, TIME]  # s, since when it is so
    raised: Annotated[float, TIME]  # s, since when it is known
    says: str  # what, with numbers and their uncertainty
    remedy: str  # what to do
    withholds: bool  # of an input or the output of the model: no estimate is `ok` while it stands, at a limit those before
    until: Annotated[float, TIME] = NAN  # s; NaN: it stands
    withholds_delays: bool = False  # the gains hold: tau and dead time alone are withheld


class SignalReport(NamedTuple):
    """The findings about the signals, whenever one begins or ends."""

    t: float
    findings: tuple[SignalFinding, ...]  # that stand, and those that have just ended


# --- configuration that several floors share ------------------------------------------------------------


class Driver(NamedTuple):
    """Task, output and convention of the driver to be identified."""

    task: str = "car_following"
    output: str = "pedal"
    headway_desired: float = 2.0  # s; a convention: only K1·THW_des + offset is identified
    output_filter: OutputFilter | None = None  # None: nothing is said of one
    latency: Latency | None = None  # of the radar, from [lead]; None: dead times are from its report on
    full_scale: FullScale | None = None  # of the output, where it is a pedal
