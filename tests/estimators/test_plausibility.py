"""What is refused although it has intervals, and what is only mentioned."""

import numpy as np
import pytest

from canid.mathematics.estimators import plausibility, status
from canid.mathematics.estimators.armax import ARMAX, ArmaxSettings
from canid.mathematics.estimators.fopdt import FOPDT, FopdtSettings
from canid.mathematics.estimators.plausibility import Following, Ranges, judge
from canid.mathematics.estimators.whole_drive_agreement import arbitrated
from canid.mathematics.identification.first_order import scan
from canid.values.types import Channel, Identifiable, Interval, LearnGate, Status, Trace

RANGES = Ranges(3.0, 1.5, "fopdt")
AT = Following(20.0, 1.5)


def channel(K, tau=0.4, dead_time=0.4, half=0.1, quoted=Identifiable.OK):
    """Intervals of +- half of each."""
    wide = [Interval(x, x - half * abs(x), x + half * abs(x)) for x in (K, tau, dead_time, tau + dead_time)]
    return Channel(*wide, quoted)


def both(one, two):
    return {"headway_error": one, "range_rate": two}


def test_a_fit_no_better_than_the_mean_is_never_ok():
    """At 0 % and below nothing is reported, above all is; where no gain may be quoted that stays the reason."""
    fine = both(channel(0.3), channel(0.6))
    for fit, kind in ((-12.0, Status.INCONSISTENT), (0.0, Status.INCONSISTENT), (0.5, Status.OK)):
        verdict = judge(fine, fit, RANGES, AT)
        assert status.by_fit(fine, {"headway_error": 1.0, "range_rate": 1.0}, *verdict)[0] is kind
    assert "fit -12 %" in judge(fine, -12.0, RANGES).refused[0]
    nothing = both(channel(0.3, quoted=Identifiable.NOT), channel(0.6, quoted=Identifiable.NOT))
    assert judge(nothing, -12.0, RANGES, AT) == ((), ())


@pytest.mark.parametrize(
    ("field", "word", "setting"), [("tau", "tau", "tau_max"), ("dead_time", "dead time", "dead_time_max")]
)
def test_a_delay_at_the_end_of_its_range_is_never_ok(field, word, setting):
    """Its sentence names the setting; an interval that only ends there is a remark; a channel without K has neither."""
    end = getattr(RANGES, setting)
    piled = channel(0.6)._replace(**{field: Interval(0.97 * end, 0.9 * end, 0.999 * end)})
    verdict = judge(both(channel(0.3), piled), 40.0, RANGES)
    assert (
        f"range rate: {word} is at the end of its range, {end} s: raise {setting} in [fopdt]"
        in verdict.refused[0]
    )
    nobody = judge(both(channel(0.3), piled), 40.0, RANGES._replace(section=""))
    assert nobody.refused[0].endswith(f"{end} s: the response is no reaction")
    touching = piled._replace(**{field: Interval(0.5 * end, 0.1 * end, 0.999 * end)})
    verdict = judge(both(channel(0.3), touching), 40.0, RANGES)
    assert not verdict.refused
    assert word in verdict.remarks[0]
    unknown = piled._replace(status=Identifiable.NOT)
    assert judge(both(channel(0.3), unknown), 40.0, RANGES) == ((), ())


def test_an_unstable_loop_is_never_ok():
    """All of the interval unstable: refused; some of it: mentioned; of a pedal, or without a speed, nothing is said."""
    unstable = both(channel(0.3), channel(4.0, 0.6, 0.6))
    assert "unstable at 20 m/s" in judge(unstable, 40.0, RANGES, AT).refused[0]
    assert judge(unstable, 40.0, RANGES, None) == ((), ())
    partly = both(channel(0.3), channel(2.0, 0.6, 0.6, half=0.5))
    verdict = judge(partly, 40.0, RANGES, AT)
    assert not verdict.refused
    assert "hold stable ones" in verdict.remarks[0]
    assert judge(both(channel(0.3), channel(0.6)), 40.0, RANGES, AT) == ((), ())
    lane = {"lateral_offset": channel(-4.0, 0.6, 0.6)}
    assert judge(lane, 40.0, RANGES, AT) == ((), ())


