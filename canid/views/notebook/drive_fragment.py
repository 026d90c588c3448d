"""A `Drive` as text and as a fragment: its trace, the last estimate of each estimator, what was wrong with the log."""

from __future__ import annotations

from collections.abc import Sequence

from canid.types import Estimate, Status, Trace
from canid.views import estimate_text
from canid.views.notebook.channel_rows import channel_table
from canid.views.notebook.fragment import fragment, lines
from canid.views.notebook.trace_fragment import trace_charts, trace_html, trace_lines


def drive_lines(trace: Trace, estimates: Sequence[Estimate], problems: Sequence[str]) -> list[str]:
    """The text of `Drive.summary()`."""
    last = [estimate_text.estimate(e) for e in latest(estimates)]
    return [*trace_lines(trace), *[""] * bool(last), *last, *[""] * bool(problems), *problems]


def drive_html(trace: Trace, estimates: Sequence[Estimate], problems: Sequence[str]) -> str:
    """The fragment of a drive."""
    good = [e for e in latest(estimates) if e.status is Status.OK]
    if not good:
        says = [estimate_text.estimate(e) for e in latest(estimates)]
        return trace_html(trace) + lines([*says, *problems])
    shown = [fragment(f"{e.estimator}, at {e.t:.1f} s", channel_table(e.channels)) for e in good]
    return fragment(f"Drive: {len(estimates)} estimates", trace_charts(trace), *shown, lines(problems))


def latest(estimates: Sequence[Estimate]) -> list[Estimate]:
    """The last estimate of each estimator that is `ok`, or where none is, the last one."""
    found: dict[str, Estimate] = {}
    for e in estimates:
        if e.status is Status.OK or found.get(e.estimator, e).status is not Status.OK:
            found[e.estimator] = e
    return list(found.values())
