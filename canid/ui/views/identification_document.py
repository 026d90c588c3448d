"""The identification of one or several logs as page and notebook fragment; the sentences are those of the text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.drive.drive_series import DriveSeries
from canid.analysis.drive.held_out_simulation import HeldOut
from canid.analysis.drive.identification_verdict import verdict
from canid.mathematics.identification.identifiability import quotable
from canid.ui.views import identification_text, signal_text
from canid.ui.views.document import document as doc
from canid.ui.views.document.document_page import page as html
from canid.ui.views.drawing.figure import Figure
from canid.ui.views.drive_report import gates, responses
from canid.ui.views.drive_report.autocorrelation_plot import autocorrelation_plot
from canid.ui.views.drive_report.estimates_over_time import estimates_over_time
from canid.ui.views.drive_report.held_out import held_out_simulation
from canid.ui.views.drive_report.level_over_time import level_over_time
from canid.ui.views.drive_report.model_over_time import model_over_time
from canid.ui.views.drive_report.plan import plan
from canid.ui.views.drive_report.strips import strips
from canid.ui.views.notebook.channel_rows import channel_table
from canid.ui.views.notebook.fragment import ACCENT, SECOND, chart, charted, fragment
from canid.values.text import estimate_text
from canid.values.text.names import SYMBOLS, capitalised, label, readable
from canid.values.text.numbers import DASH, fit_text, gain_unit, interval, number, role_unit
from canid.values.types import QUOTED, Channel, Status, Trace

# points of a line: of one log, and of each of several
MAX_POINTS, MAX_POINTS_OF_SEVERAL = 6000, 2500
# candidates of the order selection that are listed, and changes
ORDERS_SHOWN, CHANGES_SHOWN = 12, 100
# of each input, in the table of several logs
SIDE_BY_SIDE = ("K", "tau_plus_dead_time")


class IdentifiedLog(NamedTuple):
    """One log, as the page shows it."""

    identified: Identified
    trace: Trace
    output: str  # role of the driver's output
    series: DriveSeries | None
    source: doc.Source
    rest: HeldOut | None = None  # what models of the first part make of the rest


def page(logs: Sequence[IdentifiedLog]) -> str:
    """The page, to be stored as UTF-8.

    Args:
        logs: one, or several: a table of all of them, and a section for each.
    """
    if len(logs) == 1:
        return html(_document(logs[0]))
    parts = [
        _document(log, f"drive-{k + 1}-")._replace(short=f"drive-{k + 1}-drive") for k, log in enumerate(logs)
    ]
    titles = [part.title for part in parts]
    title, *_ = identification_text.several(
        zip([log.source.provenance.log for log in logs], titles, strict=True)
    )
    says = (
        "Each log is a section below; open it with a click. Whether two drivers differ is a question for a test, not for "
        "two columns: intervals that overlap may still differ."
    )
    kind = "nothing" if title.startswith("0 ") else "partly"
    sections = [doc.Section("comparison", "The logs side by side", [_side_by_side(logs, parts)])]
    each = [log.source.provenance for log in logs]
    together = each[0]._replace(
        log=", ".join(p.log for p in each),
        log_sha256=", ".join(p.log_sha256 for p in each),
        recorded=", ".join(filter(None, (p.recorded for p in each))),
    )
    about, source = f"Identification of {together.log}", doc.Source(together, logs[0].source.vehicle)
    return html(doc.Document("canid identify", kind, title, [says], sections, source, about, parts=parts))


def notebook(result: Identified) -> str:
    """The headline's parameters, and its gain over the windows of the drive."""
    output = result.drive_summary.output
    said = verdict(result, output)
    about = (
        f"{result.log or 'drive'}: {number(result.driver_time, 's')} usable of {number(result.recorded, 's')}"
    )
    findings = doc.Listing([said.withheld, said.scale, *(finding.says for finding in result.findings)])
    return fragment(said.title, about, channel_table(result.channels, output), _gains(result), findings)


