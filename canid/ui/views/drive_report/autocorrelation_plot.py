"""Autocorrelation of the whitened residual with the 99 % bound of white noise, lag by lag."""

from __future__ import annotations

import numpy as np

from canid.analysis.drive.drive_series import Autocorrelation
from canid.ui.views.drawing.figure import Figure, threshold_line, times, to_list
from canid.ui.views.drawing.grid import Tile, grid
from canid.values.text.numbers import number
from canid.values.types import ResidualTests

# of the panel, and on a phone
HEIGHT_PX = (170, 170)


def autocorrelation_plot(name: str, correlation: Autocorrelation, tests: ResidualTests | None) -> Figure:
    """Bars of the autocorrelation; dashed, the bound that one lag in a hundred of white noise exceeds."""
    beyond = np.abs(correlation.r) > correlation.bound
    bars = {
        "type": "bar", "x": times(correlation.lag), "y": to_list(correlation.r), "name": "autocorrelation",
        "showlegend": False, "marker": {"color": ["@bad" if is_beyond else "@after" for is_beyond in beyond]},
        "hovertemplate": "lag %{x} s: %{y:.3f}<extra></extra>",
    }  # fmt: skip
    at = [sign * correlation.bound for sign in (-1.0, 1.0)]
    shapes = [threshold_line(xref="paper", yref="y", x0=0, x1=1, y0=y, y1=y) for y in at]
    most = 1.2 * max(float(np.max(np.abs(correlation.r), initial=0.0)), correlation.bound)
    ordinate = {"range": [-most, most], "zeroline": True, "zerolinecolor": "@rule"}
    tile = Tile(
        "autocorrelation",
        [bars],
        {"range": [0.0, float(correlation.lag[-1] + correlation.lag[0] / 2)]},
        ordinate,
    )
    outside = f"{int(beyond.sum())} of {len(correlation.r)} bars reach beyond"
    tested = ""
    if tests is not None and tests.statistic == tests.statistic:
        tested = (
            f" Ljung–Box over all of them: {number(tests.statistic)}, bound {number(tests.bound)} (99 %): "
            f"{'white' if tests.white else 'not white'}."
        )
    figure = Figure(
        name,
        "Is the residual white?",
        f"Dashed: ±{number(correlation.bound)}, which white noise exceeds at one bar in a hundred; {outside}.{tested}",
        f"Bars of the residual's autocorrelation over {len(correlation.r)} lags up to "
        f"{number(float(correlation.lag[-1]))} s, with bounds",
    )
    titles = ("time between the samples (s)", "")
    return grid(figure, [tile], titles, HEIGHT_PX, shapes=shapes, bargap=0.4)
