"""Inputs, output, simulation of the identified model and residual over the drive."""

from __future__ import annotations

import numpy as np

from canid.analysis.drive.drive_series import DriveSeries
from canid.signals.signal_checks.drive_time import trusted, usable
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.ui.views.drawing.figure import Figure, Spec, rms
from canid.ui.views.drawing.panels import Panel, shade, signal, stack, titled
from canid.values.text.names import readable
from canid.values.text.numbers import fit_text, number, role_unit
from canid.values.types import Trace


def model_over_time(
    name: str, trace: Trace, series: DriveSeries | None, output: str, fit_percent: float, most: int
) -> Figure | None:
    """Inputs above, then the output with its simulation, and what is left.

    Args:
        name: id in the page.
        trace: of the drive.
        series: the simulation; None: there is no model.
        output: role of the driver's output.
        fit_percent: of the simulation.
        most: points of a line.

    Returns:
        None where the drive has no samples.
    """
    if not len(trace.t):
        return None
    unit = role_unit(output)
    panels = [
        Panel(titled(role, role_unit(role)), [signal(trace.t, u, readable(role), "muted", most)], 95)
        for role, u in zip(trace.input_names, trace.inputs.T, strict=True)
        if np.isfinite(u).any()
    ]
    panels = [panel._replace(data=[panel.data[0] | {"showlegend": False}]) for panel in panels]
    measured = signal(trace.t, trace.output, "measured", "measured", most)
    caption = f"{readable(output).capitalize()} ({unit}) and the inputs that it answers, as sampled."
    if series is None:
        panels.append(Panel(titled(output, unit), [measured], 170))
    else:
        left = np.where(series.used, series.measured - series.simulated, np.nan)
        shown = np.where(series.used, series.simulated, np.nan)
        simulated = signal(series.t, shown, "simulated from the inputs alone", "after", most)
        panels.append(
            Panel(
                titled(output, unit),
                [measured, simulated],
                170,
            )
        )
        residual = signal(series.t, left, "residual", "after", most, showlegend=False)
        panels.append(
            Panel(titled("residual", unit), [residual], 95, more={"zeroline": True, "zerolinecolor": "@rule"})
        )
        caption = (
            f"The model of {series.estimator.upper()} is simulated from the inputs alone, never from past values of the "
            f"output: fit {fit_text(fit_percent)}, residual {number(rms(left), unit)} rms over the "
            f"{number(float(series.used.sum()) * _step(series.t), 's')} for which the model has the inputs before."
        )
    shapes = unused(trace)
    if shapes:
        caption += (
            " Grey: not used for identification (the gates below say why), dark grey: a signal is wrong."
        )
    if len(trace.t) > most:
        caption += " Lines are thinned to the extremes of each bucket."
    span = (float(trace.t[0]), float(trace.t[-1]))
    return stack(name, "Inputs, output and simulation", caption, panels, span=span, shapes=shapes)


def unused(trace: Trace) -> list[Spec]:
    """Stretches that are not used for identification, and those in which a signal is wrong, behind the lines."""
    trace = with_limits(trace)
    sound = trusted(trace.t, trace.findings)
    return [
        *shade(trace.t, ~usable(trace) & sound, trace.dt, "not used", "shade-unused"),
        *shade(trace.t, ~sound, trace.dt, "a signal is wrong", "shade-mask"),
    ]


def _step(t: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.0
