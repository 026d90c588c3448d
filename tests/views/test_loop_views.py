"""Margins of driver and car as text and JSON."""

from __future__ import annotations

import json
import math

import numpy as np

from canid.analysis.drive import identification_json
from canid.analysis.drive.drive_parameters import Identified
from canid.mathematics.systems.car_response import CarResponse
from canid.mathematics.systems.identified_loop import IdentifiedLoop
from canid.ui.views import identification_text
from canid.values.text import json_values
from canid.values.types import Interval

GIVEN = IdentifiedLoop(
    "",
    12.3,
    2.2,
    Interval(58.7, 56.1, 62.3),
    Interval(math.inf, 8.0, math.inf),
    Interval(3.12, 2.90, 3.52),
    Interval(0.73, 0.70, 0.79),
    Interval(0.26, 0.24, 0.28),
    Interval(1.021, 1.010, 1.034),
    Interval(0.015, 0.012, 0.018),
    amplifying=1.0,
    unstable=0.0,
    car=CarResponse(
        Interval(0.04, 0.039, 0.041), Interval(0.35, 0.33, 0.37), Interval(0.01, 0.0, 0.02), np.eye(3), 120.0
    ),
)


def drive(loop: IdentifiedLoop) -> Identified:
    return Identified(60.0, 50.0, (), {}, (), loop=loop)


def shown(loop: IdentifiedLoop) -> str:
    return "\n".join(identification_text.text(drive(loop), "x.blf", "car"))


def test_text_gives_margins_with_intervals_units_and_what_they_mean() -> None:
    text = shown(GIVEN)
    assert "phase margin 58.7 [56.1, 62.3] °" in text
    assert "delay margin 3.12 [2.90, 3.52] s" in text
    assert "1.021 [1.010, 1.034] at 0.015 Hz: motion of the lead is amplified" in text
    assert "m/s² per %" in text
    still = GIVEN._replace(string_peak=Interval(1.0, 1.0, 1.0), string_peak_frequency=Interval(0.0, 0.0, 0.0))
    assert "motion of the lead is not amplified" in shown(still)
    open_case = GIVEN._replace(string_peak=Interval(1.0, 1.0, 1.02), amplifying=0.3)
    assert "amplified in 30 % of the draws: not decided" in shown(open_case)
    assert "2.5 % of the draws are unstable" in shown(GIVEN._replace(unstable=0.025))


def test_text_says_why_there_are_none() -> None:
    assert "driver and car: no margins: too short" in shown(IdentifiedLoop("too short"))


def test_json_has_every_number_and_null_for_none() -> None:
    of = json.loads(json_values.line(identification_json.to_json(drive(GIVEN), "x.blf", "car")))["loop"]
    assert set(of) == set(IdentifiedLoop._fields)
    assert of["phase_margin"] == {"value": 58.7, "low": 56.1, "high": 62.3}
    assert of["gain_margin"] == {"value": None, "low": 8.0, "high": None}
    assert of["car"]["lag"]["value"] == 0.35
    none = json.loads(
        json_values.line(identification_json.to_json(drive(IdentifiedLoop("why")), "x.blf", "car"))
    )
    assert none["loop"]["says"] == "why"
    assert none["loop"]["string_peak"]["value"] is None
    assert none["loop"]["car"] is None
