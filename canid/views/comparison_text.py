"""A comparison of two drivers as text of 80 columns."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence

from canid.comparison.comparison import DIFFERENT, NOT_COMPARABLE, Comparison, Row
from canid.comparison.drive import Side
from canid.types import Interval
from canid.views.names import SYMBOLS, readable
from canid.views.numbers import interval, number
from canid.views.table import columns
from canid.views.terminal_text import terminal_text

WIDTH = 80
# names of quantities that are no parameter of a channel
NAMES = {"noise_sd": "noise sd", "string_peak": "string peak"}
# a p-value below it is not given with more digits than the simulation has
LEAST_P = 0.0005
# columns that a name of a drive may take in a sentence
NAME_WIDTH = 44
TITLES = {
    DIFFERENT: "different",
    "no_difference_found": "no difference found",
    NOT_COMPARABLE: "not comparable",
}


def text(of: Comparison) -> list[str]:
    """What `canid compare` prints."""
    lines = [
        *_head("A", of.a),
        *_head("B", of.b),
        "",
        *_wrapped(f"{TITLES[of.verdict].upper()}: {sentence(of)}"),
        "",
    ]
    compared = [row for row in of.rows if row.compared]
    if compared:
        lines += [*_values(compared), "", *_differences(compared), ""]
        lines += _wrapped(
            "intervals are 95 % each; p is for all of them together, * differs (p below 0.05); detect.: detectable, a "
            f"difference of that size would be found in 8 of 10 such pairs{_operating_point(of)}",
        )
        lines.append("")
    lines += _not_compared(of)
    if of.causes:
        lines.append("causes")
        for cause in of.causes:
            where = "both" if cause.found == "both" else f"{cause.found} only"
            verdict = ", differs" if cause.differs else ""
            lines += _wrapped(
                f"{readable(cause.effect)} ({cause.where}), {where}{verdict}: {cause.says}", "  "
            )
        lines.append("")
    lines += _conditions(of)
    for remark in of.remarks:
        lines += _wrapped(f"- {remark}", "", "  ")
    return lines


def sentence(of: Comparison) -> str:
    """The verdict in words.

    Example:
        >>> nothing = Comparison(Side("A", ()), Side("B", ()), NOT_COMPARABLE, (), (), (), (), 2.0, None)
        >>> sentence(nothing)
        'no parameter is known on both sides; longer drives with more movement of the inputs are needed'
    """
    if of.verdict == NOT_COMPARABLE:
        if any("units differ" in row.why for row in of.rows):
            return "no parameter is known on both sides in one unit; compare drives with the same output"
        return (
            "no parameter is known on both sides; longer drives with more movement of the inputs are needed"
        )
    compared = [row for row in of.rows if row.compared]
    if of.verdict == DIFFERENT:
        said = [difference(row) for row in of.different]
        said += [f"{readable(cause.effect)} in {cause.found} only" for cause in of.causes if cause.differs]
        return f"{said[0]}{''.join(f'; {one}' for one in said[1:])}"
    sizes = [
        f"{label(row.name)} by {_size(row)}" for row in compared if row.name.endswith((" K", "_dead_time"))
    ]
    seen = f"; it would have been found (8 of 10) in {', '.join(sizes)}" if sizes else ""
    open_causes = [
        f"{readable(c.effect)} in {c.found}" for c in of.causes if c.differs is None and c.found != "both"
    ]
    undecided = (
        f"; named on one side and not testable on the other: {', '.join(open_causes)}" if open_causes else ""
    )
    return f"none of {len(compared)} parameters differs beyond chance{seen}{undecided}"


def difference(row: Row) -> str:
    """How a parameter differs.

    Example:
        >>> one = Row("range_rate K", "% per m/s", Interval(4, 3.8, 4.2), Interval(6, 5.8, 6.2))
        >>> difference(one._replace(ratio=Interval(1.5, 1.4, 1.6), p_adjusted=1e-6))
        'range rate K is 1.50 [1.40, 1.60] times as large in B (p < 0.0005)'
    """
    if by_ratio(row):
        how = f"is {interval(row.ratio)} times as large in B"
    else:
        more = "larger" if row.difference.value > 0.0 else "smaller"
        size = row.difference if row.difference.value > 0.0 else _negative(row.difference)
        how = f"is {interval(size, row.unit)} {more} in B"
    return f"{label(row.name)} {how} (p {p_text(row.p_adjusted)})"


def label(name: str) -> str:
    """A parameter as people read it.

    Example:
        >>> label("range_rate tau_plus_dead_time"), label("noise_sd"), label("some_effect: ratio")
        ('range rate τ+θ', 'noise sd', 'some effect: ratio')
    """
    channel, _, field = name.rpartition(" ")
    if channel and field in SYMBOLS:
        return f"{readable(channel)} {SYMBOLS[field]}"
    return NAMES.get(name, readable(name))


def p_text(p: float) -> str:
    """A p-value after the letter p.

    Example:
        >>> p_text(0.0213), p_text(1e-7), p_text(0.74)
        ('= 0.021', '< 0.0005', '= 0.74')
    """
    return f"< {LEAST_P}" if p < LEAST_P else f"= {p:.2g}"


def _head(name: str, side: Side) -> list[str]:
    """A line for a side and one for each further drive."""
    lines = []
    for k, drive in enumerate(side.drives):
        mark = f"{name}:" if k == 0 else "  "
        of = f", {terminal_text(drive.vehicle)}, {number(drive.used, 's')} used"
        lines += _wrapped(f"{mark} {shortened(drive.name)}{of}", "", "   ")
    return lines


def shortened(name: str, width: int = NAME_WIDTH) -> str:
    """A name of a drive, its end where it is long.

    Example:
        >>> shortened("a.blf"), shortened("x" * 50 + "/drive.blf@0:60", 20)
        ('a.blf', '…xxxx/drive.blf@0:60')
    """
    shown = terminal_text(name)
    return shown if len(shown) <= width else f"…{shown[1 - width :]}"


def _values(rows: Iterable[Row]) -> list[str]:
    return columns(
        ("parameter", "A", "B", "unit"),
        ((label(row.name), interval(row.a), interval(row.b), row.unit) for row in rows),
    )


def _differences(rows: Sequence[Row]) -> list[str]:
    """Differences and ratios side by side where they fit, else one below the other."""
    name = [f"{'* ' if row.differs else '  '}{label(row.name)}" for row in rows]
    less = [interval(row.difference) for row in rows]
    ratio = [interval(row.ratio) if by_ratio(row) else "" for row in rows]
    p = [p_text(row.p_adjusted).removeprefix("= ").replace(" ", "") for row in rows]
    seen = [number(row.detectable, digits=2) for row in rows]
    head = ("  parameter", "B less A", "B / A", "p", "detect.")
    whole = columns(head, zip(name, less, ratio, p, seen, strict=True))
    if max(map(len, whole)) <= WIDTH:
        return whole
    first = columns((head[0], head[1], *head[3:]), zip(name, less, p, seen, strict=True))
    return [*first, "", *columns((head[0], head[2]), zip(name, ratio, strict=True))]


def refused(of: Comparison) -> list[tuple[str, str]]:
    """Why parameters are not compared, and which."""
    why: dict[str, list[str]] = {}
    for row in of.rows:
        if not row.compared:
            why.setdefault(row.why, []).append(label(row.name))
    return [(reason, ", ".join(names)) for reason, names in why.items()]


def _operating_point(of: Comparison) -> str:
    """Where the margins of both are compared."""
    if of.point is None:
        return ""
    return (
        f"; margins of both at {number(of.point.speed, 'm/s')} and {number(of.point.headway, 's')} of headway"
    )


def _not_compared(of: Comparison) -> list[str]:
    rows = refused(of)
    if not rows:
        return []
    lines = ["not compared"]
    for reason, names in rows:
        lines += _wrapped(f"{names}: {terminal_text(reason)}", "  ")
    return [*lines, ""]


def _conditions(of: Comparison) -> list[str]:
    rows = [
        (condition_name(row.name), range_text(row.a), range_text(row.b), row.unit) for row in of.conditions
    ]
    return [*columns(("conditions", "A", "B", "unit"), rows), ""] if rows else []


def condition_name(name: str) -> str:
    """A condition as people read it.

    Example:
        >>> condition_name("used"), condition_name("excitation range_rate"), condition_name("speed")
        ('usable driving', 'range rate, sd', 'speed, 5 to 95 %')
    """
    if name == "used":
        return "usable driving"
    kind, _, of = name.partition(" ")
    return f"{readable(of)}, sd" if kind == "excitation" else f"{readable(name)}, 5 to 95 %"


def range_text(of: Interval) -> str:
    """A median with its range, or a number."""
    if not math.isfinite(of.low):
        return number(of.value)
    return f"{number(of.value)} ({number(of.low)} to {number(of.high)})"


def by_ratio(row: Row) -> bool:
    """Ratios of a quantity with a bound or an angle say nothing."""
    return all(map(math.isfinite, row.ratio)) and row.name.partition(" ")[0] not in (
        "phase_margin",
        "string_peak",
        "wanted_headway",
    )


def _size(row: Row) -> str:
    """The detectable difference, of a gain in shares of its value."""
    if row.name.endswith(" K") and row.a.value:
        return f"{100.0 * row.detectable / abs(row.a.value):.0f} %"
    return number(row.detectable, row.unit, 2)


def _negative(of: Interval) -> Interval:
    return Interval(-of.value, -of.high, -of.low)


def _wrapped(line: str, indent: str = "", further: str | None = None) -> list[str]:
    after = f"{indent}  " if further is None else further
    return textwrap.wrap(
        line, WIDTH, initial_indent=indent, subsequent_indent=after, break_on_hyphens=False
    ) or [""]
