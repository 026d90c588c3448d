"""A comparison of two drivers as text of 80 columns, page and notebook fragment."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from markupsafe import Markup

from canid.analysis.comparison.comparison import DIFFERENT, NOT_COMPARABLE, Comparison, Row
from canid.analysis.comparison.drive import DriveEstimates
from canid.analysis.comparison.result_estimates import NOT_IDENTIFIABLE
from canid.analysis.drive.response_sentence import FOR_EACH
from canid.ui.views.comparison_report.forest import forest
from canid.ui.views.comparison_report.levels import levels
from canid.ui.views.comparison_report.responses import responses
from canid.ui.views.document import document as doc
from canid.ui.views.document.document_page import page as html
from canid.ui.views.document.document_text import WIDTH, block_lines, lines
from canid.ui.views.notebook.fragment import bar, fragment, scale
from canid.values.findings import Provenance
from canid.values.terminal_text import terminal_text
from canid.values.text.names import SYMBOLS, label, readable
from canid.values.text.numbers import chance, interval, number
from canid.values.types import Interval

# columns that a name of a drive may take in a sentence
NAME_WIDTH = 44
TITLES = {
    DIFFERENT: "different",
    "no_difference_found": "no difference found",
    NOT_COMPARABLE: "not comparable",
}
VALUES = ("parameter", ">A", ">B", "unit")
DIFFERENCES = ("  parameter", ">B less A", ">B / A", ">p-value", ">detectable")
PAGE = (*VALUES, "verdict", *DIFFERENCES[1:])
SEVERAL = (">spread", ">drives")
CONDITIONS = ("conditions", ">A", ">B", "unit")


def text(comparison: Comparison) -> list[str]:
    """What `canid compare` prints."""
    heads = [
        f"{f'{name}:' if k == 0 else '  '} {_drive(drive)}"
        for name, side in (("A", comparison.a), ("B", comparison.b))
        for k, drive in enumerate(side.drives)
    ]
    rows = list(_rows(comparison))
    blocks: list[doc.Block] = [
        f"{TITLES[comparison.verdict].upper()}: {sentence(comparison)}",
        doc.Listing(heads, hang="   "),
        doc.chosen(VALUES, rows),
        *_differences(rows),
        _explained(comparison) if rows else "",
        _not_compared(comparison),
        _named(comparison),
        doc.chosen(CONDITIONS, _conditions(comparison)),
        doc.Listing(comparison.remarks, bullet="- "),
    ]
    return lines(blocks, WIDTH)


def page(comparison: Comparison, provenance: Provenance) -> str:
    """The page, to be stored as UTF-8.

    Example:
        >>> from canid.analysis.comparison.drive import Side
        >>> nothing = Comparison(Side("A", ()), Side("B", ()), "not_comparable", (), (), (), (), 0.0, None)
        >>> "no parameter of the response is known on both sides" in page(nothing, Provenance())
        True
    """
    compared = [row for row in comparison.rows if row.compared]
    drawn, answers = levels(comparison), responses(comparison)
    several = any(math.isfinite(row.spread) for row in compared)
    parameters: list[doc.Block] = [
        doc.Drawing(forest(compared), caption=_FOREST) if compared else None,
        doc.chosen(
            (*PAGE, *SEVERAL * several),
            _rows(comparison),
            caption=_explained(comparison),
            kind="cards compared",
        ),
        _not_compared(comparison),
    ]
    conditions: list[doc.Block] = [
        doc.chosen((*CONDITIONS, ">overlap"), _conditions(comparison), caption=_CONDITIONS, kind="cards"),
        doc.Listing(comparison.remarks),
    ]  # fmt: skip
    sections = [
        doc.Section("parameters", "Which parameters differ, and by how much", parameters, "Parameters"),
        doc.Section("responses", "How both respond", answers, "Responses"),
        doc.Section("causes", "Causes", [_named(comparison)._replace(title="")]),
        doc.Section("conditions", "Conditions, and how to read this", conditions, "Conditions"),
        doc.Section("over-time", "Over the drives", [*drawn, _LEVELS]),
    ]
    key = [
        (Markup('<b class="key-{}">{}</b>').format(color, side.label),
         tuple(f"{_drive(drive)} ({drive.method})" for drive in side.drives))
        for color, side in (("before", comparison.a), ("after", comparison.b))
    ]  # fmt: skip
    known = {"responses": answers, "causes": comparison.causes, "over-time": drawn}
    return html(
        doc.Document(
            "canid comparison",
            comparison.verdict,
            TITLES[comparison.verdict].capitalize(),
            [f"{sentence(comparison)}."],
            [section for section in sections if known.get(section.name, True)],
            doc.Source(provenance),
            "Comparison",
            key=key,
        )
    )


def notebook(comparison: Comparison) -> str:
    """Every compared parameter of both sides, with drawings of its intervals on one scale."""
    rows = []
    for row, shown in zip((row for row in comparison.rows if row.compared), _rows(comparison), strict=True):
        low, high = scale([row.a, row.b])
        rows.append(
            shown
            | {f">{x}": (str(shown[f">{x}"]), bar(iv, low, high)) for x, iv in (("A", row.a), ("B", row.b))}
        )
    table = doc.chosen((*VALUES, "verdict"), rows)
    return fragment(
        f"Comparison: {TITLES[comparison.verdict]}",
        sentence(comparison),
        table,
        doc.Listing(comparison.remarks),
    )


_FOREST = Markup(
    'First: A (<span class="key-before">upper</span>) and B (<span class="key-after">lower</span>) with 95 % intervals. '
    "Second: the difference; thick: 95 % interval of this parameter, thin: intervals that hold for all parameters "
    "together with 95 %. A parameter in bold differs: its p is step-down adjusted, which is a little sharper than the "
    "thin intervals."
)
_CONDITIONS = "Of the usable driving: median, 5 and 95 % points; of inputs the standard deviation. Overlap: of the ranges."
_LEVELS = doc.Sentence(
    'Smoothed level of windows of 40 s with its 95 % band, on one scale; "varies": a constant level is rejected '
    "(p < 0.05).",
    "hint",
)


def sentence(comparison: Comparison) -> str:
    """The verdict in words.

    Example:
        >>> from canid.analysis.comparison.drive import Side
        >>> nothing = Comparison(Side("A", ()), Side("B", ()), NOT_COMPARABLE, (), (), (), (), 2.0, None)
        >>> sentence(nothing)
        'no parameter of the response is known on both sides; longer drives with more movement of the inputs are needed'
    """
    if comparison.verdict == NOT_COMPARABLE:
        if any("units differ" in row.why for row in comparison.rows):
            return "no parameter of the response is known on both sides in one unit; compare drives with the same output"
        if comparison.rows and not any(NOT_IDENTIFIABLE in row.why for row in comparison.rows):
            return (
                "no parameter may be quoted on both sides; why, and what to do, stands under 'not compared'"
            )
        return (
            "no parameter of the response is known on both sides; longer drives with more movement of the inputs are "
            "needed"
        )
    compared = [row for row in comparison.rows if row.compared]
    if comparison.verdict == DIFFERENT:
        said = [difference(row) for row in comparison.different]
        said += [
            f"{readable(cause.effect)} in {cause.found} only" for cause in comparison.causes if cause.differs
        ]
        return f"{said[0]}{''.join(f'; {further}' for further in said[1:])}"
    sizes = [
        f"{label(row.name)} by {_size(row)}" for row in compared if row.name.endswith((" K", "_dead_time"))
    ]
    seen = f"; it would have been found (8 of 10) in {', '.join(sizes)}" if sizes else ""
    open_causes = [
        f"{readable(c.effect)} in {c.found}"
        for c in comparison.causes
        if c.differs is None and c.found != "both"
    ]
    undecided = (
        f"; named on one side and not testable on the other: {', '.join(open_causes)}" if open_causes else ""
    )
    none = f"none of {len(compared)} parameters differs"
    if len(compared) == 1:
        none = f"{label(compared[0].name)} alone could be compared, and does not differ"
    return f"{none} beyond chance{seen}{undecided}"


def difference(row: Row) -> str:
    """How a parameter differs; of the driver's response in plain words.

    Example:
        >>> one = Row("range_rate K", "% per m/s", Interval(4, 3.8, 4.2), Interval(6, 5.8, 6.2))
        >>> difference(one._replace(ratio=Interval(1.5, 1.4, 1.6), p_adjusted=1e-6))
        'B responds 1.50 [1.40, 1.60] times as strongly as A to each m/s by which the lead is faster'
        >>> late = Row("range_rate tau_plus_dead_time", "s", Interval(1, 0.9, 1.1), Interval(1.5, 1.4, 1.6))
        >>> difference(late._replace(difference=Interval(0.5, 0.4, 0.6), p_adjusted=1e-6))
        'B responds 0.50 [0.40, 0.60] s later than A'
    """
    channel, _, what = row.name.rpartition(" ")
    more = row.difference.value > 0.0
    size = row.difference if more else _negative(row.difference)
    if channel in FOR_EACH and what == "K" and by_ratio(row):
        return f"B responds {interval(row.ratio)} times as strongly as A to each {FOR_EACH[channel]}"
    if channel in FOR_EACH and what == "tau_plus_dead_time":
        to = "" if channel == "range_rate" else f" to the {readable(channel)}"
        return f"B responds {interval(size, row.unit)} {'later' if more else 'earlier'} than A{to}"
    if by_ratio(row):
        return f"{label(row.name)} is {interval(row.ratio)} times as large in B"
    return f"{label(row.name)} is {interval(size, row.unit)} {'larger' if more else 'smaller'} in B"


def _drive(drive: DriveEstimates) -> str:
    return f"{shortened(drive.name)}, {terminal_text(drive.vehicle)}, {number(drive.used, 's')} used"


def shortened(name: str, width: int = NAME_WIDTH) -> str:
    """A name of a drive, its end where it is long.

    Example:
        >>> shortened("a.blf"), shortened("x" * 50 + "/drive.blf@0:60", 20)
        ('a.blf', '…/drive.blf@0:60')
    """
    shown = terminal_text(name)
    if len(shown) <= width:
        return shown
    end = shown[1 - width :]
    folder = end.find("/")
    return f"…{end[folder:] if 0 <= folder < width // 2 else end}"


def _rows(comparison: Comparison) -> Iterator[dict[str, doc.Cell]]:
    """Each compared parameter, by the heads of the columns."""
    for row in comparison.rows:
        if row.compared:
            yield {
                "parameter": label(row.name),
                "  parameter": f"{'* ' if row.differs else '  '}{label(row.name)}",
                ">A": interval(row.a),
                ">B": interval(row.b),
                "unit": row.unit,
                ">B less A": interval(row.difference),
                ">B / A": interval(row.ratio) if by_ratio(row) else "",
                ">p-value": chance(row.p_adjusted, 2).replace(" ", ""),
                ">detectable": number(row.detectable, digits=2),
                # between drives of one driver, one for both sides; how many drives of A and B know the parameter
                ">spread": number(row.spread),
                ">drives": " and ".join(map(str, row.drives)),
                "verdict": "* differs" if row.differs else "not shown",
            }


def _differences(rows: list[dict[str, doc.Cell]]) -> list[doc.Table]:
    """Differences and ratios side by side where they fit, else one below the other."""
    whole = doc.chosen(DIFFERENCES, rows)
    if max(map(len, block_lines(whole)), default=0) <= WIDTH:
        return [whole]
    head, less, ratio, *more = DIFFERENCES
    return [doc.chosen((head, less, *more), rows), doc.chosen((head, ratio), rows)]


def _explained(comparison: Comparison) -> str:
    """How to read the tables."""
    at = comparison.point
    margins = (
        f"; margins of both at {number(at.speed, 'm/s')} and {number(at.headway, 's')} of headway"
        if at
        else ""
    )
    return (
        "intervals are 95 % each; the p-value is for all of them together, * differs (below 0.05); detectable: a "
        f"difference of that size would be found in 8 of 10 such pairs{margins}"
    )


def _not_compared(comparison: Comparison) -> doc.Listing:
    """Parameters without a verdict, and why."""
    why: dict[str, list[str]] = {}
    for row in comparison.rows:
        if not row.compared:
            why.setdefault(row.why, []).append(label(row.name))
    return doc.Listing(
        [f"{', '.join(_together(names))}: {terminal_text(reason)}" for reason, names in why.items()],
        "not compared",
    )


def _together(names: Sequence[str]) -> list[str]:
    """Parameters of one input after its name, which is written once.

    Example:
        >>> _together(["range rate K", "range rate τ", "noise sd"])
        ['range rate K', 'τ', 'noise sd']
    """
    out, last = [], ""
    for name in names:
        channel, _, what = name.rpartition(" ")
        channel *= what in SYMBOLS.values()
        out.append(what if channel and channel == last else name)
        last = channel
    return out


def _named(comparison: Comparison) -> doc.Listing:
    """Causes that the diagnoses name; one of one side differs only if the data of the other exclude it."""
    return doc.Listing(
        [
            f"{readable(cause.effect)} ({cause.where}), {cause.found}{' only' * (cause.found != 'both')}"
            f"{', differs' * bool(cause.differs)}: {cause.says}"
            for cause in comparison.causes
        ],
        "causes",
    )


def _conditions(comparison: Comparison) -> list[dict[str, doc.Cell]]:
    return [
        {
            "conditions": condition_name(row.name),
            ">A": range_text(row.a),
            ">B": range_text(row.b),
            "unit": row.unit,
            ">overlap": number(100 * row.overlap, "%") if row.overlap == row.overlap else "",
        }
        for row in comparison.conditions
    ]


def condition_name(name: str) -> str:
    """A condition as people read it.

    Example:
        >>> condition_name("used"), condition_name("excitation range_rate"), condition_name("speed")
        ('usable driving', 'range rate, sd', 'speed, 5 to 95 %')
    """
    if name == "used":
        return "usable driving"
    kind, _, role = name.partition(" ")
    return f"{readable(role)}, sd" if kind == "excitation" else f"{readable(name)}, 5 to 95 %"


def range_text(range_: Interval) -> str:
    """A median with its range, or a number."""
    if not math.isfinite(range_.low):
        return number(range_.value)
    return f"{number(range_.value)} ({number(range_.low)} to {number(range_.high)})"


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


def _negative(interval_: Interval) -> Interval:
    return Interval(-interval_.value, -interval_.high, -interval_.low)
