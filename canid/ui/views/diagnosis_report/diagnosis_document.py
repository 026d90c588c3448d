"""A diagnosis as page and notebook fragment: sections in the order of questions, with the sentences of the text."""

from __future__ import annotations

from collections.abc import Sequence

from canid.ui.views import search_bounds, signal_text
from canid.ui.views.diagnosis_report import diagnosis_answer, diagnosis_text
from canid.ui.views.diagnosis_report import diagnosis_parts as parts
from canid.ui.views.diagnosis_report.evidence_plot import SYMBOLS, evidence_plot, outcome
from canid.ui.views.diagnosis_report.heat_maps import heat_maps
from canid.ui.views.diagnosis_report.spectra import spectra
from canid.ui.views.diagnosis_report.time_series import whole_drive, worst_windows
from canid.ui.views.diagnosis_report.trajectories import trajectories
from canid.ui.views.document import document as doc
from canid.ui.views.document.document_page import page as html
from canid.ui.views.drawing.figure import Figure
from canid.ui.views.drawing.forest import two_intervals
from canid.ui.views.notebook.channel_rows import channel_table
from canid.ui.views.notebook.fragment import ACCENT, SECOND, chart, charted, fragment
from canid.values.findings import Check, Report, Verdict, duration, extends, used_time
from canid.values.text.names import capitalised, either, parameter, readable
from canid.values.text.numbers import chance, number, percent, role_unit, time_range


def page(report: Report, vehicle: str = "") -> str:
    """The diagnosis as one HTML page, to be stored as UTF-8.

    Args:
        report: the diagnosis.
        vehicle: its name; default: its file.

    Example:
        >>> from canid.values.findings import no_fit
        >>> from canid.values.types import Interval
        >>> import numpy as np
        >>> nothing, none = Interval(), np.zeros(0)
        >>> short = Report(Verdict.NOT_ENOUGH_DATA, "drive longer", "pedal", none, none, none > 0, no_fit(0), no_fit(0),
        ...     (), nothing, nothing, (), 0, (), (), (), (), (), (), None, (), {}, (), ())
        >>> "drive longer" in page(short)
        True
    """
    # the title names the causes of the verdict, and of these what no other block's cause is a surrogate for
    named = [either((f.effect, *f.rivals)) for f in report.findings if not f.surrogate]
    causes = f": {' + '.join(named)}" if report.verdict in (Verdict.NAMED, Verdict.ONE_OF) else ""
    steps = doc.Listing(report.steps, bullet="1.") if report.steps else "No step was taken."
    sections = [
        doc.Section("verdict", "What is wrong, and why", _verdict(report), "Verdict"),
        doc.Section("time", "Where in time", _time(report), "In time"),
        doc.Section("where", "Where: operating points and frequency", _where(report), "Where"),
        doc.Section("evidence", "Evidence", [evidence_plot(report), _tried(report)]),
        doc.Section("undecided", "Not testable on this drive", _undecided(report), "Not testable"),
        doc.Section("parameters", "Driver parameters", _driver(report), "Parameters"),
        doc.Section("checks", "Checks", _checks(report)),
        doc.Section("loop", "In closed loop", _loop(report), "Closed loop"),
        doc.Section("steps", "Steps of the search", [steps], "Steps"),
    ]
    signals = signal_text.findings(report.signals)
    return html(
        doc.Document(
            "canid diagnosis",
            report.verdict.value,
            parts.TITLES[report.verdict] + causes,
            [
                *diagnosis_answer.answer(report),
                *(doc.Sentence(f"⚠ {says}", "remark") for says in parts.remarks(report)),
            ],
            sections,
            doc.Source(report.provenance, vehicle or report.provenance.vehicle, signals, bool(signals)),
            "Diagnosis",
            _key(report),
        )
    )


def notebook(report: Report) -> str:
    """Verdict, findings, and measured against simulated output."""
    findings = [
        (readable(f.effect), f.where, "surrogate" if f.surrogate else "", f.says) for f in report.findings
    ]
    curves = [("measured", report.measured, SECOND), ("simulated", report.extended.simulated, ACCENT)]
    key = [
        (f"measured {readable(report.output)} ({role_unit(report.output)})", SECOND),
        ("simulated", ACCENT),
    ]
    return fragment(
        f"Diagnosis: {readable(report.verdict.value)}",
        " ".join(diagnosis_answer.answer(report)),
        doc.Table(("finding", "in", "", ""), findings),
        charted(key, chart(report.t, curves)),
        channel_table(report.extended.channels, report.output),
    )


