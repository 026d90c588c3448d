"""Estimates of K, τ, θ and τ + θ over the drive, with the 95 % bands of every estimator."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from canid.identification.identifiability import quotable
from canid.types import Array, Channel, Estimate, Status
from canid.views.drive_report.panels import Panel, band, shown_range, stack
from canid.views.names import SYMBOLS, readable
from canid.views.numbers import gain_unit, number
from canid.views.report.figure import Figure, Spec, line, times

COLORS = {"fopdt": "after", "armax": "before"}
OTHER_COLOR = "rival"
# points of a line: of live estimates, two a second, a drive has thousands
MAX_POINTS = 1500


def estimates_over_time(
    name: str,
    estimates: Sequence[Estimate],
    channel: str,
    output: str,
    span: tuple[float, float],
    parameters: Sequence[str] = ("K", "tau", "dead_time"),
) -> Figure | None:
    """One panel per parameter of one channel; None where nothing was estimated.

    Args:
        name: id in the page.
        estimates: in the order of time, of all estimators.
        channel: input name.
        output: role of the driver's output, for the unit of K.
        span: s, of the time axis.
        parameters: fields of `Channel`.
    """
    names = sorted({e.estimator for e in estimates}, key=lambda one: (one != "fopdt", one))
    each = {one: [e for e in estimates if e.estimator == one and channel in e.channels] for one in names}
    panels = []
    for parameter in parameters:
        data: list[Spec] = []
        shown: list[Array] = []
        for one, rows in each.items():
            lines, values = _lines(one, rows, channel, parameter)
            data += lines
            shown += values
        unit = gain_unit(output, channel) if parameter == "K" else "s"
        panels.append(Panel(f"{SYMBOLS[parameter]} ({unit})", data, range=shown_range(shown)))
    if not any(panel.range for panel in panels):
        return None
    return stack(
        name,
        f"{readable(channel).capitalize()}: parameters over the drive",
        _caption(each, channel, parameters),
        [panel for panel in panels if panel.range],
        span=span,
    )


def _lines(
    one: str, rows: Sequence[Estimate], channel: str, parameter: str
) -> tuple[list[Spec], list[Array]]:
    """Band, and lines of what may and what may not be quoted; and what the panel's range should hold."""
    step = max(math.ceil(len(rows) / MAX_POINTS), 1)
    rows = rows[::step]
    if not rows:
        return [], []
    t = np.array([e.t for e in rows])
    known = [_known(e, channel) for e in rows]
    value, low, high = np.array([getattr(c, parameter) for c in known], dtype=float).T
    may = np.array([quotable(c, parameter) for c in known])
    color = COLORS.get(one, OTHER_COLOR)
    out = [band(t, low, high, f"{one}, 95 %", color)]
    out.append(line(times(t), np.where(may, value, math.nan), one, color))
    rest = np.where(may, math.nan, value)
    if np.isfinite(rest).any():
        faint = {"line": {"color": f"@{color}", "width": 1, "dash": "dot"}, "showlegend": False}
        out.append(line(times(t), rest, f"{one}, not to be quoted", color) | faint)
    # where something may be quoted, the band of what may not does not set the range
    these = may & np.isfinite(value) if (may & np.isfinite(value)).any() else np.isfinite(value)
    return out, [low[these], high[these]]


def _known(e: Estimate, channel: str) -> Channel:
    return e.channels[channel] if e.status is Status.OK else Channel()


def _caption(each: dict[str, list[Estimate]], channel: str, parameters: Sequence[str]) -> str:
    said = []
    for one, rows in each.items():
        ok = [e for e in rows if e.status is Status.OK and quotable(e.channels[channel], "K")]
        share = 100.0 * len(ok) / len(rows) if rows else 0.0
        said.append(f"{one}: K may be quoted in {number(share, '%')} of {len(rows)} estimates")
    return (
        f"95 % bands; dotted where a value may not be quoted. {'; '.join(said)}. "
        "The range is that of nearly all intervals that may be quoted: wider ones are cut off."
    )