def short_names(paths: Sequence[str]) -> list[str]:
    """Names of files without their folders, unless two of them would be the same.

    Example:
        >>> short_names(["a/one.blf", "b/two.blf"]), short_names(["a/one.blf", "b/one.blf"])
        (['one.blf', 'two.blf'], ['a/one.blf', 'b/one.blf'])
    """
    short = [path.replace("\\", "/").rpartition("/")[2] for path in paths]
    return short if len(set(short)) == len(set(paths)) else list(paths)


def _side_by_side(logs: Sequence[IdentifiedLog], parts: Sequence[doc.Document]) -> doc.Table:
    names = [(name, what) for name in logs[0].trace.input_names for what in SIDE_BY_SIDE]
    rows = [
        (
            Markup('<a href="#{}">{}</a>').format(part.short, short),
            *(_quoted(log.identified.channels.get(name, Channel()), what) for name, what in names),
            number(log.identified.fit_percent, "%"),
            number(log.identified.time.usable, "s"),
            part.kind,
        )
        for log, part, short in zip(
            logs, parts, short_names([log.source.provenance.log for log in logs]), strict=True
        )
    ]
    columns = [f">{label(f'{name} {what}')} ({_unit(logs[0], name, what)})" for name, what in names]
    caption = (
        "Headline of each whole drive, 95 % intervals; –: may not be quoted. Verdict: identified (all parameters), partly, "
        "changed (the gains stepped), nothing. Fit: of the output simulated from the inputs alone."
    )
    return doc.Table(("log", *columns, ">fit", ">usable", "verdict"), rows, caption=caption, kind="cards")


def _document(log: IdentifiedLog, anchor: str = "") -> doc.Document:
    """One log; `anchor`: what ids in the page begin with."""
    drive = log.identified
    answer = verdict(drive, log.output)
    scale = [answer.scale] if answer.scale else []
    limits = [f"{capitalised(end.says)}." for end in drive.output_limits]
    open_scale, known_scale = (scale, []) if identification_text.is_open(drive) else ([], scale)
    tests = identification_text.residual_tests(drive.headline)
    loop = identification_text.loop_lines(drive.loop, answer.withheld)
    if drive.loop.crossover.value == drive.loop.crossover.value:
        loop.append(f"crossover frequency {interval(drive.loop.crossover, 'rad/s')}")
    sections = [
        doc.Section("parameters", "Parameters", _parameters(log)),
        doc.Section("time", "Over the drive", _over_time(log, anchor)),
        doc.Section(
            "residuals",
            "Residual tests",
            [doc.Listing(tests) if tests else _UNTESTED, _autocorrelation(log, anchor)],
        ),
        doc.Section("responses", "How the driver responds", _responses(log, anchor), "Responses"),
        doc.Section("data", "Data", [gates.findings(drive.findings), *limits, *known_scale, *_data(log)]),
        doc.Section(
            "loop", "Driver and car: margins and string stability", [doc.Listing(loop)], "Driver and car"
        ),
        doc.Section("models", "ARMAX and its orders", _models(log), "Models"),
    ]
    return doc.Document(
        "canid identify",
        answer.kind,
        answer.title,
        [answer.says, doc.Sentence(answer.withheld, "withheld" if answer.says else ""), *open_scale],
        [section._replace(name=anchor + section.name) for section in sections],
        log.source,
        "Identification",
        key=[
            ("fit, simulated from the inputs alone", fit_text(drive.fit_percent)),
            ("drive", signal_text.time(drive.time)),
        ],
    )


_UNTESTED = "Not tested: there is no model of the whole drive, or too few data."


def _unit(log: IdentifiedLog, name: str, what: str) -> str:
    return gain_unit(log.output, name) if what == "K" else "s"


