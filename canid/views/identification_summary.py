"""The summary of `canid identify`: some twenty lines of at most 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import NamedTuple

from canid.drive_parameters import Identified
from canid.estimators import step_watch
from canid.estimators.estimator import WholeDrive
from canid.signal_checks.signal_checks import sentence
from canid.systems.identified_loop import IdentifiedLoop
from canid.types import Identifiable, ResidualTests
from canid.views import estimate_text, signal_text
from canid.views.identification_verdict import IdentificationVerdict, verdict
from canid.views.names import HEADLINE_MARK, readable
from canid.views.numbers import gain_unit, interval, number

# columns of a terminal that nobody has made wider
WIDTH = 80
# lines of a terminal of 24 and one: a verdict on one screen
MAX_LINES = 25
# findings and changes that are listed; the others are counted
LISTED = 3


class _Part(NamedTuple):
    """Lines that belong together."""

    lines: list[str]
    least: int  # of them that stay where the summary becomes too long


def summary(drive: Identified, log: str, vehicle: str, output: str = "", windows: str = "") -> list[str]:
    """What `canid identify` prints.

    Args:
        drive: from `identify`.
        log: its name, which is never cut.
        vehicle: its name.
        output: role of the driver's output, for the unit of K.
        windows: how to see the estimates over sliding windows; empty: they are shown already.

    Example:
        >>> summary(Identified(60.0, 0.0, (), {}, ()), "a.blf", "car")[:2]
        ['a.blf', 'car, 0 s, driving 0 s, behind a lead 0 s, usable for identification 0 s']
    """
    of = verdict(drive, output)
    head = _wrapped(f"{vehicle}, {signal_text.time(drive.time)}")
    parts = [
        _Part([log, *head], 2),
        _Part(_wrapped(_said(drive, of)), 3),
        _Part(_findings(drive), 2),
    ]
    for name in drive.ranked if of.identifiable else ():
        first = name == drive.ranked[0]
        mark = f"{HEADLINE_MARK} " if first else ""
        parts.append(_Part(_method(mark, name, drive.whole[name], output), 3 if first else 1))
    if of.identifiable:
        parts += [
            _Part(_changes(drive.headline, output), 1),
            _Part(_residuals(drive.headline), 1),
            _Part(_loop(drive.loop, of.withheld), 1),
            _Part(_orders(drive), 0),
        ]
    if windows:
        parts.append(_Part([f"{len(drive.windows)} windows: {windows}"], 1))
    return _cut(parts)


def _said(drive: Identified, of: IdentificationVerdict) -> str:
    """The verdict without the numbers, which follow, and without a finding that follows."""
    if not of.identifiable and any(one.withholds for one in drive.findings):
        return f"{of.title}: a signal that the model needs is wrong."
    return f"{of.title}.{f' {of.withheld}' if of.withheld else ''}"


def _cut(parts: list[_Part]) -> list[str]:
    """Drop lines from the end of the least important parts, until all fit on one screen."""
    kept = [len(part.lines) for part in parts]
    for k in range(len(parts) - 1, -1, -1):
        while sum(kept) > MAX_LINES and kept[k] > min(parts[k].least, len(parts[k].lines)):
            kept[k] -= 1
    return [line for part, n in zip(parts, kept, strict=True) for line in _first(part.lines, n)]


def _first(lines: list[str], n: int) -> list[str]:
    if n >= len(lines) or not n:
        return lines[:n]
    return [*lines[: n - 1], f"{lines[n - 1][: WIDTH - 2].rstrip()} …"]


def _wrapped(text: str, indent: str = "  ") -> list[str]:
    """A sentence in lines; the second and later ones are indented."""
    return textwrap.wrap(text, WIDTH, subsequent_indent=indent, break_long_words=True, break_on_hyphens=False)


def _findings(drive: Identified) -> list[str]:
    """Findings on the signals."""
    if not drive.findings:
        return ["signals: no finding"]
    lines = []
    for one in drive.findings[:LISTED]:
        until = f"; until {one.until:.0f} s" if one.until == one.until else ""
        lines += _wrapped(f"✗ {sentence(one)}{until}")
    more = len(drive.findings) - LISTED
    return [*lines, f"  and {more} more"] if more > 0 else lines


def _method(mark: str, name: str, found: WholeDrive | None, output: str) -> list[str]:
    """One method's numbers over the whole drive."""
    if found is None:
        return [f"{mark}whole drive, {name.upper()}: no model (too few data, or no stable model)"]
    fit = (
        ""
        if found.fit_percent is None
        else f", fit {number(found.fit_percent, '%')} ({readable(found.fit_kind)})"
    )
    lines = [f"{mark}whole drive, {name.upper()}{found.specification}{fit}"]
    if found.details.get("changes"):
        return [*lines, "  no number holds for the whole drive: see the changes"]
    for channel_name, channel in found.channels.items():
        lines += _wrapped(f"  {estimate_text.channel(channel_name, channel, output, None)}", "    ")
    return lines


