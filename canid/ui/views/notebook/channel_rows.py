"""Intervals, channels and estimates as fragments: rows of K, τ, θ or τ + θ with a drawing of each interval."""

from __future__ import annotations

from collections.abc import Mapping

from canid.ui.views.document.document import Table
from canid.ui.views.notebook.fragment import bar, fragment, scale
from canid.values.text import estimate_text
from canid.values.text.names import SYMBOLS, method, readable
from canid.values.text.numbers import gain_unit, interval
from canid.values.types import QUOTED, Channel, Estimate, Identifiable, Interval, Status


def rows(channels: Mapping[str, Channel], output: str = "") -> list[tuple[str, str, Interval, str]]:
    """Input, symbol, interval and unit of what may be quoted; one row without numbers where nothing may be.

    Example:
        >>> K = Channel(Interval(5.6, 5.0, 6.2), status=Identifiable.GAIN_ONLY)
        >>> rows({"range_rate": K}, "pedal")
        [('range rate', 'K', Interval(value=5.6, low=5.0, high=6.2), '% per m/s')]
    """
    out = []
    for name, channel in channels.items():
        for field in QUOTED[channel.status]:
            unit = (gain_unit(output, name) if output else "") if field == "K" else "s"
            out.append((readable(name), SYMBOLS[field], getattr(channel, field), unit))
        if channel.status is Identifiable.NOT:
            out.append((readable(name), "–", Interval(), estimate_text.unknown(channel)))
    return out


def channel_table(channels: Mapping[str, Channel], output: str = "") -> Table:
    """The table; gains of one input have a scale of their own, all times share one."""
    several = rows(channels, output)
    times = scale(known for _, _, known, unit in several if unit == "s")
    cells = []
    for name, symbol, known, unit in several:
        low, high = times if unit == "s" else scale([known])
        says = interval(known, unit) if symbol != "–" else unit
        cells.append((name, symbol, says, bar(known, low, high, f"{name} {symbol} {says}")))
    return Table(("input", "", "95 % interval", ""), cells)


def interval_html(known: Interval) -> str:
    """Value, interval and a drawing of it."""
    return fragment(
        "", Table(("95 % interval", ""), [(interval(known), bar(known, *scale([known]), interval(known)))])
    )


def channel_html(channel: Channel) -> str:
    """What may be quoted of one channel."""
    return fragment("Channel", channel.withheld, channel_table({"": channel}))


def estimate_html(estimate: Estimate) -> str:
    """One estimate."""
    mark = ", headline" if estimate.headline else ""
    shown = channel_table(estimate.channels) if estimate.status is Status.OK else None
    return fragment(
        f"{method(estimate.estimator)} at {estimate.t:.1f} s: {estimate.status.value}{mark}",
        estimate.says,
        shown,
    )
