"""Time series of the measured and the simulated output and of the residual: the whole drive, and its worst windows."""

from __future__ import annotations

import math

import numpy as np

from canid.ui.views.drawing.decimation import MAX_POINTS
from canid.ui.views.drawing.figure import Figure, Spec, annotation, line, rms, running_rms, times
from canid.ui.views.drawing.grid import Tile, grid
from canid.ui.views.drawing.panels import Panel, shade_spans, signal, stack, titled
from canid.values.findings import Flags, Report, extends, step
from canid.values.runs import runs
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit, time_range
from canid.values.types import Array

# px of the panels
DRIVE_PX, RESIDUAL_PX, RMS_PX = 210, 120, 85
# px of a window, and on a phone
WINDOW_PX = (190, 92)
# window of the running rms: longer than the driver's noise, shorter than a manoeuvre
RMS_WINDOW_S = 15.0


def whole_drive(report: Report) -> Figure | None:
    """The whole drive: output, residual and its running rms; None where nothing could be simulated."""
    before, after = report.baseline.simulated, report.extended.simulated
    if not np.isfinite(before).any():
        return None
    unit = role_unit(report.output)
    close = inside(report.t, [(w.start, w.stop) for w in report.worst])
    sides = [("before", _before(report), before)]
    sides += [("after", "extended simulation", after)] * extends(report)
    output = [signal(report.t, report.measured, "measured", "measured", MAX_POINTS, close)]
    residuals: list[Spec] = []
    running: list[Spec] = []
    for color, name, simulated in sides:
        residual = np.where(report.used, report.measured - simulated, math.nan)
        each = (simulated, residual, running_rms(residual, _samples(report)))
        for lines, y in zip((output, residuals, running), each, strict=True):
            lines.append(signal(report.t, y, name, color, MAX_POINTS, close))
    shapes = [
        *shade_spans([(w.start, w.stop) for w in report.worst], "worst windows", "worst"),
        *shade_spans([(m.start, m.stop) for m in report.masked], "left out: masked", "shade-mask"),
        *shade_spans(_unused(report), "left out: not fitted", "shade-unused"),
    ]
    font = {"color": "@ink", "size": 12}
    labels = [
        annotation(str(k + 1), (w.start + w.stop) / 2, 1.0, xref="x", yanchor="top", font=font)
        for k, w in enumerate(report.worst)
    ]
    zero = {"zeroline": True, "zerolinecolor": "@rule"}
    panels = [
        Panel(titled(report.output, unit), output, DRIVE_PX, _used_range(report)),
        Panel(titled("residual", unit), residuals, RESIDUAL_PX, more=zero),
        Panel(titled("rms", unit), running, RMS_PX, more={"rangemode": "tozero", "nticks": 4}),
    ]
    caption = _drive_caption(report, report.measured - before, report.measured - after)
    title = "Measured and simulated"
    return stack("whole-drive", title, caption, panels, shapes=shapes, annotations=labels)


def worst_windows(report: Report) -> Figure | None:
    """The worst windows, one panel each; None where there are none."""
    if not report.worst:
        return None
    unit = role_unit(report.output)
    sides = [
        ("measured", report.measured, "measured"),
        (_before(report), report.baseline.simulated, "before"),
    ]
    sides += [("extended simulation", report.extended.simulated, "after")] * extends(report)
    tiles = []
    for k, window in enumerate(report.worst, 1):
        at = inside(report.t, [(window.start, window.stop)])
        change = " → ".join(map(number, (window.before, window.after)[: 1 + extends(report)]))
        text = f"<b>{k}</b>  {time_range(window.start, window.stop)}: {change} {unit} rms"
        lines = [line(times(report.t[at]), y[at], name, color) for name, y, color in sides]
        tiles.append(Tile(text, lines))
    title, output = "The worst windows", readable(report.output)
    alt = f"One panel over time per worst window ({len(tiles)}): measured and simulated {output}"
    figure = Figure("worst-windows", title, _windows_caption(report), alt)
    return grid(figure, tiles, ("time (s)", f"{output} ({unit})"), WINDOW_PX)


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


def _used_range(report: Report) -> tuple[float, float] | None:
    """Range of the output where the fit uses it: a simulation may go anywhere where nothing is compared."""
    lines = (report.measured, report.baseline.simulated, report.extended.simulated)
    shown = np.concatenate([line[report.used] for line in lines] + [report.measured])
    shown = shown[np.isfinite(shown)]
    if not report.used.any() or not shown.size or shown.min() == shown.max():
        return None
    margin = 0.05 * float(shown.max() - shown.min())
    return float(shown.min()) - margin, float(shown.max()) + margin


def _before(report: Report) -> str:
    return "baseline simulation" if extends(report) else "simulation"


def _unused(report: Report) -> list[tuple[float, float]]:
    """Time ranges that the fit does not use, without the masked ones."""
    masked = inside(report.t, [(m.start, m.stop) for m in report.masked])
    return [(float(report.t[a]), float(report.t[b - 1])) for a, b in runs(~report.used & ~masked)]


def _drive_caption(report: Report, before: Array, after: Array) -> str:
    unit = role_unit(report.output)
    used = report.used
    model = "baseline" if extends(report) else "simulation"
    caption = (
        f"The residual (measured − simulated) has {number(rms(before[used]), unit)} rms with the {model}"
    )
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
