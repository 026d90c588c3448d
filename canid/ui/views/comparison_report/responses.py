"""What both drivers do after a step of an input, and over frequency, in one panel: A and B with their 95 % bands."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from canid.analysis.comparison.comparison import Comparison
from canid.analysis.comparison.drive import DriveEstimates
from canid.mathematics.systems.driver_response import (
    FREQUENCIES_HZ,
    STEP_POINTS,
    STEP_S,
    Band,
    responses_of_draws,
)
from canid.ui.views.document.document import Drawing
from canid.ui.views.drawing.level_panel import level
from canid.ui.views.drawing.svg import Scale, element, scale, svg, text, ticks
from canid.values.text.names import readable
from canid.values.text.numbers import gain_unit
from canid.values.types import Array

WIDTH, HEIGHT, TOP, BOTTOM = 332.0, 210.0, 26.0, 34.0
LEFT, RIGHT = 52.0, 14.0
# drives of a side that are drawn
MAX_DRIVES = 3
TICKS_HZ = (0.01, 0.1, 1.0)
CAPTION = (
    "A (orange) and B (blue), FOPDT with the 95 % band of each at one time or frequency. Left: what the driver has added so "
    "many seconds after the input has changed by one unit. Then: how large, and how much later, the answer to a sine is."
)


def responses(comparison: Comparison) -> list[Drawing]:
    """A row of three panels for each input that both sides answer; none where a side has no joint posterior.

    Example:
        >>> from canid.analysis.comparison.drive import Side
        >>> responses(Comparison(Side("A", ()), Side("B", ()), "", (), (), (), (), 0.0, None))
        []
    """
    sides = [
        (kind, drive)
        for kind, side in (("a", comparison.a), ("b", comparison.b))
        for drive in side.drives[:MAX_DRIVES]
    ]
    known = [(kind, drive) for kind, drive in sides if drive.draws is not None]
    outputs = {drive.output for _, drive in known}
    # of a gain in %/(m/s) and one in 1/s no difference can be seen
    if {kind for kind, _ in known} != {"a", "b"} or len(outputs) != 1:
        return []
    out: list[Drawing] = []
    for name in dict.fromkeys(
        name for _, drive in known for name in (drive.draws.inputs if drive.draws else ())
    ):
        drawn = [(kind, bands) for kind, drive in known if (bands := _bands(drive, name)) is not None]
        if {kind for kind, _ in drawn} == {"a", "b"}:
            unit = gain_unit(outputs.copy().pop(), name)
            out.append(
                Drawing(
                    _row(drawn, unit),
                    f"Response to {readable(name)}{_withheld(known, name)}",
                    CAPTION if not out else "",
                )
            )
    return out


def _withheld(known: Sequence[tuple[str, DriveEstimates]], name: str) -> str:
    """Of which sides the gain may not be quoted: their curves are given for what they are worth."""
    sides = [
        kind.upper()
        for kind, drive in known
        if (K := drive.quantities.get(f"{name} K")) is not None and K.why
    ]
    return f" (not to be quoted: {' and '.join(dict.fromkeys(sides))})" if sides else ""


def _bands(drive: DriveEstimates, name: str) -> tuple[Band, Band, Band] | None:
    drawn = drive.draws
    if drawn is None or name not in drawn.inputs:
        return None
    k = drawn.inputs.index(name)
    return responses_of_draws(drawn.K[:, k], drawn.tau[:, k], drawn.dead_time[:, k])


def _row(drawn: list[tuple[str, tuple[Band, Band, Band]]], unit: str) -> Markup:
    seconds, logs = np.linspace(0.0, STEP_S, STEP_POINTS), np.log10(FREQUENCIES_HZ)
    of_time = [(t, f"{t:.0f} s") for t in ticks(0.0, STEP_S, 6)]
    of_frequency = [(math.log10(f), f"{f:g} Hz") for f in TICKS_HZ]
    heads = (f"step ({unit})", f"magnitude ({unit})", "phase (°)")
    return Markup("").join(
        _panel(
            [(kind, bands[k]) for kind, bands in drawn],
            seconds if k == 0 else logs,
            of_frequency if k else of_time,
            head,
        )
        for k, head in enumerate(heads)
    )


def _panel(drawn: list[tuple[str, Band]], at: Array, marks: list[tuple[float, str]], head: str) -> Markup:
    """A panel; what is far outside of both curves of a wide band is cut off."""
    curves = np.concatenate([band.value for _, band in drawn] + [np.zeros(1)])
    low, high = float(curves.min()), float(curves.max())
    spare = 0.5 * (high - low)
    ends = np.concatenate([end for _, band in drawn for end in (band.low, band.high)])
    shown = np.clip(ends, low - spare, high + spare)
    x = Scale(float(at[0]), float(at[-1]), LEFT, WIDTH - RIGHT)
    y = scale([low, high, *shown], HEIGHT - BOTTOM, TOP, 0.04)
    assert y is not None  # the curves are finite
    parts = [text(head, LEFT, 15, "head")]
    for value in ticks(y.low, y.high, 6):
        parts.append(element("line", "grid", x1=x.start, x2=x.stop, y1=y(value), y2=y(value)))
        parts.append(text(f"{value:g}", x.start - 6, y(value) + 4, "tick", "end"))
    for value, words in marks:
        parts.append(text(words, x(value), y.start + 16, "tick", "middle"))
    for kind, band in drawn:
        parts += level(at, band.value, band.low, band.high, x, y, kind)
    return svg(parts, WIDTH, HEIGHT, f"{head}: A and B")
