"""Of a whole drive no two methods quote numbers that exclude each other, in one printout."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest

import canid
from canid.mathematics.estimators import agreement, plausibility
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.estimators.whole_drive_agreement import arbitrated, diagnosed, disjoint
from canid.mathematics.identification.identifiability import quotable
from canid.values.types import Channel, Identifiable, Interval, ResidualTests, Trace
from tests.fixtures.measured_logs import LOGS as MEASURED_LOGS
from tests.fixtures.measured_logs import LONG_LOGS, MEASURED, needs_measured

NAME = "range_rate"


def band(low: float, high: float) -> Interval:
    return Interval((low + high) / 2, low, high)


def found(
    K: Interval,
    total: Interval = band(0.5, 1.0),  # noqa: B008
    fit: float = 40.0,
    left: float = 0.0,
    status: Identifiable = Identifiable.SUM_ONLY,
) -> WholeDrive:
    tests = ResidualTests(True, 0.0, 1.0, (NAME,) if left else (), (), True, {}, {NAME: left} if left else {})
    return WholeDrive({NAME: Channel(K, tau_plus_dead_time=total, status=status)}, None, fit, tests)


def judged(fopdt: WholeDrive, armax: WholeDrive) -> tuple[Channel, Channel, str]:
    out = arbitrated({"armax": armax, "fopdt": fopdt})
    one, other = out["fopdt"], out["armax"]
    assert one is not None
    assert other is not None
    for each, before in ((one, fopdt), (other, armax)):
        # what is said of a method with its lines stands in the verdict too
        new = set(each.lines) - set(before.lines)
        assert all(line in str(each.details["says"]) for line in new)
    return one.channels[NAME], other.channels[NAME], "\n".join((*one.lines, *other.lines))


def test_disjoint_gains_are_quoted_by_neither() -> None:
    """Both stay readable, with what each would need to be right."""
    one, other, says = judged(found(band(0.13, 0.19)), found(band(0.20, 0.28)))
    assert one.status is other.status is Identifiable.NOT
    assert band(0.13, 0.19) == one.K
    assert "0.16 [0.13, 0.19] by FOPDT but 0.24 [0.20, 0.28] by ARMAX" in says
    assert "FOPDT needs" in says
    assert "ARMAX needs" in says


def test_disjoint_sums_leave_the_gains() -> None:
    """Only what they contradict each other in is withheld."""
    one, other, _ = judged(found(band(1, 2), band(0.4, 0.6)), found(band(1, 2), band(0.7, 0.9)))
    assert one.status is other.status is Identifiable.GAIN_ONLY


def test_agreement_changes_nothing() -> None:
    """Nor does a response that is left over and small."""
    one, other, says = judged(found(band(1, 2), left=0.1), found(band(1.5, 2.5)))
    assert one.status is other.status is Identifiable.SUM_ONLY
    assert not says


@pytest.mark.parametrize(
    ("fit", "left", "quoted"), [(-18.0, 0.0, False), (30.0, 0.9, False), (30.0, 0.1, True)]
)
def test_a_gain_that_nobody_confirms(fit: float, left: float, quoted: bool) -> None:
    """It is withheld where the other model fails, or a response is left over, not where the other only knows less."""
    one, _, says = judged(found(band(1, 2), left=left), found(band(-1, 4), fit=fit, status=Identifiable.NOT))
    assert quotable(one, "K") is quoted
    assert bool(says) is not quoted


def test_a_response_that_is_left_over_withholds_the_delays_of_both() -> None:
    """It says that the answer is not of first order, whichever method's residuals hold it; gains that agree stay."""
    one, other, says = judged(found(band(1, 2), left=0.9), found(band(1.5, 2.5)))
    assert one.status is other.status is Identifiable.GAIN_ONLY
    assert "90 %" in says


