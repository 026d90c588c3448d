"""A drive's parameters: over sliding windows, as live, and over the whole drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import numpy as np

from canid import presentation
from canid.drive_summary import DriveSummary, summarise
from canid.estimators import ESTIMATORS, agreement, plausibility, pooling
from canid.estimators.estimator import AnyEstimator, AnyRunning, WholeDrive
from canid.estimators.fopdt import FOPDT
from canid.estimators.windows import reported_estimates
from canid.identification.armax import order_selection
from canid.identification.armax.armax_batch import ArmaxFit
from canid.identification.armax.order_selection import Candidate
from canid.identification.identifiability import not_quotable
from canid.signal_checks import signal_checks
from canid.signal_checks.drive_time import of_trace, usable
from canid.systems.identified_loop import IdentifiedLoop, identified_loop
from canid.types import (
    NAN,
    Channel,
    DriveTime,
    Estimate,
    ResidualTests,
    Sample,
    SignalFinding,
    Trace,
)

if TYPE_CHECKING:
    import pandas
    import polars


class ArmaxDrive(NamedTuple):
    """The ARMAX model of the whole drive."""

    fit: ArmaxFit
    channels: Mapping[str, Channel]
    residual_tests: ResidualTests


class Identified(NamedTuple):
    """Parameters of the driver of one drive."""

    duration: float  # s
    driver_time: float  # s that are usable, see `signal_checks.drive_time`
    windows: tuple[Estimate, ...]
    whole: Mapping[str, WholeDrive | None]  # estimator -> its result over the whole drive; None: it has none
    orders: tuple[Candidate, ...]  # of ARMAX, compared on this drive, best first
    time: DriveTime = DriveTime(0.0, 0.0, 0.0, 0.0)
    findings: tuple[SignalFinding, ...] = ()  # on the signals
    loop: IdentifiedLoop = IdentifiedLoop()  # margins and string stability with the car
    drive_summary: DriveSummary = DriveSummary()  # conditions, noise and draws, for comparisons of drives
    log: str = ""  # name of the log; "": not known, the drive came as a `Trace`
    vehicle: str = ""  # name of the vehicle

    def __repr__(self) -> str:
        name = self.ranked[0] if self.whole else "no estimator"
        of = f"{self.log}: " if self.log else ""
        lines = [f"Identified({of}{self.duration:.0f} s, {self.driver_time:.0f} s usable, {name}"]
        lines += [f"  {channel}: {found!r}" for channel, found in self.channels.items()]
        return "\n".join(lines) + ")"

    @overload
    def to_frame(self, library: Literal["pandas"]) -> pandas.DataFrame: ...
    @overload
    def to_frame(self, library: Literal["polars"]) -> polars.DataFrame: ...
    @overload
    def to_frame(self, library: Literal[""] = "") -> Any: ...
    def to_frame(self, library: str = "") -> Any:
        """The headline's parameters as a data frame, one row each: input, parameter, value, low, high, unit, quotable.

        Args:
            library: as in `Trace.to_frame`.
        """
        return presentation.frame(self, library)

    def summary(self) -> str:
        """The result as text, as `canid identify` prints it."""
        return presentation.summary(self)

    def plot(self) -> Any:
        """The parameters over the windows of the drive, with those of the whole drive, as a plotly Figure."""
        return presentation.plot(self)

    def _repr_html_(self) -> str:
        return presentation.html(self)

    @property
    def ranked(self) -> list[str]:
        """Estimators with a result over the whole drive, by who carries the headline; for steering ARMAX."""
        results = [found for found in (*self.whole.values(), *self.windows) if found is not None]
        return agreement.by_headline(self.whole, {name for found in results for name in found.channels})

    @property
    def headline(self) -> WholeDrive | None:
        """The result over the whole drive that is to be read; None: it has none."""
        return self.whole[self.ranked[0]] if self.whole else None

    @property
    def channels(self) -> Mapping[str, Channel]:
        """The headline over the whole drive, FOPDT's or for steering ARMAX's: input name -> Channel."""
        found = self.headline
        return {} if found is None else found.channels

    @property
    def fit_percent(self) -> float:
        """Fit of the headline over the whole drive; NaN where it has none."""
        found = self.headline
        return NAN if found is None or found.fit_percent is None else found.fit_percent

    @property
    def armax(self) -> ArmaxDrive | None:
        """ARMAX over the whole drive; None: too few data, or no stable model."""
        found = self.whole.get("armax")
        if found is None or found.residual_tests is None:
            return None
        return ArmaxDrive(found.model, found.channels, found.residual_tests)


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
        >>> found = canid.identify(drive, select_orders=False)
        >>> found.channels["range_rate"].K.low < 5.62 < found.channels["range_rate"].K.high  # its truth
        True
    """
    unknown = sorted(settings.keys() - {estimator.name for estimator in ESTIMATORS})
    if unknown:
        names = ", ".join(estimator.name for estimator in ESTIMATORS)
        raise TypeError(f"identify: no estimator is called {', '.join(unknown)}; there are {names}")
    used = usable(trace)
    time = of_trace(trace)
    # what a wrong signal has touched teaches nothing; the windows are withheld, as live
    trusted = trace if used.all() or not trace.findings else trace._replace(learn=used, bound=None)
    rows = pooling.pooled(trusted)
    ready = rows.learn & np.isfinite(rows.output) & np.isfinite(rows.inputs).all(axis=1)
    whole = _with_changes(
        {
            estimator.name: estimator.identify(trusted, settings_of(estimator, trace, settings))
            for estimator in ESTIMATORS
            if estimator.identify is not None
        }
    )
    return Identified(
        duration=float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0,
        driver_time=time.usable,
        windows=tuple(windows(trace, **settings)) if sliding else (),
        whole=whole,
        orders=tuple(
            order_selection.compare(rows.output, rows.inputs, ready, segment=rows.segment, dt=rows.dt)
            if select_orders
            else ()
        ),
        time=time,
        findings=trace.findings,
        loop=_loop(whole[FOPDT.name], trusted, settings_of(FOPDT, trace, settings).output),
        drive_summary=summarise(trusted, whole[FOPDT.name], settings_of(FOPDT, trace, settings)),
    )


