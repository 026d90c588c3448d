"""A `Trace` as text and as a fragment: what it holds, the range of every signal, and the output over time."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from canid.signals.signal_checks.drive_time import of_trace, usable
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.ui.views import signal_text
from canid.ui.views.document.document import Block, Listing, Table
from canid.ui.views.document.document_text import lines
from canid.ui.views.notebook.fragment import ACCENT, SECOND, chart, charted, fragment
from canid.values.runs import runs
from canid.values.text.names import readable
from canid.values.text.numbers import DASH, number, role_unit
from canid.values.types import Trace

HEAD = ("signal", "unit", "measured", "low", "median", "high")
# curves of a small figure
SHOWN_INPUTS = 2
# px
INPUT_HEIGHT = 56


def trace_blocks(trace: Trace) -> list[Block]:
    """What it holds."""
    return [Listing([_head(trace), *_about(trace)]), Table(HEAD, _rows(trace))]


def trace_text(trace: Trace) -> list[str]:
    """The text of `Trace.summary()`."""
    return lines(trace_blocks(trace))


def trace_html(trace: Trace) -> Markup:
    """The fragment of a trace; grey: not used for identification."""
    return fragment(
        f"Trace: {_head(trace)}", Listing(_about(trace)), trace_charts(trace), Table(HEAD, _rows(trace))
    )


def trace_charts(trace: Trace) -> Markup:
    """Output and inputs over time, small."""
    unused = [(float(trace.t[a]), float(trace.t[b - 1])) for a, b in runs(~usable(with_limits(trace)))]
    drawn = [charted([("output", ACCENT)], chart(trace.t, [("output", trace.output, ACCENT)], shaded=unused))]
    for k, name in enumerate(trace.input_names[:SHOWN_INPUTS]):
        curve = chart(trace.t, [(readable(name), trace.inputs[:, k], SECOND)], INPUT_HEIGHT, unused)
        drawn.append(charted([(f"{readable(name)} ({role_unit(name)})", SECOND)], curve))
    return Markup("").join(drawn)


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
