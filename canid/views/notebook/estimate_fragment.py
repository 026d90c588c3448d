"""Intervals, channels and estimates as fragments."""

from __future__ import annotations

from canid.types import Channel, Estimate, Interval, Status
from canid.views import estimate_text
from canid.views.notebook.channel_rows import channel_table
from canid.views.notebook.fragment import bar, fragment, lines, scale, table
from canid.views.numbers import interval


def interval_html(of: Interval) -> str:
    """Value, interval and a drawing of it."""
    return table(("95 % interval", ""), [(interval(of), bar(of, *scale([of]), interval(of)))])


def channel_html(of: Channel) -> str:
    """What may be quoted of one channel."""
    return fragment("Channel", channel_table({"": of}))


def estimate_html(of: Estimate) -> str:
    """One estimate."""
    mark = ", headline" if of.headline else ""
    shown = channel_table(of.channels) if of.status is Status.OK else ""
    return fragment(f"{of.estimator} at {of.t:.1f} s: {of.status.value}{mark}", lines([of.says]), shown)


def estimate_lines(of: Estimate) -> list[str]:
    """The line that `canid replay` prints."""
    return [estimate_text.estimate(of)]
