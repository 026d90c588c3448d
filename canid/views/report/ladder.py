"""The evidence ladder: one bar per candidate and step of the search, the threshold on each, rivals in a bracket."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from canid.findings import Report, Tried
from canid.views.measures import number, spoken
from canid.views.report.figure import MARGIN, Figure, Spec, axis, layout, note, spans, suffix

# px: a bar with its name at 11 px, and the legend with the panels' titles
ROW = 17
TOP = 58
LEFT = 170
# evidence at which the axis may have a tick; bars are as long as its square root
TICKS = (1, 4, 10, 25, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000, 50000, 100000)
# of them as many as fit on A4
MOST_TICKS = 7
# how an outcome is drawn: colour, and in words
OUTCOMES = {
    "accepted": ("after", "accepted"),
    "rival": ("rival", "rival"),
    "rejected": ("bar", "rejected"),
    "not_testable": ("bar", "not testable"),
}
# steps side by side: more than four causes in one drive have not been seen
MOST_STEPS = 4


def ladder(report: Report) -> Figure | None:
    """Draw it; None where no cause was tried."""
    if not report.tried:
        return None
    steps = sorted({row.step for row in report.tried})[:MOST_STEPS]
    names = order(report)
    place = {name: len(names) - 1 - k for k, name in enumerate(names)}
    columns = spans(len(steps), 0.03)
    top = max(
        (_root(x) for row in report.tried for x in (row.evidence, row.expected, row.needed)), default=1.0
    )
    data: list[Spec] = []
    axes: Spec = {
        "yaxis": axis(
            tickvals=list(range(len(names))), ticktext=[spoken(name) for name in names[::-1]], showgrid=False,
            range=[-0.7, len(names) - 0.3], tickfont={"size": 11}, fixedrange=True,
        )
    }  # fmt: skip
    titles = []
    for k, step in enumerate(steps):
        rows = [row for row in report.tried if row.step == step]
        data += _bars(rows, place, f"x{suffix(k)}", every=report.tried, first=k == 0)
        axes[f"xaxis{suffix(k)}"] = axis(
            "evidence, 2 Δ log likelihood",
            domain=columns[k],
            range=[0, 1.06 * top],
            fixedrange=True,
            **_ticks(top),
        )
        titles.append(
            note(_step_title(report, step), columns[k][0], 1.0, xanchor="left", yanchor="bottom", yshift=2)
        )
    brackets = [
        shape for finding in report.findings for shape in _bracket((finding.effect, *finding.rivals), place)
    ]
    return Figure(
        "ladder",
        "Evidence for each cause",
        _says(report),
        "Horizontal bars, one per candidate cause, with the threshold that its evidence had to exceed",
        TOP + MARGIN["b"] + ROW * len(names),
        data,
        layout(
            axes, annotations=titles, shapes=brackets, barmode="overlay", bargap=0.35,
            margin=MARGIN | {"l": LEFT, "t": TOP},
        ),
    )  # fmt: skip


def order(report: Report) -> list[str]:
    """List the candidates from top to bottom: what was found with its rivals, then by evidence.

    Whoever was never testable comes last.
    """
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
    for outcome, (colour, says) in OUTCOMES.items():
        of = [row for row in rows if row.outcome == outcome]
        if outcome == "not_testable":
            data.append(_written(of, place, xaxis))
            continue
        hover = [
            f"<b>{spoken(r.effect)}</b> ({r.where}): {says}<br>evidence {number(r.evidence)}, needed {number(r.needed)}, "
            f"a typical strength would give {number(r.expected)}"
            for r in of
        ]
        data.append({
            "type": "bar", "orientation": "h", "x": [_root(r.evidence) for r in of], "y": [place[r.effect] for r in of],
            "name": says, "legendgroup": says, "marker": {"color": f"@{colour}"}, "xaxis": xaxis, "yaxis": "y",
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


def _written(rows: Sequence[Tried], place: dict[str, int], xaxis: str) -> Spec:
    """Where no bar can be, the reason stands in words."""
    return {
        "type": "scatter", "mode": "text", "xaxis": xaxis, "yaxis": "y",
        "x": [max(_root(r.expected), _root(r.needed)) for r in rows], "y": [place[r.effect] for r in rows],
        "text": ["  not testable"] * len(rows), "textposition": "middle right",
        "textfont": {"size": 10, "color": "@muted"}, "hovertext": [r.why for r in rows], "hoverinfo": "text",
        "showlegend": False, "cliponaxis": False,
    }  # fmt: skip


def _ticks(top: float) -> Spec:
    """Ticks at round evidence, apart from each other on the square root's scale."""
    values, last = [0], 0.0
    for tick in TICKS:
        if math.sqrt(tick) > top:
            break
        if math.sqrt(tick) - last >= top / MOST_TICKS:
            values.append(tick)
            last = math.sqrt(tick)
    return {"tickvals": [math.sqrt(x) for x in values], "ticktext": [f"{x:,}" for x in values]}


def _step_title(report: Report, step: int) -> str:
    if step == 1:
        return "step 1: each cause alone"
    accepted = [row.effect for row in report.tried if row.outcome == "accepted" and row.step < step]
    return f"step {step}: beside {' + '.join(map(spoken, accepted))}" if accepted else f"step {step}"


def _bracket(names: tuple[str, ...], place: dict[str, int]) -> list[Spec]:
    """A square bracket left of the names, as far as the ladder has them."""
    rows = [place[name] for name in names if name in place]
    if len(rows) < 2:
        return []
    low, high = min(rows) - 0.35, max(rows) + 0.35
    path = [(10, high), (4, high), (4, low), (10, low)]
    return [
        {"type": "line", "xref": "paper", "yref": "y", "xsizemode": "pixel", "xanchor": 0, "x0": x0 - LEFT, "x1": x1 - LEFT,
         "y0": y0, "y1": y1, "line": {"color": "@rival", "width": 2}}
        for (x0, y0), (x1, y1) in pairwise(path)
    ]  # fmt: skip


def _says(report: Report) -> str:
    shown = len({row.effect for row in report.tried})
    rest = "; those without a bar were looked at, but not fitted in full" * (shown < report.candidates_tried)
    says = (
        f"{report.candidates_tried} candidates tried; the threshold counts all of them{rest}. Bars are as long as the "
        "square root of the evidence. Of those that pass the mark the one that explains most is taken, and the others are "
        "tried again beside it. A diamond left of the mark says that this drive could hardly have shown the cause at a "
        "typical strength, so that a short bar there means nothing."
    )
    groups = [(f.effect, *f.rivals) for f in report.findings if f.rivals]
    if groups:
        says += " In brackets: causes that explain the same data as well: " + "; ".join(
            ", ".join(map(spoken, group)) for group in groups
        )
        says += "."
    return says