def _changes(found: WholeDrive | None, output: str) -> list[str]:
    """Steps of the gains, and whether each parameter is constant."""
    if found is None:
        return []
    changes = found.details.get("changes", ())
    if changes:
        lines = [line for c in changes[:LISTED] for line in _wrapped(step_watch.says(c))]
        more = len(changes) - LISTED
        if more > 0:
            lines.append(f"and {more} more changes")
        for segment in found.details.get("segments", ()):
            known = ", ".join(
                f"{readable(name)} K {interval(c.K, gain_unit(output, name) if output else '')}"
                for name, c in segment["channels"].items()
                if c.status is not Identifiable.NOT
            )
            span = f"{segment['start']:.0f}–{segment['stop']:.0f} s"
            lines += _wrapped(f"  {span}: {known or 'no gain can be estimated'}", "    ")
        return lines
    constancy = found.details.get("constancy", ())
    if not constancy:
        return ["changes: no step of the gains found"] if found.details.get("segments") == [] else []
    each = ", ".join(
        f"{readable(c['input'])} {'K' if c['parameter'] == 'K' else 'τ+θ'} "
        f"{'varies' if c['p_value'] < 0.05 else 'no change shown'} (p = {c['p_value']:.2f})"
        for c in constancy
    )
    return _wrapped(f"changes: no step of the gains found; {each}")


def _residuals(found: WholeDrive | None) -> list[str]:
    """The residual tests of the headline in one sentence."""
    tests = None if found is None else found.residual_tests
    if tests is None:
        return []
    return _wrapped(f"residuals: {residual_sentence(tests)}")


def residual_sentence(tests: ResidualTests) -> str:
    """The residual tests in one sentence.

    Example:
        >>> residual_sentence(ResidualTests(True, 20.0, 41.6, (), (), True, {"range_rate": 18}))
        'white, no response left over, variance stationary'
    """
    if tests.statistic != tests.statistic:
        return "not tested: too few data"
    left = [
        f"{readable(name)}{f' ({100 * share:.0f} %)' if (share := tests.left_over_share.get(name)) is not None else ''}"
        for name in tests.left_over
    ]
    parts = (
        "white" if tests.white else "not white",
        f"a response left over to {', '.join(left)}" if left else "no response left over",
        "variance stationary" if tests.stationary else "variance not stationary",
    )
    return ", ".join(parts)


def string_sentence(loop: IdentifiedLoop) -> str:
    """Whether the motion of the lead is amplified."""
    if loop.string_peak.low > 1.0:
        return "motion of the lead is amplified"
    if loop.string_peak.high > 1.0:
        return f"amplified in {100 * loop.amplifying:.0f} % of the draws: not decided"
    return "motion of the lead is not amplified"


def _loop(loop: IdentifiedLoop, withheld: str) -> list[str]:
    """Margins and string stability in two lines, or why there are none."""
    reason = loop.says.partition(", nor margins")[0]
    if reason and reason.casefold() in withheld.casefold():
        return ["driver and car: no margins: they depend on delays that may not be quoted"]
    if loop.says:
        return _wrapped(f"driver and car: no margins: {loop.says}")
    return [
        *_wrapped(
            f"driver and car at {loop.speed:.1f} m/s: phase margin {interval(loop.phase_margin, '°')}, "
            f"delay margin {interval(loop.delay_margin, 's')}"
        ),
        *_wrapped(f"  largest |v/v_lead| {interval(loop.string_peak)}: {string_sentence(loop)}", "    "),
    ]


def _orders(drive: Identified) -> list[str]:
    """The best order of ARMAX by BIC."""
    for c in drive.orders[:1]:
        o = c.orders
        return [
            f"best order of ARMAX by BIC: ({o.na},{o.nb},{o.nc}), dead time {o.nk} sample{'s' * (o.nk != 1)}"
        ]
    return []


def several(verdicts: Iterable[tuple[str, str]]) -> list[str]:
    """One line per log, after the summaries of several logs.

    Args:
        verdicts: name of the log, and title of its verdict.

    Example:
        >>> several([("a.blf", "Nothing is identifiable"), ("b.blf", "The driver is identified")])
        ['1 of 2 logs: something is identifiable', '  a.blf: nothing is identifiable', '  b.blf: the driver is identified']
    """
    rows = list(verdicts)
    known = sum(title != "Nothing is identifiable" for _, title in rows)
    lines = [f"{known} of {len(rows)} logs: something is identifiable"]
    return lines + [f"  {log}: {title[0].lower()}{title[1:]}" for log, title in rows]
