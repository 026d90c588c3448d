"""At which frequencies the simulation is wrong: the residual's spectrum, and its coherence with each input."""

from __future__ import annotations

import math

import numpy as np

from canid.findings import Flags, Report, Spectra
from canid.types import Array
from canid.views.measures import number, role_unit, spoken
from canid.views.report.figure import (
    MARGIN,
    Figure,
    Spec,
    axis,
    dashed,
    layout,
    line,
    listed,
    note,
    spans,
    suffix,
)
from canid.views.report.strip import runs

PANEL_HEIGHT = 220  # px
ACROSS = 3
TICKS = (0.01, 0.03, 0.1, 0.3, 1, 3)  # Hz
# a coherence axis shows at least this much, so that noise does not look large
LEAST_COHERENCE = 0.4
# bands that the sentence names, the widest
MOST_BANDS = 3


def frequency(report: Report) -> Figure | None:
    """Draw one panel for the spectrum and one per input; None where nothing was computed."""
    of = report.spectra
    if of is None or not (of.frequency > 0).any():
        return None
    unit = f"{role_unit(report.output)}²/Hz"
    names = list(of.coherence_before)
    across = min(ACROSS, 1 + len(names))
    down = math.ceil((1 + len(names)) / across)
    columns, rows = spans(across, 0.085), spans(down, 0.2)[::-1]
    up = of.frequency > 0  # a logarithm has no zero
    x = listed(of.frequency[up])
    low, high = math.log10(of.frequency[up][0]), math.log10(of.frequency[-1])
    rows_of = [*of.coherence_before.values(), *of.coherence_after.values()]
    most = min(
        max([LEAST_COHERENCE, *(1.1 * float(np.nanmax(c[up])) for c in rows_of if np.isfinite(c[up]).any())]),
        1.0,
    )
    data: list[Spec] = []
    axes: Spec = {}
    titles, shapes = [], []
    for k in range(1 + len(names)):
        ends = (f"x{suffix(k)}", f"y{suffix(k)}")
        column, row = columns[k % across], rows[k // across]
        pair = (
            (of.before, of.after)
            if k == 0
            else (of.coherence_before[names[k - 1]], of.coherence_after[names[k - 1]])
        )
        data += _pair(report, x, (pair[0][up], pair[1][up]), ends, first=k == 0)
        axes[f"xaxis{suffix(k)}"] = axis(
            "frequency (Hz)" if k + across >= 1 + len(names) else "",
            type="log", range=[low, high], domain=column, anchor=ends[1],
            tickvals=TICKS, ticktext=[f"{f:g}" for f in TICKS], tickangle=0, hoverformat=".3g", matches="x" if k else None,
        )  # fmt: skip
        scale = (
            {"type": "log", "dtick": 1, "tickformat": "~g"} if k == 0 else {"range": [0, most], "nticks": 5}
        )
        axes[f"yaxis{suffix(k)}"] = axis("", domain=row, anchor=ends[0], hoverformat=".2g", **scale)
        title = f"spectrum ({unit})" if k == 0 else f"coherence with {spoken(names[k - 1])}"
        titles.append(
            note(
                title, column[0], row[1], xanchor="left", yanchor="bottom", font={"size": 11, "color": "@ink"}
            )
        )
        if k and math.isfinite(of.level):
            shapes.append(
                dashed(xref=f"{ends[0]} domain", yref=ends[1], x0=0, x1=1, y0=of.level, y1=of.level)
            )
    return Figure(
        "frequency",
        "Residual over frequency",
        _says(report, of),
        f"Spectrum of the residual, and its coherence with {', '.join(map(spoken, names)) or 'no input'}, over frequency",
        MARGIN["t"] + MARGIN["b"] + PANEL_HEIGHT * down,
        data,
        layout(axes, annotations=titles, shapes=shapes, margin=MARGIN | {"t": 56}),
    )


def _pair(
    report: Report, x: list[float], pair: tuple[Array, Array], ends: tuple[str, str], *, first: bool
) -> list[Spec]:
    before = "baseline" if report.findings else "simulation"
    lines = [line(x, pair[0], before, "before", axes=ends, showlegend=first)]
    if report.findings:
        lines.append(line(x, pair[1], "extended model", "after", axes=ends, showlegend=first))
    return lines


def _says(report: Report, of: Spectra) -> str:
    says = []
    up = of.frequency > 0
    for name, before in of.coherence_before.items():
        text = f"Coherence with {spoken(name)} is {_bands(of.frequency[up], before[up] > of.level)}"
        if report.findings:
            text += f" before and {_bands(of.frequency[up], of.coherence_after[name][up] > of.level)} after"
        says.append(text + ".")
    total = [
        number(float(np.sqrt(np.trapezoid(s, of.frequency))), role_unit(report.output))
        for s in (of.before, of.after)
    ]
    power = " → ".join(total if report.findings else total[:1])
    return (
        f"Dashed: {number(of.level)}, above which a coherence is no chance (99 %). Where the residual follows an input, the "
        f"model's answer to it is wrong; where not, it is noise or an input that nobody measured. {' '.join(says)} "
        f"Under the spectrum lie {power} rms."
    )


def _bands(frequency: Array, above: Flags) -> str:
    """Say where it is above; single bins are chance and are left out.

    Example:
        >>> _bands(np.array([0.1, 0.2, 0.3, 0.4]), np.array([False, True, True, False]))
        'above it at 0.2–0.3 Hz'
    """
    found = [(frequency[a], frequency[b]) for a, b in runs(above) if b > a]
    if not found:
        return "nowhere above it"
    widest = sorted(sorted(found, key=lambda band: band[0] - band[1])[:MOST_BANDS])
    more = f" and {len(found) - MOST_BANDS} more" if len(found) > MOST_BANDS else ""
    return "above it at " + ", ".join(f"{a:.2g}–{b:.2g} Hz" for a, b in widest) + more
