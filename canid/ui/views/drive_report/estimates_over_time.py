"""Estimates of K, τ, θ and τ + θ over the drive, with the 95 % bands of every estimator."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from canid.mathematics.identification.identifiability import quotable
from canid.ui.views.drawing.figure import Figure, Spec, line, times
from canid.ui.views.drawing.panels import Panel, band, shown_range, stack, titled
from canid.values.text.names import SYMBOLS, readable
from canid.values.text.numbers import gain_unit, number
from canid.values.types import Array, Channel, Estimate, Interval, Status

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
    each = _by_estimator(estimates, channel)
    panels = [_panel(each, channel, p, output, SYMBOLS[p]) for p in parameters]
    known = [panel for panel in panels if panel.range]
    if not known:
        return None
    title = f"{readable(channel).capitalize()}: parameters over the drive"
    return stack(name, title, _caption(each, channel, parameters), known, span=span)


def gains_over_time(
    estimates: Sequence[Estimate],
    channels: Sequence[str],
    output: str,
    span: tuple[float, float],
    *,
    whole: Mapping[str, Channel] = MappingProxyType({}),
    more: Sequence[Panel] = (),
    shapes: Sequence[Spec] = (),
) -> Figure | None:
    """K of several inputs, a panel each; None where nothing was estimated and there are no further panels.

    Args:
        estimates: in the order of time, of all estimators.
        channels: input names.
        output: role of the driver's output, for the unit of K; empty: not known.
        span: s, of the time axis.
        whole: the whole drive's estimates, drawn as a line with its band.
        more: panels below.
        shapes: behind the lines.
    """
    panels = []
    for channel in channels:
        panel = _panel(_by_estimator(estimates, channel), channel, "K", output, f"K of {readable(channel)}")
        K = whole[channel].K if channel in whole and quotable(whole[channel], "K") else Interval()
        if math.isfinite(K.value):
            t, ends = np.array(span), ([K.low] * 2, [K.high] * 2)
            panel.data.append(band(t, np.array(ends[0]), np.array(ends[1]), "whole drive, 95 %", "measured"))
            panel.data.append(line(times(t), np.array([K.value] * 2), "whole drive", "measured"))
        panels.append(panel)
    panels = [panel for panel in [*panels, *more] if panel.data]
    return stack("gains", "", "", panels, span=span, shapes=shapes) if panels else None


def _by_estimator(estimates: Sequence[Estimate], channel: str) -> dict[str, list[Estimate]]:
    names = sorted({e.estimator for e in estimates}, key=lambda name: (name != "fopdt", name))
    return {name: [e for e in estimates if e.estimator == name and channel in e.channels] for name in names}


def _panel(
    each: Mapping[str, Sequence[Estimate]], channel: str, parameter: str, output: str, title: str
) -> Panel:
    """The lines of all estimators."""
    data: list[Spec] = []
    shown: list[Array] = []
    for name, rows in each.items():
        lines, values = _lines(name, rows, channel, parameter)
        data += lines
        shown += values
    unit = "s" if parameter != "K" else gain_unit(output, channel) if output else ""
    return Panel(titled(title, unit), data, range=shown_range(shown))


def _lines(
    estimator: str, rows: Sequence[Estimate], channel: str, parameter: str
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
    color = COLORS.get(estimator, OTHER_COLOR)
    name = estimator.upper()
    out = [band(t, low, high, f"{name}, 95 %", color)]
    out.append(line(times(t), np.where(may, value, math.nan), name, color))
    rest = np.where(may, math.nan, value)
    if np.isfinite(rest).any():
        faint = {"line": {"color": f"@{color}", "width": 1, "dash": "dot"}, "showlegend": False}
        out.append(line(times(t), rest, f"{name}, not to be quoted", color) | faint)
    # where something may be quoted, the band of what may not does not set the range
    these = may & np.isfinite(value) if (may & np.isfinite(value)).any() else np.isfinite(value)
    return out, [low[these], high[these]]


def _known(e: Estimate, channel: str) -> Channel:
    return e.channels[channel] if e.status is Status.OK else Channel()


def _caption(each: dict[str, list[Estimate]], channel: str, parameters: Sequence[str]) -> str:
    said = []
    for estimator, rows in each.items():
        ok = [e for e in rows if e.status is Status.OK and quotable(e.channels[channel], "K")]
        share = 100.0 * len(ok) / len(rows) if rows else 0.0
        said.append(f"{estimator.upper()}: K may be quoted in {number(share, '%')} of {len(rows)} estimates")
    return (
        f"95 % bands; dotted where a value may not be quoted. {'; '.join(said)}. "
        "The range is that of nearly all intervals that may be quoted: wider ones are cut off."
    )
