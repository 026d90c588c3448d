"""Where in time the simulation is wrong: the whole drive before and after, and its worst windows close up."""

from __future__ import annotations

import math

import numpy as np

from canid.findings import Flags, Report
from canid.types import Array
from canid.views.diagnosed import step
from canid.views.measures import number, role_unit, spoken, stretch
from canid.views.report.figure import (
    MARGIN,
    Figure,
    Spec,
    axis,
    layout,
    line,
    note,
    rms,
    running_rms,
    spans,
    suffix,
    times,
)
from canid.views.report.thinning import MOST, kept

# px
STRIP_HEIGHT = 540
WINDOW_HEIGHT = 190
# windows side by side: three are still readable on A4
WINDOWS_ACROSS = 3
# s of the running rms: longer than the driver's noise, shorter than a manoeuvre
WINDOW = 15.0


def strip(report: Report) -> Figure | None:
    """Draw the whole drive: output above, residual below; None where nothing could be simulated."""
    before, after = report.baseline.simulated, report.extended.simulated
    if not np.isfinite(before).any():
        return None
    unit = role_unit(report.output)
    close = inside(report.t, [(w.start, w.stop) for w in report.worst])
    found = bool(report.findings)
    sides = [("before", _before(report), before)] + [("after", "extended simulation", after)] * found
    data = [_drawn(report.t, report.measured, close, "measured", "measured", "y")]
    for colour, name, simulated in sides:
        residual = np.where(report.used, report.measured - simulated, math.nan)
        running = running_rms(residual, _samples(report))
        data += [
            _drawn(report.t, simulated, close, name, colour, "y"),
            _drawn(report.t, residual, close, name, colour, "y2", showlegend=False),
            _drawn(report.t, running, close, name, colour, "y3", showlegend=False),
        ]
    shapes = [
        *_shade([(w.start, w.stop) for w in report.worst], "worst windows", "worst"),
        *_shade([(m.start, m.stop) for m in report.masked], "left out: masked", "shade-mask"),
        *_shade(_unused(report), "left out: not fitted", "shade-unused"),
    ]
    labels = [
        note(
            str(k + 1),
            (w.start + w.stop) / 2,
            1.0,
            xref="x",
            yanchor="top",
            font={"color": "@ink", "size": 12},
        )
        for k, w in enumerate(report.worst)
    ]
    axes = {
        "xaxis": axis("time in the log (s)", anchor="y3", domain=[0, 1], hoverformat=".1f"),
        "yaxis": axis(f"{spoken(report.output)} ({unit})", domain=[0.53, 1.0]),
        "yaxis2": axis(f"residual ({unit})", domain=[0.23, 0.49], zeroline=True, zerolinecolor="@rule"),
        "yaxis3": axis(f"its rms ({unit})", domain=[0.0, 0.19], rangemode="tozero", nticks=4),
    }
    return Figure(
        "strip",
        "Measured and simulated",
        _strip_says(report, report.measured - before, report.measured - after),
        f"Three panels over time: {spoken(report.output)} measured and simulated, the residual, and its running rms",
        STRIP_HEIGHT,
        data,
        layout(axes, shapes=shapes, annotations=labels, hovermode="x"),
    )


