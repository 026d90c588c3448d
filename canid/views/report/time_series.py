"""Time series of the measured and the simulated output and of the residual: the whole drive, and its worst windows."""

from __future__ import annotations

import math

import numpy as np

from canid.findings import Flags, Report, extends
from canid.runs import runs
from canid.types import Array
from canid.views.diagnosis_parts import step
from canid.views.names import readable
from canid.views.numbers import number, role_unit, time_range
from canid.views.report.decimation import MAX_POINTS, min_max_indices
from canid.views.report.figure import (
    MARGIN_PX,
    NARROW_MARGIN_PX,
    Figure,
    Spec,
    annotation,
    axis,
    axis_suffix,
    equal_domains,
    layout,
    line,
    rms,
    running_rms,
    stacked,
    times,
)

DRIVE_HEIGHT_PX = 540
WINDOW_HEIGHT_PX = 190
# px on a phone: the drive with four lines of legend, one worst window, and between two
NARROW_DRIVE_PX, NARROW_LEGEND_PX = 440, 88
NARROW_WINDOW_PX, NARROW_GAP_PX, NARROW_TOP_PX = 92, 40, 72
# windows next to each other: three are still readable on A4
MAX_WINDOW_COLUMNS = 3
# window of the running rms: longer than the driver's noise, shorter than a manoeuvre
RMS_WINDOW_S = 15.0