def _key(report: Report) -> list[tuple[str, doc.Cell]]:
    """The numbers below the verdict."""
    sds = [number(fit.noise_sd, role_unit(report.output)) for fit in (report.baseline, report.extended)]
    time = number(duration(report), "s") if report.time is None else signal_text.time(report.time)
    used = f"this diagnosis fits {number(used_time(report), 's')} of it, by its own masks"
    gained: doc.Cell = tuple(parts.gains(report)) if extends(report) else ""
    rows: list[tuple[str, doc.Cell]] = [
        ("gain on held-out data", gained),
        ("closed loop", tuple(diagnosis_text.closed_loops(report).items)),
        ("share of the residual that no cause explains", percent(report.unexplained)),
        ("standard deviation of the residual", " → ".join(sds[: 1 + extends(report)])),
        ("model", (*diagnosis_text.fit(report), *parts.form(report))),
        ("drive", (time, used)),
    ]
    return [row for row in rows if row[1]]


def _folded(figure: Figure | None) -> doc.Fold | None:
    return None if figure is None else doc.Fold(figure.title, [figure], open=True)


def _all(listing: doc.Listing) -> doc.Fold | None:
    """A long list, which a phone shows with a click."""
    title = f"{capitalised(listing.title)} ({len(listing.items)})"
    return doc.Fold(title, [listing._replace(title="")], open=True) if listing.items else None


def _verdict(report: Report) -> list[doc.Block]:
    findings: list[doc.Block] = [diagnosis_text.finding_block(each, report) for each in report.findings]
    adequate = report.verdict is Verdict.ADEQUATE
    as_far = (
        ": the models of driver, vehicle and sensors are adequate as far as this drive can show" * adequate
    )
    causes = findings or [f"No cause was found{as_far}."]
    return [parts.sentence(report), *causes, diagnosis_text.loop_blocks(report)]


def _time(report: Report) -> list[doc.Block]:
    """Figures of the drive and of its worst windows, which are numbered, and what was masked."""
    when: dict[str, list[str]] = {}
    for mask in report.masked:
        when.setdefault(readable(mask.effect), []).append(time_range(mask.start, mask.stop))
    masked = [f"{effect}: {', '.join(ranges)}" for effect, ranges in when.items()]
    return [
        whole_drive(report) or "Nothing could be simulated.",
        # its titles have the numbers of the listing
        _folded(worst_windows(report)) or diagnosis_text.worst(report)._replace(bullet="1."),
        doc.Listing(masked, "masked before the fit: not the driver's response"),
    ]


def _where(report: Report) -> list[doc.Block]:
    drawn = [_folded(figure) for figure in (*heat_maps(report), spectra(report)) if figure is not None]
    return [*drawn] or ["Not computed: nothing could be simulated."]


def _tried(report: Report) -> doc.Fold | str:
    if not report.tried:
        return "No cause was tried."
    rows = [
        (
            str(row.step),
            readable(row.effect),
            row.where,
            *(number(x) for x in (row.evidence, row.needed, row.expected)),
            SYMBOLS[outcome(row, report)].label,
            row.why,
        )
        for row in report.tried
    ]
    head = ("step", "candidate", "block", ">evidence", ">threshold", ">expected", "outcome", "why")
    caption = (
        "Evidence and threshold at each step. Expected: the evidence of a typical strength on this drive."
    )
    title = f"Every candidate at every step, with its reason ({len(rows)} rows)"
    return doc.Fold(title, [doc.Table(head, rows, caption=caption, kind="tried")])


def _undecided(report: Report) -> list[doc.Block]:
    nothing = "Nothing: all candidates could be tested." if report.tried else "Nothing was tested."
    return [
        _all(diagnosis_text.undecided(report)) or nothing,
        _all(diagnosis_text.visible(report)),
        doc.Listing(parts.advice(report), "a drive that would decide"),
    ]


