"""The result of `canid check` as text and page: the roles of a vehicle file against a log, or the ids of a log."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import NamedTuple

import numpy as np

from canid.analysis.drive.vehicle_check import Check, Contents, Row
from canid.ui.views import signal_text
from canid.ui.views.document import document as doc
from canid.ui.views.document.document_page import page as html
from canid.ui.views.document.document_text import WIDTH, lines
from canid.ui.views.drawing.figure import Figure, Spec, times
from canid.ui.views.drawing.panels import Panel, instants, signal, stack, titled
from canid.ui.views.drive_report import enough, gates
from canid.ui.views.drive_report.strips import strips
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit, same_digits
from canid.values.types import NAN, Signal

# points of a line: a log has some ten roles
MAX_POINTS = 3000
PANEL_PX = 78
# changes of the lead that are drawn, and marks of readings that were left out: more are a band of ink
MAX_CHANGES_DRAWN, MAX_MARKS = 40, 400
# significant digits: enough to see an offset of 0.1 in 100
TABLE_DIGITS = 4
# and as many as show how a position moves, which hardly does
FINE_DIGITS = 8
# share of the time from which on a role that is stale is marked
MARKED_STALE_PERCENT = 1.0
# ids that are listed without a click
IDS_SHOWN = 12
RANGE = (">low", ">median", ">high")
# two tables, so that each fits a terminal
TEXT = ("role", "unit", ">1/s", ">missing %", *RANGE)
TEXT_FROM = ("role", ">readings", "from")
PAGE = (
    *("role", "unit", "state", *RANGE, ">readings", ">1/s", ">longest gap", ">stale", ">missing %"),
    *("why missing", "from"),
)


class CheckedLog(NamedTuple):
    """A check, as the page shows it."""

    check: Check
    step: float  # s, of the samples
    source: doc.Source


def text(checked: Check) -> list[str]:
    """What came for each role of the vehicle file, the state of the gate, and the problems."""
    gate = (f"{_gate(gate)} {share:.0f} %" for gate, share in checked.gates.items())
    time = (f"time: {signal_text.time(checked.time)}", f"learning gate: {', '.join(gate)}", *checked.remarks)
    roles = [doc.chosen(head, _roles(checked)) for head in (TEXT, TEXT_FROM)]
    return lines([_came(checked), *roles, doc.Listing(time), _problems(checked)], WIDTH)


def contents(counted: Contents) -> list[str]:
    """The ids of a log, without a vehicle file."""
    rows = [
        (f"bus {bus}", f"0x{id_:X}", str(length), f"{n:,}", _rate(n, counted.duration - counted.paused))
        for (bus, id_, length), n in sorted(counted.frames.items())
    ]
    frames = sum(counted.frames.values()) + sum(counted.apart.values())
    total = f"{frames:,} frames, {len(rows)} ids, {_duration(counted)}{_apart(counted.apart)}"
    return lines([total, doc.Table(("bus", "id", "bytes", "frames", "1/s"), rows)], WIDTH)


def page(log: CheckedLog) -> str:
    """The page, to be stored as UTF-8."""
    checked = log.check
    count = len(checked.problems)
    came = sum(row.readings > 0 for row in checked.rows)
    problems = [_problems(checked), doc.Listing(checked.remarks, "remarks")]
    sections = [
        doc.Section("problems", "Problems and what to do", problems, "Problems"),
        doc.Section("enough", "Is the drive long enough?", [enough.table(checked.time, checked.output)]),
        doc.Section("roles", "Roles", [_roles_of_page(checked)]),
        doc.Section("signals", "Signals over time", _over_time(log), "Signals"),
        doc.Section("ids", "Ids without mapping", [_unmapped(checked)]),
    ]
    return html(
        doc.Document(
            "canid check",
            "problems" if count else "fits",
            f"{count} problem{'s' * (count > 1)}" if count else "The vehicle file fits",
            [
                f"{came} of {len(checked.rows)} mapped roles came, in {_came(checked)}; {number(checked.time.usable, 's')} "
                "are usable for identification."
            ],
            sections,
            log.source,
            "Check",
        )
    )


def _came(checked: Check) -> str:
    return f"{checked.frames:,} frames, {len(checked.ids)} ids, {_duration(checked)}{_apart(checked.apart)}"


def _apart(kinds: Mapping[str, int]) -> str:
    """Frames that belong to no id; "" where there are none."""
    named = " and ".join(f"{n:,} {kind} frame{'s' * (n != 1)}" for kind, n in kinds.items())
    return named and f", {named} apart from the ids"


def _duration(counted: Check | Contents) -> str:
    paused = f" of which {counted.paused:.1f} s without any frame" if counted.paused else ""
    return f"{counted.duration:.1f} s{paused}"


def _gate(name: str) -> str:
    # the key of JSON for an open gate is older than the definition of driving
    return "open" if name == "driving" else readable(name)


def _rate(n: float, duration: float) -> str:
    return number(n / duration if duration else NAN, digits=TABLE_DIGITS)


def _problems(checked: Check) -> doc.Listing:
    scale = checked.output_scale
    open_scale = [f"⚠ {scale.says}"] if scale is not None and not scale.confirmed else []
    judged = [f"✗ {problem}" for problem in checked.problems] or ["✓ the vehicle file fits"]
    return doc.Listing([*judged, *open_scale])


def _roles(checked: Check) -> list[dict[str, doc.Cell]]:
    """What is known of each role, by the head of its column."""
    rows = []
    for row in checked.rows:
        digits = min(TABLE_DIGITS + same_digits(row.low, row.high), FINE_DIGITS)
        shown = [number(x, digits=TABLE_DIGITS) for x in (row.rate, row.missing_percent)]
        shown += [number(x, digits=digits) for x in (row.low, row.median, row.high)]
        cells: dict[str, doc.Cell] = dict(zip((">1/s", ">missing %", *RANGE), shown, strict=True))
        cells |= {
            "role": row.role,
            "unit": role_unit(row.role),
            "from": row.source,
            ">readings": f"{row.readings:,}",
        }
        cells |= {">longest gap": number(row.longest_gap, "s"), ">stale": number(row.stale_percent, "%")}
        rows.append(cells | {"state": _state(row), "why missing": _why(checked.left_out.get(row.role, {}))})
    return rows


def _roles_of_page(checked: Check) -> doc.Table:
    named = [
        cells | {"role": readable(row.role), "from": f"`{row.source}`"}
        for row, cells in zip(checked.rows, _roles(checked), strict=True)
    ]
    caption = (
        "What came for each role of the vehicle file. Longest gap: time without a reading. Stale: share of the time in "
        "which the latest reading was too old to count. Missing: readings that the frame itself calls invalid, or that "
        "are out of range."
    )
    others = [readable(role) for role in checked.signals if role not in {row.role for row in checked.rows}]
    if others:
        caption += (
            f" {' and '.join(others).capitalize()}: of the lead that is chosen among the radar's tracks."
        )
    return doc.chosen(PAGE, named, caption=caption, kind="cards")


def _state(row: Row) -> str:
    if not row.readings:
        return "✗ never came"
    if row.missing_percent == 100.0:
        return "✗ never valid"
    return "✗ with gaps" if row.stale_percent > MARKED_STALE_PERCENT else "✓ found"


def _why(left_out: Mapping[str, int]) -> str:
    """Reasons for readings without a value."""
    return ", ".join(f"{why} {n:,} times" for why, n in left_out.items())


def _over_time(log: CheckedLog) -> list[doc.Block]:
    checked = log.check
    span = (0.0, max(checked.duration, 1.0))
    gate = strips(
        "gate",
        "The learning gate",
        "used: would be learned from; settling: the seconds after the gate's opening.",
        gates.gate_strip(checked.gate.t, checked.gate.gate, checked.gate.learn, checked.findings, log.step),
        span,
    )
    table = gates.gate_table(checked.gate.gate, log.step, checked.time)
    return [_signals(checked, span) or "No valid value came.", gate, table, gates.findings(checked.findings)]


def _unmapped(checked: Check) -> str | doc.Table | doc.Fold:
    """Frames that the vehicle file does not name."""
    if not checked.unmapped:
        return "None: every id of the log is named by the vehicle file."
    rows = [
        (str(bus), f"`0x{id_:X}`", f"{n:,}", _rate(n, checked.duration - checked.paused))
        for bus, id_, n in checked.unmapped
    ]
    title = f"{len(rows)} ids of {len(checked.ids)} are not named by the vehicle file"
    table = doc.Table((">bus", "id", ">frames", ">1/s"), rows, title)
    return table if len(rows) <= IDS_SHOWN else doc.Fold(title, [table._replace(title="")])


def _signals(checked: Check, span: tuple[float, float]) -> Figure | None:
    """The decoded signals, one panel each."""
    panels = [
        _panel(role, course, checked.left_out.get(role, {}))
        for role, course in checked.signals.items()
        if np.isfinite(course.value).any()
    ]
    if not panels:
        return None
    longest = max(len(course.t) for course in checked.signals.values())
    thinned = (
        f" Lines are thinned to the extremes of each bucket, {MAX_POINTS:,} points of up to {longest:,} readings."
        if longest > MAX_POINTS
        else ""
    )
    few = len(checked.lead_changes) <= MAX_CHANGES_DRAWN
    shapes = instants([(t, "") for t in checked.lead_changes], "muted")[0] if few else []
    changed = " Dashed: another vehicle ahead." if shapes else ""
    return stack(
        "signals",
        "Decoded signals",
        "As they came, decoded and converted. A mark below a line is a reading that was left out, for the reason in the "
        f"panel's title.{changed}{thinned}",
        panels,
        span=span,
        shapes=shapes,
    )


def _panel(role: str, course: Signal, left_out: Mapping[str, int]) -> Panel:
    unit = role_unit(role)
    values = course.value[np.isfinite(course.value)]
    switch = not unit and set(np.unique(values).tolist()) <= {0.0, 1.0}
    line = signal(course.t, course.value, readable(role), "after", MAX_POINTS, showlegend=False)
    if switch:
        line = line | {"line": {"color": "@after", "width": 1.2, "shape": "hv"}}
    title = titled(role, unit)
    if why := _why(left_out):
        # the reason may be a text of a value table, and plotly reads marks of HTML in titles
        title += f" · left out: {escape(why, quote=False)}"
    return Panel(
        title,
        [line, *_marks(course, readable(role), 0.0 if switch else float(values.min()))],
        PANEL_PX // 2 if switch else PANEL_PX,
        (-0.15, 1.15) if switch else None,
        {"tickvals": [0, 1], "ticktext": ["off", "on"]} if switch else {"nticks": 4},
    )


def _marks(course: Signal, name: str, at: float) -> list[Spec]:
    """Where readings were left out: a mark at the lower end of the panel for each, or for one of several."""
    lost = course.t[~np.isfinite(course.value)]
    if not lost.size:
        return []
    lost = lost[:: -(-lost.size // MAX_MARKS)]
    return [{
        "type": "scatter", "mode": "markers", "x": times(lost), "y": [at] * lost.size, "name": f"{name}, left out",
        "marker": {"symbol": "line-ns-open", "size": 5, "color": "@muted"}, "showlegend": False, "hoverinfo": "skip",
    }]  # fmt: skip
