"""Autocorrelation of the whitened residual with the 99 % bound of white noise, lag by lag."""

from __future__ import annotations

import numpy as np

from canid.drive_series import Autocorrelation
from canid.types import ResidualTests
from canid.views.numbers import number
from canid.views.report.figure import (
    MARGIN_PX,
    NARROW_MARGIN_PX,
    Figure,
    axis,
    layout,
    threshold_line,
    times,
    to_list,
)

HEIGHT_PX = 230


def autocorrelation_plot(name: str, of: Autocorrelation, tests: ResidualTests | None) -> Figure:
    """Bars of the autocorrelation; dashed, the bound that one lag in a hundred of white noise exceeds."""
    beyond = np.abs(of.r) > of.bound
    bars = {
        "type": "bar", "x": times(of.lag), "y": to_list(of.r), "name": "autocorrelation", "showlegend": False,
        "marker": {"color": ["@bad" if one else "@after" for one in beyond]},
        "hovertemplate": "lag %{x} s: %{y:.3f}<extra></extra>",
    }  # fmt: skip
    shapes = [
        threshold_line(xref="paper", yref="y", x0=0, x1=1, y0=sign * of.bound, y1=sign * of.bound)
        for sign in (-1.0, 1.0)
    ]
    most = 1.2 * max(float(np.max(np.abs(of.r), initial=0.0)), of.bound)
    axes = {
        "xaxis": axis("lag (s)", range=[0.0, float(of.lag[-1] + of.lag[0] / 2)]),
        "yaxis": axis("autocorrelation (1)", range=[-most, most], zeroline=True, zerolinecolor="@rule"),
    }
    outside = f"{int(beyond.sum())} of {len(of.r)} lags are beyond it"
    tested = ""
    if tests is not None and tests.statistic == tests.statistic:
        tested = (
            f" Ljung–Box over all of them: {number(tests.statistic)}, bound {number(tests.bound)} (99 %): "
            f"{'white' if tests.white else 'not white'}."
        )
    return Figure(
        name,
        "Is the residual white?",
        f"Dashed: ±{number(of.bound)}, which white noise exceeds at one lag in a hundred; {outside}.{tested}",
        f"Bars of the residual's autocorrelation over {len(of.r)} lags up to {number(float(of.lag[-1]))} s, with bounds",
        HEIGHT_PX,
        [bars],
        layout(axes, shapes=shapes, bargap=0.4, margin=MARGIN_PX | {"t": 16}),
        (HEIGHT_PX, {"margin": NARROW_MARGIN_PX | {"t": 16}}),
    )
