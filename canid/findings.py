"""The nouns of the diagnosis: what the simulation gets wrong, why, and what a better model gains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.types import NAN, Array, Channel, Interval

Flags = npt.NDArray[np.bool_]


class Verdict(Enum):
    """What a diagnosis may say. The member's value is its public name."""

    ADEQUATE = "adequate"  # the simulation holds: nothing that this drive can show is wrong with it
    NAMED = "named"
    ONE_OF = "one_of"  # several causes explain it equally well
    UNEXPLAINED = "unexplained"  # something is wrong that no known cause explains
    NOT_ENOUGH_DATA = "not_enough_data"


class Fit(NamedTuple):
    """One model on the whole drive: its parameters and its simulation from the measured inputs."""

    channels: Mapping[str, Channel]
    fit_percent: float  # 100 (1 − |y − simulated| / |y − mean|)
    simulated: Array  # (n,) output unit; NaN where nothing can be simulated
    noise_sd: float  # output unit; what stays unexplained of the output


class Finding(NamedTuple):
    """One cause that was found."""

    effect: str  # id in CATALOGUE
    where: str  # "driver", "vehicle", "sensing"
    rivals: tuple[str, ...]  # causes that explain the same data as well, or must by their form
    surrogate: bool  # it helps, but leaves structure behind: not the cause
    parameters: Mapping[str, Interval]
    units: Mapping[str, str]  # parameter -> unit
    gain: Interval  # relative reduction of the simulation's error variance on data that chose nothing
    says: str
    evidence: (
        float  # 2 Δ log likelihood over the model without it, robust against the noise's own colour and size
    )
    needed: float  # what the evidence had to exceed, all candidates counted
    episodes: tuple[tuple[float, float], ...] = ()  # s; when, for causes that come and go


class Tried(NamedTuple):
    """One candidate at one step of the search."""

    effect: str
    where: str
    step: int  # 1, 2, ...: with how many causes in the model it was tried, plus one
    evidence: float  # 2 Δ log likelihood; NaN: not computed
    needed: float
    expected: float  # evidence that a typical strength of it would leave on this drive; NaN: not computed
    outcome: str  # "accepted", "rejected", "rival", "not_testable"
    why: str


class NotTestable(NamedTuple):
    """What this drive cannot decide."""

    effects: tuple[str, ...]  # one: invisible here; two: cannot be told apart here
    why: str  # with the drive that would decide


class Check(NamedTuple):
    """One check of the data or of the model."""

    name: str
    passed: bool | None  # None: could not be made
    value: float
    limit: float
    says: str
    unit: str = ""  # of value and limit
    gate: bool = False  # of the adequacy gate, not of the data


class Masked(NamedTuple):
    """A stretch that says nothing about the driver."""

    effect: str  # id of the mask in CATALOGUE
    start: float  # s
    stop: float


def masked_for(masked: Iterable[Masked]) -> dict[str, float]:
    """Seconds per mask, longest first.

    Example:
        >>> masked_for([Masked("cut_in", 3.0, 5.0), Masked("cruise_control", 9.0, 60.0)])
        {'cruise_control': 51.0, 'cut_in': 2.0}
    """
    seconds: dict[str, float] = {}
    for one in masked:
        seconds[one.effect] = seconds.get(one.effect, 0.0) + one.stop - one.start
    return dict(sorted(seconds.items(), key=lambda pair: -pair[1]))


class Window(NamedTuple):
    """Where in time the simulation is wrong."""

    start: float  # s
    stop: float
    before: float  # root mean square of the residual, output unit
    after: float


class OperatingMap(NamedTuple):
    """Where over operating points the simulation is wrong."""

    x: str  # role
    y: str
    x_edges: Array  # (p + 1,)
    y_edges: Array  # (q + 1,)
    before: Array  # (p, q) mean residual, output unit; NaN: never there
    after: Array  # (p, q)
    seconds: Array  # (p, q)


class Spectra(NamedTuple):
    """At which frequencies the simulation is wrong."""

    frequency: Array  # (m,) Hz
    before: Array  # (m,) output unit² / Hz
    after: Array  # (m,)
    coherence_before: Mapping[str, Array]  # input -> (m,) with the residual, 0 to 1
    coherence_after: Mapping[str, Array]
    level: float  # a coherence above this is no chance (99 %)


class Trajectory(NamedTuple):
    """One quantity in closed loop: lead from the log, driver and car simulated."""

    role: str
    measured: Array  # (n,)
    before: Array  # (n,)
    after: Array  # (n,)
    gain: Interval  # relative reduction of the error's variance


class Blocked(NamedTuple):
    """What was looked at in one block of the loop."""

    where: str  # "driver", "vehicle", "sensing"
    state: str  # "adequate", "wrong", "unexplained", "not_testable"
    says: str


class Provenance(NamedTuple):
    """What a reader needs to get the same report again."""

    log: str = ""
    log_sha256: str = ""
    vehicle: str = ""
    vehicle_sha256: str = ""
    command: str = ""
    versions: Mapping[str, str] = {}
    dbc_sha256: Mapping[str, str] = {}  # DBC file -> its hash


class Report(NamedTuple):
    """The diagnosis of one drive."""

    verdict: Verdict
    says: str  # the verdict line
    output: str  # role of the driver's output
    t: Array  # (n,) s
    measured: Array  # (n,) output
    used: Flags  # (n,) samples that the fit rests on
    baseline: Fit
    extended: Fit  # the baseline again where nothing was found
    findings: tuple[Finding, ...]
    unexplained: (
        Interval  # share of the extended model's residual variance that an unknown cause holds; NaN: not told
    )
    gain: Interval  # of all findings together, open loop, on data that chose nothing
    not_testable: tuple[NotTestable, ...]
    candidates_tried: int
    tried: tuple[Tried, ...]
    checks: tuple[Check, ...]  # data checks first, then the adequacy gate's
    masked: tuple[Masked, ...]
    blocks: tuple[Blocked, ...]
    worst: tuple[Window, ...]
    maps: tuple[OperatingMap, ...]
    spectra: Spectra | None
    closed_loop: tuple[Trajectory, ...]
    shifts: Mapping[str, tuple[Interval, Interval]]  # "range_rate K" -> before, after the extension
    advice: tuple[str, ...]  # what to drive to decide what could not be decided
    steps: tuple[str, ...]  # what was done, in order
    provenance: Provenance = Provenance()


def no_fit(n: int) -> Fit:
    """Return the fit of a drive on which nothing could be fitted.

    Example:
        >>> no_fit(3).simulated.shape
        (3,)
    """
    return Fit({}, NAN, np.full(n, NAN), NAN)