def drive(tau=0.4, extra=0.0, gain=0.6, n=1500):
    """Whole drive of an acceleration; `extra` of range rate comes once more, 2.5 s late."""
    rng = np.random.default_rng(3)
    u = np.column_stack(
        [scan(0.1 * rng.normal(size=n), np.array([0.97])), scan(rng.normal(size=n), np.array([0.9]))]
    )
    a = np.exp(-0.1 / tau)
    x = np.roll(scan((1.0 - a) * u[:, 1], np.array([a])), 3)
    y = 0.3 * np.roll(u[:, 0], 5) + gain * x + extra * np.roll(u[:, 1], 25) + 0.02 * rng.normal(size=n)
    signals = {"speed": np.full(n, 20.0), "headway": u[:, 0] + 1.5}
    names = ("headway_error", "range_rate")
    learn, segment = np.full(n, True), np.zeros(n, np.int64)
    return Trace(0.1, np.arange(n) * 0.1, y, u, names, (LearnGate.OPEN,) * n, learn, segment, signals)


def identified(trace, **settings):
    assert FOPDT.identify is not None
    found = FOPDT.identify(trace, FopdtSettings(output="accel")._replace(**settings))
    assert found is not None
    return found


@pytest.mark.long("identifies whole drives")
def test_a_whole_drive_carries_its_sentence():
    """A lag beyond its range, and a loop that cannot be: no number, and the reason in text and JSON; else both numbers."""
    right = identified(drive())
    assert right.channels["range_rate"].status is not Identifiable.NOT
    assert right.residual_tests is not None
    slow = identified(drive(tau=5.0))
    assert slow.channels["range_rate"]._replace(withheld="") == Channel()
    assert any("raise tau_max" in line for line in slow.lines)
    assert "raise tau_max" in slow.details["says"]
    strong = drive(gain=8.0)
    assert any("unstable" in line for line in identified(strong).lines)
    assert not any("unstable" in line for line in identified(strong, output="pedal").lines)


def test_a_large_response_that_is_left_over_keeps_delays_from_being_quoted():
    """The gain stays, as its intervals do not suffer; the sentence gives the size."""
    left = arbitrated({"fopdt": identified(drive(extra=0.4))})["fopdt"]
    assert left is not None
    assert left.residual_tests is not None
    assert left.residual_tests.left_over_share["range_rate"] > plausibility.MAX_LEFT_OVER
    assert left.channels["range_rate"].status is Identifiable.GAIN_ONLY
    assert any("τ and θ may not be quoted" in line for line in left.lines)


def opposed(seed=3, n=1800):
    """Whole drive whose output answers fast movements of range rate, and hides under slow ones of the opposite sign."""
    trace = drive(n=n)
    rng = np.random.default_rng(seed)
    slow = scan(0.02 * rng.normal(size=n), np.array([0.995]))
    u = trace.inputs.copy()
    u[:, 1] += 10.0 * slow
    return trace._replace(inputs=u, output=trace.output - 15.0 * slow)


def test_armax_that_explains_no_more_than_the_mean_is_never_ok():
    """Over the whole drive no number and the sentence, also where the intervals are clear of zero; else both numbers."""
    assert ARMAX.identify is not None
    for trace, wrong in ((opposed(), True), (drive(), False)):
        whole = ARMAX.identify(trace, ArmaxSettings())
        assert whole is not None
        assert whole.fit_percent is not None
        assert (whole.fit_percent <= 0.0) is wrong
        assert (whole.channels["range_rate"]._replace(withheld="") == Channel()) is wrong
        assert ("no more than the mean" in whole.details["says"]) is wrong