def test_a_gain_with_more_left_over_than_it_gives_is_not_quoted() -> None:
    """Of 0.40 with 125 % left over and 0.20 neither is quoted, nor what a diagnosis without a cause says of it."""
    one, other, says = judged(found(band(0.31, 0.49), left=1.25), found(band(0.14, 0.30)))
    assert one.status is Identifiable.NOT
    assert other.status is Identifiable.NOT
    assert "more of a response than the model gives (125 %)" in says
    assert "no point in common" not in says
    made = arbitrated({"armax": found(band(0.14, 0.30)), "fopdt": found(band(0.31, 0.49), left=1.25)})
    mine = {NAME: Channel(band(0.10, 0.22), status=Identifiable.GAIN_ONLY)}
    left, why, _ = diagnosed(mine, made, None)
    assert not quotable(left[NAME], "K")
    assert "the residuals of FOPDT still hold a response of 125 %" in why[0]
    # a cause may be what they hold
    assert diagnosed(mine, made, mine) == (mine, (), ())
    # less than that withholds delays alone
    one, _, _ = judged(found(band(0.31, 0.49), left=0.9), found(band(0.30, 0.45)))
    assert one.status is Identifiable.GAIN_ONLY


def test_disjoint_lags_leave_the_sum() -> None:
    """tau and dead time are withheld, their sum and the gain are not."""
    apart = [
        WholeDrive(
            {NAME: Channel(band(1, 2), tau, band(0.2, 0.4), band(0.5, 1.0), Identifiable.OK)}, None, 40.0
        )
        for tau in (band(0.1, 0.3), band(0.5, 0.7))
    ]
    one, other, says = judged(*apart)
    assert one.status is other.status is Identifiable.SUM_ONLY
    assert "tau is 0.20" in says


def test_the_diagnosis_is_one_of_the_methods() -> None:
    """Without causes it has the rules of the others; delays that a left-over response refuses it does not quote either."""
    mine = {NAME: Channel(band(5, 7), tau_plus_dead_time=band(0.5, 1.0), status=Identifiable.SUM_ONLY)}
    left, says, _ = diagnosed(mine, {"fopdt": found(band(1, 2)), "armax": None}, None)
    assert left[NAME].status is Identifiable.NOT
    assert "1.50 [1.00, 2.00] by FOPDT but 6.00 [5.00, 7.00] by diagnose" in says[0]
    agreeing = {"fopdt": found(band(5, 7), left=0.9)}
    assert diagnosed(mine, agreeing, None)[0][NAME].status is Identifiable.GAIN_ONLY
    # causes that the estimators have not explain what those leave
    assert diagnosed(mine, agreeing, mine) == (mine, (), ())
    changed = {"fopdt": found(band(5, 7), status=Identifiable.NOT)._replace(details={"changes": ("one",)})}
    assert diagnosed(mine, changed, None)[0][NAME].status is Identifiable.NOT


def test_a_named_cause_explains_a_difference() -> None:
    """A model without the cause averages over it, the diagnosis' own baseline as `identify`: then its number holds."""
    mine = {NAME: Channel(band(5, 7), tau_plus_dead_time=band(0.5, 1.0), status=Identifiable.SUM_ONLY)}
    whole = {"fopdt": found(band(1, 2)), "armax": found(band(1, 6))}
    left, why, says = diagnosed(mine, whole, {NAME: Channel(band(1.8, 2.6))})
    assert (left, why) == (mine, ())
    assert len(says) == 1
    assert "Without the cause K of range rate is 1.5 [1.0, 2.0] by FOPDT, as in `identify`" in says[0]


@pytest.mark.parametrize("baseline", [Channel(band(3, 4)), Channel()])
def test_a_named_cause_explains_no_other_difference(baseline: Channel) -> None:
    """Where the diagnosis without its causes finds another number than `identify`, or none, something else differs too."""
    mine = {NAME: Channel(band(5, 7), status=Identifiable.GAIN_ONLY)}
    left, why, says = diagnosed(mine, {"fopdt": found(band(1, 2))}, {NAME: baseline})
    assert left[NAME].status is Identifiable.NOT
    assert "by diagnose" in why[0]
    assert says == ()


@pytest.mark.parametrize(
    ("fit", "left", "quoted"), [(-18.0, 0.0, False), (30.0, 0.9, False), (30.0, 0.1, True)]
)
def test_a_gain_of_the_diagnosis_that_nobody_confirms(fit: float, left: float, quoted: bool) -> None:
    """It has the rule of every other method, as long as no cause is named."""
    mine = {NAME: Channel(band(1, 2), status=Identifiable.GAIN_ONLY)}
    unsure = found(band(-1, 4), fit=fit, left=left, status=Identifiable.NOT)
    assert quotable(diagnosed(mine, {"fopdt": unsure}, None)[0][NAME], "K") is quoted
    assert quotable(diagnosed(mine, {"fopdt": unsure}, mine)[0][NAME], "K")


