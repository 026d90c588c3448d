"""A drive's parameters: over sliding windows, as live, and over the whole drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from canid.analysis.drive import scale_uncertainty
from canid.analysis.drive.drive_summary import DriveSummary, summarise
from canid.mathematics.estimators import (
    ESTIMATORS,
    agreement,
    plausibility,
    pooling,
)
from canid.mathematics.estimators.estimator import AnyRunning, WholeDrive
from canid.mathematics.estimators.fopdt import FOPDT
from canid.mathematics.estimators.whole_drive import estimates, settings_of
from canid.mathematics.estimators.windows import reported_estimates
from canid.mathematics.identification.armax import order_selection
from canid.mathematics.identification.armax.armax_batch import ArmaxFit
from canid.mathematics.identification.armax.order_selection import Candidate
from canid.mathematics.systems.drive_responses import DriveResponses, drive_responses
from canid.mathematics.systems.identified_loop import IdentifiedLoop, identified_loop
from canid.models.diagnosis import causes_not_excluded
from canid.signals.signal_checks import signal_checks
from canid.signals.signal_checks.drive_time import fitted_trace, of_trace
from canid.signals.signal_checks.output_ends import OutputEnd, reached
from canid.signals.signal_checks.output_scale import OutputScale, output_scale
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.signals.vehicle.schema import did_you_mean
from canid.values.presentation import Tabled
from canid.values.types import (
    NAN,
    Channel,
    DriveTime,
    Estimate,
    ResidualTests,
    Sample,
    SignalFinding,
    Trace,
)


class ArmaxDrive(NamedTuple):
    """The ARMAX model of the whole drive."""

    fit: ArmaxFit
    channels: Mapping[str, Channel]
    residual_tests: ResidualTests


class _Identified(NamedTuple):
    duration: float  # s, from the first sample to the last, with pauses
    driver_time: float  # s that are usable, see `signals.signal_checks.drive_time`
    windows: tuple[Estimate, ...]
    whole: Mapping[str, WholeDrive | None]  # estimator -> its result over the whole drive; None: it has none
    orders: tuple[Candidate, ...]  # of ARMAX, compared on this drive, best first
    time: DriveTime = DriveTime(0.0, 0.0, 0.0, 0.0)
    findings: tuple[SignalFinding, ...] = ()  # on the signals
    loop: IdentifiedLoop = IdentifiedLoop()  # margins and string stability with the car
    drive_summary: DriveSummary = DriveSummary()  # conditions, noise and draws, for comparisons of drives
    responses: DriveResponses = DriveResponses()  # to a step and over frequency
    log: str = ""  # name of the log; "": not known, the drive came as a `Trace`
    vehicle: str = ""  # name of the vehicle
    output_scale: OutputScale | None = (
        None  # of a pedal; None: the output is none, or nothing was read of one
    )
    output_limits: tuple[OutputEnd, ...] = ()  # that the output met, a pedal at 0 % apart

    def __repr__(self) -> str:
        name = self.ranked[0] if self.whole else "no estimator"
        prefix = f"{self.log}: " if self.log else ""
        lines = [f"Identified({prefix}{self.recorded:.0f} s, {self.driver_time:.0f} s usable, {name}"]
        lines += [f"  {channel}: {estimate!r}" for channel, estimate in self.channels.items()]
        return "\n".join(lines) + ")"

    @property
    def recorded(self) -> float:
        """`duration` without the pauses of the log, and between episodes, s."""
        return min(self.duration, self.time.total) if self.time.total else self.duration

    @property
    def ranked(self) -> list[str]:
        """Estimators with a result over the whole drive, by who carries the headline; for steering ARMAX."""
        results = [result for result in (*self.whole.values(), *self.windows) if result is not None]
        return agreement.by_headline(self.whole, {name for result in results for name in result.channels})

    @property
    def headline(self) -> WholeDrive | None:
        """The result over the whole drive that is to be read; None: it has none."""
        return self.whole[self.ranked[0]] if self.whole else None

    @property
    def channels(self) -> Mapping[str, Channel]:
        """The headline over the whole drive, FOPDT's or for steering ARMAX's: input name -> Channel."""
        headline = self.headline
        return {} if headline is None else headline.channels

    @property
    def fit_percent(self) -> float:
        """Fit of the headline over the whole drive; NaN where it has none."""
        headline = self.headline
        return NAN if headline is None or headline.fit_percent is None else headline.fit_percent

    @property
    def armax(self) -> ArmaxDrive | None:
        """ARMAX over the whole drive; None: too few data, or no stable model."""
        result = self.whole.get("armax")
        if result is None or result.residual_tests is None:
            return None
        return ArmaxDrive(result.model, result.channels, result.residual_tests)


class Identified(_Identified, Tabled):
    """Parameters of the driver of one drive."""

    __slots__ = ()


def identify(
    trace: Trace, *, select_orders: bool = True, sliding: bool = True, **settings: Any
) -> Identified:
    """Identify the driver of a whole drive.

    Args:
        trace: from `read_trace`.
        select_orders: compare other orders of ARMAX as well.
        sliding: estimate in sliding windows as well, which takes two thirds of the time.
        **settings: by estimator: `armax=ArmaxSettings(...)`, `fopdt=FopdtSettings(...)`; or None: its defaults.

    Returns:
        an `Identified`; what is not identifiable from the drive is NaN, never an exception.

    Raises:
        TypeError: settings of an estimator that does not exist.

    Example:
        >>> import canid
        >>> drive = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> result = canid.identify(drive, select_orders=False)
        >>> result.channels["range_rate"].K.low < 5.62 < result.channels["range_rate"].K.high  # its truth
        True
    """
    unknown = sorted(settings.keys() - {estimator.name for estimator in ESTIMATORS})
    if unknown:
        names = ", ".join(estimator.name for estimator in ESTIMATORS)
        hint = did_you_mean(
            unknown[0], ("start", "stop", "vehicle", "select_orders", "sliding", *names.split(", "))
        )
        raise TypeError(
            f"identify: no argument and no estimator is called {unknown[0]!r}{hint}; estimators: {names}"
        )
    fitted = fitted_trace(trace)
    identified = _whole_drive(fitted, trace, settings)
    whole = causes_not_excluded.averaged_over(identified.whole, trace)
    rows = pooling.pooled(fitted)
    ready = rows.learn & np.isfinite(rows.output) & np.isfinite(rows.inputs).all(axis=1)
    return identified._replace(
        whole=whole,
        windows=tuple(windows(trace, **settings)) if sliding else (),
        orders=tuple(
            order_selection.compare(rows.output, rows.inputs, ready, segment=rows.segment, dt=rows.dt)
            if select_orders
            else ()
        ),
        loop=_loop(whole[FOPDT.name], fitted, settings_of(FOPDT, trace, settings).output),
        drive_summary=summarise(fitted, whole[FOPDT.name], settings_of(FOPDT, trace, settings)),
        responses=drive_responses(whole, fitted),
    )


def whole_drive(trace: Trace, **settings: Any) -> Identified:
    """The estimates over the whole drive alone, which decide what may be quoted: of a driver without a hidden cause.

    Args:
        trace: from `read_trace`.
        **settings: as of `identify`.
    """
    return _whole_drive(fitted_trace(trace), trace, settings)


def _whole_drive(fitted: Trace, trace: Trace, settings: Mapping[str, Any]) -> Identified:
    limited = with_limits(trace)
    time = of_trace(limited)
    return Identified(
        duration=float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0,
        driver_time=time.usable,
        windows=(),
        whole=scale_uncertainty.widened(estimates(fitted, trace, settings), limited),
        orders=(),
        time=time,
        findings=trace.findings,
        output_scale=output_scale(trace.output, trace.dt, trace.full_scale, trace.findings),
        output_limits=reached(limited),
    )


def _loop(result: WholeDrive | None, trace: Trace, output: str) -> IdentifiedLoop:
    """Margins by FOPDT's model, the one that has a joint posterior."""
    if result is None:
        return identified_loop(None, {}, trace, output)
    if result.details.get("changes"):
        return IdentifiedLoop("the gains changed during the drive: no one loop holds for all of it")
    left = plausibility.left_over(result.residual_tests) if result.residual_tests is not None else ""
    if left:
        return IdentifiedLoop(f"{left}, nor margins, which depend on them")
    return identified_loop(result.model, result.channels, trace, output)