def _loop(found: WholeDrive | None, trace: Trace, output: str) -> IdentifiedLoop:
    """Margins by FOPDT's model, the one that has a joint posterior."""
    if found is None:
        return identified_loop(None, {}, trace, output)
    if found.details.get("changes"):
        return IdentifiedLoop("the gains changed during the drive: no one loop holds for all of it")
    left = plausibility.left_over(found.residual_tests) if found.residual_tests is not None else ""
    if left:
        return IdentifiedLoop(f"{left}, nor margins, which depend on them")
    return identified_loop(found.model, found.channels, trace, output)


# said of a method that finds no changes itself, where another has found some
CHANGED = "the gains changed during the drive: none of these holds for all of it"


def _with_changes(whole: dict[str, WholeDrive | None]) -> dict[str, WholeDrive | None]:
    """Where one method finds that the gains changed, nothing that another says of the whole drive may be quoted."""
    if not any(found.details.get("changes") for found in whole.values() if found is not None):
        return whole
    out = dict(whole)
    for name, found in whole.items():
        if found is not None and not found.details.get("changes"):
            channels = {key: not_quotable(c) for key, c in found.channels.items()}
            out[name] = found._replace(channels=channels, lines=(CHANGED, *found.lines))
    return out


def windows(trace: Trace, **settings: Any) -> list[Estimate]:
    """Estimates of each estimator along the drive, one every 10 s: the same numbers as live."""
    running: list[AnyRunning] = [
        estimator.make(trace.input_names, trace.dt, settings_of(estimator, trace, settings))
        for estimator in ESTIMATORS
    ]
    made = reported_estimates(running, samples(trace))
    if not trace.findings:
        return made
    return [signal_checks.withheld(e, signal_checks.at(trace.findings, e.t)) for e in made]


def settings_of(estimator: AnyEstimator, trace: Trace, given: Mapping[str, Any]) -> Any:
    """Return the given settings or the defaults, with what the drive says of its output where they say nothing.

    Args:
        estimator: whose settings.
        trace: of the drive.
        given: by the estimators' names.
    """
    settings = given.get(estimator.name) or estimator.settings()
    if hasattr(settings, "output_filter") and settings.output_filter is None:
        settings = settings._replace(output_filter=trace.output_filter)
    return settings


# rows that are made samples at once: a whole drive's would take 20 MB an hour
ROWS_AT_ONCE = 1024


def samples(trace: Trace) -> Iterator[Sample]:
    """The trace row by row, as the estimators take it."""
    bounds = np.full(len(trace.t), NAN) if trace.bound is None else trace.bound
    for a in range(0, len(trace.t), ROWS_AT_ONCE):
        part = slice(a, a + ROWS_AT_ONCE)
        numbers = (trace.t, trace.output, trace.inputs, trace.learn, trace.segment, bounds)
        rows = zip(*(column[part].tolist() for column in numbers), trace.gate[part], strict=True)
        for t, y, u, learn, segment, bound, gate in rows:
            yield Sample(t, y, tuple(u), gate, learn, segment, {}, bound)
