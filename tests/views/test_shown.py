"""What is shown says which number to read, and shows a contradiction with its numbers."""

import io
import json

import pytest
from rich.console import Console

from canid.types import Channel, Estimate, Identifiable, Interval, ResidualTests, Status
from canid.views import as_json, summary, words
from canid.views.screen import View, render, update

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
    out = io.StringIO()
    Console(file=out, width=106).print(render(view))
    return out.getvalue().splitlines()


def seen(*estimates):
    view = View("test")
    for e in estimates:
        view = update(view, e)
    return drawn(view)


def test_the_screen_marks_the_one_number_to_read():
    """Of two estimators one line carries the mark."""
    lines = seen(estimate("armax"), estimate("fopdt", headline=True))
    marked = [line for line in lines if words.READ in line]
    assert len(marked) == 1
    assert "fopdt" in marked[0]
    assert "the number to read" in marked[0]
    assert not [line for line in seen(estimate("armax"), estimate("fopdt")) if words.READ in line]


def test_a_contradicted_estimate_shows_its_own_numbers():
    """Not the last good ones: the reader sees what is contradicted, and why."""
    good = estimate("fopdt")
    other = Channel(Interval(8.88, 8.0, 9.5), status=Identifiable.GAIN_ONLY)
    doubted = estimate("fopdt", Status.INCONSISTENT, says="range rate: K is two things", t=61.0)
    text = "\n".join(seen(good, doubted._replace(channels={"range_rate": other})))
    assert "8.88" in text
    assert "5.50" not in text
    assert "inconsistent" in text
    assert "K is two things" in text
    assert "last told" not in text
    # without an estimate the last good one stays
    silent = estimate("fopdt", Status.NO_LEAD, says="no vehicle ahead", t=62.0)
    text = "\n".join(seen(good, silent._replace(channels={"range_rate": Channel()})))
    assert "5.50" in text
    assert "last told" in text


def test_lines_and_summary_name_it_too():
    """A plain line begins with the mark; the summary marks who had it last."""
    assert words.estimate(estimate("fopdt", headline=True)).startswith(words.READ)
    assert not words.estimate(estimate("fopdt")).startswith(words.READ)
    assert "because" in words.estimate(estimate("fopdt", Status.INCONSISTENT, says="because"))
    tally = summary.Tally()
    for e in (estimate("armax", headline=True), estimate("armax"), estimate("fopdt", headline=True)):
        tally.put(e)
    assert [words.READ in line for line in summary.estimates(tally) if ": ok" in line] == [False, True]


def test_json_has_every_name_of_the_contract():
    """docs/json.md's names, and null where nothing is known."""
    told = json.loads(as_json.line(as_json.estimate(estimate("armax", headline=True))))
    assert told["headline"] is True
    assert told["residual_tests"] == {
        "white": False,
        "statistic": 70.2,
        "bound": 40.3,
        "left_over": ["range_rate"],
        "feedback": [],
        "stationary": True,
        "excitation_order": {"range_rate": 12},
    }
    channel = told["channels"]["range_rate"]
    assert channel["K_anytime"] == {"value": 5.5, "low": 4.0, "high": 7.0}
    assert channel["prior_weight"] == 0.25
    bare = Estimate(1.0, "fopdt", Status.CONVERGING, "wait", {"range_rate": Channel()})
    told = json.loads(as_json.line(as_json.estimate(bare)))
    assert told["headline"] is False
    assert told["residual_tests"] is None
    assert told["channels"]["range_rate"]["prior_weight"] is None
    assert told["channels"]["range_rate"]["K_anytime"] == {"value": None, "low": None, "high": None}
    nothing = TESTS._replace(statistic=float("nan"), bound=float("nan"))
    told = json.loads(as_json.line(as_json.estimate(bare._replace(residual_tests=nothing))))
    assert told["residual_tests"]["statistic"] is None


@pytest.mark.parametrize(
    ("tests", "said"),
    [
        (TESTS, "not white"),
        (TESTS, "part of the answer is not modelled"),
        (TESTS._replace(feedback=("range_rate",)), "the loop is closed"),
        (TESTS._replace(stationary=False), "has a trend"),
        (TESTS._replace(statistic=float("nan")), "not tested"),
    ],
)
def test_residual_tests_in_words(tests, said):
    assert said in "\n".join(words.residual_tests(tests))
