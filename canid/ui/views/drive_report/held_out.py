"""Measured against simulated on the part of a drive that the models have not seen."""

from __future__ import annotations

import numpy as np

from canid.analysis.drive.held_out_simulation import HeldOut
from canid.ui.views.drawing.figure import Figure
from canid.ui.views.drawing.panels import Panel, signal, stack, titled
from canid.ui.views.drive_report.estimates_over_time import COLORS, OTHER_COLOR
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit
from canid.values.types import Trace


def held_out_simulation(
    name: str, trace: Trace, rest: HeldOut | None, output: str, most: int
) -> Figure | None:
    """The output and each method's simulation over the rest of the drive; None: there is no rest.

    Args:
        name: id in the page.
        trace: of the whole drive.
        rest: what models of its first part make of the rest.
        output: role of the driver's output.
        most: points of a line.
    """
    if rest is None:
        return None
    late = trace.t >= rest.since
    lines = [signal(trace.t[late], trace.output[late], "measured", "measured", most)]
    lines += [
        signal(
            series.t,
            series.simulated,
            f"{method.upper()}, of the first part",
            COLORS.get(method, OTHER_COLOR),
            most,
        )
        for method, series in rest.methods.items()
    ]
    fits = ", ".join(
        f"{method.upper()} {number(series.fit_percent, '%')}" for method, series in rest.methods.items()
    )
    worse = any(series.fit_percent < 0.0 for series in rest.methods.values())
    caption = (
        f"Models of the first two thirds of the usable time, simulated from the inputs alone over the rest, from "
        f"{number(rest.since, 's')} on: fit {fits}. Nothing is fitted to the rest, the constant neither, so that a pedal "
        f"that drifts counts as an error{'; below 0 %: worse than the mean of the rest would be' if worse else ''}."
    )
    span = (rest.since, float(trace.t[-1])) if np.isfinite(rest.since) else (0.0, 1.0)
    panel = Panel(titled(output, role_unit(output)), lines, 170)
    return stack(
        name, f"{readable(output).capitalize()} on data that were not used", caption, [panel], span=span
    )
