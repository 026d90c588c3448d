"""Judged requirements as JUnit's XML, which CI servers show: a suite for each log, a case for each requirement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from xml.etree import ElementTree as ET

from canid.analysis.drive.requirements import Judged
from canid.values.terminal_text import terminal_text


class JudgedLog(NamedTuple):
    """One log."""

    log: str
    cases: tuple[Judged, ...]


def xml(logs: Sequence[JudgedLog]) -> str:
    """The file's text. Characters that XML cannot hold are shown as on a terminal.

    Example:
        >>> from canid.analysis.drive.requirements import requirement
        >>> case = Judged(requirement("fit_percent in 50..100"), "the fit is 40 %", "the fit is 40 %, not in 50 to 100")
        >>> xml([JudgedLog("a.blf", (case,))]).splitlines()[1][:70]
        '<testsuites name="canid identify" tests="1" failures="1"><testsuite na'
    """
    counts = [(len(log.cases), sum(bool(case.failed) for case in log.cases)) for log in logs]
    tests, failures = (str(sum(each)) for each in zip(*counts, strict=True)) if counts else ("0", "0")
    root = ET.Element("testsuites", name="canid identify", tests=tests, failures=failures)
    for log, (n, failed) in zip(logs, counts, strict=True):
        name = terminal_text(log.log)
        suite = ET.SubElement(root, "testsuite", name=name, tests=str(n), failures=str(failed))
        for case in log.cases:
            about = ET.SubElement(
                suite, "testcase", name=terminal_text(case.requirement.text), classname=name
            )
            if case.failed:
                ET.SubElement(about, "failure", message=terminal_text(case.failed))
            if case.says != case.failed:
                ET.SubElement(about, "system-out").text = terminal_text(case.says)
    return "<?xml version='1.0' encoding='utf-8'?>\n" + ET.tostring(root, encoding="unicode") + "\n"
