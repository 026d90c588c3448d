"""The whole picture of a given size: recorder and headline always, everything else by importance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from canid.ui.terminal.spans import Line, Span, fitted, width
from canid.ui.views.terminal_view import estimate_lines, headline, help_lines, recorder_bar, sections
from canid.ui.views.terminal_view.layout import Section, allocated
from canid.ui.views.terminal_view.state import View
from canid.ui.views.terminal_view.units import SpeedUnit
from canid.values.types import Estimate, Status

# columns from which on there are two columns side by side, of some 70 each
TWO_FROM_COLUMNS = 140
# share of the left one, which has the large numbers and the trends
LEFT_SHARE = 0.55
# of the diagnosis of the drive so far, before there is room for all of it
DIAGNOSIS_LINES = 3
SEPARATOR = Span(" │ ", "dim")
# What appears as the picture grows: (section, form), most important first. The recorder's lines, the first form of the
# headline and the last line are always there. Of what is wrong the first item precedes all that is in order.
STEPS = (
    ("troubles", 1), ("findings", 1), ("headline", 1), ("measured", 1), ("others", 1), ("progress", 1), ("monitor", 1),
    ("diagnosis", 1), ("troubles", 2), ("findings", 2), ("events", 1), ("diagnosis", 2), ("measured", 2), ("load", 1),
    ("headline", 2), ("trend", 1), ("others", 2), ("truth", 1), ("in_order", 1), ("trend", 2), ("excitation", 1),
    ("progress", 2), ("events", 2), ("trend", 3), ("tests", 1), ("trend", 4), ("events", 3), ("trend", 5),
)  # fmt: skip
# from top to bottom
LEFT = ("troubles", "findings", "headline", "progress", "trend")
RIGHT = (
    "measured",
    "others",
    "monitor",
    "diagnosis",
    "excitation",
    "tests",
    "truth",
    "load",
    "in_order",
    "events",
)
ORDER = (
    "troubles", "findings", "measured", "headline", "progress", "trend", "others", "monitor", "diagnosis", "excitation",
    "tests", "truth", "load", "in_order", "events",
)  # fmt: skip


class Overlay(NamedTuple):
    """What a person has asked for with a key."""

    unit: SpeedUnit = SpeedUnit.M_S
    help: bool = False
    last_line: Line = ()  # a prompt, or that the view is paused; (): the keys
    keys: bool = False  # whether keys are read


NOTHING_ASKED = Overlay()


def render(view: View, columns: int, height: int, overlay: Overlay = NOTHING_ASKED) -> list[Line]:
    """Draw the view.

    Args:
        view: what to show.
        columns: of the terminal.
        height: rows of the terminal.
        overlay: what keys have asked for.

    Returns:
        At most `height` lines of at most `columns` columns, all text escaped.
    """
    bar = recorder_bar.lines(view, columns)
    keys = [help_lines.footer(columns)] if overlay.keys else []
    footer = [overlay.last_line] if overlay.last_line else keys
    room = max(height - len(bar) - len(footer), 0)
    if overlay.help:
        body = _help(view, columns, room)
    elif columns >= TWO_FROM_COLUMNS:
        body = _two_columns(view, overlay.unit, columns, room)
    else:
        body = _column(view, overlay.unit, ORDER, columns, room)
    filled = [*bar, *body[:room], *_empty(max(room - len(body), 0)), *footer]
    return [fitted(line, columns) for line in filled[:height]]


def _help(view: View, columns: int, room: int) -> list[Line]:
    """The headline in its smallest form, and what the keys do."""
    short = _estimates(view, columns)[0].forms[0]
    explained = help_lines.lines(columns)
    if len(explained) > room - len(short):
        explained = help_lines.short(columns)
    return [*short[: max(room - len(explained), 2)], *explained]


def _two_columns(view: View, unit: SpeedUnit, columns: int, room: int) -> list[Line]:
    left = int(LEFT_SHARE * columns)
    right = columns - left - width((SEPARATOR,))
    first = _column(view, unit, LEFT, left, room)
    second = _column(view, unit, RIGHT, right, room)
    out: list[Line] = []
    for k in range(max(len(first), len(second))):
        line = fitted(first[k], left) if k < len(first) else ()
        fill = Span(" " * (left - width(line)))
        out.append((*line, fill, SEPARATOR, *(second[k] if k < len(second) else ())))
    return out


def _column(view: View, unit: SpeedUnit, order: Sequence[str], columns: int, room: int) -> list[Line]:
    """The parts named in `order` from top to bottom, as large as there is room for, apart where there is more."""
    parts = [part for part in _sections(view, unit, columns) if part.name in order]
    chosen = allocated(parts, STEPS, room)
    spare = room - sum(map(len, chosen.values()))
    gaps = sum(map(bool, chosen.values())) - 1
    chosen["trend"] = _trend(
        view, columns, len(chosen.get("trend", ())), spare - gaps if spare >= gaps else spare
    )
    shown = [chosen[name] for name in order if chosen[name]]
    apart = room - sum(map(len, shown)) >= len(shown) - 1
    out: list[Line] = []
    for lines in shown:
        out += [(), *lines] if out and apart else lines
    return out


def _trend(view: View, columns: int, rows: int, spare: int) -> list[Line]:
    """As many curves as `rows` was allocated for, of the same height; what is spare makes them higher."""
    curves = headline.curves(view) if rows else []
    for count in range(len(curves), 0, -1):
        # no height divides by fewer curves than it was made for, apart from those of 2 rows
        if rows % count == 0 and rows // count >= 2:
            height = rows // count + spare // count
            return [line for curve in curves[:count] for line in headline.plotted(curve, columns, height)]
    return []


def _empty(rows: int) -> list[Line]:
    return [()] * rows


def _sections(view: View, unit: SpeedUnit, columns: int) -> list[Section]:
    """All parts of a picture."""
    measured = sections.measured(view, unit, columns)
    gate = sections.gate(view.sample, columns)
    # one row of the first curve more, then of all: their heights are known before they are drawn
    count = len(headline.curves(view))
    heights = (2, 2 * min(count, 2), 3 * min(count, 2), 3 * count, 5 * count) if count else ()
    return [
        *_estimates(view, columns),
        Section("troubles", ([], sections.troubles(view, columns, 1), sections.troubles(view, columns))),
        Section("findings", ([], sections.findings(view, columns, 1), sections.findings(view, columns))),
        Section("measured", ([], measured[:1], [*measured, *gate])),
        Section("monitor", ([], sections.monitor(view, columns))),
        Section(
            "diagnosis", ([], *(sections.diagnosis(view, columns, most) for most in (DIAGNOSIS_LINES, None)))
        ),
        Section("excitation", ([], sections.excitation(view, columns))),
        Section("tests", ([], sections.residual_tests(view, columns))),
        Section("load", ([], sections.loads(view, columns))),
        Section("in_order", ([], sections.in_order(view, columns))),
        Section("truth", ([], sections.truth(view, columns))),
        Section("events", ([], *(sections.events(view, columns, last) for last in (1, 3, 12)))),
        Section("trend", ([], *map(_empty, heights))),
    ]


def _estimates(view: View, columns: int) -> list[Section]:
    """The headline in its forms, first of all; then its progress, and the other estimators."""
    lead = headline.leading(view)
    if lead is None:
        waits: list[Line] = [(Span("no estimate yet", "dim"),)] if view.estimating else []
        return [Section("headline", (waits,)), Section("progress", ([],)), Section("others", ([],))]
    n = estimate_lines.numbers(view, lead)
    head, says = estimate_lines.head(n, columns), estimate_lines.sentence(lead, columns)
    main = headline.main_channel(n.shown.channels)
    channels = {
        name: estimate_lines.channel(name, ch, view.output, n.style, columns)
        for name, ch in n.shown.channels.items()
    }
    every = [line for lines in channels.values() for line in lines]
    forms = [[*head, *(channels[main] if main else []), *says], [*head, *every, *says]]
    large, complete = headline.large_numbers(n, view.output, columns)
    if large:
        rest = [line for name, lines in channels.items() if name != main or not complete for line in lines]
        forms.append([*head, *large, *rest, *says])
    others = [estimate_lines.numbers(view, e) for e in view.estimates if e.estimator != lead.estimator]
    return [
        Section("headline", tuple(forms)),
        Section(
            "progress",
            (
                [],
                headline.progress(lead, view.output, columns),
                headline.progress(lead, view.output, columns, every=True),
            ),
        ),
        Section(
            "others",
            (
                [],
                [line for other in others for line in _brief(other, lead, view.output, columns)],
                [line for other in others for line in estimate_lines.lines(other, view.output, columns)],
            ),
        ),
    ]


def _brief(n: estimate_lines.Numbers, lead: Estimate, output: str, columns: int) -> list[Line]:
    """Head and numbers of an estimate, or why there are none now, unless the headline says the same."""
    if n.now.status is Status.OK:
        return estimate_lines.lines(n, output, columns)
    says = [] if n.now.says == lead.says else estimate_lines.sentence(n.now, columns)
    return [*estimate_lines.head(n, columns), *says]