def windows(trace: Trace, **settings: Any) -> list[Estimate]:
    """Estimates of each estimator along the drive, one every 10 s: the same numbers as live."""
    running: list[AnyRunning] = [
        estimator.make(trace.input_names, trace.dt, settings_of(estimator, trace, settings))
        for estimator in ESTIMATORS
    ]
    made = reported_estimates(running, samples(trace), signal_checks.forgotten_at(trace.findings))
    if not trace.findings:
        return made
    return [signal_checks.withheld(e, signal_checks.at(trace.findings, e.t)) for e in made]


# signals that estimators read besides output and inputs
SIGNALS = ("headway", "speed")
# rows that are made samples at once: a whole drive's would take 20 MB an hour
ROWS_AT_ONCE = 1024


def samples(trace: Trace) -> Iterator[Sample]:
    """The trace row by row, as the estimators take it."""
    bounds = np.full(len(trace.t), NAN) if trace.bound is None else trace.bound
    for a in range(0, len(trace.t), ROWS_AT_ONCE):
        part = slice(a, a + ROWS_AT_ONCE)
        numbers = (trace.t, trace.output, trace.inputs, trace.learn, trace.segment, bounds)
        signals = {role: trace.signals[role][part].tolist() for role in SIGNALS if role in trace.signals}
        rows = zip(*(column[part].tolist() for column in numbers), trace.gate[part], strict=True)
        for k, (t, y, u, learn, segment, bound, gate) in enumerate(rows):
            at = {role: column[k] for role, column in signals.items()}
            yield Sample(t, y, tuple(u), gate, learn, segment, at, bound)
