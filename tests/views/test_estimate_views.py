"""The views mark the headline estimate, and show a contradiction with its numbers."""

import json

import pytest

from canid.ui.views import end_summary
from canid.ui.views.terminal_view.picture import render
from canid.ui.views.terminal_view.state import View, update
from canid.values.text import estimate_text, json_values
from canid.values.text.names import HEADLINE_MARK
from canid.values.types import Channel, Estimate, Identifiable, Interval, ResidualTests, Status
from tests.terminal import plain

TESTS = ResidualTests(False, 70.2, 40.3, ("range_rate",), (), True, {"range_rate": 12})
CHANNEL = Channel(
    Interval(5.5, 5.0, 6.0),
    status=Identifiable.GAIN_ONLY,
    K_anytime=Interval(5.5, 4.0, 7.0),
    prior_weight=0.25,
)


def estimate(name, status=Status.OK, headline=False, says="range rate: K only", t=60.0):
    return Estimate(
        t, name, status, says, {"range_rate": CHANNEL}, 80.0, {"range_rate": 1.0}, 45.0, TESTS, headline
    )


def drawn(view):
    return plain(render(view, 106, 40)).splitlines()


def seen(*estimates):
    view = View("test")
    for e in estimates:
        view = update(view, e)
    return drawn(view)


def test_the_display_marks_the_headline_estimate():
    """Of two estimators one line carries the mark."""
    lines = seen(estimate("armax"), estimate("fopdt", headline=True))
    marked = [line for line in lines if HEADLINE_MARK in line]
    assert len(marked) == 1
    assert "FOPDT" in marked[0]
    assert "headline estimate" in marked[0]
    assert not [line for line in seen(estimate("armax"), estimate("fopdt")) if HEADLINE_MARK in line]


def test_a_contradicted_estimate_shows_its_own_numbers():
    """The display shows the contradicted numbers and why, not the last good ones."""
    good = estimate("fopdt")
    other = Channel(Interval(8.88, 8.0, 9.5), status=Identifiable.GAIN_ONLY)
    doubted = estimate("fopdt", Status.INCONSISTENT, says="range rate: K is two things", t=61.0)
    text = "\n".join(seen(good, doubted._replace(channels={"range_rate": other})))
    assert "8.88" in text
    assert "5.50" not in text
    assert "inconsistent" in text
    assert "K is two things" in text
    assert "last estimate" not in text
    # without an estimate the last good one stays
    silent = estimate("fopdt", Status.NO_LEAD, says="no vehicle ahead", t=62.0)
    text = "\n".join(seen(good, silent._replace(channels={"range_rate": Channel()})))
    assert "5.50" in text
    assert "last estimate" in text


def test_lines_and_summary_name_it_too():
    """A plain line begins with the mark; the summary marks the estimator that had it last."""
    assert estimate_text.estimate(estimate("fopdt", headline=True)).startswith(HEADLINE_MARK)
    assert not estimate_text.estimate(estimate("fopdt")).startswith(HEADLINE_MARK)
    assert "because" in estimate_text.estimate(estimate("fopdt", Status.INCONSISTENT, says="because"))
    tally = end_summary.EstimateTally()
    for e in (estimate("armax", headline=True), estimate("armax"), estimate("fopdt", headline=True)):
        tally.put(e)
    assert [HEADLINE_MARK in line for line in end_summary.estimates(tally) if ": ok" in line] == [False, True]


def test_json_has_every_name_of_the_contract():
    """docs/json.md's names, and null where nothing is known."""
    value = json.loads(json_values.line(json_values.plain(estimate("armax", headline=True))))
    assert value["headline"] is True
    assert value["residual_tests"] == {
        "white": False,
        "statistic": 70.2,
        "bound": 40.3,
        "left_over": ["range_rate"],
        "feedback": [],
        "stationary": True,
        "excitation_order": {"range_rate": 12},
        "left_over_share": {},
    }
    channel = value["channels"]["range_rate"]
    assert channel["K_anytime"] == {"value": 5.5, "low": 4.0, "high": 7.0}
    assert channel["prior_weight"] == 0.25
    bare = Estimate(1.0, "fopdt", Status.CONVERGING, "wait", {"range_rate": Channel()})
    value = json.loads(json_values.line(json_values.plain(bare)))
    assert value["headline"] is False
    assert value["residual_tests"] is None
    assert value["channels"]["range_rate"]["prior_weight"] is None
    assert value["channels"]["range_rate"]["K_anytime"] == {"value": None, "low": None, "high": None}
    nothing = TESTS._replace(statistic=float("nan"), bound=float("nan"))
    value = json.loads(json_values.line(json_values.plain(bare._replace(residual_tests=nothing))))
    assert value["residual_tests"]["statistic"] is None


@pytest.mark.parametrize(
    ("tests", "said"),
    [
        (TESTS, "not white"),
        (TESTS, "part of the response is not modelled"),
        (TESTS._replace(feedback=("range_rate",)), "the loop is closed"),
        (TESTS._replace(stationary=False), "has a trend"),
        (TESTS._replace(statistic=float("nan")), "not tested"),
    ],
)
def test_residual_tests_in_words(tests, said):
    assert said in "\n".join(estimate_text.residual_tests(tests))
