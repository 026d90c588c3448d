"""The answer of a fleet in plain sentences: how much there is, how drivers differ, what changed, causes, what is wrong."""

from __future__ import annotations

import math
from collections import Counter

from canid.analysis.fleet.answers.labels import hours, label, spread
from canid.values.fleet_summary import FleetSummary, Parameter, Population
from canid.values.text.names import readable
from canid.values.text.numbers import interval, plural

# names in a sentence
MAX_NAMES = 3


def verdict(summary: FleetSummary) -> str:
    """In a few words."""
    population = _first(summary)
    if population is None:
        return "no drive has an estimate"
    drives = sum(driver.drives for pooled in summary.populations for driver in pooled.drivers)
    drivers = len({driver.name for pooled in summary.populations for driver in pooled.drivers})
    head = f"{plural(drivers, 'driver')}, {plural(drives, 'drive')}"
    if drivers < 2:
        return head
    differ = [label(parameter.name) for parameter in population.parameters if parameter.between.low > 0.0]
    return f"{head}: drivers differ" if differ else f"{head}: no difference between drivers is shown"


def sentences(summary: FleetSummary) -> tuple[str, ...]:
    """The answer, plainly."""
    out = [_counts(summary)]
    if summary.excluded:
        most = summary.excluded[0]
        n = sum(reason.number for reason in summary.excluded)
        several = "s with results do not count" if n > 1 else " with results does not count"
        often = "most often: " if len(summary.excluded) > 1 else ""
        out.append(f"{n:,} drive{several} for the population; {often}{most.what}")
    if summary.drivers_excluded:
        named = _names([driver.what for driver in summary.drivers_excluded])
        why = Counter(driver.says for driver in summary.drivers_excluded)
        often = "most often: " * (len(why) > 1)
        out.append(
            f"nothing is known of {plural(len(summary.drivers_excluded), 'driver')} ({named}); "
            f"{often}{why.most_common(1)[0][0]}"
        )
    population = _first(summary)
    if population is not None:
        out += _spread(population)
        kinds = sum(bool(pooled.drivers) for pooled in summary.populations)
        if kinds > 1:
            out.append(f"{kinds} kinds of output are pooled apart, because their gains cannot be compared")
    for population in summary.populations:
        out += [asked.sentence for asked in population.questions if asked.sentence]
    if summary.causes:
        sure = [cause for cause in summary.causes if cause.q <= 0.05]
        listed = [
            f"{readable(cause.effect)} in {cause.car} ({cause.drives} of {cause.diagnosed} drives)"
            for cause in sure
        ]
        if listed:
            out.append(f"causes beyond chance: {_names(listed)}")
        joint = [
            f"{readable(cause.effect)} in {cause.car} ({cause.joint})"
            for cause in summary.causes
            if cause.joint
        ]
        if joint:
            out.append(f"causes on several drives of a driver together: {_names(joint)}")
        if not listed and not joint:
            out.append(
                f"{plural(len(summary.causes), 'cause')} named, none beyond what chance gives over so many drives"
            )
    if summary.signals:
        worst = summary.signals[0]
        out.append(f"worst signal: {readable(worst.what)} in {plural(worst.number, 'drive')}")
    return tuple(out)


def _first(summary: FleetSummary) -> Population | None:
    """The kind of output with most drives, among those of which something is known; None: there is none."""
    return next((pooled for pooled in summary.populations if pooled.drivers), None)


def _counts(summary: FleetSummary) -> str:
    c = summary.counts
    good = c.ok + c.damaged
    said = f"{good:,} of {c.logs - c.duplicates:,} logs have results"
    why = [
        f"{c.failed:,} failed" if c.failed else "",
        _agreeing(c.damaged, "is damaged and was read in part", "are damaged and were read in part"),
    ]
    why += [
        _agreeing(c.duplicates, "more is a copy", "more are copies"),
        _agreeing(c.open, "is not analysed yet", "are not analysed yet"),
    ]
    named = ", ".join(filter(None, why))
    usable = f"{hours(c.usable)} of {hours(c.duration)} driven are usable"
    return said + (f" ({named})" if named else "") + f"; {usable}"


def _spread(population: Population) -> list[str]:
    known = [
        parameter
        for parameter in population.parameters
        if parameter.drivers > 1 and math.isfinite(parameter.between.value)
    ]
    if not known:
        return []
    gain = next((parameter for parameter in known if parameter.name == "range_rate.K"), known[0])
    unit = f" {gain.unit}" if gain.unit else ""
    said = (
        f"{label(gain.name)} of {population.kind.output} is {interval(gain.mean)}{unit} on average; {_between(gain)}; "
        f"drives of one driver differ by a standard deviation of {spread(gain, gain.within)}"
    )
    return [said, gain.says] if gain.says else [said]


def _between(parameter: Parameter) -> str:
    if parameter.between.low > 0.0:
        return f"drivers differ by a standard deviation of {spread(parameter, parameter.between)}"
    return f"between drivers no spread is shown (standard deviation {spread(parameter, parameter.between)})"


def _agreeing(n: int, singular: str, several: str) -> str:
    return f"{n:,} {singular if n == 1 else several}" if n else ""


def _names(names: list[str]) -> str:
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more:,} more" if more > 0 else "")