def _parameters(log: IdentifiedLog) -> list[doc.Block]:
    """Every parameter of every method, what the further methods lack, and the changes."""
    drive, output = log.identified, log.output
    methods = [(name, method) for name in drive.ranked if (method := drive.whole[name]) is not None]
    rows: list[list[doc.Cell]] = []
    for name in log.trace.input_names:
        for what in SYMBOLS:
            channels = [method.channels.get(name, Channel()) for _, method in methods]
            if any(math.isfinite(getattr(c, what).value) for c in channels):
                cells = [_cell(c, what) for c in channels]
                rows.append([label(f"{name} {what}"), _unit(log, name, what), *cells])
    caption = (
        "95 % intervals over the whole drive. ✓: may be quoted. In brackets: not to be quoted, given for what it is worth. "
        "The first method carries the headline."
    )
    head = ("parameter", "unit", *(f">{name.upper()}" for name, _ in methods))
    said = verdict(drive, output).withheld
    says = [
        f"{name.upper()}: {lack}."
        # the verdict has those of the first, and no reason twice
        for name, method in methods[1:]
        for lack in (estimate_text.all_missing(method.channels, output), str(method.details.get("says", "")))
        if lack and lack.casefold() not in said.casefold()
    ]
    titles = [identification_text.title(name, method, readable(method.fit_kind)) for name, method in methods]
    changes = identification_text.changes(drive.headline, output, CHANGES_SHOWN)
    table = doc.Table(head, rows, caption=caption, kind="cards")
    return [
        table if rows else "No method has a number of the whole drive.",
        doc.Listing([*titles, *says, *changes]),
    ]


def _cell(channel: Channel, what: str) -> str:
    value = interval(getattr(channel, what))
    return f"✓ {value}" if quotable(channel, what) else value if value == DASH else f"({value})"


def _quoted(channel: Channel, what: str) -> str:
    return interval(getattr(channel, what)) if quotable(channel, what) else DASH


def _over_time(log: IdentifiedLog, anchor: str) -> list[doc.Block]:
    drive, trace, output = log.identified, log.trace, log.output
    most = MAX_POINTS_OF_SEVERAL if anchor else MAX_POINTS
    span = (float(trace.t[0]), float(trace.t[-1])) if len(trace.t) else (0.0, 1.0)
    shown = SIDE_BY_SIDE if drive.headline is not None else ("K",)
    gate = strips(
        f"{anchor}gate",
        "What is used for identification",
        "used: the gate is open, and the seconds after its opening are over; settling: these seconds, in which earlier "
        "transients decay.",
        gates.gate_strip(trace.t, trace.gate, trace.learn, trace.findings, trace.dt),
        span,
    )
    no_level = doc.Sentence(
        "No smoothed level of the parameters: the drive has fewer than six windows of 40 s of usable data, or no parameter "
        "is known.",
        "hint",
    )
    return [
        model_over_time(f"{anchor}model", trace, log.series, output, drive.fit_percent, most),
        held_out_simulation(f"{anchor}held-out", trace, log.rest, output, most),
        gate,
        level_over_time(f"{anchor}level", drive, output, span) or no_level,
        *(
            estimates_over_time(f"{anchor}windows-{name}", drive.windows, name, output, span, shown)
            for name in trace.input_names
        ),
        _plan(log, anchor),
    ]


def _plan(log: IdentifiedLog, anchor: str) -> doc.Fold | None:
    drawn = plan(f"{anchor}plan", log.trace, log.series, log.identified.windows, log.output)
    return drawn and doc.Fold(drawn.title, [drawn], open=True)


def _autocorrelation(log: IdentifiedLog, anchor: str) -> Figure | None:
    headline, series = log.identified.headline, log.series
    if series is None or series.autocorrelation is None:
        return None
    tests = None if headline is None else headline.residual_tests
    return autocorrelation_plot(f"{anchor}autocorrelation", series.autocorrelation, tests)


def _responses(log: IdentifiedLog, anchor: str) -> list[doc.Block]:
    answers = log.identified.responses
    rows = responses.poles_and_zeros(answers)
    if not rows:
        return ["Not shown: no method has a gain of the whole drive."]
    caption = (
        "Poles and zeros in the z plane, at the sampling interval of the model; a pole p on the real axis between 0 and 1 "
        "is a lag of −dt / ln p"
    )
    return [
        responses.step_response(f"{anchor}step", answers, log.output),
        responses.frequency_response(f"{anchor}frequency", answers, log.output),
        doc.Table(("method", "input", "poles", "zeros", "lags"), rows, caption=caption, kind="narrow cards"),
    ]


