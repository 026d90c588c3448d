"""What the identified driver does after a step of an input, and over frequency, with the measured response."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from canid.mathematics.systems.drive_responses import DriveResponses
from canid.mathematics.systems.driver_response import Band, Complex, Response
from canid.mathematics.systems.measured_response import Measured
from canid.ui.views.drawing.figure import Figure, Spec, line, to_list
from canid.ui.views.drawing.grid import Tile, grid
from canid.ui.views.drive_report.estimates_over_time import COLORS, OTHER_COLOR
from canid.values.text.names import readable
from canid.values.text.numbers import gain_unit, number
from canid.values.types import Array, Identifiable

# px of a panel, and on a phone
PANEL_PX = (220, 150)
TICKS_HZ = (0.01, 0.03, 0.1, 0.3, 1)
# high over low end of a measured magnitude, above which it is no information
MOST_RATIO = 10.0
# largest range of a phase axis, degrees
MOST_PHASE = 540.0


def step_response(name: str, responses: DriveResponses, output: str) -> Figure | None:
    """A panel for each input; None: no method has a model.

    Args:
        name: id in the page.
        responses: of a drive.
        output: role of the driver's output.
    """
    tiles = [
        Tile(
            f"{readable(role)} ({gain_unit(output, role)}){_withheld(responses, role)}",
            [spec for method, at in _methods(responses, role) for spec in _banded(method, at.time, at.step)],
            {"hoverformat": ".2f"},
            {
                "zeroline": True,
                "zerolinecolor": "@rule",
                "range": _gain_range([at.step for _, at in _methods(responses, role)]),
            },
        )
        for role in _inputs(responses)
    ]
    if not tiles:
        return None
    figure = Figure(
        name,
        "Step response",
        "What the driver has added so many seconds after an input has changed by one unit and stays there: nothing until "
        "the dead time θ is over, 63 % of K another lag τ later, K in the end. Shaded: 95 % of FOPDT at each time.",
        f"Step response to {_listed(responses)} over seconds, with bands",
    )
    return grid(figure, tiles, ("time since the step (s)", ""), PANEL_PX)


def frequency_response(name: str, responses: DriveResponses, output: str) -> Figure | None:
    """Magnitude and phase of each input, one row each; None: no method has a model."""
    inputs = _inputs(responses)
    if not inputs:
        return None
    abscissa: Spec = {
        "type": "log", "tickvals": TICKS_HZ, "ticktext": [f"{f:g}" for f in TICKS_HZ], "tickangle": 0,
        "hoverformat": ".3g", "range": [-2.0, math.log10(2.0)],
    }  # fmt: skip
    tiles = []
    for role in inputs:
        methods, measured = _methods(responses, role), responses.measured.get(role)
        sizes = [at.magnitude for _, at in methods]
        data = [spec for method, at in methods for spec in _banded(method, at.frequency, at.magnitude)]
        data += [] if measured is None else [_dots(measured, measured.magnitude)]
        least = min(float(np.min(size.value)) for size in sizes) / 3.0
        most = max(float(np.nanmax([size.value, size.high])) for size in sizes) * 2.0
        ordinate: Spec = {"type": "log", "dtick": 1, "tickformat": "~g", "hoverformat": ".3g"}
        limits = [math.log10(max(least, 1e-6 * most)), math.log10(most)]
        tiles.append(
            Tile(
                f"{readable(role)}: magnitude ({gain_unit(output, role)})",
                data,
                abscissa,
                ordinate | {"range": limits},
            )
        )
    for role in inputs:
        methods, measured = _methods(responses, role), responses.measured.get(role)
        data = [spec for method, at in methods for spec in _banded(method, at.frequency, at.phase)]
        if measured is not None:
            data.append(_dots(measured, _near(measured, methods[0][1])))
        lowest = min(float(at.phase.value.min()) for _, at in methods)
        highest = max(float(at.phase.value.max()) for _, at in methods)
        low = max(lowest - 60.0, highest - MOST_PHASE)
        tiles.append(
            Tile(
                f"{readable(role)}: phase (°)", data, abscissa, {"dtick": 90, "range": [low, highest + 60.0]}
            )
        )
    figure = Figure(
        name,
        "Frequency response",
        _caption(responses),
        f"Magnitude and phase of the response to {_listed(responses)} over frequency, with bands",
    )
    return grid(figure, tiles, ("frequency (Hz)", ""), PANEL_PX, columns=len(inputs))


def poles_and_zeros(responses: DriveResponses) -> list[tuple[str, ...]]:
    """Rows: method, input, poles and zeros in the z plane, and the lag of each real pole."""
    return [
        (method.upper(), readable(role), _complex(at.poles), _complex(at.zeros), _lags(at))
        for method, inputs in responses.methods.items()
        for role, at in inputs.items()
    ]


def _caption(responses: DriveResponses) -> str:
    says = (
        "How large, and how much later, the driver's answer to a sine of an input is. A dead time turns the phase in "
        "proportion to the frequency, a lag by 90° at most. Shaded: 95 % of FOPDT at each frequency."
    )
    if not responses.measured:
        return f"{says} Measured: not shown, too few uninterrupted data."
    some = next(iter(responses.measured.values()))
    return (
        f"{says} Dots: measured, by a model of so many coefficients that it assumes no form (ARX over {some.samples} "
        "samples; bars: 95 %; none where its ends differ by a factor of ten)."
    )


def _inputs(responses: DriveResponses) -> list[str]:
    return list(dict.fromkeys(role for inputs in responses.methods.values() for role in inputs))


def _listed(responses: DriveResponses) -> str:
    return " and ".join(map(readable, _inputs(responses)))


def _methods(responses: DriveResponses, role: str) -> Sequence[tuple[str, Response]]:
    return [(method, inputs[role]) for method, inputs in _ordered(responses.methods) if role in inputs]


def _ordered(methods: Mapping[str, Mapping[str, Response]]) -> list[tuple[str, Mapping[str, Response]]]:
    """The wider bands first, so that the narrower are in front."""
    return sorted(methods.items(), key=lambda each: each[0] != "armax")


def _banded(method: str, x: Array, band: Band) -> list[Spec]:
    color = COLORS.get(method, OTHER_COLOR)
    there = to_list(x)
    region: Spec = {
        "type": "scatter", "mode": "lines", "x": [*there, *there[::-1]],
        "y": to_list(band.high) + to_list(band.low)[::-1], "fill": "toself", "fillcolor": f"@{color}", "opacity": 0.2,
        "line": {"width": 0, "color": f"@{color}"}, "name": f"{method.upper()}, 95 %", "legendgroup": f"{method}, 95 %",
        "hoverinfo": "skip",
    }  # fmt: skip
    curve = line(there, band.value, method.upper(), color) | {"line": {"color": f"@{color}", "width": 1.8}}
    return [region, curve] if np.isfinite(band.low).all() else [curve]


def _dots(measured: Measured, band: Band) -> Spec:
    size = measured.magnitude
    x, band = (
        measured.frequency,
        Band(*(np.where(size.high <= MOST_RATIO * size.low, end, math.nan) for end in band)),
    )
    bars: Spec = {
        "type": "data", "symmetric": False, "array": to_list(band.high - band.value),
        "arrayminus": to_list(band.value - band.low), "width": 0, "thickness": 1, "color": "@measured",
    }  # fmt: skip
    return {
        "type": "scatter", "mode": "markers", "x": to_list(x), "y": to_list(band.value), "error_y": bars,
        "marker": {"color": "@measured", "size": 5}, "name": "measured", "legendgroup": "measured",
    }  # fmt: skip


def _near(measured: Measured, model: Response) -> Band:
    """The measured phase on the branch of the model's."""
    at = np.interp(measured.frequency, model.frequency, model.phase.value)
    turns = 360.0 * np.round((at - measured.phase.value) / 360.0)
    return Band(*(x + turns for x in measured.phase))


