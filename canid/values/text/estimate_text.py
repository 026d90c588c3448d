"""Estimates as lines of text: one channel, one estimate, its residual tests, and the monitor's reports."""

from __future__ import annotations

import math
from collections.abc import Mapping

from canid.values.text.names import HEADLINE_MARK, SYMBOLS, method, readable
from canid.values.text.numbers import clock, gain_unit, interval
from canid.values.types import (
    Channel,
    Estimate,
    Identifiable,
    Interval,
    MonitorReport,
    Progress,
    ResidualTests,
    Status,
)

# decimals of K, τ and θ in lines that follow one another: fixed, so that the eye can compare. Summaries and pages have the
# decimals that the interval supports.
DECIMALS = 2


def fixed(iv: Interval) -> str:
    """Value and 95 % interval with a fixed number of decimals.

    Example:
        >>> fixed(Interval(4.412, 3.58, 5.21))
        '4.41 [3.58, 5.21]'
    """
    return interval(iv, places=DECIMALS)


def delays(ch: Channel, places: int | None = DECIMALS) -> str:
    """Lag τ and dead time θ; in brackets what is known of them and may not be quoted yet.

    `places`: decimals of what may be quoted; None: as many as the intervals support.

    Example:
        >>> known = Channel(tau=Interval(0.42, 0.03, 0.71), tau_plus_dead_time=Interval(0.8, 0.7, 0.9))
        >>> delays(known._replace(status=Identifiable.SUM_ONLY))
        'τ+θ 0.80 [0.70, 0.90] s (τ < 0.7 s)'
        >>> delays(known._replace(status=Identifiable.GAIN_ONLY))
        '(τ+θ 0.8 [0.7, 0.9] s, τ < 0.7 s)'
    """
    if ch.status is Identifiable.OK:
        return f"τ {interval(ch.tau, 's', places)}  θ {interval(ch.dead_time, 's', places)}"
    if ch.status is Identifiable.SUM_ONLY:
        return f"τ+θ {interval(ch.tau_plus_dead_time, 's', places)}{_bracketed(ch, 'tau')}"
    if ch.status is Identifiable.GAIN_ONLY:
        return _bracketed(ch, "tau_plus_dead_time", "tau").lstrip()
    return ""


def _bracketed(ch: Channel, *names: str) -> str:
    rough = [
        f"{SYMBOLS[name]} {bounded(getattr(ch, name))}"
        for name in names
        if math.isfinite(getattr(ch, name).value)
    ]
    return f" ({', '.join(rough)})" if rough else ""


# s; a delay whose interval begins below this is bounded on one side only
ONE_SIDED_BELOW_S = 0.1


def bounded(iv: Interval) -> str:
    """A delay that may not be quoted: its interval, or its bound where it is known on one side only.

    Example:
        >>> bounded(Interval(0.5, 0.3, 0.9)), bounded(Interval(0.5, 0.02, 0.9))
        ('0.5 [0.3, 0.9] s', '< 0.9 s')
    """
    return f"< {iv.high:.1f} s" if iv.low < ONE_SIDED_BELOW_S else interval(iv, "s", 1)


def missing(progress: Progress, unit: str = "") -> str:
    """What is missing until more may be quoted, and how much more such driving would do; `unit`: of K.

    Example:
        >>> missing(Progress("tau", 0.2, 0.1, 180.0))
        'τ ±0.20 s, needed ±0.10 s: +180 s'
        >>> missing(Progress("K", 2.0, 1.5, math.nan), "% per s")
        'K ±2.00, needed ±1.50 % per s'
    """
    if progress.parameter == "K":
        known = f"K ±{progress.sd:.2f}, needed ±{progress.needed:.2f}{f' {unit}' if unit else ''}"
    else:
        known = f"{SYMBOLS[progress.parameter]} ±{progress.sd:.2f} s, needed ±{progress.needed:.2f} s"
    return f"{known}: +{_forecast(progress.seconds)}" if progress.seconds > 0.0 else known


def _forecast(seconds: float) -> str:
    """A time to the precision that a forecast has."""
    if seconds < 600.0:
        return f"{max(round(seconds, -1), 10.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.0f} h"


def all_missing(channels: Mapping[str, Channel], output: str = "") -> str:
    """What is missing of each channel, in one line; empty where nothing is. `output`: its role, for the unit of K.

    Example:
        >>> all_missing({"range_rate": Channel(progress=Progress("tau", 0.2, 0.1, 180.0))})
        'to quote more: range rate τ ±0.20 s, needed ±0.10 s: +180 s'
    """
    each = [
        f"{readable(name)} {missing(ch.progress, gain_unit(output, name) if output else '')}"
        for name, ch in channels.items()
        if ch.progress is not None
    ]
    return f"to quote more: {' · '.join(each)}" if each else ""


