"""Data types of a diagnosis report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.values.identified_model import IdentifiedModel
from canid.values.presentation import Shown
from canid.values.types import NAN, Array, Channel, DriveTime, Interval, SignalFinding

Flags = npt.NDArray[np.bool_]


class Verdict(Enum):
    """Verdict of a diagnosis. The member's value is its public name."""

    ADEQUATE = "adequate"  # the model passes: this drive shows nothing wrong with it
    NAMED = "named"
    ONE_OF = "one_of"  # several causes explain it equally well
    UNEXPLAINED = "unexplained"  # something is wrong that no effect of the catalogue explains
    NOT_ENOUGH_DATA = "not_enough_data"


class BaselineForm(NamedTuple):
    """Which gap the baseline wants at a speed."""

    name: str  # "time_headway", "gap", "free_speed"
    parameters: Mapping[str, Interval]  # "T", "s0", "v0"; those that the form has and the drive shows
    units: Mapping[str, str]
    says: str  # the form in words, and why it was chosen


class Fit(NamedTuple):
    """One model on the whole drive: its parameters and its simulation from the measured inputs."""

    channels: Mapping[str, Channel]
    fit_percent: float  # 100 (1 − |y − simulated| / |y − mean|)
    simulated: Array  # (n,) output unit; NaN where nothing can be simulated
    noise_sd: float  # output unit; of the unexplained part of the output
    form: BaselineForm | None = None  # None: nothing was fitted

    def __repr__(self) -> str:
        known = [f"fit {self.fit_percent:.0f} %", *(f"{name}: {ch!r}" for name, ch in self.channels.items())]
        return f"Fit({', '.join(known)})"


class NullGain(NamedTuple):
    """Gain of the simulation by the same effects on drives without them: the driver's own noise in the loop alone."""

    median: float = NAN
    high: float = NAN  # its 95 % point; a gain below it is none
    replicates: int = 0  # simulated drives that it rests on


class RivalCause(NamedTuple):
    """A rival that was fitted in place of a cause."""

    effect: str  # id in CATALOGUE
    parameters: Mapping[str, Interval]
    units: Mapping[str, str]  # parameter -> unit


class Finding(NamedTuple):
    """One effect that was named as a cause."""

    effect: str  # id in CATALOGUE
    where: str  # "driver", "vehicle", "sensing", "remnant"
    rivals: tuple[str, ...]  # effects that explain the same data as well, or must by their form
    surrogate: bool  # it reduces the residual but leaves structure in it: not the cause
    parameters: Mapping[str, Interval]
    units: Mapping[str, str]  # parameter -> unit
    # relative reduction of the simulation's error variance on held-out data; of the driver's findings the interval is where
    # that of another drive of the same driver lies, behind another lead
    gain: Interval
    says: str
    evidence: float  # 2 Δ log likelihood over the model without it, robust against autocorrelated noise of varying scale
    needed: float  # what the evidence had to exceed, corrected for the number of candidates
    episodes: tuple[tuple[float, float], ...] = ()  # s; of effects that come and go
    # nats/min, one-step predictive log score on held-out data over the model without it; NaN: not scored
    log_score_gain: Interval = Interval()
    null_gain: NullGain = NullGain()  # of `gain`; of findings of the driver
    rival_causes: tuple[RivalCause, ...] = ()  # of `rivals` those that were fitted in its place


class Tried(NamedTuple):
    """One candidate at one step of the search."""

    effect: str
    where: str
    step: int  # 1, 2, ...: one more than the effects that were in the model
    evidence: float  # 2 Δ log likelihood; NaN: not computed
    needed: float
    expected: float  # evidence that a typical strength of it would leave on this drive; NaN: not computed
    outcome: str  # "accepted", "rejected", "rival", "not_testable"
    why: str


class NotTestable(NamedTuple):
    """What this drive cannot decide."""

    effects: tuple[str, ...]  # one: not identifiable here; two: not distinguishable here
    why: str  # and which drive would decide
    evidence: float = NAN  # that a typical strength would leave on this drive; NaN: not computed
    needed: float = NAN


