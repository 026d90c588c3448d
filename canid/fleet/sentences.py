"""The answer of a fleet in plain sentences: how much there is, how drivers differ, what changed, causes, what is wrong."""

from __future__ import annotations

import math

from canid.fleet_summary import FleetSummary, Parameter, Population
from canid.views.fleet_report.labels import label, spread
from canid.views.names import readable
from canid.views.numbers import interval

# names in a sentence
MAX_NAMES = 3


def verdict(of: FleetSummary) -> str:
    """In a few words."""
    population = _first(of)
    if population is None:
        return "no drive has an estimate"
    drives = sum(driver.drives for one in of.populations for driver in one.drivers)
    drivers = len({driver.name for one in of.populations for driver in one.drivers})
    head = f"{_plural(drivers, 'driver')}, {_plural(drives, 'drive')}"
    if drivers < 2:
        return head
    differ = [label(one.name) for one in population.parameters if one.between.low > 0.0]
    return f"{head}: drivers differ" if differ else f"{head}: no difference between drivers is shown"


def sentences(of: FleetSummary) -> tuple[str, ...]:
    """The answer, plainly."""
    out = [_counts(of)]
    if of.excluded:
        most = of.excluded[0]
        n = sum(one.number for one in of.excluded)
        out.append(
            f"{_plural(n, 'drive')} with results do not count for the population; most often: {most.what}"
        )
    population = _first(of)
    if population is not None:
        out += _spread(population)
        kinds = sum(bool(one.drivers) for one in of.populations)
        if kinds > 1:
            out.append(f"{kinds} kinds of output are pooled apart, because their gains cannot be compared")
    for population in of.populations:
        out += [asked.sentence for asked in population.questions if asked.sentence]
    if of.causes:
        sure = [one for one in of.causes if one.q <= 0.05]
        listed = [
            f"{readable(one.effect)} in {one.car} ({one.drives} of {one.diagnosed} drives)" for one in sure
        ]
        if listed:
            out.append(f"causes beyond chance: {_names(listed)}")
        joint = [f"{readable(one.effect)} in {one.car} ({one.joint})" for one in of.causes if one.joint]
        if joint:
            out.append(f"causes on several drives of a driver together: {_names(joint)}")
        if not listed and not joint:
            out.append(
                f"{_plural(len(of.causes), 'cause')} named, none beyond what chance gives over so many drives"
            )
    if of.signals:
        worst = of.signals[0]
        out.append(f"worst signal: {readable(worst.what)} in {_plural(worst.number, 'drive')}")
    return tuple(out)


def _first(of: FleetSummary) -> Population | None:
    """The kind of output with most drives, among those of which something is known; None: there is none."""
    return next((one for one in of.populations if one.drivers), None)


def _counts(of: FleetSummary) -> str:
    c = of.counts
    good = c.ok + c.damaged
    said = f"{good:,} of {c.logs - c.duplicates:,} logs have results"
    why = [
        f"{c.failed:,} failed" if c.failed else "",
        f"{c.damaged:,} are damaged and were read in part" if c.damaged else "",
    ]
    why += [
        f"{c.duplicates:,} more are copies" if c.duplicates else "",
        f"{c.open:,} are not analysed yet" if c.open else "",
    ]
    named = ", ".join(filter(None, why))
    hours = f"{c.usable / 3600.0:,.1f} h of {c.duration / 3600.0:,.1f} h driven are usable"
    return said + (f" ({named})" if named else "") + f"; {hours}"


def _spread(of: Population) -> list[str]:
    known = [one for one in of.parameters if one.drivers > 1 and math.isfinite(one.between.value)]
    if not known:
        return []
    gain = next((one for one in known if one.name == "range_rate.K"), known[0])
    unit = f" {gain.unit}" if gain.unit else ""
    said = (
        f"{label(gain.name)} of {of.kind.output} is {interval(gain.mean)}{unit} on average; {_between(gain)}, "
        f"and drives of one driver by {spread(gain, gain.within)}"
    )
    return [said, gain.says] if gain.says else [said]


def _between(of: Parameter) -> str:
    if of.between.low > 0.0:
        return f"drivers differ by a standard deviation of {spread(of, of.between)}"
    return f"between drivers no spread is shown (standard deviation {spread(of, of.between)})"


def _plural(n: int, what: str) -> str:
    return f"{n:,} {what}{'' if n == 1 else 's'}"


def _names(names: list[str]) -> str:
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more:,} more" if more > 0 else "")
