"""Dot plot of the evidence on a logarithmic axis: one row per candidate, with the threshold; rivals in brackets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from canid.ui.views.drawing.figure import (
    MARGIN_PX,
    NARROW_MARGIN_PX,
    Figure,
    Spec,
    annotation,
    axis,
    layout,
)
from canid.values.findings import Report, Tried
from canid.values.text.names import readable
from canid.values.text.numbers import number

# px: a row with its name at 11 px, and on a phone; legend and label of the threshold, a line of it; names of candidates
ROW_HEIGHT_PX, NARROW_ROW_HEIGHT_PX = 18, 15
TOP_PX, LEGEND_LINE_PX = 92, 19
LEFT_PX, NARROW_LEFT_PX = 190, 146
# left end of the axis: no improvement, or one by chance; a logarithm has no zero
LEAST_EVIDENCE = 1.0
# of the axis in decades, beyond both ends, for symbols
AXIS_MARGIN = 0.1
# in the order of the control loop
BLOCKS = ("sensing", "vehicle", "driver", "remnant")


class Symbol(NamedTuple):
    """How candidates of one outcome are drawn: by shape and size as well, not by color alone."""

    label: str  # legend, and the tables
    marker: str
    size: int
    color: str


NAMED, SURROGATE, ORDINARY, RIVAL = "named", "surrogate", "ordinary", "rival"
ABOVE, BELOW, NOT_FITTED, NOT_TESTABLE = "above", "below", "not_fitted", "not_testable"
SYMBOLS = {
    NAMED: Symbol("✓ named cause", "circle", 14, "after"),
    SURROGATE: Symbol("accepted, not the cause", "circle-x-open", 13, "after"),
    ORDINARY: Symbol("accepted, ordinary size", "square", 9, "muted"),
    RIVAL: Symbol("rival", "diamond", 11, "rival"),
    ABOVE: Symbol("above, not accepted", "diamond-open", 8, "ink"),
    BELOW: Symbol("below the threshold", "circle-open", 7, "muted"),
    NOT_FITTED: Symbol("screened out", "x-thin", 7, "muted"),
    NOT_TESTABLE: Symbol("not testable", "line-ew", 7, "muted"),
}


def evidence_plot(report: Report) -> Figure | None:
    """The dot plot; None where no cause was tried."""
    rows = decisive(report)
    if not rows:
        return None
    names = order(report, rows)
    place = {name: len(names) - 1 - k for k, name in enumerate(names)}
    top = max(_shown(x) for row in report.tried for x in (row.evidence, row.expected, row.needed))
    kinds = {row.effect: outcome(row, report) for row in report.tried}
    bold = {row.effect for row in rows.values() if outcome(row, report) in (NAMED, SURROGATE)}
    named = [f"<b>{readable(n)}</b>" if n in bold else readable(n) for n in names]
    shown = [f"✓ {text}" if kinds[n] == NAMED else text for text, n in zip(named, names, strict=True)]
    axes: Spec = {
        "xaxis": axis(
            "evidence, 2 Δ log likelihood (no unit)", type="log", fixedrange=True, tickangle=0, **_ticks(top, 3),
            range=[math.log10(LEAST_EVIDENCE) - AXIS_MARGIN, math.log10(top) + AXIS_MARGIN],
        ),
        "yaxis": axis(
            tickvals=list(range(len(names))), ticktext=shown[::-1], showgrid=False, range=[-0.7, len(names) - 0.3],
            tickfont={"size": 11}, fixedrange=True,
        ),
    }  # fmt: skip
    groups = [(finding.effect, *finding.rivals) for finding in report.findings]
    lines = _block_lines(names, rows, place)
    shapes = [*lines, *(shape for group in groups for shape in _bracket(group, place, LEFT_PX))]
    narrow_shapes = [*lines, *(shape for group in groups for shape in _bracket(group, place, NARROW_LEFT_PX))]
    labels = [_threshold_label([rows[name] for name in names])]
    blocks = [
        annotation(rows[name].where, 1.0, place[name], xanchor="right", yref="y", font={"size": 10, "color": "@muted"})
        for name in _first_of_blocks(names, rows)
    ]  # fmt: skip
    data = [*_lines([rows[name] for name in names], place), *_symbols(report, rows, place)]
    narrow_top = LEGEND_LINE_PX * (1 + sum(spec["showlegend"] for spec in data))
    return Figure(
        "evidence-plot",
        "Evidence for each cause",
        _caption(report, rows),
        "One row per candidate cause: its evidence on a logarithmic axis, and the threshold that it had to exceed",
        TOP_PX + MARGIN_PX["b"] + ROW_HEIGHT_PX * len(names),
        data,
        layout(
            axes, annotations=[*labels, *blocks], shapes=shapes,
            margin=MARGIN_PX | {"l": LEFT_PX, "t": TOP_PX},
        ),
        (
            narrow_top + NARROW_MARGIN_PX["b"] + NARROW_ROW_HEIGHT_PX * len(names),
            {
                "xaxis": axes["xaxis"] | _ticks(top, 1),
                "yaxis": axes["yaxis"] | {"tickfont": {"size": 10}},
                "annotations": labels,
                "shapes": narrow_shapes,
                "margin": NARROW_MARGIN_PX | {"l": NARROW_LEFT_PX, "t": narrow_top},
            },
        ),
    )  # fmt: skip


def decisive(report: Report) -> dict[str, Tried]:
    """Of each candidate the step that decided on it: the one that accepted it, or the last at which it was tried."""
    rows: dict[str, Tried] = {}
    for row in sorted(report.tried, key=lambda row: row.step):
        if rows.get(row.effect) is None or rows[row.effect].outcome not in ("accepted", "rival"):
            rows[row.effect] = row
    return rows


def outcome(row: Tried, report: Report) -> str:
    """Key of `SYMBOLS`: what became of a candidate at a step.

    Example:
        >>> from types import SimpleNamespace
        >>> nothing = SimpleNamespace(findings=())
        >>> outcome(Tried("one", "vehicle", 1, 90.0, 11.5, 1.0, "accepted", ""), nothing)
        'ordinary'
        >>> outcome(Tried("another", "driver", 1, 20.0, 13.3, 1.0, "rejected", ""), nothing)
        'above'
    """
    if row.outcome == "accepted":
        surrogate_of = {finding.effect: finding.surrogate for finding in report.findings}
        if row.effect not in surrogate_of:
            return ORDINARY
        return SURROGATE if surrogate_of[row.effect] else NAMED
    if row.outcome in (RIVAL, NOT_TESTABLE):
        return row.outcome
    if not math.isfinite(row.evidence):
        return NOT_FITTED
    return ABOVE if row.evidence > row.needed else BELOW


def order(report: Report, rows: Mapping[str, Tried]) -> list[str]:
    """Candidates from top to bottom: findings with their rivals, then block by block by evidence."""
    first = [name for f in report.findings for name in (f.effect, *f.rivals) if name in rows]
    blocks = [*BLOCKS, *{row.where for row in rows.values()}]

    def key(name: str) -> tuple[int, float]:
        evidence = rows[name].evidence
        return blocks.index(rows[name].where), -evidence if math.isfinite(evidence) else math.inf

    return list(dict.fromkeys([*first, *sorted(rows, key=key)]))


def _shown(x: float) -> float:
    """Where evidence is on the axis: of none, at its left end."""
    return max(x, LEAST_EVIDENCE) if math.isfinite(x) else LEAST_EVIDENCE


def _points(values: Sequence[tuple[float | None, float | None]], **more: object) -> Spec:
    return {
        "type": "scatter", "x": [x for x, _ in values], "y": [y for _, y in values], "xaxis": "x", "yaxis": "y",
        "hoverinfo": "skip", "showlegend": False, **more,
    }  # fmt: skip


def _lines(rows: Sequence[Tried], place: Mapping[str, int]) -> list[Spec]:
    """From the axis to each symbol a line; the threshold through all rows; what a typical strength would have."""
    stems: list[tuple[float | None, float | None]] = []
    for row in rows:
        y = place[row.effect]
        stems += [(LEAST_EVIDENCE, y), (_shown(row.evidence), y), (None, None)]
    needed = [
        (row.needed, place[row.effect] + side) for row in rows if row.needed > 0 for side in (0.5, -0.5)
    ]
    expected = [row for row in rows if math.isfinite(row.expected)]
    return [
        _points(stems, mode="lines", line={"color": "@rule", "width": 1}),
        _points(
            needed, mode="lines", name="threshold", showlegend=True, line={"color": "@before", "width": 1.5},
        ),
        _points(
            [(_shown(row.expected), place[row.effect]) for row in expected], mode="markers", showlegend=bool(expected),
            name="expected if typical", hoverinfo="text",
            hovertext=[f"expected at a typical strength: {number(row.expected)}" for row in expected],
            marker={"symbol": "triangle-up-open", "size": 7, "color": "@high"},
        ),
    ]  # fmt: skip


def _symbols(report: Report, rows: Mapping[str, Tried], place: Mapping[str, int]) -> list[Spec]:
    data = []
    rivals = {rival for finding in report.findings for rival in finding.rivals}
    kinds = {name: RIVAL if name in rivals else outcome(row, report) for name, row in rows.items()}
    for key, (label, marker, size, color) in SYMBOLS.items():
        alike = [row for name, row in rows.items() if kinds[name] == key]
        line = {"width": 1.5, "color": f"@{color}"}
        if alike:
            data.append(
                _points(
                    [(_shown(row.evidence), place[row.effect]) for row in alike], mode="markers", name=label,
                    marker={"symbol": marker, "size": size, "color": f"@{color}", "line": line},
                    hoverinfo="text", hovertext=[_hover(row, label) for row in alike], cliponaxis=False, showlegend=True,
                )
            )  # fmt: skip
    return data


def _hover(row: Tried, label: str) -> str:
    why = f"<br>{row.why}" if row.why else ""
    return (
        f"<b>{readable(row.effect)}</b> ({row.where}, step {row.step}): {label}<br>evidence {number(row.evidence)}, "
        f"threshold {number(row.needed)}, expected at a typical strength {number(row.expected)}{why}"
    )


def _ticks(top: float, most: int) -> Spec:
    """Decades, and where there is room their threefold; the left end stands for all below."""
    between = (1, 3) if most > 1 and top < 1e5 else (1,)
    values = [
        f * 10**k for k in range(math.ceil(math.log10(top)) + 1) for f in between if f * 10**k <= 1.2 * top
    ]
    return {
        "tickvals": values,
        "ticktext": [f"≤ {x}" if x == LEAST_EVIDENCE else f"{x:,}" for x in values],
    }


def _threshold_label(rows: Sequence[Tried]) -> Spec:
    needed = [row.needed for row in rows if row.needed > 0]
    low, high = (min(needed), max(needed)) if needed else (math.nan, math.nan)
    span = number(low) + (f" to {number(high)}" if high - low > 0.05 else "")
    return annotation(
        f"threshold {span}", math.log10(needed[0]) if needed else 0.0, 1.0, xref="x", yanchor="bottom",
        font={"size": 11, "color": "@before"},
    )  # fmt: skip


def _first_of_blocks(names: Sequence[str], rows: Mapping[str, Tried]) -> list[str]:
    """The first row of each run of rows of one block."""
    return [b for a, b in pairwise(["", *names]) if not a or rows[a].where != rows[b].where]


def _block_lines(names: Sequence[str], rows: Mapping[str, Tried], place: Mapping[str, int]) -> list[Spec]:
    return [
        {"type": "line", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": place[name] + 0.5, "y1": place[name] + 0.5,
         "layer": "below", "line": {"color": "@grid", "width": 1}}
        for name in _first_of_blocks(names, rows)[1:]
    ]  # fmt: skip


def _bracket(names: tuple[str, ...], place: Mapping[str, int], left_px: int) -> list[Spec]:
    """A square bracket left of the names that have a row."""
    rows = [place[name] for name in names if name in place]
    if len(rows) < 2:
        return []
    low, high = min(rows) - 0.35, max(rows) + 0.35
    path = [(10, high), (4, high), (4, low), (10, low)]
    return [
        {"type": "line", "xref": "paper", "yref": "y", "xsizemode": "pixel", "xanchor": 0, "x0": x0 - left_px,
         "x1": x1 - left_px, "y0": y0, "y1": y1, "line": {"color": "@rival", "width": 2}}
        for (x0, y0), (x1, y1) in pairwise(path)
    ]  # fmt: skip


def _caption(report: Report, rows: Mapping[str, Tried]) -> str:
    kinds = {outcome(row, report) for row in rows.values()}
    rest = "; those without a row were screened, but not fitted in full" * (
        len(rows) < report.candidates_tried
    )
    caption = (
        "Evidence is 2 Δ log likelihood: twice the gain in log likelihood by the cause, at the step of the search that "
        f"decided on it. {report.candidates_tried} candidates were tried; the threshold takes all of them into "
        f"account{rest}. In each block the candidate that explains most is accepted, and the others are tried again in "
        "addition to it."
    )
    if ORDINARY in kinds:
        caption += (
            " Squares: accepted into the model, but of an ordinary size or withdrawn afterwards: no cause."
        )
    caption += (
        " A triangle left of the threshold: this drive could hardly show the cause at a typical strength, and little "
        "evidence is then no evidence against it."
    )
    groups = [(f.effect, *f.rivals) for f in report.findings if f.rivals]
    if groups:
        caption += " In brackets: causes that explain the data equally well: " + "; ".join(
            ", ".join(map(readable, group)) for group in groups
        )
        caption += "."
    return caption
