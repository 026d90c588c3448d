"""Results in Python: short `repr`, the command line's text, HTML that is data and not markup, plots and data frames."""

from __future__ import annotations

import ast
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import canid
from canid.ui.views import data_frame, identification_text
from canid.ui.views.drawing import plotly_package
from canid.values.errors import ConfigError
from canid.values.findings import Report
from canid.values.types import NAN, LearnGate, Trace

REPO = Path(__file__).parents[2]
LOG = REPO / "replay_logs/following_urban.blf"
# lines and columns of a `repr`
MAX_LINES, MAX_COLUMNS = 6, 600


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    """One of each kind, of one drive."""
    drive = canid.read_drive(LOG, "generic", stop=100.0)
    found = canid.identify(LOG, "generic", stop=100.0, select_orders=False)
    report = canid.diagnose(drive, "generic")
    return {
        "Drive": drive,
        "Trace": drive.trace,
        "Estimate": drive.estimates[-1],
        "Channel": found.channels["range_rate"],
        "Interval": found.channels["range_rate"].K,
        "Identified": found,
        "Report": report,
        "Comparison": canid.compare(found, [found._replace(log="<b>other</b>")]),
    }


KINDS = ("Drive", "Trace", "Estimate", "Channel", "Interval", "Identified", "Report", "Comparison")


class Markup(HTMLParser):
    """Tags of a fragment, and whether they are balanced."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.seen.add(tag)
        assert not any(name.startswith("on") for name, _ in attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


ALLOWED = {*("div", "b", "span", "table", "thead", "tbody", "tr", "th", "td")}
ALLOWED |= {"svg", "line", "circle", "rect", "text", "polyline", "title"}


@pytest.mark.slow("pages in a browser")
@pytest.mark.parametrize("kind", KINDS)
def test_a_result_shows_itself(kind: str, results: dict[str, Any]) -> None:
    """A few lines of `repr` without arrays, the text of the verb, a fragment of known tags, a plotly figure."""
    from plotly.graph_objects import Figure

    of = results[kind]
    assert type(of).__name__ == kind
    for text in (repr(of), str([of])):
        assert text.count("\n") < MAX_LINES
        assert len(text) < MAX_LINES * MAX_COLUMNS
        assert "array(" not in text
    assert of.summary().strip()
    fragment = Markup()
    fragment.feed(of._repr_html_())
    assert fragment.open == []
    assert {"svg", "table"} <= fragment.seen <= ALLOWED
    figure = of.plot()
    assert isinstance(figure, Figure)
    assert figure.to_json()


@pytest.mark.slow("pages in a browser")
def test_the_text_is_that_of_the_verb(results: dict[str, Any]) -> None:
    """`summary()` of an identified log is what `canid identify` prints."""
    found = results["Identified"]
    assert found.summary().splitlines() == identification_text.summary(
        found, str(LOG), "Generic car-following vehicle", "pedal"
    )
    of_trace = canid.identify(results["Trace"], "generic", select_orders=False, sliding=False)
    assert of_trace.channels == found.channels


def test_an_interval_prints_what_it_supports_and_keeps_its_digits() -> None:
    """`str` rounds to the interval's width, `repr` is exact, NaN is a dash."""
    of = canid.Interval(5.55979412, 5.03936776, 6.16734877)
    assert str(of) == f"{of}" == of.summary() == "5.6 [5.0, 6.2]"
    assert eval(repr(of), {"Interval": canid.Interval}) == of
    assert str(canid.Interval()) == "–"
    assert "svg" not in canid.Interval()._repr_html_()
    canid.Interval().plot()


@pytest.mark.slow("whole drives through the pipeline")
def test_names_are_data_in_html_and_plots(results: dict[str, Any]) -> None:
    """Markup in names of logs, roles and sentences is shown, not interpreted."""
    bad = '<script>alert(1)</script>"><img src=x onerror=alert(1)>'
    trace: Trace = results["Trace"]
    hostile = trace._replace(signals={bad: trace.t, "‮\x1b[2J": trace.t}, input_names=(bad, bad))
    report: Report = results["Report"]._replace(says=bad, output=bad)
    for of in (
        hostile,
        report,
        results["Identified"]._replace(log=bad),
        results["Estimate"]._replace(says=bad),
    ):
        fragment = Markup()
        fragment.feed(of._repr_html_())
        assert fragment.seen <= ALLOWED
    figure = results["Identified"]._replace(log=bad).plot()
    assert "<script" not in figure.layout.title.text


def nothing(n: int = 0) -> Trace:
    """A trace without a number."""
    column = np.full(n, NAN)
    return Trace(
        0.1,
        np.arange(n) * 0.1,
        column,
        np.full((n, 2), NAN),
        ("headway_error", "range_rate"),
        (LearnGate.STALE,) * n,
        np.zeros(n, bool),
        np.zeros(n, np.int64),
        {"gap": column},
    )


@pytest.mark.parametrize("n", [0, 1, 700])
def test_results_without_numbers_are_shown_as_well(n: int) -> None:
    """An empty trace, one sample, NaN everywhere, and what identify and diagnose make of them."""
    trace = nothing(n)
    results: list[Any] = [trace, canid.diagnose(trace)]
    if n:
        results.append(canid.identify(trace, select_orders=False))
    for of in results:
        assert repr(of)
        assert of.summary()
        assert of._repr_html_()
        of.plot()
    assert len(trace.to_frame("pandas")) == n


@pytest.mark.slow("whole drives through the pipeline")
def test_a_trace_as_a_frame(results: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """All columns in both libraries, with units; where none is installed, one line says what to install."""
    trace: Trace = results["Trace"]
    frame = trace.to_frame("pandas")
    assert frame.attrs["units"]["gap"] == "m"
    np.testing.assert_array_equal(frame["gap"], trace.signals["gap"])
    polars = trace.to_frame("polars")
    np.testing.assert_array_equal(polars["gap [m]"].to_numpy(), trace.signals["gap"])
    assert polars.shape == frame.shape == (len(trace.t), 5 + len(set(trace.signals) | set(trace.input_names)))
    table = results["Identified"].to_frame("pandas")
    assert table[table.quotable].value.notna().all()
    with pytest.raises(ValueError, match="excel"):
        trace.to_frame("excel")  # type: ignore[call-overload]
    monkeypatch.setattr(data_frame, "find_spec", lambda _: None)
    with pytest.raises(ConfigError, match="pip install pandas"):
        trace.to_frame()
    monkeypatch.setattr(plotly_package, "find_spec", lambda _: None)
    with pytest.raises(ConfigError, match="plotly"):
        trace.plot()


def test_the_package_is_one_screen() -> None:
    """`help(canid)` begins with one screen that names all of `dir(canid)`; importing it imports no mathematics."""
    assert canid.__doc__ is not None
    assert 24 <= canid.__doc__.count("\n") <= 40
    assert max(map(len, canid.__doc__.splitlines())) <= 120
    public = [name for name in dir(canid) if not name.startswith("_")]
    assert [name for name in public if name not in canid.__doc__] == []
    assert all(getattr(canid, name).__doc__ for name in public)
    heavy = "{'scipy', 'cantools', 'can', 'pandas', 'plotly', 'pydantic'}"
    code = f"import canid, canid.values.types, sys; canid.values.types.Interval(); print({heavy} & set(sys.modules))"
    ran = subprocess.run([sys.executable, "-c", code], cwd=REPO, capture_output=True, text=True, check=True)
    assert ast.literal_eval(ran.stdout.replace("set()", "0")) == 0
