"""The first sentences of a diagnosis alone hold what was planted, in its numbers."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable

import pytest

from canid.models.diagnosis.diagnose import diagnose
from canid.ui.views.diagnosis_report.diagnosis_answer import HIDDEN, MAX_LINES, answer, summary
from canid.ui.views.document.document_text import WIDTH
from canid.values.findings import NotTestable, Report, Verdict, Visible
from tests.plants import plant_one, plant_two
from tests.plants.measurement import trace

PLANTS = {"one": plant_one.plant, "two": plant_two.plant}
# effect -> its parameter that the sentence states, and between which strengths it is planted
PLANTED = {
    "relative_speed_dead_zone": ("width", 0.8, 1.3),
    "looming_gain": ("exponent", 0.7, 1.1),
}
NUMBERS = re.compile(r"(-?[\d.]+) \[(-?[\d.]+), (-?[\d.]+)\]")


@pytest.mark.slow("diagnoses planted drives")
@pytest.mark.parametrize("simulator", PLANTS)
@pytest.mark.parametrize("effect", PLANTED)
def test_the_answer_alone_says_what_was_planted(simulator: str, effect: str, seed: int) -> None:
    rng = random.Random(seed)
    name, weakest, strongest = PLANTED[effect]
    planted = rng.uniform(weakest, strongest)
    made = PLANTS[simulator]({effect: {name: planted}}, seed=seed, minutes=10, noise="ar1", profile="mixed")
    report = diagnose(trace(made))
    assert report.verdict in (Verdict.NAMED, Verdict.ONE_OF), report.says
    first = answer(report)[0]
    found = [tuple(map(float, numbers)) for numbers in NUMBERS.findall(first)]
    # three times as wide as the 95 % interval: missed once in ten million
    assert any(low - (high - low) < planted < high + (high - low) for _, low, high in found), (planted, first)
    shown = summary(report, "a.blf", "car", "more")
    assert len(shown) <= MAX_LINES
    assert max(map(len, shown)) <= WIDTH


def test_where_several_causes_fit_the_first_sentence_has_the_number_and_the_others(
    report_of: Callable[..., Report],
) -> None:
    """Neither braces nor names of code, and no evidence before the answer."""
    first = answer(report_of(Verdict.ONE_OF, minutes=2))[0]
    assert "0.34" in first
    assert "this drive cannot say which" in first
    assert not re.search(r"[{}_]|nats|held-out", first)


def test_a_cause_is_named_first_also_where_more_is_left(report_of: Callable[..., Report]) -> None:
    """The sentence of a drive with a cause and something unexplained held the latter alone."""
    checks = report_of(Verdict.UNEXPLAINED).checks
    named = report_of(Verdict.NAMED)
    first = answer(named._replace(verdict=Verdict.UNEXPLAINED, checks=checks))[0]
    assert first.startswith(answer(named)[0])
    assert "Something else is left that no other cause explains: " in first


def test_what_the_drive_would_have_hidden_is_said_where_nothing_is_found(
    report_of: Callable[..., Report],
) -> None:
    """What it nearly shows first; what has no expected evidence, such as two causes that are the same, is left out."""
    undecided = [
        NotTestable(("speed_gain",), "", 7.0, 13.0),
        NotTestable(("range_offset", "standstill_gap"), "", math.nan, math.nan),
        NotTestable(("headway_dead_zone",), "", 9.0, 13.0),
    ]
    first = answer(report_of(Verdict.ADEQUATE)._replace(not_testable=tuple(undecided)))[0]
    assert first.endswith("A headway dead zone or a speed gain of typical strength would not have shown.")
    shown = (Visible("speed_gain", "exponent", 1.2, "1", 0.3),)
    first = answer(report_of(Verdict.ADEQUATE)._replace(not_testable=tuple(undecided), visible=shown))[0]
    assert first.endswith(
        "A speed gain from 1.2 on would have. A headway dead zone of typical strength would not have shown."
    )
    many = tuple(NotTestable((f"cause_{k}",), "", 9.0 - k, 13.0) for k in range(HIDDEN + 2))
    first = answer(report_of(Verdict.ADEQUATE)._replace(not_testable=many))[0]
    assert first.endswith("or a cause 5 of typical strength would not have shown, nor would 2 others.")
