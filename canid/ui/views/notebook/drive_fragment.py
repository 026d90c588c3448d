"""A `Drive` as text and as a fragment: its trace, the last estimate of each estimator, what was wrong with the log."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from canid.analysis.drive.drive_reader import Drive, Health
from canid.ui.views import end_summary
from canid.ui.views.document.document import Listing
from canid.ui.views.document.document_text import lines
from canid.ui.views.notebook.channel_rows import channel_table
from canid.ui.views.notebook.fragment import fragment
from canid.ui.views.notebook.trace_fragment import trace_blocks, trace_charts, trace_html
from canid.values.text import estimate_text
from canid.values.text.names import method
from canid.values.types import Estimate, Status


def drive_text(drive: Drive) -> list[str]:
    """The text of `Drive.summary()`."""
    return lines([*trace_blocks(drive.trace), Listing(_last(drive)), Listing(_problems(drive.health))])


def drive_html(drive: Drive) -> Markup:
    """The fragment of a drive."""
    good = [e for e in latest(drive.estimates) if e.status is Status.OK]
    problems = Listing(_problems(drive.health))
    if not good:
        return trace_html(drive.trace) + fragment("", Listing(_last(drive)), problems)
    shown = [fragment(f"{method(e.estimator)}, at {e.t:.1f} s", channel_table(e.channels)) for e in good]
    title = f"Drive: {len(drive.estimates)} estimates"
    return fragment(title, trace_charts(drive.trace), *shown, problems)


def _last(drive: Drive) -> list[str]:
    return [estimate_text.estimate(e) for e in latest(drive.estimates)]


def _problems(health: Health) -> list[str]:
    """What was wrong with the log."""
    return end_summary.health(health.damage, health.back_in_time, health.counters, health.said)


def latest(estimates: Sequence[Estimate]) -> list[Estimate]:
    """The last estimate of each estimator that is `ok`, or where none is, the last one."""
    by_estimator: dict[str, Estimate] = {}
    for e in estimates:
        if e.status is Status.OK or by_estimator.get(e.estimator, e).status is not Status.OK:
            by_estimator[e.estimator] = e
    return list(by_estimator.values())