def windows(report: Report) -> Figure | None:
    """Draw the worst windows close up; None where there are none."""
    if not report.worst:
        return None
    unit = role_unit(report.output)
    across = min(WINDOWS_ACROSS, len(report.worst))
    down = math.ceil(len(report.worst) / across)
    columns, rows = spans(across, 0.055), spans(down, 0.24)[::-1]
    data: list[Spec] = []
    axes: Spec = {}
    titles = []
    for k, window in enumerate(report.worst):
        at = inside(report.t, [(window.start, window.stop)])
        x, names = times(report.t[at]), (f"x{suffix(k)}", f"y{suffix(k)}")
        column, row = columns[k % across], rows[k // across]
        first = k == 0
        data += [
            line(x, report.measured[at], "measured", "measured", axes=names, showlegend=first),
            line(x, report.baseline.simulated[at], _before(report), "before", axes=names, showlegend=first),
        ]
        if report.findings:
            data.append(
                line(x, report.extended.simulated[at], "extended simulation", "after", axes=names, showlegend=first)
            )  # fmt: skip
        last_row = k + across >= len(report.worst)
        axes[f"xaxis{suffix(k)}"] = axis(
            "time (s)" if last_row else "", domain=column, anchor=names[1], nticks=5
        )
        title = f"{spoken(report.output)} ({unit})" if k % across == 0 else ""
        axes[f"yaxis{suffix(k)}"] = axis(title, domain=row, anchor=names[0], nticks=5)
        change = f"{number(window.before, unit)}"
        change += f" → {number(window.after, unit)}" if report.findings else ""
        titles.append(
            note(f"<b>{k + 1}</b>  {stretch(window.start, window.stop)}: {change} rms", column[0], row[1],
                 xanchor="left", yanchor="bottom", font={"size": 11, "color": "@ink"})
        )  # fmt: skip
    return Figure(
        "windows",
        "The worst windows close up",
        _windows_says(report),
        f"{len(report.worst)} small panels over time, one per worst window: measured and simulated {spoken(report.output)}",
        MARGIN["t"] + MARGIN["b"] + WINDOW_HEIGHT * down,
        data,
        layout(axes, annotations=titles, margin=MARGIN | {"t": 56}),
    )


def inside(t: Array, stretches: list[tuple[float, float]]) -> Flags:
    """Tell which times lie in one of the stretches.

    Example:
        >>> inside(np.array([0.0, 1.0, 2.0]), [(0.5, 2.0)])
        array([False,  True,  True])
    """
    flags = np.zeros(len(t), dtype=bool)
    for start, stop in stretches:
        flags |= (t >= start) & (t <= stop)
    return flags


def runs(flags: Flags) -> list[tuple[int, int]]:
    """First and last index of each run of true.

    Example:
        >>> runs(np.array([True, False, True, True]))
        [(0, 0), (2, 3)]
    """
    edges = np.flatnonzero(np.diff(np.r_[False, flags, False]))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _samples(report: Report) -> int:
    return max(round(WINDOW / step(report)), 1) if step(report) else 1


def _before(report: Report) -> str:
    return "baseline simulation" if report.findings else "simulation"


def _drawn(t: Array, y: Array, keep: Flags, name: str, colour: str, yaxis: str, **more: bool) -> Spec:
    at = kept(y, keep)
    return line(times(t[at]), y[at], name, colour, axes=("x", yaxis), **more)


def _unused(report: Report) -> list[tuple[float, float]]:
    """Stretches that the fit does not rest on, beside the masked ones."""
    masked = inside(report.t, [(m.start, m.stop) for m in report.masked])
    return [(float(report.t[a]), float(report.t[b])) for a, b in runs(~report.used & ~masked)]


def _shade(stretches: list[tuple[float, float]], name: str, colour: str) -> list[Spec]:
    """One shape for all stretches, behind the lines: a path of rectangles, because hundreds of shapes are slow."""
    if not stretches:
        return []
    path = " ".join(f"M{a:.3f},0V1H{b:.3f}V0Z" for a, b in stretches)
    return [{
        "type": "path", "path": path, "xref": "x", "yref": "paper", "layer": "below", "fillcolor": f"@{colour}",
        "line": {"width": 0}, "name": name, "showlegend": True,
    }]  # fmt: skip


def _strip_says(report: Report, before: Array, after: Array) -> str:
    unit = role_unit(report.output)
    used = report.used
    says = (
        f"The residual (measured minus simulated) has {number(rms(before[used]), unit)} rms with the baseline"
    )
    if report.findings:
        says += f" and {number(rms(after[used]), unit)} with the extended model"
    says += f" over the used samples; the lowest panel has it over {number(WINDOW, 's')} around each instant."
    if report.worst:
        says += " Yellow, numbered: the worst windows, 1 the worst."
    masked, unused = sum(m.stop - m.start for m in report.masked), sum(b - a for a, b in _unused(report))
    if masked:
        says += f" Dark grey: masked, {number(masked, 's')} in sum."
    if unused:
        says += (
            f" Light grey: not fitted (such as no lead, brake, pedal at 0 %), {number(unused, 's')} in sum."
        )
    if len(report.t) > MOST:
        size = -(-2 * len(report.t) // MOST)
        says += (
            f" Lines are thinned to the smallest and the largest of every {size} samples; "
            "in the worst windows every sample is drawn."
        )
    return says


def _windows_says(report: Report) -> str:
    if not report.findings:
        return "Nothing was added to the model, so there is one simulation. Gaps are stretches that were left out."
    better = sum(w.after < w.before for w in report.worst)
    return (
        f"The extended model is nearer to the measurement in {better} of these {len(report.worst)} windows "
        "(rms before → after over each title). They were chosen as the baseline's worst: some improvement in them is "
        "chance; the gain that counts is the held-out one."
    )
