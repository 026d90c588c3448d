"""Power spectrum of the residual, and its coherence with each input."""

from __future__ import annotations

import math

import numpy as np

from canid.findings import Flags, Report, Spectra, extends
from canid.runs import runs
from canid.types import Array
from canid.views.names import readable
from canid.views.numbers import number, role_unit
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
    stacked,
    threshold_line,
    to_list,
)

PANEL_HEIGHT_PX = 220
# px on a phone: one panel, and between two
NARROW_PANEL_PX, NARROW_GAP_PX = 105, 42
MAX_COLUMNS = 3
FREQUENCY_TICKS_HZ = (0.01, 0.03, 0.1, 0.3, 1, 3)
# least upper end of a coherence axis, so that noise does not appear large
MIN_COHERENCE_RANGE = 0.4
# bands that the caption names: the widest
BANDS_SHOWN = 3


def spectra(report: Report) -> Figure | None:
    """One panel for the spectrum and one per input; None where nothing was computed."""
    of = report.spectra
    if of is None or not (of.frequency > 0).any():
        return None
    unit = density_unit(role_unit(report.output))
    names = list(of.coherence_before)
    across = min(MAX_COLUMNS, 1 + len(names))
    down = math.ceil((1 + len(names)) / across)
    columns, rows = equal_domains(across, 0.085), equal_domains(down, 0.2)[::-1]
    up = of.frequency > 0  # a logarithm has no zero
    x = to_list(of.frequency[up])
    low, high = math.log10(of.frequency[up][0]), math.log10(of.frequency[-1])
    most = _coherence_range(of)
    pairs = [
        (of.before, of.after),
        *((of.coherence_before[name], of.coherence_after[name]) for name in names),
    ]
    data: list[Spec] = []
    axes: Spec = {}
    titles, narrow_titles, shapes = [], [], []
    for k in range(1 + len(names)):
        ends = (f"x{axis_suffix(k)}", f"y{axis_suffix(k)}")
        column, row = columns[k % across], rows[k // across]
        data += _pair(report, x, (pairs[k][0][up], pairs[k][1][up]), ends, first=k == 0)
        axes[f"xaxis{axis_suffix(k)}"] = axis(
            "frequency (Hz)" if k + across >= 1 + len(names) else "",
            type="log", range=[low, high], domain=column, anchor=ends[1],
            tickvals=FREQUENCY_TICKS_HZ, ticktext=[f"{f:g}" for f in FREQUENCY_TICKS_HZ], tickangle=0, hoverformat=".3g",
            matches="x" if k else None,
        )  # fmt: skip
        scale = (
            {"type": "log", "dtick": 1, "tickformat": "~g"} if k == 0 else {"range": [0, most], "nticks": 5}
        )
        axes[f"yaxis{axis_suffix(k)}"] = axis("", domain=row, anchor=ends[0], hoverformat=".2g", **scale)
        title = f"power ({unit})" if k == 0 else f"coherence with {readable(names[k - 1])}"
        style = {"xanchor": "left", "yanchor": "bottom", "font": {"size": 11, "color": "@ink"}}
        titles.append(annotation(title, column[0], row[1], **style))
        narrow_titles.append(annotation(title, 0.0, 1.0, yref=f"{ends[1]} domain", **style))
        if k and math.isfinite(of.level):
            shapes.append(
                threshold_line(xref=f"{ends[0]} domain", yref=ends[1], x0=0, x1=1, y0=of.level, y1=of.level)
            )
    panels = NARROW_PANEL_PX * (1 + len(names)) + NARROW_GAP_PX * len(names)
    return Figure(
        "spectra",
        "Residual over frequency",
        _caption(report, of),
        f"Spectrum of the residual, and its coherence with {', '.join(map(readable, names)) or 'no input'}, over frequency",
        MARGIN_PX["t"] + MARGIN_PX["b"] + PANEL_HEIGHT_PX * down,
        data,
        layout(axes, annotations=titles, shapes=shapes, margin=MARGIN_PX | {"t": 56}),
        (
            panels + 52 + NARROW_MARGIN_PX["b"],
            {
                **stacked(axes, NARROW_GAP_PX, panels),
                "annotations": narrow_titles,
                "margin": NARROW_MARGIN_PX | {"t": 52},
            },
        ),
    )


def density_unit(unit: str) -> str:
    """Unit of a power spectral density.

    Example:
        >>> density_unit("%"), density_unit("m/s²")
        ('%²/Hz', '(m/s²)²/Hz')
    """
    return f"{unit}²/Hz" if len(unit) < 2 else f"({unit})²/Hz"


def _coherence_range(of: Spectra) -> float:
    """Upper end of the coherence axes: just above the largest coherence, at most 1."""
    up = of.frequency > 0
    rows = [row[up] for row in (*of.coherence_before.values(), *of.coherence_after.values())]
    largest = [1.1 * float(np.nanmax(row)) for row in rows if np.isfinite(row).any()]
    return min(max([MIN_COHERENCE_RANGE, *largest]), 1.0)


def _pair(
    report: Report, x: list[float], pair: tuple[Array, Array], ends: tuple[str, str], *, first: bool
) -> list[Spec]:
    before = "baseline" if extends(report) else "simulation"
    lines = [line(x, pair[0], before, "before", axes=ends, showlegend=first)]
    if extends(report):
        lines.append(line(x, pair[1], "extended model", "after", axes=ends, showlegend=first))
    return lines


def _caption(report: Report, of: Spectra) -> str:
    up = of.frequency > 0
    frequency = of.frequency[up]
    sides = ["the simulation", ""] if not extends(report) else ["the baseline", "the extended model"]
    compared = f"the residual (measured − simulated) of {' and of '.join(filter(None, sides))}"
    sentences = []
    for name, before in of.coherence_before.items():
        text = f"{readable(name).capitalize()}: {_bands(frequency, before[up] > of.level)}"
        if extends(report):
            text += f"; with the extended model {_bands(frequency, of.coherence_after[name][up] > of.level)}"
        sentences.append(text + ".")
    total = [
        number(float(np.sqrt(np.trapezoid(s[up], frequency))), role_unit(report.output))
        for s in (of.before, of.after)
    ]
    power = " → ".join(total if extends(report) else total[:1])
    return (
        f"Power of {compared}, and its squared coherence with each measured input: the share of its power at a frequency "
        "that follows the input linearly (0 to 1, no unit). "
        f"Dashed: {number(of.level)}, which independent signals exceed at about 1 % of the frequencies. "
        f"{' '.join(sentences)} Coherence alone shows no error of the model: the driver is in a feedback loop, so that his "
        "own noise moves the car and with it the inputs. Whether more is left than that is decided by the adequacy tests "
        f"under Checks. From {number(float(frequency[0]), 'Hz')} to {number(float(frequency[-1]), 'Hz')} the residual has "
        f"{power} rms; samples that the fit does not use count as 0, and slower changes are not in it."
    )


def _bands(frequency: Array, above: Flags) -> str:
    """The bands in which it is above; single frequencies are left out as chance.

    Example:
        >>> _bands(np.array([0.1, 0.2, 0.3, 0.4]), np.array([False, True, True, False]))
        'above it at 0.2–0.3 Hz'
    """
    found = [(frequency[a], frequency[b - 1]) for a, b in runs(above, longer_than=1)]
    if not found:
        return "nowhere above it"
    widest = sorted(sorted(found, key=lambda band: band[0] - band[1])[:BANDS_SHOWN])
    more = f" and in {len(found) - BANDS_SHOWN} narrower bands" if len(found) > BANDS_SHOWN else ""
    return "above it at " + ", ".join(f"{a:.2g}–{b:.2g} Hz" for a, b in widest) + more