def whole_drive(report: Report) -> Figure | None:
    """The whole drive: output, residual and its running rms; None where nothing could be simulated."""
    before, after = report.baseline.simulated, report.extended.simulated
    if not np.isfinite(before).any():
        return None
    unit = role_unit(report.output)
    close = inside(report.t, [(w.start, w.stop) for w in report.worst])
    found = extends(report)
    sides = [("before", _before(report), before)] + [("after", "extended simulation", after)] * found
    data = [_decimated(report.t, report.measured, close, "measured", "measured", "y")]
    for color, name, simulated in sides:
        residual = np.where(report.used, report.measured - simulated, math.nan)
        running = running_rms(residual, _samples(report))
        data += [
            _decimated(report.t, simulated, close, name, color, "y"),
            _decimated(report.t, residual, close, name, color, "y2", showlegend=False),
            _decimated(report.t, running, close, name, color, "y3", showlegend=False),
        ]
    shapes = [
        *_shade([(w.start, w.stop) for w in report.worst], "worst windows", "worst"),
        *_shade([(m.start, m.stop) for m in report.masked], "left out: masked", "shade-mask"),
        *_shade(_unused(report), "left out: not fitted", "shade-unused"),
    ]
    labels = [
        annotation(
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
        "yaxis": axis(f"{readable(report.output)} ({unit})", domain=[0.53, 1.0], **_used_range(report)),
        "yaxis2": axis(f"residual ({unit})", domain=[0.23, 0.49], zeroline=True, zerolinecolor="@rule"),
        "yaxis3": axis(f"rms ({unit})", domain=[0.0, 0.19], rangemode="tozero", nticks=4),
    }
    return Figure(
        "whole-drive",
        "Measured and simulated",
        _drive_caption(report, report.measured - before, report.measured - after),
        f"Three panels over time: {readable(report.output)} measured and simulated, the residual, and its running rms",
        DRIVE_HEIGHT_PX,
        data,
        layout(axes, shapes=shapes, annotations=labels, hovermode="x"),
        (
            NARROW_DRIVE_PX,
            _narrow_titles(axes) | {"margin": NARROW_MARGIN_PX | {"t": NARROW_LEGEND_PX}},
        ),
    )


def worst_windows(report: Report) -> Figure | None:
    """The worst windows, one panel each; None where there are none."""
    if not report.worst:
        return None
    unit = role_unit(report.output)
    across = min(MAX_WINDOW_COLUMNS, len(report.worst))
    down = math.ceil(len(report.worst) / across)
    columns, rows = equal_domains(across, 0.055), equal_domains(down, 0.24)[::-1]
    data: list[Spec] = []
    axes: Spec = {}
    titles, narrow_titles = [], []
    for k, window in enumerate(report.worst):
        at = inside(report.t, [(window.start, window.stop)])
        x, names = times(report.t[at]), (f"x{axis_suffix(k)}", f"y{axis_suffix(k)}")
        column, row = columns[k % across], rows[k // across]
        first = k == 0
        data += [
            line(x, report.measured[at], "measured", "measured", axes=names, showlegend=first),
            line(x, report.baseline.simulated[at], _before(report), "before", axes=names, showlegend=first),
        ]
        if extends(report):
            data.append(
                line(x, report.extended.simulated[at], "extended simulation", "after", axes=names, showlegend=first)
            )  # fmt: skip
        last_row = k + across >= len(report.worst)
        axes[f"xaxis{axis_suffix(k)}"] = axis(
            "time (s)" if last_row else "", domain=column, anchor=names[1], nticks=5
        )
        title = f"{readable(report.output)} ({unit})" if k % across == 0 else ""
        axes[f"yaxis{axis_suffix(k)}"] = axis(title, domain=row, anchor=names[0], nticks=5)
        change = number(window.before)
        change += f" → {number(window.after)}" if extends(report) else ""
        text = f"<b>{k + 1}</b>  {time_range(window.start, window.stop)}: {change} {unit} rms"
        style = {"xanchor": "left", "yanchor": "bottom", "font": {"size": 10, "color": "@ink"}}
        titles.append(annotation(text, column[0], row[1], **style))
        narrow_titles.append(annotation(text, 0.0, 1.0, yref=f"{names[1]} domain", **style))
    count = len(report.worst)
    panels = NARROW_WINDOW_PX * count + NARROW_GAP_PX * (count - 1)
    return Figure(
        "worst-windows",
        "The worst windows",
        _windows_caption(report),
        f"One panel over time per worst window ({len(report.worst)}): measured and simulated {readable(report.output)}",
        MARGIN_PX["t"] + MARGIN_PX["b"] + WINDOW_HEIGHT_PX * down,
        data,
        layout(axes, annotations=titles, margin=MARGIN_PX | {"t": 56}),
        (
            panels + NARROW_TOP_PX + NARROW_MARGIN_PX["b"],
            {
                **stacked(axes, NARROW_GAP_PX, panels),
                "annotations": narrow_titles,
                "margin": NARROW_MARGIN_PX | {"t": NARROW_TOP_PX},
            },
        ),
    )


def inside(t: Array, ranges: list[tuple[float, float]]) -> Flags:
    """Which times lie in one of the ranges.

    Example:
        >>> inside(np.array([0.0, 1.0, 2.0]), [(0.5, 2.0)])
        array([False,  True,  True])
    """
    flags = np.zeros(len(t), dtype=bool)
    for start, stop in ranges:
        flags |= (t >= start) & (t <= stop)
    return flags


def _samples(report: Report) -> int:
    return max(round(RMS_WINDOW_S / step(report)), 1) if step(report) else 1


def _narrow_titles(axes: Spec) -> Spec:
    """Titles that fit next to low panels."""
    of = {key: axes[key] for key in ("yaxis", "yaxis2", "yaxis3")}
    return {
        key: one | {"title": one["title"] | {"standoff": 4, "font": {"size": 10}}} for key, one in of.items()
    }


def _used_range(report: Report) -> Spec:
    """Range of the output where the fit uses it: a simulation may go anywhere where nothing is compared."""
    lines = (report.measured, report.baseline.simulated, report.extended.simulated)
    shown = np.concatenate([line[report.used] for line in lines] + [report.measured])
    shown = shown[np.isfinite(shown)]
    if not report.used.any() or not shown.size or shown.min() == shown.max():
        return {}
    margin = 0.05 * float(shown.max() - shown.min())
    return {"range": [float(shown.min()) - margin, float(shown.max()) + margin]}


def _before(report: Report) -> str:
    return "baseline simulation" if extends(report) else "simulation"


def _decimated(t: Array, y: Array, keep: Flags, name: str, color: str, yaxis: str, **more: bool) -> Spec:
    at = min_max_indices(y, keep)
    return line(times(t[at]), y[at], name, color, axes=("x", yaxis), **more)


def _unused(report: Report) -> list[tuple[float, float]]:
    """Time ranges that the fit does not use, without the masked ones."""
    masked = inside(report.t, [(m.start, m.stop) for m in report.masked])
    return [(float(report.t[a]), float(report.t[b - 1])) for a, b in runs(~report.used & ~masked)]


def _shade(ranges: list[tuple[float, float]], name: str, color: str) -> list[Spec]:
    """One shape for all ranges, behind the lines: a path of rectangles, because hundreds of shapes are slow."""
    if not ranges:
        return []
    path = " ".join(f"M{a:.3f},0V1H{b:.3f}V0Z" for a, b in ranges)
    return [{
        "type": "path", "path": path, "xref": "x", "yref": "paper", "layer": "below", "fillcolor": f"@{color}",
        "line": {"width": 0}, "name": name, "showlegend": True,
    }]  # fmt: skip


def _drive_caption(report: Report, before: Array, after: Array) -> str:
    unit = role_unit(report.output)
    used = report.used
    of = "baseline" if extends(report) else "simulation"
    caption = f"The residual (measured − simulated) has {number(rms(before[used]), unit)} rms with the {of}"
    if extends(report):
        caption += f" and {number(rms(after[used]), unit)} with the extended model"
    caption += (
        " over the samples that the fit uses; the lowest panel shows its rms over the "
        f"{number(RMS_WINDOW_S, 's')} around each time. The upper axis fits these samples: a double click shows all."
    )
    if report.worst:
        caption += " Yellow, numbered: the worst windows, 1 is the worst."
    masked, unused = sum(m.stop - m.start for m in report.masked), sum(b - a for a, b in _unused(report))
    if masked:
        caption += f" Dark grey: masked, {number(masked, 's')} in total."
    if unused:
        caption += (
            f" Light grey: not fitted (such as no lead, brake, pedal at 0 %), {number(unused, 's')} in total."
        )
    if len(report.t) > MAX_POINTS:
        size = -(-2 * len(report.t) // MAX_POINTS)
        caption += (
            f" Lines are thinned to the minimum and the maximum of every {size} samples; "
            "in the worst windows every sample is drawn."
        )
    return caption


def _windows_caption(report: Report) -> str:
    if not extends(report):
        return "No cause was added to the model, so there is one simulation. Gaps are samples that were left out."
    better = sum(w.after < w.before for w in report.worst)
    return (
        f"The extended model is closer to the measurement in {better} of these {len(report.worst)} windows "
        "(titles: rms of the baseline → of the extended model). They were selected as the baseline's worst, so that some "
        "of the improvement is regression to the mean; the gain that counts is the one on held-out data."
    )
