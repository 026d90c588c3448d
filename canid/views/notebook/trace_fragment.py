"""A `Trace` as text and as a fragment: what it holds, the range of every signal, and the output over time."""

from __future__ import annotations

import numpy as np

from canid.runs import runs
from canid.signal_checks.drive_time import of_trace, usable
from canid.types import Trace
from canid.views import signal_text
from canid.views.names import readable
from canid.views.notebook.fragment import ACCENT, SECOND, chart, fragment, legend, lines, table
from canid.views.numbers import DASH, number, role_unit
from canid.views.table import columns

HEAD = ("signal", "unit", "measured", "low", "median", "high")
# curves of a small figure
SHOWN_INPUTS = 2
# px
INPUT_HEIGHT = 56


def trace_lines(trace: Trace) -> list[str]:
    """The text of `Trace.summary()`."""
    return [_head(trace), *_about(trace), "", *columns(HEAD, _rows(trace))]


def trace_html(trace: Trace) -> str:
    """The fragment of a trace; grey: not used for identification."""
    return fragment(
        f"Trace: {_head(trace)}", lines(_about(trace)), trace_charts(trace), table(HEAD, _rows(trace))
    )


def trace_charts(trace: Trace) -> str:
    """Output and inputs over time, small."""
    unused = [(float(trace.t[a]), float(trace.t[b - 1])) for a, b in runs(~usable(trace))]
    out = [legend([("output", ACCENT)]), chart(trace.t, [("output", trace.output, ACCENT)], shaded=unused)]
    for k, name in enumerate(trace.input_names[:SHOWN_INPUTS]):
        out.append(legend([(f"{readable(name)} ({role_unit(name)})", SECOND)]))
        out.append(chart(trace.t, [(readable(name), trace.inputs[:, k], SECOND)], INPUT_HEIGHT, unused))
    return "".join(f"<div>{part}</div>" for part in out if part)


def _head(trace: Trace) -> str:
    span = float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0
    return f"{len(trace.t):,} samples, {number(span, 's')} at {trace.dt:g} s"


def _about(trace: Trace) -> list[str]:
    inputs = ", ".join(map(readable, trace.input_names))
    time = f"time: {signal_text.time(of_trace(trace))}" if trace.t.size else "no samples"
    return [time, f"inputs: {inputs}", *signal_text.findings(trace.findings)]


def _rows(trace: Trace) -> list[tuple[str, ...]]:
    out = []
    for role, values in {"output": trace.output, **trace.signals}.items():
        known = np.asarray(values, float)
        known = known[np.isfinite(known)]
        share = f"{100.0 * known.size / max(len(values), 1):.0f} %"
        points = np.quantile(known, (0.0, 0.5, 1.0)).tolist() if known.size else []
        numbers = [number(x, digits=4) for x in points] or [DASH] * 3
        out.append((readable(role), role_unit(role) if role != "output" else "", share, *numbers))
    return out
