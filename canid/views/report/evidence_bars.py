"""Bar chart of the evidence: one bar per candidate and step of the search, with its threshold; rivals in brackets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from canid.findings import Report, Tried
from canid.views.names import readable
from canid.views.numbers import number
from canid.views.report.figure import (
    MARGIN_PX,
    Figure,
    Spec,
    annotation,
    axis,
    axis_suffix,
    equal_domains,
    layout,
)

# px: a bar with its name at 11 px; the legend with the panels' titles; the candidates' names
BAR_HEIGHT_PX = 17
TOP_PX = 58
LEFT_PX = 170
# evidence at which the axis may have a tick; the length of a bar is its square root
EVIDENCE_TICKS = (1, 4, 10, 25, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000, 100000)
# ticks that fit on A4
MAX_TICKS = 7
# outcome -> color, text
OUTCOMES = {
    "accepted": ("after", "accepted"),
    "rival": ("rival", "rival"),
    "rejected": ("bar", "rejected"),
    "not_testable": ("bar", "not testable"),
}
# steps next to each other: more than four causes in one drive have not occurred
MAX_STEPS = 4


def evidence_bars(report: Report) -> Figure | None:
    """The bar chart; None where no cause was tried."""
    if not report.tried:
        return None
    steps = sorted({row.step for row in report.tried})[:MAX_STEPS]
    names = order(report)
    place = {name: len(names) - 1 - k for k, name in enumerate(names)}
    columns = equal_domains(len(steps), 0.03)
    top = max(
        (_root(x) for row in report.tried for x in (row.evidence, row.expected, row.needed)), default=1.0
    )
    data: list[Spec] = []
    axes: Spec = {
        "yaxis": axis(
            tickvals=list(range(len(names))), ticktext=[readable(name) for name in names[::-1]], showgrid=False,
            range=[-0.7, len(names) - 0.3], tickfont={"size": 11}, fixedrange=True,
        )
    }  # fmt: skip
    titles = []
    for k, step in enumerate(steps):
        rows = [row for row in report.tried if row.step == step]
        data += _bars(rows, place, f"x{axis_suffix(k)}", every=report.tried, first=k == 0)
        axes[f"xaxis{axis_suffix(k)}"] = axis(
            "evidence, 2 Δ log likelihood",
            domain=columns[k],
            range=[0, 1.06 * top],
            fixedrange=True,
            **_ticks(top),
        )
        titles.append(
            annotation(
                _step_title(report, step), columns[k][0], 1.0, xanchor="left", yanchor="bottom", yshift=2
            )
        )
    brackets = [
        shape for finding in report.findings for shape in _bracket((finding.effect, *finding.rivals), place)
    ]
    return Figure(
        "evidence-bars",
        "Evidence for each cause",
        _caption(report),
        "Horizontal bars, one per candidate cause, with the threshold that its evidence had to exceed",
        TOP_PX + MARGIN_PX["b"] + BAR_HEIGHT_PX * len(names),
        data,
        layout(
            axes, annotations=titles, shapes=brackets, barmode="overlay", bargap=0.35,
            margin=MARGIN_PX | {"l": LEFT_PX, "t": TOP_PX},
        ),
    )  # fmt: skip


def order(report: Report) -> list[str]:
    """Candidates from top to bottom: findings with their rivals, then the others by evidence, not testable ones last."""
    best: dict[str, float] = {}
    for row in report.tried:
        known = row.evidence if math.isfinite(row.evidence) else -math.inf
        best[row.effect] = max(best.get(row.effect, -math.inf), known)
    first = [
        name for finding in report.findings for name in (finding.effect, *finding.rivals) if name in best
    ]
    return list(dict.fromkeys([*first, *sorted(best, key=lambda name: -best[name])]))


def _root(x: float) -> float:
    return math.sqrt(max(x, 0.0)) if math.isfinite(x) else 0.0


def _bars(
    rows: Sequence[Tried], place: dict[str, int], xaxis: str, *, every: Sequence[Tried], first: bool
) -> list[Spec]:
    data: list[Spec] = []
    for outcome, (color, label) in OUTCOMES.items():
        of = [row for row in rows if row.outcome == outcome]
        if outcome == "not_testable":
            data.append(_not_testable(of, place, xaxis))
            continue
        hover = [
            f"<b>{readable(r.effect)}</b> ({r.where}): {label}<br>evidence {number(r.evidence)}, needed {number(r.needed)}, "
            f"expected at a typical strength {number(r.expected)}"
            for r in of
        ]
        data.append({
            "type": "bar", "orientation": "h", "x": [_root(r.evidence) for r in of], "y": [place[r.effect] for r in of],
            "name": label, "legendgroup": label, "marker": {"color": f"@{color}"}, "xaxis": xaxis, "yaxis": "y",
            "hovertext": hover, "hoverinfo": "text", "showlegend": first and any(r.outcome == outcome for r in every),
        })  # fmt: skip
    needed = {"symbol": "line-ns", "size": 11, "line": {"width": 2, "color": "@before"}}
    expected = {"symbol": "diamond-open", "size": 7, "color": "@ink"}
    for name, values, marker in (
        ("needed", [r.needed for r in rows], needed),
        ("expected at a typical strength", [r.expected for r in rows], expected),
    ):
        known = [
            (_root(x), place[r.effect], number(x))
            for x, r in zip(values, rows, strict=True)
            if math.isfinite(x)
        ]
        data.append({
            "type": "scatter", "mode": "markers", "x": [x for x, _, _ in known], "y": [y for _, y, _ in known],
            "name": name, "legendgroup": name, "marker": marker, "xaxis": xaxis, "yaxis": "y", "showlegend": first,
            "hovertext": [f"{name}: {text}" for *_, text in known], "hoverinfo": "text",
        })  # fmt: skip
    return data


def _not_testable(rows: Sequence[Tried], place: dict[str, int], xaxis: str) -> Spec:
    """A label in the place of the bar, with the reason as its hover text."""
    return {
        "type": "scatter", "mode": "text", "xaxis": xaxis, "yaxis": "y",
        "x": [max(_root(r.expected), _root(r.needed)) for r in rows], "y": [place[r.effect] for r in rows],
        "text": ["  not testable"] * len(rows), "textposition": "middle right",
        "textfont": {"size": 10, "color": "@muted"}, "hovertext": [r.why for r in rows], "hoverinfo": "text",
        "showlegend": False, "cliponaxis": False,
    }  # fmt: skip


def _ticks(top: float) -> Spec:
    """Ticks at round values, evenly apart on the square-root scale."""
    values, last = [0], 0.0
    for tick in EVIDENCE_TICKS:
        if math.sqrt(tick) > top:
            break
        if math.sqrt(tick) - last >= top / MAX_TICKS:
            values.append(tick)
            last = math.sqrt(tick)
    return {"tickvals": [math.sqrt(x) for x in values], "ticktext": [f"{x:,}" for x in values]}


def _step_title(report: Report, step: int) -> str:
    if step == 1:
        return "step 1: each cause alone"
    accepted = [row.effect for row in report.tried if row.outcome == "accepted" and row.step < step]
    return (
        f"step {step}: in addition to {' + '.join(map(readable, accepted))}" if accepted else f"step {step}"
    )


def _bracket(names: tuple[str, ...], place: dict[str, int]) -> list[Spec]:
    """A square bracket left of the names that have a row."""
    rows = [place[name] for name in names if name in place]
    if len(rows) < 2:
        return []
    low, high = min(rows) - 0.35, max(rows) + 0.35
    path = [(10, high), (4, high), (4, low), (10, low)]
    return [
        {"type": "line", "xref": "paper", "yref": "y", "xsizemode": "pixel", "xanchor": 0, "x0": x0 - LEFT_PX,
         "x1": x1 - LEFT_PX, "y0": y0, "y1": y1, "line": {"color": "@rival", "width": 2}}
        for (x0, y0), (x1, y1) in pairwise(path)
    ]  # fmt: skip


def _caption(report: Report) -> str:
    shown = len({row.effect for row in report.tried})
    rest = "; those without a bar were screened, but not fitted in full" * (shown < report.candidates_tried)
    caption = (
        f"{report.candidates_tried} candidates tried; the threshold takes all of them into account{rest}. The length of a "
        "bar is the square root of the evidence. Of the candidates above their threshold, the one that explains most is "
        "accepted, and the others are tried again in addition to it. A diamond to the left of the threshold means that "
        "this drive could hardly show the cause at a typical strength: a short bar is then no evidence against it."
    )
    groups = [(f.effect, *f.rivals) for f in report.findings if f.rivals]
    if groups:
        caption += " In brackets: causes that explain the data equally well: " + "; ".join(
            ", ".join(map(readable, group)) for group in groups
        )
        caption += "."
    return caption