def unknown(ch: Channel) -> str:
    """What stands for the numbers of a channel none of which may be quoted; why one is withheld is said once, elsewhere.

    Example:
        >>> unknown(Channel()), unknown(Channel(withheld="the gains changed during the drive, at 60 s"))
        ('not identifiable', 'not to be quoted')
    """
    return "not to be quoted" if ch.withheld else "not identifiable"


def channel(name: str, ch: Channel, output: str = "", places: int | None = DECIMALS) -> str:
    """One channel in one line.

    Args:
        name: of the input.
        ch: what is known of it.
        output: role of the driver's output, for the unit of K.
        places: decimals; None: as many as the intervals support.

    Example:
        >>> K = Channel(Interval(7.232, 2.31, 11.28), status=Identifiable.GAIN_ONLY)
        >>> channel("range_rate", K), channel("range_rate", K, "pedal", None)
        ('range rate: K 7.23 [2.31, 11.28]', 'range rate: K 7.2 [2.3, 11.3] % per m/s')
    """
    if ch.status is Identifiable.NOT:
        return f"{readable(name)}: {unknown(ch)}"
    gain = interval(ch.K, gain_unit(output, name) if output else "", places)
    return f"{readable(name)}: K {gain}  {delays(ch, places)}".rstrip()


def residual_tests(tests: ResidualTests) -> list[str]:
    """The residual tests, one line each, with ✓ where a test is passed and ✗ where it fails.

    Example:
        >>> tests = ResidualTests(True, 20.0, 41.6, (), ("range_rate",), True, {"range_rate": 18})
        >>> for line in residual_tests(tests): print(line)
        ✓ residuals white (Ljung–Box 20, bound 42)
        ✓ range rate: no response left in the residuals; the loop is closed
        ✓ residual variance stationary: no trend
        order of persistent excitation: 18 in range rate
    """
    if tests.statistic != tests.statistic:
        return ["residuals not tested: too few data"]
    white = "white" if tests.white else "not white: the order of the model or of its noise is too low"
    marks = {True: "✓", False: "✗"}
    lines = [
        f"{marks[tests.white]} residuals {white} (Ljung–Box {tests.statistic:.0f}, bound {tests.bound:.0f})"
    ]
    for name in tests.excitation_order:
        left = "no response left in the residuals"
        if name in tests.left_over:
            share = tests.left_over_share.get(name)
            size = "" if share is None else f", {100 * share:.0f} % of the model's own"
            left = f"part of the response is not modelled{size}"
        loop = "; the loop is closed" if name in tests.feedback else ""
        lines.append(f"{marks[name not in tests.left_over]} {readable(name)}: {left}{loop}")
    variance = "stationary: no trend" if tests.stationary else "not stationary: it has a trend"
    order = ", ".join(f"{n} in {readable(name)}" for name, n in tests.excitation_order.items())
    lines.append(f"{marks[tests.stationary]} residual variance {variance}")
    return [*lines, f"order of persistent excitation: {order}"]


def estimate(e: Estimate, output: str = "") -> str:
    """One estimate in one line; the headline estimate is marked. `output`: role of the driver's output, for the unit of K.

    Example:
        >>> K = Channel(Interval(4.4, 3.6, 5.2), status=Identifiable.GAIN_ONLY)
        >>> estimate(Estimate(60.0, "fopdt", Status.OK, "range rate: K only", {"range_rate": K}, headline=True))
        '▶    60.0 s  FOPDT   ok            range rate: K 4.40 [3.60, 5.20]'
    """
    mark = HEADLINE_MARK if e.headline else " "
    parts = [f"{mark}{e.t:8.1f} s", f"{method(e.estimator):6}", f"{readable(e.status.value):12}"]
    known = [
        channel(name, ch, output) for name, ch in e.channels.items() if ch.status is not Identifiable.NOT
    ]
    return "  ".join(parts) + "  " + (" | ".join(known) if known and e.status is Status.OK else e.says)


def misfit(s: MonitorReport) -> str:
    """Since when which block does not fit its model, or what fits.

    Example:
        >>> misfit(MonitorReport(90.0, False, 62.0, "vehicle", "the vehicle responds less", {}))
        'since 1:02.0 the model does not fit; vehicle suspected: the vehicle responds less'
        >>> misfit(MonitorReport(240.0, True, 230.0, "", "fits: driver", {}))
        'since 3:50.0 the model fits again; fits: driver'
    """
    if s.since != s.since:
        return s.says
    since = f"since {clock(s.since)}" if s.since >= 0 else "since before this start"
    if s.fits:
        return f"{since} the model fits again; {s.says}"
    return f"{since} the model does not fit; {s.block} suspected: {s.says}"


def monitor_report(s: MonitorReport) -> str:
    """A report of the monitor in one line.

    Example:
        >>> monitor_report(MonitorReport(90.0, True, float("nan"), "", "fits: driver", {}))
        '     90.0 s  monitor fits          fits: driver'
    """
    return f" {s.t:8.1f} s  {'monitor':7} {'fits' if s.fits else 'misfit':12}  {misfit(s)}"
