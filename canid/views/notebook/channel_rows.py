"""Channels as the rows of a table: K, τ, θ or τ + θ with a drawing of each interval."""

from __future__ import annotations

from collections.abc import Mapping

from canid.types import QUOTED, Channel, Identifiable, Interval
from canid.views.names import SYMBOLS, readable
from canid.views.notebook.fragment import bar, scale, table
from canid.views.numbers import gain_unit, interval


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
            out.append((readable(name), "–", Interval(), "not identifiable"))
    return out


def channel_table(channels: Mapping[str, Channel], output: str = "") -> str:
    """The table; gains of one input have a scale of their own, all times share one."""
    several = rows(channels, output)
    if not several:
        return ""
    times = scale(of for _, _, of, unit in several if unit == "s")
    cells = []
    for name, symbol, of, unit in several:
        low, high = times if unit == "s" else scale([of])
        says = interval(of, unit)
        cells.append(
            (name, symbol, says if symbol != "–" else unit, bar(of, low, high, f"{name} {symbol} {says}"))
        )
    return table(("input", "", "95 % interval", ""), cells)
