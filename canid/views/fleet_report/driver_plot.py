"""Drivers side by side: caterpillar plot of one parameter, own and shrunken estimates, as SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from canid.fleet_summary import Driver, Parameter, Population
from canid.types import Interval
from canid.views.comparison_report.drawing import element, svg, text
from canid.views.fleet_report.labels import label, short
from canid.views.numbers import number

WIDTH, ROW, TOP, BOTTOM = 430.0, 17.0, 10.0, 24.0
# px from the left: names end; intervals lie between
NAMES, PLACE = 118.0, (128.0, 420.0)
# characters of a name: what the place for names holds at 12 px
NAME_LENGTH = 18
# drivers that are drawn one by one; of more the ends alone, and the distribution of all
MAX_DRIVERS, AT_EACH_END = 40, 12


class _Scale(NamedTuple):
    low: float
    high: float

    def x(self, value: float) -> float:
        inside = min(max(value, self.low), self.high)
        return PLACE[0] + (PLACE[1] - PLACE[0]) * (inside - self.low) / (self.high - self.low)


def ranked(of: Population, name: str) -> list[Driver]:
    """The drivers whose shrunken estimate is known, the largest first."""
    known = [d for d in of.drivers if name in d.shrunken and math.isfinite(d.shrunken[name].value)]
    return sorted(known, key=lambda d: (-d.shrunken[name].value, d.name))


def driver_plot(of: Population, parameter: Parameter) -> Markup:
    """Draw the drivers; empty where none is known."""
    drivers = ranked(of, parameter.name)
    if not drivers:
        return Markup("")
    left_out = len(drivers) - 2 * AT_EACH_END if len(drivers) > MAX_DRIVERS else 0
    rows: list[Driver | None] = [*drivers]
    if left_out:
        rows = [*drivers[:AT_EACH_END], None, *drivers[-AT_EACH_END:]]
    shown = [d for d in rows if d is not None]
    scale = _scale(parameter, shown)
    bottom = TOP + ROW * len(rows)
    parts = [*_population(parameter, scale, bottom), *_ticks(scale, bottom)]
    for k, driver in enumerate(rows):
        y = TOP + ROW * (k + 0.5)
        if driver is None:
            words = f"{left_out:,} drivers between"
            parts.append(text(words, (PLACE[0] + PLACE[1]) / 2, y + 4, "tick", "middle"))
            continue
        parts.append(text(short(driver.name, NAME_LENGTH), NAMES, y + 4, "name", "end"))
        own = driver.own.get(parameter.name, Interval())
        parts += _interval(own, scale, y + 3.0, "own", 2.2)
        parts += _interval(driver.shrunken[parameter.name], scale, y - 2.5, "shrunken", 3.2)
    alt = (
        f"{label(parameter.name)} of {len(drivers):,} drivers, from "
        f"{number(drivers[-1].shrunken[parameter.name].value)} to {number(drivers[0].shrunken[parameter.name].value)}"
    )
    return svg(parts, WIDTH, bottom + BOTTOM, alt)


def distribution(of: Population, parameter: Parameter) -> Markup:
    """Histogram of all drivers' shrunken estimates; empty where the drivers are drawn one by one."""
    values = [d.shrunken[parameter.name].value for d in ranked(of, parameter.name)]
    if len(values) <= MAX_DRIVERS:
        return Markup("")
    height, bottom = 130.0, 106.0
    scale = _scale(parameter, ranked(of, parameter.name))
    # Freedman & Diaconis 1981 gives some 20 of 500 drivers
    counts, edges = np.histogram(values, bins=24, range=(scale.low, scale.high))
    parts = [*_population(parameter, scale, bottom), *_ticks(scale, bottom)]
    highest = max(int(counts.max()), 1)
    for count, left, right in zip(counts, edges[:-1], edges[1:], strict=True):
        tall = (bottom - TOP) * count / highest
        if count:
            parts.append(
                element(
                    "rect",
                    "bar",
                    x=scale.x(float(left)) + 0.5,
                    y=bottom - tall,
                    width=scale.x(float(right)) - scale.x(float(left)) - 1.0,
                    height=tall,
                )
            )
    parts.append(text(f"{highest:,}", NAMES, TOP + 8, "tick", "end"))
    parts.append(text("drivers", NAMES, TOP + 22, "tick", "end"))
    return svg(parts, WIDTH, height, f"distribution of {label(parameter.name)} over {len(values):,} drivers")


def _scale(parameter: Parameter, drivers: Sequence[Driver]) -> _Scale:
    """What the shrunken intervals need; own estimates that are hardly known may end outside."""
    ends = [x for d in drivers for x in d.shrunken[parameter.name] if math.isfinite(x)]
    ends += [x for x in parameter.new_driver if math.isfinite(x)] if len(drivers) > 2 else []
    low, high = min(ends), max(ends)
    if not high > low:
        low, high = low - 1.0, high + 1.0
    return _Scale(low - 0.05 * (high - low), high + 0.05 * (high - low))


def _population(parameter: Parameter, scale: _Scale, bottom: float) -> list[str]:
    """The range of a new driver, and the population's mean."""
    parts = []
    ends = (parameter.new_driver.low, parameter.new_driver.high)
    if all(map(math.isfinite, ends)):
        left, right = map(scale.x, ends)
        parts.append(element("rect", "range", x=left, y=TOP, width=right - left, height=bottom - TOP))
    if math.isfinite(parameter.mean.value):
        x = scale.x(parameter.mean.value)
        parts.append(element("line", "zero", x1=x, x2=x, y1=TOP, y2=bottom))
    return parts


def _ticks(scale: _Scale, bottom: float) -> list[str]:
    parts = []
    for value in _round_values(scale.low, scale.high):
        x = scale.x(value)
        parts.append(element("line", "grid", x1=x, x2=x, y1=TOP, y2=bottom))
        parts.append(text(number(value), x, bottom + 15, "tick", "middle"))
    return parts


def _round_values(low: float, high: float) -> list[float]:
    """Two to five round numbers.

    >>> _round_values(0.13, 0.62)
    [0.2, 0.4, 0.6]
    """
    step = 10.0 ** math.floor(math.log10((high - low) / 2.0))
    step *= next(f for f in (5.0, 2.0, 1.0) if (high - low) / (f * step) >= 2.0)
    first = math.ceil(low / step)
    return [round(k * step, 12) for k in range(first, math.floor(high / step) + 1)]


def _interval(iv: Interval, scale: _Scale, y: float, kind: str, radius: float) -> list[str]:
    if not all(map(math.isfinite, iv)):
        return []
    left, right = scale.x(iv.low), scale.x(iv.high)
    parts = [element("line", kind, x1=left, x2=right, y1=y, y2=y)]
    if scale.low <= iv.value <= scale.high:
        parts.append(element("circle", kind, cx=scale.x(iv.value), cy=y, r=radius))
    # of an interval that lies outside as a whole the arrow alone is seen
    for outside, x, way in ((iv.low < scale.low, left, 4.0), (iv.high > scale.high, right, -4.0)):
        if outside:
            path = f"M {x + way:.1f} {y - 3:.1f} L {x:.1f} {y:.1f} L {x + way:.1f} {y + 3:.1f}"
            parts.append(element("path", kind, d=path))
    return parts