def _gain_range(bands: Sequence[Band]) -> list[float]:
    """What the curves need and twice as much of the bands, which may be much wider."""
    low = min(min(float(band.value.min()), 0.0) for band in bands)
    high = max(max(float(band.value.max()), 0.0) for band in bands)
    known = [band for band in bands if np.isfinite(band.low).all()]
    least = min([low, *(float(band.low.min()) for band in known)])
    most = max([high, *(float(band.high.max()) for band in known)])
    width = high - low
    return [max(least, low - width) - 0.05 * width, min(most, high + width) + 0.05 * width]


def _withheld(responses: DriveResponses, role: str) -> str:
    """What may not be quoted of an input, by any method."""
    status = {at.status for _, at in _methods(responses, role)}
    if status == {Identifiable.NOT}:
        return ": not to be quoted"
    known = status & {Identifiable.OK, Identifiable.SUM_ONLY}
    return "" if known else ": its delay not to be quoted"


def _complex(values: Complex) -> str:
    return (
        ", ".join(f"{z.real:.3f}{z.imag:+.3f}j" if abs(z.imag) > 1e-9 else f"{z.real:.3f}" for z in values)
        or "–"
    )


def _lags(response: Response) -> str:
    """−dt / ln of each real pole between 0 and 1."""
    lags = [
        -response.dt / math.log(z.real) for z in response.poles if abs(z.imag) < 1e-9 and 0.0 < z.real < 1.0
    ]
    return ", ".join(number(lag, "s") for lag in lags) or "–"
