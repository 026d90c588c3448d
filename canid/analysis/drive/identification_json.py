"""A drive's parameters as the JSON object that docs/json.md describes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, NotRequired, TypedDict

import numpy as np

from canid.analysis.drive import identification_verdict
from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_summary import DriveSummary
from canid.analysis.drive.identification_verdict import IdentificationVerdict
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.fopdt_whole_drive import Constancy, Segment
from canid.mathematics.identification.armax.armax_batch import Orders
from canid.mathematics.identification.armax.order_selection import Candidate
from canid.mathematics.systems.identified_loop import IdentifiedLoop
from canid.mathematics.systems.posterior_draws import Drawn
from canid.signals.signal_checks.output_ends import OutputEnd
from canid.signals.signal_checks.output_scale import OutputScale
from canid.values.text import json_values
from canid.values.text.numbers import role_unit
from canid.values.types import (
    Array,
    Channel,
    DriveTime,
    Estimate,
    GainChange,
    Interval,
    ResidualTests,
    SignalFinding,
)

# The estimator whose result stands as `whole` alone; every other one's stands under its own name.
UNNAMED = "fopdt"
# significant digits of draws from the posterior: of two hundred a quantile is known to two
DRAW_DIGITS = 5


class StandardErrors(TypedDict):
    """Of the coefficients, in their shapes."""

    A: Array
    B: Mapping[str, Array]
    C: Array
    offset: float


class Whiteness(TypedDict):
    """The Ljung-Box test."""

    white: bool
    statistic: float
    bound: float
    lags: int


class Cross(TypedDict):
    """Correlation of the residual with one input."""

    causal: bool
    feedback: bool


class Whole(TypedDict, total=False):
    """One estimator's result over the whole drive; a key that the method has nothing for is left out."""

    channels: Mapping[str, Channel]
    fit_percent: float
    fit_kind: str
    residual_tests: ResidualTests
    says: str
    # details of FOPDT
    changes: tuple[GainChange, ...]
    segments: tuple[Segment, ...]
    constancy: tuple[Constancy, ...]
    standstill: float
    standstill_share: float
    form_open: bool
    form_spread: float
    # details of ARMAX
    orders: Orders
    dt: float
    standard_errors: StandardErrors
    offset: float
    sigma: float
    poles: list[list[float]]
    whiteness: Whiteness
    cross: Mapping[str, Cross]
    box_jenkins: Mapping[str, Any]


class Armax(Whole):
    """ARMAX's result, which always has its polynomials."""

    A: Array
    B: Mapping[str, Array]
    C: Array
    K: Mapping[str, Interval]


class Headline(Whole):
    """The result that is to be read."""

    estimator: str


class Results(TypedDict):
    """The headline's result, and each estimator's under its name."""

    whole: Headline | None
    fopdt: NotRequired[Whole | None]
    armax: NotRequired[Armax | None]


class OfLog(TypedDict, total=False):
    """What a verb adds that has read a log."""

    damage: str | None  # what could not be read


class Identification(NamedTuple):
    """The object of `canid identify --json`."""

    log: str
    vehicle: str
    verdict: IdentificationVerdict
    duration: float
    driver_time: float
    time: DriveTime
    signals: tuple[SignalFinding, ...]
    windows: tuple[Estimate, ...]
    results: Results
    loop: IdentifiedLoop
    output: str
    unit: str
    summary: DriveSummary  # what a comparison of drives needs (`canid compare`)
    orders: tuple[Candidate, ...]
    of_log: OfLog
    output_scale: OutputScale | None = None  # of a pedal
    output_limits: tuple[OutputEnd, ...] = ()  # that it met


def document(drive: Identified, log: str, vehicle: str, of_log: OfLog | None = None) -> Identification:
    """What `canid identify` writes of one drive."""
    summary = drive.drive_summary
    return Identification(
        log,
        vehicle,
        identification_verdict.verdict(drive, summary.output),
        drive.duration,
        drive.driver_time,
        drive.time,
        drive.findings,
        drive.windows,
        _results(drive),
        drive.loop,
        summary.output,
        role_unit(summary.output) if summary.output else "",
        summary if summary.draws is None else summary._replace(draws=Drawn(*map(short_draws, summary.draws))),
        drive.orders,
        of_log or {},
        drive.output_scale,
        drive.output_limits,
    )


def to_json(drive: Identified, log: str, vehicle: str) -> dict[str, Any]:
    """The same as JSON; null where nothing is known."""
    written: dict[str, Any] = json_values.plain(document(drive, log, vehicle))
    return written


def short_draws(draws: Array) -> Array:
    """Draws with as many digits as their number supports."""
    return np.array([[float(f"{x:.{DRAW_DIGITS}g}") for x in row] for row in draws.tolist()])


def _results(drive: Identified) -> Results:
    first = drive.ranked[0] if drive.whole else ""
    headline = _whole(drive.headline)
    results: dict[str, Any] = {"whole": None if headline is None else {"estimator": first, **headline}}
    results |= {
        name: _whole(result) for name, result in drive.whole.items() if name != UNNAMED or name != first
    }
    return results  # type: ignore[return-value]  # an estimator may have any name


def _whole(result: WholeDrive | None) -> Whole | None:
    if result is None:
        return None
    whole: Whole = {"channels": result.channels}
    if result.fit_percent is not None:
        whole |= {"fit_percent": result.fit_percent, "fit_kind": result.fit_kind}
    if result.residual_tests is not None:
        whole["residual_tests"] = result.residual_tests
    whole.update(result.details)  # type: ignore[typeddict-item]  # of any estimator
    return whole