def _data(log: IdentifiedLog) -> list[doc.Table]:
    """Time by gate; standard deviation of each input where it is used, and the order of persistent excitation."""
    trace, headline = log.trace, log.identified.headline
    tests = None if headline is None else headline.residual_tests
    rows = []
    for name, u in zip(trace.input_names, trace.inputs.T, strict=True):
        moved = u[trace.learn & np.isfinite(u)]
        order = DASH if tests is None else str(tests.excitation_order.get(name, DASH))
        sd = float(np.std(moved)) if len(moved) else math.nan
        rows.append((readable(name), number(sd, role_unit(name)), order))
    caption = (
        "Excitation: how much the inputs moved in the usable samples, and how many parameters each can excite (order of "
        "persistent excitation)"
    )
    excitation = doc.Table(("input", ">standard deviation", ">order"), rows, caption=caption)
    return [gates.gate_table(trace.gate, trace.dt, log.identified.time), excitation]


def _models(log: IdentifiedLog) -> list[doc.Block]:
    """ARMAX and its orders, and the estimates over sliding windows."""
    drive = log.identified
    orders = [
        (
            f"({o.orders.na}, {o.orders.nb}, {o.orders.nc})",
            str(o.orders.nk),
            *(f"{x:.4f}" if math.isfinite(x) else DASH for x in (o.aic, o.bic)),
            number(o.fpe),
            "white" if o.white else "not white",
        )
        for o in drive.orders[:ORDERS_SHOWN]
    ]
    head = ("(na, nb, nc)", ">dead time, samples", ">AIC", ">BIC", ">FPE", "residual")
    caption = "Orders compared on the same samples, best by BIC first (per sample; Ljung–Box at 99 %)"
    windows = [estimate_text.estimate(e, log.output) for e in drive.windows]
    about = "One estimate per method every 10 s, each over the last minute at most; ▶: headline"
    fold = doc.Fold(
        f"Estimates over sliding windows, as live ({len(windows)})", [about, doc.Listing(windows)], "windows"
    )
    return [
        _coefficients(drive),
        doc.Fold(caption, [doc.Table(head, orders, kind="narrow cards")]) if orders else None,
        fold if windows else None,
    ]


def _coefficients(drive: Identified) -> doc.Table | str:
    armax, whole = drive.armax, drive.whole.get("armax")
    if armax is None or whole is None:
        return "No ARMAX model: too few data, or no stable one."
    fit, sd = armax.fit, armax.fit.standard_errors
    rows = [("A", fit.A[1:], sd.A[1:])]
    rows += [(f"B {readable(n)}", b, s) for n, b, s in zip(armax.channels, fit.B, sd.B, strict=True)]
    rows.append(("C", fit.C[1:], sd.C[1:]))
    poles = ", ".join(f"{p.real:.3f}{p.imag:+.3f}j" if p.imag else f"{p.real:.3f}" for p in fit.poles)
    cells = [
        (
            name,
            ", ".join(
                f"{number(x, digits=4)} ± {number(s, digits=2)}" for x, s in zip(values, errors, strict=True)
            ),
        )
        for name, values, errors in rows
        if len(values)
    ]
    caption = f"A(q) y = B(q) u + C(q) e{whole.specification}: coefficients ± standard error; poles {poles}"
    return doc.Table(("polynomial", "coefficients"), cells, caption=caption)


def _gains(result: Identified) -> Markup | None:
    """K over the windows, of the input whose gain is known best."""
    known = {name: ch.K for name, ch in result.channels.items() if "K" in QUOTED[ch.status]}
    name = min(
        known,
        key=lambda each: (known[each].high - known[each].low) / abs(known[each].value or 1e-9),
        default="",
    )
    estimator = result.ranked[0] if result.whole else ""
    windows = [
        e for e in result.windows if e.estimator == estimator and e.status is Status.OK and name in e.channels
    ]
    if not name or len(windows) < 2:
        return None
    t = np.array([e.t for e in windows])
    K = np.array([e.channels[name].K for e in windows])
    edges = [
        (says, K[:, k], color)
        for says, k, color in (("low", 1, SECOND), ("high", 2, SECOND), ("K", 0, ACCENT))
    ]
    unit = gain_unit(result.drive_summary.output, name)
    key = [(f"K of {readable(name)} in windows ({unit})", ACCENT), ("95 %", SECOND)]
    return charted(key, chart(t, edges))
