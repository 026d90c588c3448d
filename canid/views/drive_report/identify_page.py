"""The identification of one or several logs as one self-contained HTML page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.drive_parameters import Identified
from canid.drive_series import DriveSeries
from canid.estimators import step_watch
from canid.findings import Provenance
from canid.identification.identifiability import quotable
from canid.types import Channel, Interval, Trace
from canid.views import estimate_text, identification_verdict, signal_text
from canid.views.drive_report import gates, loop_rows, page_parts, residual_rows
from canid.views.drive_report.autocorrelation_plot import autocorrelation_plot
from canid.views.drive_report.estimates_over_time import estimates_over_time
from canid.views.drive_report.level_over_time import level_over_time
from canid.views.drive_report.model_over_time import model_over_time
from canid.views.drive_report.strips import strips
from canid.views.names import HEADLINE_MARK, SYMBOLS, readable
from canid.views.numbers import gain_unit, interval, number, role_unit
from canid.views.report.figure import Figure

# points of a line: of one log, and of each of several
MAX_POINTS, MAX_POINTS_OF_SEVERAL = 6000, 2500
PARAMETERS = ("K", "tau", "dead_time", "tau_plus_dead_time")
# candidates of the order selection that are listed
ORDERS_SHOWN = 12


class IdentifiedLog(NamedTuple):
    """One log, as the page shows it."""

    identified: Identified
    trace: Trace
    output: str  # role of the driver's output
    series: DriveSeries | None
    health: Sequence[str]  # what was wrong with the log, sentences
    provenance: Provenance
    vehicle: str = ""  # its name
    damaged: bool = False


class Cell(NamedTuple):
    """A number of a table."""

    text: str
    may: bool  # be quoted


class Row(NamedTuple):
    """A parameter of a table."""

    name: str
    unit: str
    cells: list[Cell]


def page(logs: Sequence[IdentifiedLog]) -> str:
    """The page.

    Args:
        logs: one, or several: a table of all of them, and a section for each.

    Returns:
        The page, to be stored as UTF-8.
    """
    many = len(logs) > 1
    drives = [_drive(log, f"drive-{k + 1}-" if many else "") for k, log in enumerate(logs)]
    for d, short in zip(drives, short_names([log.provenance.log for log in logs]), strict=True):
        d["short"] = short
    figures = [f for d in drives for f in _figures(d["figures"])]
    first = logs[0]
    names = first.trace.input_names
    columns = [
        (f"{readable(name)} {SYMBOLS[what]}", gain_unit(first.output, name) if what == "K" else "s")
        for name in names
        for what in ("K", "tau_plus_dead_time")
    ]
    return page_parts.render(
        "identify.html.j2",
        figures,
        drives=drives,
        columns=columns,
        known=sum(d["verdict"].identifiable for d in drives),
        provenance=_together([log.provenance for log in logs]),
    )


def short_names(paths: Sequence[str]) -> list[str]:
    """Names of files without their folders, unless two of them would be the same.

    Example:
        >>> short_names(["a/one.blf", "b/two.blf"]), short_names(["a/one.blf", "b/one.blf"])
        (['one.blf', 'two.blf'], ['a/one.blf', 'b/one.blf'])
    """
    short = [path.replace("\\", "/").rpartition("/")[2] for path in paths]
    return short if len(set(short)) == len(set(paths)) else list(paths)


def _together(each: Sequence[Provenance]) -> Provenance:
    """The provenance of several logs read by one command."""
    return each[0]._replace(
        log=", ".join(p.log for p in each),
        log_sha256=", ".join(p.log_sha256 for p in each),
        recorded=", ".join(filter(None, (p.recorded for p in each))),
    )


def _figures(of: Mapping[str, Any]) -> list[Figure | None]:
    return [of["model"], of["gate"], of["level"], *of["windows"], of["autocorrelation"]]


def _drive(log: IdentifiedLog, anchor: str) -> dict[str, Any]:
    """What the template shows of one log."""
    drive, trace, output = log.identified, log.trace, log.output
    headline = drive.headline
    most = MAX_POINTS_OF_SEVERAL if anchor else MAX_POINTS
    span = (float(trace.t[0]), float(trace.t[-1])) if len(trace.t) else (0.0, 1.0)
    of = identification_verdict.verdict(drive, output)
    methods = [name for name in drive.ranked if drive.whole[name] is not None]
    channels = {name: found.channels for name in methods if (found := drive.whole[name]) is not None}
    tests = None if headline is None else headline.residual_tests
    shown = ("tau_plus_dead_time",) if headline is not None else ()
    armax = drive.armax
    return {
        "anchor": anchor,
        "log": log.provenance.log,
        "vehicle": log.vehicle,
        "recorded": log.provenance.recorded,
        "health": log.health,
        "damaged": log.damaged,
        "verdict": of,
        "key": _key(log),
        "methods": [{"name": name.upper(), "fit": _fit(drive, name)} for name in methods],
        "parameters": [
            Row(
                f"{readable(name)} {SYMBOLS[what]}",
                gain_unit(output, name) if what == "K" else "s",
                [_cell(channels[method].get(name, Channel()), what) for method in methods],
            )
            for name in trace.input_names
            for what in PARAMETERS
            if any(math.isfinite(getattr(c.get(name, Channel()), what).value) for c in channels.values())
        ],
        "missing": _missing(drive, methods, output),
        "channel_names": trace.input_names,
        "stretches": _stretches(drive, trace.input_names, output),
        "changes": [step_watch.says(c) for c in _details(drive).get("changes", ())],
        "figures": {
            "model": model_over_time(f"{anchor}model", trace, log.series, output, drive.fit_percent, most),
            "gate": strips(
                f"{anchor}gate",
                "What is used for identification",
                "used: the gate is open, and the seconds after its opening are over; settling: these seconds, in which "
                "earlier transients decay.",
                gates.gate_strip(trace.t, trace.gate, trace.learn, trace.findings, trace.dt),
                span,
            ),
            "level": level_over_time(f"{anchor}level", drive, output, span),
            "windows": [
                plot
                for name in trace.input_names
                if (
                    plot := estimates_over_time(
                        f"{anchor}windows-{name}", drive.windows, name, output, span, ("K", *shown)
                    )
                )
                is not None
            ],
            "autocorrelation": None
            if log.series is None or log.series.autocorrelation is None
            else autocorrelation_plot(f"{anchor}autocorrelation", log.series.autocorrelation, tests),
        },
        "tests": [] if tests is None else residual_rows.rows(tests),
        "findings": drive.findings,
        "time": signal_text.time(drive.time),
        "gates": gates.gate_times(trace.gate, trace.dt),
        "excitation": _excitation(log),
        "loop": loop_rows.rows(drive.loop),
        "loop_about": loop_rows.about(drive.loop),
        "loop_says": loop_rows.says(drive.loop),
        "specification": "" if armax is None else drive.whole["armax"].specification,  # type: ignore[union-attr]
        "coefficients": [] if armax is None else _coefficients(drive),
        "poles": "" if armax is None else ", ".join(_pole(pole) for pole in armax.fit.poles),
        "orders": drive.orders[:ORDERS_SHOWN],
        "windows": [_window(e, output) for e in drive.windows],
        "fit": drive.fit_percent,
        "usable": drive.time.usable,
        "row": [
            _quoted(drive.channels.get(name, Channel()), what)
            for name in trace.input_names
            for what in ("K", "tau_plus_dead_time")
        ],
    }


def _details(drive: Identified) -> Mapping[str, Any]:
    return {} if drive.headline is None else drive.headline.details


def _key(log: IdentifiedLog) -> list[tuple[str, str]]:
    """The numbers below the verdict."""
    drive = log.identified
    rows = []
    for name, channel in drive.channels.items():
        for what in PARAMETERS:
            if quotable(channel, what):
                unit = gain_unit(log.output, name) if what == "K" else "s"
                rows.append((f"{readable(name)} {SYMBOLS[what]}", interval(getattr(channel, what), unit)))
    if math.isfinite(drive.fit_percent):
        rows.append(("fit, simulated from the inputs alone", number(drive.fit_percent, "%")))
    rows.append(("drive", number(drive.time.total, "s")))
    if math.isfinite(drive.time.behind_lead):
        rows.append(("behind a lead", number(drive.time.behind_lead, "s")))
    return [*rows, ("usable for identification", number(drive.time.usable, "s"))]


def _fit(drive: Identified, name: str) -> str:
    found = drive.whole[name]
    if found is None or found.fit_percent is None:
        return ""
    return f"fit {number(found.fit_percent, '%')} ({readable(found.fit_kind)})"


def _cell(channel: Channel, what: str) -> Cell:
    value: Interval = getattr(channel, what)
    return Cell(interval(value), quotable(channel, what))


def _quoted(channel: Channel, what: str) -> str:
    return interval(getattr(channel, what)) if quotable(channel, what) else "–"


def _missing(drive: Identified, methods: Sequence[str], output: str) -> list[str]:
    """What each further method lacks, and what speaks against it."""
    out = []
    # the verdict has those of the first
    for name in methods[1:]:
        found = drive.whole[name]
        if found is None:
            continue
        says = estimate_text.all_missing(found.channels, output)
        against = str(found.details.get("says", ""))
        out += [f"{name.upper()}: {text}." for text in (says, against) if text]
    return out


def _stretches(drive: Identified, names: Sequence[str], output: str) -> list[tuple[str, list[str]]]:
    """Parameters between the changes of the gains."""
    return [
        (
            f"{one['start']:.0f}–{one['stop']:.0f} s",
            [
                identification_verdict.quoted(name, one["channels"].get(name, Channel()), output)
                or "not identifiable"
                for name in names
            ],
        )
        for one in _details(drive).get("segments", ())
    ]


def _excitation(log: IdentifiedLog) -> list[tuple[str, str, str]]:
    """Standard deviation of each input where it is used, and the order of persistent excitation."""
    trace, headline = log.trace, log.identified.headline
    tests = None if headline is None else headline.residual_tests
    used = trace.learn
    out = []
    for name, u in zip(trace.input_names, trace.inputs.T, strict=True):
        moved = u[used & np.isfinite(u)]
        order = "–" if tests is None else str(tests.excitation_order.get(name, "–"))
        out.append((name, number(float(np.std(moved)) if len(moved) else math.nan, role_unit(name)), order))
    return out


def _coefficients(drive: Identified) -> list[tuple[str, str]]:
    armax = drive.armax
    if armax is None:
        return []
    fit, sd = armax.fit, armax.fit.standard_errors
    rows = [("A", fit.A[1:], sd.A[1:])]
    rows += [(f"B {readable(n)}", b, s) for n, b, s in zip(armax.channels, fit.B, sd.B, strict=True)]
    rows.append(("C", fit.C[1:], sd.C[1:]))
    return [
        (name, ", ".join(f"{x:.4g} ± {s:.2g}" for x, s in zip(values, errors, strict=True)))
        for name, values, errors in rows
        if len(values)
    ]


def _pole(pole: complex) -> str:
    return f"{pole.real:.3f}{pole.imag:+.3f}j" if pole.imag else f"{pole.real:.3f}"


def _window(e: Any, output: str) -> tuple[str, str, str, str]:
    text = estimate_text.estimate(e).split("  ")
    known = [
        estimate_text.channel(name, ch, output, None) for name, ch in e.channels.items() if quotable(ch, "K")
    ]
    mark = f"{HEADLINE_MARK} " if e.headline else ""
    says = " | ".join(known) if known and e.status.value == "ok" else e.says
    return f"{e.t:.1f} s", f"{mark}{e.estimator}", readable(e.status.value), says or text[-1]
