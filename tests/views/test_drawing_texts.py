"""A text that a drawing shows is data: of a log, a driver or a unit it is shown, and makes neither elements nor damage."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np
import pytest
from markupsafe import Markup

from canid.analysis.comparison.comparison import Comparison, Row
from canid.analysis.comparison.drive import DriveEstimates, Level, Side
from canid.analysis.drive.drive_parameters import Identified
from canid.ui.views.comparison_report import forest, levels
from canid.ui.views.drawing import svg
from canid.ui.views.drawing.forest import plain_interval
from canid.ui.views.drive_report import level_plot
from canid.ui.views.fleet_report import driver_plot
from canid.ui.views.notebook.fragment import chart
from canid.values.fleet_summary import Driver, Kind, Parameter, Population
from canid.values.terminal_text import terminal_text
from canid.values.types import Interval

HOSTILE = (
    "<script>alert(1)</script>",
    "</svg><img src=x onerror=alert(1)>",
    "]]>",
    "<![CDATA[",
    "-->",
    "&lt;b&gt; &amp; &",
    '" onload="alert(1)',
    "' onload='alert(1)",
    "</style>",
    "a\x00b\x01c\x1bd\ufffe\udcff",
    "a\nb\tc\rd\u202e",
)
IV = Interval(1.0, 0.5, 2.0)


def of_drivers(name: str) -> str:
    parameter = Parameter(name, name, False, 2, 2, IV, IV, IV, IV, name)
    drivers = tuple(Driver(f"{k:02}{name}"[:18], 1, 60.0, {name: IV}, {name: IV}) for k in range(50))
    population = Population(Kind(name, name), (parameter,), drivers, (), (), ())
    return driver_plot.driver_plot(population, parameter) + driver_plot.distribution(population, parameter)


def of_levels(name: str) -> str:
    t = np.arange(3.0)
    drive = DriveEstimates(
        "", "identify", "", "", 1.0, {}, levels=(Level(name, t, t, t - 1.0, t + 1.0, 0.5, 0.1),)
    )
    both = Comparison(Side("A", (drive,)), Side("B", (drive,)), "", (), (), (), (), 0.0, None)
    return Markup("").join(drawn.svg for drawn in levels.levels(both))


# what makes a drawing with one text wherever it takes a text
DRAWINGS: dict[str, Callable[[str], str]] = {
    "elements": lambda text: svg.whole(
        [svg.text(text, 1.0, 2.0, text, text, fill=text), svg.element("g", text, text, d=text)],
        (1.0, 1.0),
        text,
        text,
    ),
    "svg": lambda text: svg.svg([], 1.0, 1.0, text),
    "small": lambda text: svg.small([], 1.0, 1.0, text, text),
    "interval of a notebook": lambda text: plain_interval(IV, 0.0, 3.0, text, text),
    "curves of a notebook": lambda text: chart(np.arange(3.0), [(text, np.arange(3.0), text)]),
    "plot of a drive": lambda text: level_plot.svg(
        Identified(60.0, 60.0, (), {"fopdt": None}, ()), text, text
    ),
    "drivers of a fleet": of_drivers,
    "rows of a comparison": lambda text: forest.forest([Row(text, text, IV, IV, difference=IV, together=IV)]),
    "levels of a comparison": of_levels,
}


@pytest.mark.parametrize("made", DRAWINGS.values(), ids=DRAWINGS)
@pytest.mark.parametrize("text", HOSTILE)
def test_a_text_makes_no_element(made: Callable[[str], str], text: str) -> None:
    """The drawing is XML with the elements and attributes of one with a plain text, which shows the text itself."""
    tree, plain = (ElementTree.fromstring(f"<a>{made(each)}</a>") for each in (text, "plain"))
    assert [(each.tag, [*each.attrib]) for each in tree.iter()] == [
        (each.tag, [*each.attrib]) for each in plain.iter()
    ]
    shown = [each for node in tree.iter() for each in (node.text or "", *node.attrib.values())]
    assert any(terminal_text(text)[:6] in each for each in shown)


def test_a_text_among_the_parts_is_escaped() -> None:
    """What is no `Markup`, which mypy refuses, is no element either: the parts of a drawing are joined as markup."""
    drawn = svg.svg(["<script>"], 1.0, 1.0, "")  # type: ignore[list-item]
    assert drawn.endswith(">&lt;script&gt;</svg>")
    assert svg.text(Markup("<b>"), 0.0, 0.0).endswith(">&lt;b&gt;</text>")
    assert isinstance(svg.element("g"), Markup)
    assert isinstance(svg.text("a", 0.0, 0.0), Markup)
