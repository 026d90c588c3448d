"""Power spectrum of the residual, and its coherence with each input."""

from __future__ import annotations

import math

import numpy as np

from canid.ui.views.drawing.figure import Figure, Spec, line, to_list
from canid.ui.views.drawing.grid import Tile, grid
from canid.values.findings import Flags, Report, Spectra, extends
from canid.values.runs import runs
from canid.values.text.names import readable
from canid.values.text.numbers import number, role_unit
from canid.values.types import Array

# px of a panel, and on a phone
PANEL_PX = (220, 105)
FREQUENCY_TICKS_HZ = (0.01, 0.03, 0.1, 0.3, 1, 3)
# least upper end of a coherence axis, so that noise does not appear large
MIN_COHERENCE_RANGE = 0.4
# bands that the caption names: the widest
BANDS_SHOWN = 3


def spectra(report: Report) -> Figure | None:
    """One panel for the spectrum and one per input; None where nothing was computed."""
    spectrum = report.spectra
    if spectrum is None or not (spectrum.frequency > 0).any():
        return None
    names = [readable(name) for name in spectrum.coherence_before]
    up = spectrum.frequency > 0  # a logarithm has no zero
    x = to_list(spectrum.frequency[up])
    abscissa: Spec = {
        "type": "log", "range": [math.log10(spectrum.frequency[up][0]), math.log10(spectrum.frequency[-1])],
        "tickvals": FREQUENCY_TICKS_HZ, "ticktext": [f"{f:g}" for f in FREQUENCY_TICKS_HZ], "tickangle": 0,
        "hoverformat": ".3g",
    }  # fmt: skip
    decades: Spec = {"type": "log", "dtick": 1, "tickformat": "~g", "hoverformat": ".2g"}
    tiles = [
        Tile(
            f"power ({density_unit(role_unit(report.output))})",
            _pair(report, x, spectrum.before[up], spectrum.after[up]), abscissa, decades,
        )
    ]  # fmt: skip
    shares: Spec = {"range": [0, _coherence_range(spectrum)], "hoverformat": ".2g"}
    pairs = zip(names, spectrum.coherence_before.values(), spectrum.coherence_after.values(), strict=True)
    for name, before, after in pairs:
        lines = _pair(report, x, before[up], after[up])
        tiles.append(
            Tile(f"coherence with {name}", lines, abscissa | {"matches": "x"}, shares, spectrum.level)
        )
    alt = f"Spectrum of the residual, and its coherence with {', '.join(names) or 'no input'}, over frequency"
    figure = Figure("spectra", "Residual over frequency", _caption(report, spectrum), alt)
    return grid(figure, tiles, ("frequency (Hz)", ""), PANEL_PX)


def density_unit(unit: str) -> str:
    """Unit of a power spectral density.

    Example:
        >>> density_unit("%"), density_unit("m/s²")
        ('%²/Hz', '(m/s²)²/Hz')
    """
    return f"{unit}²/Hz" if len(unit) < 2 else f"({unit})²/Hz"


def _coherence_range(spectrum: Spectra) -> float:
    """Upper end of the coherence axes: just above the largest coherence, at most 1."""
    up = spectrum.frequency > 0
    rows = [row[up] for row in (*spectrum.coherence_before.values(), *spectrum.coherence_after.values())]
    largest = [1.1 * float(np.nanmax(row)) for row in rows if np.isfinite(row).any()]
    return min(max([MIN_COHERENCE_RANGE, *largest]), 1.0)


def _pair(report: Report, x: list[float], before: Array, after: Array) -> list[Spec]:
    if not extends(report):
        return [line(x, before, "simulation", "before")]
    return [line(x, before, "baseline", "before"), line(x, after, "extended model", "after")]


def _caption(report: Report, spectrum: Spectra) -> str:
    up = spectrum.frequency > 0
    frequency = spectrum.frequency[up]
    sides = ["the simulation", ""] if not extends(report) else ["the baseline", "the extended model"]
    compared = f"the residual (measured − simulated) of {' and of '.join(filter(None, sides))}"
    sentences = []
    for name, before in spectrum.coherence_before.items():
        text = f"{readable(name).capitalize()}: {_bands(frequency, before[up] > spectrum.level)}"
        if extends(report):
            text += f"; with the extended model {_bands(frequency, spectrum.coherence_after[name][up] > spectrum.level)}"
        sentences.append(text + ".")
    total = [
        number(float(np.sqrt(np.trapezoid(s[up], frequency))), role_unit(report.output))
        for s in (spectrum.before, spectrum.after)
    ]
    power = " → ".join(total if extends(report) else total[:1])
    return (
        f"Power of {compared}, and its squared coherence with each measured input: the share of its power at a frequency "
        "that follows the input linearly (0 to 1, no unit). "
        f"Dashed: {number(spectrum.level)}, which independent signals exceed at about 1 % of the frequencies. "
        f"{' '.join(sentences)} Coherence alone shows no error of the model: the driver is in a feedback loop, so that his "
        "own noise moves the car and with it the inputs. Whether more is left than that is decided by the adequacy tests "
        f"under Checks. From {number(float(frequency[0]), 'Hz')} to {number(float(frequency[-1]), 'Hz')} the residual has "
        f"{power} rms; samples that the fit does not use count as 0, and slower changes are not in it."
    )


def _bands(frequency: Array, above: Flags) -> str:
    """The bands in which it is above; where there are none, at how many single frequencies, which may be chance.

    Example:
        >>> _bands(np.array([0.1, 0.2, 0.3, 0.4]), np.array([False, True, True, False]))
        'above it at 0.2–0.3 Hz'
        >>> _bands(np.array([0.1, 0.2, 0.3, 0.4]), np.array([False, True, False, True]))
        'above it at 2 single frequencies alone, next to none of their neighbours'
    """
    bands = [(frequency[a], frequency[b - 1]) for a, b in runs(above, longer_than=1)]
    if not bands:
        single = int(above.sum())
        frequencies = f"{single} single {'frequencies' if single > 1 else 'frequency'}"
        return (
            f"above it at {frequencies} alone, next to none of their neighbours"
            if single
            else "nowhere above it"
        )
    widest = sorted(sorted(bands, key=lambda band: band[0] - band[1])[:BANDS_SHOWN])
    more = f" and in {len(bands) - BANDS_SHOWN} narrower bands" if len(bands) > BANDS_SHOWN else ""
    return "above it at " + ", ".join(f"{a:.2g}–{b:.2g} Hz" for a, b in widest) + more