class Visible(NamedTuple):
    """From which strength on an effect that was not named would have shown."""

    effect: str
    parameter: str
    strength: float  # NaN: no strength up to eight times the typical one would have
    unit: str
    bends: float  # bias of K of range rate if so strong an effect were there, relative; NaN: not estimated


class Check(NamedTuple):
    """One check of the data or of the model."""

    name: str
    passed: bool | None  # None: could not be made
    value: float
    limit: float
    says: str
    unit: str = ""  # of value and limit
    gate: bool = False  # an adequacy test, not a check of the data


class Masked(NamedTuple):
    """A stretch that is left out of every fit."""

    effect: str  # id of the mask in CATALOGUE
    start: float  # s
    stop: float


def masked_for(masked: Iterable[Masked]) -> dict[str, float]:
    """Seconds per mask, longest first.

    Example:
        >>> masked_for([Masked("one", 3.0, 5.0), Masked("another", 9.0, 60.0)])
        {'another': 51.0, 'one': 2.0}
    """
    seconds: dict[str, float] = {}
    for stretch in masked:
        seconds[stretch.effect] = seconds.get(stretch.effect, 0.0) + stretch.stop - stretch.start
    return dict(sorted(seconds.items(), key=lambda pair: -pair[1]))


class Window(NamedTuple):
    """A stretch of time with a large residual."""

    start: float  # s
    stop: float
    before: float  # root mean square of the residual, output unit
    after: float


class OperatingMap(NamedTuple):
    """Mean residual over two operating variables."""

    x: str  # role
    y: str
    x_edges: Array  # (p + 1,)
    y_edges: Array  # (q + 1,)
    before: Array  # (p, q) mean residual, output unit; NaN: never there
    after: Array  # (p, q)
    seconds: Array  # (p, q)


class Spectra(NamedTuple):
    """Spectra of the residual, and its coherence with the inputs."""

    frequency: Array  # (m,) Hz
    before: Array  # (m,) output unit² / Hz
    after: Array  # (m,)
    coherence_before: Mapping[str, Array]  # input -> (m,) with the residual, 0 to 1
    coherence_after: Mapping[str, Array]
    level: float  # 99 % quantile of the coherence of independent signals


class Trajectory(NamedTuple):
    """One quantity in closed loop: lead from the log, driver and car simulated."""

    role: str
    measured: Array  # (n,)
    before: Array  # (n,)
    after: Array  # (n,)
    gain: Interval  # relative reduction of the error's variance


class ClosedLoopError(NamedTuple):
    """Normalised error in closed loop: rms error over the rms of what was measured (Punzo & Montanino 2016)."""

    gap: float = NAN
    speed: float = NAN


class Rival(NamedTuple):
    """A published car-following model, calibrated in closed loop on this drive."""

    model: str
    source: str
    parameters: Mapping[str, Interval] = {}  # calibrated on the whole drive
    units: Mapping[str, str] = {}  # parameter -> unit
    nrmse: ClosedLoopError = ClosedLoopError()  # on data that did not calibrate it
    folds: tuple[ClosedLoopError, ...] = ()  # the same, fold by fold
    status: str = "ok"  # or "not_enough_data"
    says: str = ""  # what is missing


def nrmse(simulated: Array, measured: Array) -> float:
    """Root mean square of the error over that of what was measured, where something was simulated.

    Example:
        >>> nrmse(np.array([10.0, 11.0, NAN]), np.array([10.0, 10.0, 10.0])).__round__(3)
        0.071
    """
    here = np.isfinite(simulated) & np.isfinite(measured)
    scale = float(np.sum(measured[here] ** 2))
    return float(np.sqrt(np.sum((simulated - measured)[here] ** 2) / scale)) if scale > 0 else NAN


class Blocked(NamedTuple):
    """Result of one block of the loop."""

    where: str  # "driver", "vehicle", "sensing", "remnant"
    state: str  # "adequate", "wrong", "unexplained", "not_testable"
    says: str


class DriveShare(NamedTuple):
    """One of several drives that were diagnosed together."""

    name: str
    used: float  # s
    # effect -> gain in one-step log score on this drive by a fit to the others, nats/min; NaN: too short
    gains: Mapping[str, Interval]
    channels: Mapping[str, Channel]  # the driver as this drive alone has it, the causes held; {}: too short


