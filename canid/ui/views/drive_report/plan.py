"""Where a drive went, as a plan without a map: east and north of its beginning, colored by gap, residual and K."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from canid.analysis.drive.drive_series import DriveSeries
from canid.mathematics.identification.identifiability import quotable
from canid.ui.views.drawing.figure import Figure, Spec, times, to_list
from canid.ui.views.drawing.grid import Tile, grid
from canid.values.text.names import readable
from canid.values.text.numbers import gain_unit, number, role_unit
from canid.values.types import Array, Estimate, Status, Trace

# m, mean radius of the earth (IUGG); a drive is small against it
EARTH_RADIUS_M = 6_371_008.8
# points of a plan: a screen shows no more of a line
MAX_POINTS = 1200
# m that a drive must extend: below it the plan is the noise of the receiver
LEAST_M = 20.0
# share of the values between which the colors lie: single peaks would leave all else in one color
COLORED = (2.0, 98.0)
HEIGHTS_PX = (250, 125)
SAME_SCALE = {"scaleanchor": "x", "scaleratio": 1}
# between blue and red; grey means that nothing is known
MIDDLE = "#c9a227"


def positions(signals: Mapping[str, Array]) -> tuple[Array, Array] | None:
    """East and north in m of the first position: as measured, or from latitude and longitude; None without either.

    Args:
        signals: by role, each (n,).

    Example:
        >>> east, north = positions({"lat": np.array([48.0, 48.001]), "lon": np.array([11.0, 11.0])})
        >>> east.round(1).tolist(), north.round(1).tolist()
        ([0.0, 0.0], [0.0, 111.2])
    """
    if "east" in signals and "north" in signals:
        east, north = signals["east"], signals["north"]
    elif "lat" in signals and "lon" in signals:
        lat, lon = np.radians(signals["lat"]), np.radians(signals["lon"])
        known = np.isfinite(lat) & np.isfinite(lon)
        if not known.any():
            return None
        # equirectangular: within 0.1 % over 50 km
        east, north = EARTH_RADIUS_M * math.cos(float(lat[known].mean())) * lon, EARTH_RADIUS_M * lat
    else:
        return None
    here = np.flatnonzero(np.isfinite(east) & np.isfinite(north))
    return (east - east[here[0]], north - north[here[0]]) if here.size else None


def plan(
    name: str, trace: Trace, series: DriveSeries | None, windows: Sequence[Estimate], output: str
) -> Figure | None:
    """The track, once for each of gap, residual and K that is known along it; None where no position is.

    Args:
        name: id in the page.
        trace: of the drive.
        series: the simulation, for the residual; None: there is no model.
        windows: estimates along the drive.
        output: role of the driver's output.
    """
    position = positions(trace.signals)
    if position is None:
        return None
    east, north = position
    here = np.isfinite(east) & np.isfinite(north)
    if max(np.ptp(east[here]), np.ptp(north[here])) < LEAST_M:
        return None
    rows = np.flatnonzero(here)[:: max(math.ceil(int(here.sum()) / MAX_POINTS), 1)]
    colored = [
        (title, unit, value[rows])
        for title, unit, value in _values(trace, series, windows, output)
        if np.isfinite(value[rows]).any()
    ]
    place = (trace.t[rows], east[rows], north[rows])
    tiles = [_tile(k, place, *values) for k, values in enumerate(colored)] or [
        _tile(0, place, "track", "", None)
    ]
    shown = ", ".join(title for title, _, _ in colored)
    caption = (
        "A plan without a map: north is up, both axes have the same scale. Colors go from blue to red between the two "
        "numbers in the title; grey: not known there. The ring is where the drive begins, the dot where the cursor of the "
        "other plots is."
    )
    figure = Figure(name, "Where it was", caption, f"The track in the plane, colored by {shown or 'nothing'}")
    return grid(figure, tiles, ("east (m)", "north (m)"), HEIGHTS_PX, showlegend=False)


def _values(
    trace: Trace, series: DriveSeries | None, windows: Sequence[Estimate], output: str
) -> list[tuple[str, str, Array]]:
    out = [("gap", "m", trace.signals["gap"])] if "gap" in trace.signals else []
    if series is not None and len(series.t) == len(trace.t):
        residual = np.where(series.used, series.measured - series.simulated, np.nan)
        out.append((f"residual of the {readable(output)}", role_unit(output), residual))
    name = trace.input_names[-1]
    known = [
        (window.t, window.channels[name].K.value)
        for window in windows
        if window.estimator == "fopdt" and window.status is Status.OK and name in window.channels
        and quotable(window.channels[name], "K")
    ]  # fmt: skip
    if len(known) > 1:
        t, K = map(np.array, zip(*known, strict=True))
        along = np.interp(trace.t, t, K, left=np.nan, right=np.nan)
        out.append((f"K of {readable(name)}", gain_unit(output, name), along))
    return out


def _tile(k: int, place: tuple[Array, Array, Array], title: str, unit: str, value: Array | None) -> Tile:
    t, east, north = place
    path: Spec = {
        "type": "scatter", "mode": "lines", "x": to_list(east), "y": to_list(north), "hoverinfo": "skip", "name": "path",
        "line": {"color": "@bar", "width": 1}, "showlegend": False,
    }  # fmt: skip
    begin = path | {"mode": "markers", "x": to_list(east[:1]), "y": to_list(north[:1]), "name": "beginning"}
    begin["marker"] = {"symbol": "circle-open", "size": 13, "color": "@ink"}
    data = [path, begin]
    if value is not None:
        known = np.isfinite(value)
        low, high = np.percentile(value[known], COLORED)
        title = f"{title}, {number(float(low))} to {number(float(high), unit)}"
        data.append(
            path
            | {
                "mode": "markers", "x": to_list(east[known]), "y": to_list(north[known]), "name": "drive",
                "customdata": times(t[known]), "text": to_list(value[known]), "hoverinfo": "text",
                "hovertemplate": "%{customdata} s: %{text}<extra></extra>",
                "marker": {"size": 5, "color": to_list(value[known]), "cmin": float(low), "cmax": float(high),
                           "colorscale": [[0.0, "@low"], [0.5, MIDDLE], [1.0, "@high"]]},
            }
        )  # fmt: skip
    # one zoom for all of them
    return Tile(title, data, {"matches": "x"}, {"matches": "y"}) if k else Tile(title, data, y=SAME_SCALE)