def _driver(report: Report) -> list[doc.Block]:
    """Parameters without and with the causes, the final model, and what each of several drives says."""
    rows = [*_parameters(report), *_of_causes(report)]
    before = ">baseline" if extends(report) else ">value"
    head = ("parameter", "unit", before, *((">extended", "intervals", "shift") * extends(report)))
    caption = "95 % intervals."
    if extends(report):
        caption += (
            " Baseline above (orange), extended model below (blue). A shift out of the baseline's interval is the bias that "
            "the missing cause had introduced."
        )
    if any("⚠" in cell for row in rows for cell in row.values()):
        caption += (
            " An estimate at a bound of the range that is searched is marked: the data would move it further, so that it is "
            "no estimate."
        )
    lacking = parts.not_quoted(report)
    nothing = f"No parameter of the driver may be quoted: {'; '.join(lacking)}." if lacking else ""
    final = diagnosis_text.model(report)
    drive_it = "`canid simulate OUT.blf --model REPORT.json --lead LOG` drives it behind another lead."
    return [
        doc.chosen(
            head,
            [row | {">value": row[">baseline"]} for row in rows],
            caption=caption,
            kind="parameters cards",
        ),
        None if parts.known_parameters(report) else nothing or "No parameter could be estimated.",
        final._replace(items=[*final.items, drive_it]) if final.items else None,
        diagnosis_text.drives(report),
    ]


def _parameters(report: Report) -> list[dict[str, doc.Cell]]:
    """The driver's, by the heads of the columns."""
    rows = []
    for key, both in parts.known_parameters(report).items():
        name, unit = parameter(key, report.output)
        before, after = (_marked(parts.estimate(key, iv, report)) for iv in both)
        known = "⚠" not in before + after
        cells: dict[str, doc.Cell] = {
            "parameter": name,
            "unit": unit,
            ">baseline": before,
            ">extended": after,
        }
        rows.append(
            cells
            | {
                "intervals": two_intervals(*both) if known else "",
                "shift": parts.shift(*both) if known else "–",
            }
        )
    return rows


def _of_causes(report: Report) -> list[dict[str, doc.Cell]]:
    """Those of the causes, which are in the extended model alone."""
    rows = []
    for finding in report.findings:
        at = search_bounds.of_finding(finding)
        for name, iv in finding.parameters.items():
            unit = finding.units.get(name, "")
            value = _marked(search_bounds.text(iv, unit if name in at else "", at.get(name)))
            cells: dict[str, doc.Cell] = {
                "parameter": f"{readable(finding.effect)}: {readable(name)}",
                "intervals": "",
                "shift": "",
            }
            cells |= {"unit": "" if unit == "1" else unit, ">extended": value}
            rows.append(cells | {">baseline": "not in it" if extends(report) else value})
    return rows


def _marked(says: str) -> str:
    return f"⚠ {says}" if says.startswith("at its") else says


def _checks(report: Report) -> list[doc.Block]:
    gate = [check for check in report.checks if check.gate]
    hint = doc.Sentence(
        "Adequacy tests: does the final model leave structure in the residual? A cause is named only where they pass.",
        "hint",
    )
    data = _checked(
        [check for check in report.checks if not check.gate], "Checks of the data", (">value", ">limit")
    )
    tests = _checked(gate, "Adequacy tests", (">p-value", ">fails below"))
    return [*data, hint if gate else None, *tests, None if report.checks else "No check was made."]


def _checked(checks: Sequence[Check], title: str, limits: tuple[str, str]) -> list[doc.Block]:
    """Those that failed; those that passed are folded."""
    head = ("check", "result", *limits, "explanation")
    rows = [
        (
            readable(check.name),
            "– not possible" if check.passed is None else "✓ passed" if check.passed else "✗ failed",
            chance(check.value, 2)
            if check.gate and check.passed is not None
            else number(check.value, check.unit),
            number(check.limit, check.unit),
            check.says,
        )
        for check in sorted(checks, key=lambda check: bool(check.passed))
    ]
    rest = sum(not check.passed for check in checks)
    fine = doc.Table(head, rows[rest:], kind="checks cards")
    caption = f"{title}: failed or not possible"
    return [
        doc.Table(head, rows[:rest], caption, kind="checks cards"),
        doc.Fold(f"{title}: {diagnosis_text.passed(checks)}", [fine]) if fine.rows else None,
    ]


def _loop(report: Report) -> list[doc.Block]:
    caption = (
        "On the same stretches: rms error over the rms of what was measured. Parameters of published car-following models: "
        "calibrated to the gap of the whole drive, 95 % intervals; one at a bound of the range that was searched is not "
        "estimated."
    )
    return [
        _folded(trajectories(report)),
        diagnosis_text.closed_loops(report),
        None
        if report.closed_loop
        else "Not simulated: it needs a lead vehicle and a model of driver and car.",
        diagnosis_text.rivals(report, (*diagnosis_text.RIVALS, "parameters"), caption),
    ]
