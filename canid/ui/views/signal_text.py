"""Findings on the signals, and what a drive holds, as lines of text."""

from __future__ import annotations

from collections.abc import Iterable

from canid.signals.signal_checks.signal_checks import sentence
from canid.values.types import DriveTime, SignalFinding, SignalReport


def time(drive: DriveTime) -> str:
    """What a drive holds.

    Example:
        >>> time(DriveTime(60.0, 55.0, 50.0, 43.0))
        '60 s, driving 55 s, behind a lead 50 s, usable for identification 43 s'
    """
    behind = f"behind a lead {drive.behind_lead:.0f} s, " if drive.behind_lead == drive.behind_lead else ""
    return f"{drive.total:.0f} s, driving {drive.driving:.0f} s, {behind}usable for identification {drive.usable:.0f} s"


def findings(several: Iterable[SignalFinding]) -> list[str]:
    """One line per finding.

    Example:
        >>> one = SignalFinding("speed_unit", ("speed",), 3.0, 20.0, "speed is 3.6 times gnss_speed", "check it", True)
        >>> findings([one, one._replace(until=90.0)])[1]
        '✗ speed is 3.6 times gnss_speed (since 3 s): check it; until 90 s'
    """
    return [
        f"✗ {sentence(finding)}{f'; until {finding.until:.0f} s' if finding.until == finding.until else ''}"
        for finding in several
    ]


def report(r: SignalReport) -> list[str]:
    """A report in lines: what has begun or ended now.

    Example:
        >>> one = SignalFinding("speed_unit", ("speed",), 3.0, 20.0, "speed is 3.6 times gnss_speed", "check it", True)
        >>> report(SignalReport(20.0, (one,)))
        ['     20.0 s  signals wrong         speed is 3.6 times gnss_speed (since 3 s): check it']
    """
    new = [finding for finding in r.findings if r.t in (finding.raised, finding.until)]
    return [
        f" {r.t:8.1f} s  {'signals':7} {'wrong' if finding.until != finding.until else 'no longer':12}  {sentence(finding)}"
        for finding in new
    ]
