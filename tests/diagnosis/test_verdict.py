"""The verdict is that of the block that fails; a cause elsewhere does not hide it, and the noise's law is no cause."""

from __future__ import annotations

import pytest

from canid.models.diagnosis import verdict
from canid.models.diagnosis.verdict import Gained
from canid.values.findings import Blocked, Finding, NullGain, Verdict
from canid.values.text.names import readable
from canid.values.types import Interval

STATES = {"sensing": "adequate", "vehicle": "adequate", "driver": "adequate", "remnant": "adequate"}


def lines(**states: str) -> tuple[Blocked, ...]:
    return tuple(Blocked(where, state, f"of the {where}.") for where, state in (STATES | states).items())


def found(where: str, *rivals: str) -> Finding:
    return Finding(f"of_{where}", where, rivals, False, {}, {}, Interval(), f"In the {where}.", 80.0, 13.0)


@pytest.mark.parametrize("where", ["sensing", "driver"])
def test_a_block_that_fails_sets_the_verdict_whatever_another_one_names(where: str) -> None:
    other = found("vehicle")
    of = lines(**{where: "unexplained", "vehicle": "wrong"})
    assert verdict.decided((other,), of, 0.0) is Verdict.UNEXPLAINED
    says = verdict.sentence(Verdict.UNEXPLAINED, (other,), of, Gained(Interval(), NullGain(), Interval()), 20)
    assert f"left in the {where}" in says
    assert "of vehicle in the vehicle" in says


@pytest.mark.parametrize(("missed", "wanted"), [(0.04, Verdict.ADEQUATE), (0.4, Verdict.UNEXPLAINED)])
def test_an_ordinary_car_leaves_the_drivers_verdict(missed: float, wanted: Verdict) -> None:
    of = lines(vehicle="unexplained")
    assert verdict.decided((), of, missed) is wanted
    assert verdict.decided((found("driver"),), of, missed) is Verdict.NAMED
    says = verdict.sentence(wanted, (), of, Gained(Interval(), NullGain(), Interval()), 20)
    assert "Something is left in the vehicle" in says


@pytest.mark.parametrize("rivals", [(), ("another",)])
def test_the_law_of_the_noise_is_no_cause(rivals: tuple[str, ...]) -> None:
    law = found("remnant", *rivals)
    assert verdict.decided((law,), lines(remnant="wrong"), 0.0) is Verdict.ADEQUATE
    assert verdict.decided((law,), lines(remnant="wrong", driver="unexplained"), 0.0) is Verdict.UNEXPLAINED
    both = (found("driver"), law)
    assert verdict.decided(both, lines(remnant="wrong", driver="wrong"), 0.0) is Verdict.NAMED


@pytest.mark.parametrize(
    ("effect", "rival"), [("delay_drift", "clock_skew"), ("pedal_ceiling", "end_of_record")]
)
def test_a_cause_that_may_be_a_sensors_is_not_blamed_on_the_driver(effect: str, rival: str) -> None:
    """Both blocks stand in one sentence, before the names."""
    drift = found("driver", rival)._replace(effect=effect)
    nothing = Gained(Interval(), NullGain(), Interval())
    says = verdict.sentence(Verdict.ONE_OF, (drift,), lines(driver="wrong"), nothing, 20)
    assert says == f"ONE OF: in the driver or the sensing one of {readable(effect)}, {readable(rival)}."
