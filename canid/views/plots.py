"""Results as plotly figures, for notebooks and scripts; the reports have figures of their own (`views/report`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from canid.comparison.comparison import Comparison
from canid.drive_parameters import Identified
from canid.errors import ConfigError
from canid.findings import Report
from canid.runs import runs
from canid.signal_checks.drive_time import usable
from canid.types import QUOTED, Channel, Estimate, Interval, Status, Trace
from canid.views import comparison_text
from canid.views.names import readable
from canid.views.notebook.channel_rows import rows
from canid.views.numbers import gain_unit, interval, role_unit

# readable on light and on dark templates
MEASURED, MODEL, BEFORE = "#8a919c", "#3d85c6", "#c77d1e"
# stretches that are shaded, the longest ones; a figure with thousands of shapes hangs a notebook
MAX_SHADED = 60


def figure(panels: int = 1, titles: Sequence[str] = ()) -> Any:
    """An empty figure with panels above each other that share the time axis.

    Raises:
        ConfigError: plotly is not installed.
    """
    if find_spec("plotly") is None:
        raise ConfigError("plot() needs plotly: pip install 'canid[report]'")
    made = import_module("plotly.subplots").make_subplots(
        rows=panels, cols=1, shared_xaxes=True, vertical_spacing=0.06, subplot_titles=list(titles) or None
    )
    return made.update_layout(height=160 + 170 * panels, margin={"l": 60, "r": 20, "t": 50, "b": 40})


def interval_plot(of: Interval) -> Any:
    """One interval."""
    return _forest([("", of, "")], "95 % interval")


def channel_plot(of: Channel) -> Any:
    """What may be quoted of a channel."""
    return _channels({"": of}, "")


def estimate_plot(of: Estimate) -> Any:
    """The parameters of an estimate."""
    return _channels(of.channels if of.status is Status.OK else {}, "").update_layout(
        title=_plain(f"{of.estimator} at {of.t:.1f} s: {of.status.value}")
    )


def trace_plot(of: Trace) -> Any:
    """Output and inputs; grey: not used for identification."""
    names = ["output", *of.input_names]
    made = figure(
        len(names),
        [f"{readable(name)} {_bracketed(role_unit(name) if k else '')}" for k, name in enumerate(names)],
    )
    for k, values in enumerate([of.output, *of.inputs.T]):
        made.add_scatter(x=of.t, y=values, name=readable(names[k]), row=k + 1, col=1, line_width=1)
    _shade(made, of)
    return made.update_layout(showlegend=False).update_xaxes(title_text="s", row=len(names), col=1)


def drive_plot(trace: Trace, estimates: Sequence[Estimate]) -> Any:
    """K of every input as the estimators saw it along the drive, above the output."""
    names = list(trace.input_names)
    made = figure(1 + len(names), [*(f"K of {readable(name)}" for name in names), "output"])
    for k, name in enumerate(names):
        for estimator in sorted({e.estimator for e in estimates}):
            _gains(made, [e for e in estimates if e.estimator == estimator], name, estimator, k + 1)
    made.add_scatter(x=trace.t, y=trace.output, name="output", row=len(names) + 1, col=1, line_width=1)
    _shade(made, trace)
    return made


def identified_plot(of: Identified) -> Any:
    """K of every input over the windows, with the band of the whole drive."""
    output, names = of.drive_summary.output, list(of.channels)
    if not names:
        return figure().update_layout(title="nothing is identifiable")
    made = figure(
        len(names), [f"K of {readable(name)} {_bracketed(gain_unit(output, name))}" for name in names]
    )
    for k, name in enumerate(names):
        for estimator in of.ranked:
            _gains(made, [e for e in of.windows if e.estimator == estimator], name, estimator, k + 1)
        whole = of.channels[name]
        if "K" in QUOTED[whole.status]:
            at: dict[str, Any] = {"row": k + 1, "col": 1, "exclude_empty_subplots": False}
            made.add_hrect(y0=whole.K.low, y1=whole.K.high, fillcolor=MODEL, opacity=0.15, line_width=0, **at)
            made.add_hline(y=whole.K.value, line_color=MODEL, **at)
    made.update_layout(title=_plain(of.log or "Identified driver"))
    return made.update_xaxes(title_text="s", row=len(names), col=1)


def report_plot(of: Report) -> Any:
    """Measured and simulated output, and what is left, with the episodes of the findings."""
    unit = _bracketed(role_unit(of.output))
    made = figure(2, [f"{readable(of.output)} {unit}", f"residual {unit}"])
    made.add_scatter(
        x=of.t, y=of.measured, name="measured", line={"color": MEASURED, "width": 1}, row=1, col=1
    )
    models = [("baseline", of.baseline, BEFORE)] + [("extended model", of.extended, MODEL)] * bool(
        of.findings
    )
    for name, fit, color in models:
        line = {"color": color, "width": 1}
        made.add_scatter(x=of.t, y=fit.simulated, name=name, line=line, row=1, col=1)
        left = np.where(of.used, of.measured - fit.simulated, np.nan)
        made.add_scatter(x=of.t, y=left, name=name, line=line, showlegend=False, row=2, col=1)
    for finding in of.findings:
        for start, stop in finding.episodes[:MAX_SHADED]:
            made.add_vrect(x0=start, x1=stop, fillcolor=BEFORE, opacity=0.15, line_width=0)
    made.update_layout(title=_plain(f"Diagnosis: {readable(of.verdict.value)}"))
    return made.update_xaxes(title_text="s", row=2, col=1)


def comparison_plot(of: Comparison) -> Any:
    """Ratio of B over A where there is one."""
    several = [
        (comparison_text.label(r.name), r.ratio, "")
        for r in of.rows
        if r.compared and np.isfinite(r.ratio.value)
    ]
    return _forest(several, "B over A, 95 % interval").add_vline(x=1.0, line_dash="dot")


def _channels(channels: Mapping[str, Channel], output: str) -> Any:
    several = [(f"{name} {symbol}".strip(), of, unit) for name, symbol, of, unit in rows(channels, output)]
    return _forest([row for row in several if np.isfinite(row[1].value)], "95 % interval")


def _forest(several: Sequence[tuple[str, Interval, str]], title: str) -> Any:
    """Intervals below each other."""
    made = figure().update_layout(height=120 + 40 * len(several))
    values = np.array([of for _, of, _ in several]).reshape(-1, 3)
    names = [_plain(f"{name} {_bracketed(unit)}".strip()) for name, _, unit in several]
    made.add_scatter(
        x=values[:, 0],
        y=names,
        mode="markers",
        marker={"color": MODEL, "size": 9},
        error_x={"array": values[:, 2] - values[:, 0], "arrayminus": values[:, 0] - values[:, 1]},
        text=[interval(of, unit) for _, of, unit in several],
    )
    return made.update_xaxes(title_text=title).update_yaxes(autorange="reversed", type="category")


def _gains(made: Any, estimates: Sequence[Estimate], name: str, estimator: str, row: int) -> None:
    """K of one input by one estimator, where it may be quoted."""
    known = [e for e in estimates if e.status is Status.OK and "K" in QUOTED[e.channels[name].status]]
    K = np.array([e.channels[name].K for e in known]).reshape(-1, 3)
    color = MODEL if estimator == "fopdt" else BEFORE
    made.add_scatter(
        x=[e.t for e in known],
        y=K[:, 0],
        error_y={"array": K[:, 2] - K[:, 0], "arrayminus": K[:, 0] - K[:, 1], "thickness": 0.7, "width": 0},
        mode="markers",
        marker={"color": color, "size": 4},
        name=estimator,
        legendgroup=estimator,
        showlegend=row == 1,
        row=row,
        col=1,
    )


def _shade(made: Any, trace: Trace) -> None:
    """Mark what is not used for identification."""
    unused = sorted(runs(~usable(trace)), key=lambda span: span[0] - span[1])[:MAX_SHADED]
    for a, b in unused:
        made.add_vrect(
            x0=float(trace.t[a]), x1=float(trace.t[b - 1]), fillcolor=MEASURED, opacity=0.2, line_width=0
        )


def _bracketed(unit: str) -> str:
    return f"({unit})" if unit else ""


def _plain(text: str) -> str:
    """A text that plotly does not read as markup."""
    return text.replace("&", "&amp;").replace("<", "&lt;")
