"""Drivers side by side: caterpillar plot of one parameter, own and shrunken estimates, as SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from canid.analysis.fleet.answers.labels import label, short
from canid.ui.views.drawing.forest import interval_line, value_axis
from canid.ui.views.drawing.svg import Scale, element, scale, svg, text
from canid.values.fleet_summary import Driver, Parameter, Population
from canid.values.text.numbers import number
from canid.values.types import Interval

WIDTH, ROW, TOP, BOTTOM = 430.0, 17.0, 10.0, 24.0
# px from the left: names end; intervals lie between
NAMES, PLACE = 118.0, (128.0, 420.0)
# characters of a name: what the place for names holds at 12 px
NAME_LENGTH = 18
# drivers that are drawn one by one; of more the ends alone, and the distribution of all
MAX_DRIVERS, AT_EACH_END = 40, 12


def ranked(population: Population, name: str) -> list[Driver]:
    """The drivers whose shrunken estimate is known, the largest first."""
    known = [d for d in population.drivers if name in d.shrunken and math.isfinite(d.shrunken[name].value)]
    return sorted(known, key=lambda d: (-d.shrunken[name].value, d.name))


def driver_plot(population: Population, parameter: Parameter) -> Markup:
    """Draw the drivers; empty where none is known."""
    drivers = ranked(population, parameter.name)
    if not drivers:
        return Markup("")
    left_out = len(drivers) - 2 * AT_EACH_END if len(drivers) > MAX_DRIVERS else 0
    rows: list[Driver | None] = [*drivers]
    if left_out:
        rows = [*drivers[:AT_EACH_END], None, *drivers[-AT_EACH_END:]]
    shown = [d for d in rows if d is not None]
    at = _scale(parameter, shown)
    bottom = TOP + ROW * len(rows)
    parts = [*_population(parameter, at, bottom), *value_axis(at, TOP, bottom)]
    for k, driver in enumerate(rows):
        y = TOP + ROW * (k + 0.5)
        if driver is None:
            words = f"{left_out:,} drivers between"
            parts.append(text(words, (PLACE[0] + PLACE[1]) / 2, y + 4, "tick", "middle"))
            continue
        parts.append(text(short(driver.name, NAME_LENGTH), NAMES, y + 4, "name", "end"))
        own_estimate = driver.own.get(parameter.name, Interval())
        shrunken = driver.shrunken[parameter.name]
        parts += interval_line(own_estimate, at, y + 3.0, "own", radius=2.2, arrow=4.0)
        parts += interval_line(shrunken, at, y - 2.5, "shrunken", radius=3.2, arrow=4.0)
    alt = (
        f"{label(parameter.name)} of {len(drivers):,} drivers, from "
        f"{number(drivers[-1].shrunken[parameter.name].value)} to {number(drivers[0].shrunken[parameter.name].value)}"
    )
    return svg(parts, WIDTH, bottom + BOTTOM, alt)


def distribution(population: Population, parameter: Parameter) -> Markup:
    """Histogram of all drivers' shrunken estimates; empty where the drivers are drawn one by one."""
    values = [d.shrunken[parameter.name].value for d in ranked(population, parameter.name)]
    if len(values) <= MAX_DRIVERS:
        return Markup("")
    height, bottom = 130.0, 106.0
    at = _scale(parameter, ranked(population, parameter.name))
    # Freedman & Diaconis 1981 gives some 20 of 500 drivers
    counts, edges = np.histogram(values, bins=24, range=(at.low, at.high))
    parts = [*_population(parameter, at, bottom), *value_axis(at, TOP, bottom)]
    highest = max(int(counts.max()), 1)
    for count, left, right in zip(counts, edges[:-1], edges[1:], strict=True):
        tall = (bottom - TOP) * count / highest
        if count:
            parts.append(
                element(
                    "rect",
                    "bar",
                    x=at(float(left)) + 0.5,
                    y=bottom - tall,
                    width=at(float(right)) - at(float(left)) - 1.0,
                    height=tall,
                )
            )
    parts.append(text(f"{highest:,}", NAMES, TOP + 8, "tick", "end"))
    parts.append(text("drivers", NAMES, TOP + 22, "tick", "end"))
    return svg(parts, WIDTH, height, f"distribution of {label(parameter.name)} over {len(values):,} drivers")


def _scale(parameter: Parameter, drivers: Sequence[Driver]) -> Scale:
    """What the shrunken intervals need; own estimates that are hardly known may end outside."""
    ends = [x for d in drivers for x in d.shrunken[parameter.name]]
    ends += parameter.new_driver if len(drivers) > 2 else []
    return scale(ends, *PLACE, spare=0.05) or Scale(0.0, 1.0, *PLACE)


def _population(parameter: Parameter, at: Scale, bottom: float) -> list[Markup]:
    """The range of a new driver, and the population's mean."""
    parts = []
    ends = (parameter.new_driver.low, parameter.new_driver.high)
    if all(map(math.isfinite, ends)):
        left, right = at(ends[0]), at(ends[1])
        parts.append(element("rect", "range", x=left, y=TOP, width=right - left, height=bottom - TOP))
    if math.isfinite(parameter.mean.value):
        x = at(parameter.mean.value)
        parts.append(element("line", "zero", x1=x, x2=x, y1=TOP, y2=bottom))
    return parts