def test_steering_uses_armax() -> None:
    """There FOPDT alone loses."""
    one = WholeDrive({"lateral_offset": Channel(band(1, 2), status=Identifiable.GAIN_ONLY)}, None, 30.0)
    other = WholeDrive({"lateral_offset": Channel(band(3, 4), status=Identifiable.GAIN_ONLY)}, None, 30.0)
    out = arbitrated({"fopdt": one, "armax": other})
    assert [of.channels["lateral_offset"].status for of in out.values() if of is not None] == [
        Identifiable.NOT,
        Identifiable.GAIN_ONLY,
    ]


def test_in_steering_a_left_over_response_speaks_against_the_first_order_alone() -> None:
    """FOPDT's delays are withheld by the arbiter, as in car following; ARMAX is of higher order and keeps its own."""
    tests = ResidualTests(True, 0.0, 1.0, ("lateral_offset",), (), True, {}, {"lateral_offset": 0.9})
    channel = Channel(band(1, 2), tau_plus_dead_time=band(0.5, 1.0), status=Identifiable.SUM_ONLY)
    of_both = WholeDrive({"lateral_offset": channel}, None, 30.0, tests)
    out = arbitrated({"fopdt": of_both, "armax": of_both})
    assert [of.channels["lateral_offset"].status for of in out.values() if of is not None] == [
        Identifiable.GAIN_ONLY,
        Identifiable.SUM_ONLY,
    ]


def contradicted(trace: Trace) -> list[tuple[str, ...]]:
    """What two of FOPDT, ARMAX and the diagnosis may both quote of a drive, though they exclude each other."""
    whole = canid.identify(trace, select_orders=False, sliding=False).whole
    methods = {name: of.channels for name, of in whole.items() if of is not None}
    report = canid.diagnose(trace)
    methods["diagnose"] = report.extended.channels
    # what a named cause explains is said, and is no contradiction
    said = " ".join(report.without_causes)
    delays = {
        name: {key for key, c in of.items() if quotable(c, "tau_plus_dead_time")}
        for name, of in methods.items()
    }
    fopdt = whole["fopdt"]
    left = (
        fopdt is not None
        and fopdt.residual_tests is not None
        and plausibility.left_over(fopdt.residual_tests)
    )
    out = [
        (a, b, name, what)
        for a, b in combinations(methods, 2)
        for name, what in disjoint(methods[a], methods[b])
        if b != "diagnose" or f"{plausibility.WORDS[what][0]} of {name.replace('_', ' ')} is" not in said
    ]
    steering = bool(agreement.wrong_for(trace.input_names))
    if left and not steering:
        out += [("armax", key, "a response is left over") for key in delays.get("armax", ())]
    if fopdt is not None and fopdt.residual_tests is not None and not steering:
        # a cause may be what is left over
        explained = {"diagnose"} if any(finding.where == "driver" for finding in report.findings) else set()
        gains = plausibility.gains_left_over(fopdt.residual_tests)
        quoted = [(name, key) for name in methods.keys() - explained for key in gains]
        out += [
            (name, key, "more is left over than the model gives")
            for name, key in quoted
            if quotable(methods[name][key], "K")
        ]
    return out


LOGS = Path(__file__).parents[2] / "replay_logs"


@pytest.mark.slow("identifies and diagnoses drives")
@pytest.mark.parametrize("log", sorted(path.name for path in LOGS.glob("*.blf")))
def test_no_shipped_drive_contradicts_itself(log: str) -> None:
    """No two methods quote what excludes each other, nor one a delay that another's residuals refuse."""
    name = log.partition(".")[0]
    vehicle = "generic_lane" if "lane" in name else name.removesuffix("_simulated")
    assert not contradicted(canid.read_trace(LOGS / log, "generic" if "following" in name else vehicle))


@needs_measured
@pytest.mark.slow("identifies and diagnoses measured drives")
@pytest.mark.parametrize("log", [*MEASURED_LOGS, *LONG_LOGS])
def test_no_measured_drive_contradicts_itself(log: tuple[str, str]) -> None:
    """The same on measured drives."""
    assert not contradicted(canid.read_trace(MEASURED / log[0], log[1]))