class Provenance(NamedTuple):
    """What is needed to reproduce the report."""

    log: str = ""
    log_sha256: str = ""
    vehicle: str = ""
    vehicle_sha256: str = ""
    command: str = ""
    versions: Mapping[str, str] = {}
    dbc_sha256: Mapping[str, str] = {}  # DBC file -> its hash
    recorded: str = ""  # when the log begins, UTC; of several one after the other; "": it does not say


class _Report(NamedTuple):
    verdict: Verdict
    says: str  # the verdict line
    output: str  # role of the driver's output
    t: Array  # (n,) s
    measured: Array  # (n,) output
    used: Flags  # (n,) samples that the fit rests on
    baseline: Fit
    extended: Fit  # the baseline again where nothing was found
    findings: tuple[Finding, ...]
    # share of the extended model's residual variance that is unexplained structure; NaN: not estimated
    unexplained: Interval
    gain: Interval  # of all findings together, open loop, on held-out data; its interval is that of another drive
    not_testable: tuple[NotTestable, ...]
    candidates_tried: int
    tried: tuple[Tried, ...]
    checks: tuple[Check, ...]  # data checks first, then the adequacy tests
    masked: tuple[Masked, ...]
    blocks: tuple[Blocked, ...]
    worst: tuple[Window, ...]
    maps: tuple[OperatingMap, ...]
    spectra: Spectra | None
    closed_loop: tuple[Trajectory, ...]
    shifts: Mapping[str, tuple[Interval, Interval]]  # "range_rate K" -> before, after the extension
    advice: tuple[str, ...]  # which drives would decide what is not testable
    steps: tuple[str, ...]  # what was done, in order
    provenance: Provenance = Provenance()
    rivals: tuple[Rival, ...] = ()  # published car-following models, where they were asked for
    recommended: str = ""  # "canid" or a rival: the model to simulate with behind another lead; "": no rivals
    signals: tuple[SignalFinding, ...] = ()  # findings on the signals
    time: DriveTime | None = None  # what the drive holds
    model: IdentifiedModel | None = None  # the final model, for simulation; None: nothing was identified
    # nats/min, of the driver's findings together, one-step predictive log score on held-out data
    log_score_gain: Interval = Interval()
    null_gain: NullGain = NullGain()  # of `gain`
    drives: tuple[DriveShare, ...] = ()  # where several were diagnosed together
    # sentences: what `identify` finds on this drive that keeps a number from being quoted
    contradictions: tuple[str, ...] = ()
    without_causes: tuple[str, ...] = ()  # sentences: what `identify`, which has no causes, gives instead
    differ: tuple[str, ...] = ()  # sentences: what is not the same on all of them
    visible: tuple[Visible, ...] = ()  # what a diagnosis of the driver that passes its tests could have seen

    def __repr__(self) -> str:
        lines = [f"Report({self.says}"]
        lines += [f"  {name}: {channel!r}" for name, channel in self.extended.channels.items()]
        return "\n".join(lines) + ")"


class Report(_Report, Shown):
    """The diagnosis of one drive."""

    __slots__ = ()


def extends(report: Report) -> bool:
    """Does a finding change a simulated model? One of the remnant changes the law of the noise only.

    Example:
        >>> from types import SimpleNamespace
        >>> extends(SimpleNamespace(findings=()))
        False
    """
    return any(finding.where != "remnant" for finding in report.findings)


def duration(report: Report) -> float:
    """Length of the drive, s."""
    return float(report.t[-1] - report.t[0]) + step(report) if len(report.t) else 0.0


def used_time(report: Report) -> float:
    """Time that the fit uses, s."""
    return float(report.used.sum()) * step(report)


def step(report: Report) -> float:
    """Step of the grid, s; 0 for less than two samples.

    Example:
        >>> from types import SimpleNamespace
        >>> step(SimpleNamespace(t=np.array([5.0, 5.1, 5.2])))
        0.1
    """
    return round(float(report.t[-1] - report.t[0]) / (len(report.t) - 1), 9) if len(report.t) > 1 else 0.0


def no_fit(n: int) -> Fit:
    """Return an empty fit.

    Example:
        >>> no_fit(3).simulated.shape
        (3,)
    """
    return Fit({}, NAN, np.full(n, NAN), NAN)
