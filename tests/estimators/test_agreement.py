"""A contradiction between estimators is reported once it persists; there is one headline estimate at most."""

import itertools
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.mathematics.estimators import agreement
from canid.mathematics.identification import model_average
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.values.types import Channel, Estimate, Identifiable, Interval, OtherGain, Status
from tests.exact import exact

SILENT = (Status.CONVERGING, Status.NOT_EXCITED, Status.NO_LEAD, Status.NO_DRIVER, Status.STALE)


UNTOLD = Interval()


def band(low, high):
    return Interval((low + high) / 2, low, high)


def says(t, name, low, high, status=Status.OK, channel="range_rate", lag=UNTOLD):
    ch = Channel(band(low, high), tau_plus_dead_time=lag, status=Identifiable.SUM_ONLY)
    if status is not Status.OK:
        ch = Channel()
    return Estimate(t, name, status, "K only", {"headway_error": Channel(), channel: ch})


def listen(instants):
    """All judged estimates, from lists of estimates of one instant each."""
    state, out = agreement.State(), []
    for estimates in instants:
        state, checked = agreement.step(state, estimates)
        out += checked
    return out


def both(t, armax, fopdt, **how):
    return [says(t, "armax", *armax, **how), says(t, "fopdt", *fopdt, **how)]


TIMES = [0.5 * k for k in range(41)]


def test_intervals_that_touch_contradict_nothing():
    """Overlap, however small, changes no status and no word."""
    out = listen(both(t, (4.0, 5.0), (5.0, 6.0)) for t in TIMES)
    assert {e.status for e in out} == {Status.OK}
    assert {e.says for e in out} == {"K only"}


def test_a_contradiction_that_persists_is_reported_of_both_with_its_reason():
    """After five seconds apart, not before, both are inconsistent; the numbers stay, the sentence names them."""
    out = listen(both(t, (7.0, 8.0), (5.0, 6.0)) for t in TIMES)
    assert {e.t: e.status for e in out} == {
        t: Status.INCONSISTENT if t >= agreement.PERSISTENCE_S else Status.OK for t in TIMES
    }
    last = out[-2:]
    assert [e.estimator for e in last] == ["armax", "fopdt"]
    for e in last:
        assert e.says.startswith("range rate: K is 5.50 [5.00, 6.00] by FOPDT but 7.50 [7.00, 8.00] by ARMAX")
        assert "keep following" in e.says
        assert math.isfinite(e.channels["range_rate"].K.value)
        assert not e.headline


def test_the_sum_of_the_delays_is_compared_too():
    """K agrees, tau + dead time does not: the sentence says which, with its unit."""
    out = listen(
        [
            says(t, "armax", 4.0, 6.0, lag=band(0.2, 0.4), channel="lateral_offset"),
            says(t, "fopdt", 5.0, 6.0, lag=band(0.5, 0.7), channel="lateral_offset"),
        ]
        for t in TIMES
    )
    assert out[-1].status is Status.INCONSISTENT
    assert (
        "lateral offset: tau + dead time is 0.30 [0.20, 0.40] s by ARMAX but 0.60 [0.50, 0.70] s by FOPDT"
        in out[-1].says
    )


def test_one_agreement_restarts_the_clock():
    """Apart for 4.5 s, once together, apart for 4.5 s: nothing is reported; and a reported contradiction ends at once."""
    apart = [t % 5.0 != 0.0 for t in TIMES]
    out = listen(
        both(t, (7.0, 8.0) if a else (5.5, 8.0), (5.0, 6.0)) for t, a in zip(TIMES, apart, strict=True)
    )
    assert {e.status for e in out} == {Status.OK}
    out = listen(both(t, (7.0, 8.0) if t < 10.0 else (5.5, 8.0), (5.0, 6.0)) for t in TIMES)
    assert {e.t for e in out if e.status is Status.INCONSISTENT} == {t for t in TIMES if 5.0 <= t < 10.0}


def test_another_contradiction_has_a_clock_of_its_own():
    """K apart for 4 s and then the delays for 4 s is not one contradiction of 8 s."""
    out = listen(
        [
            says(t, "armax", *((7.0, 8.0) if t < 4.0 else (5.0, 8.0)), lag=band(0.5, 0.6)),
            says(t, "fopdt", 5.0, 6.0, lag=band(0.5, 0.6) if t < 4.0 else band(0.8, 0.9)),
        ]
        for t in TIMES
        if t < 8.0
    )
    assert {e.status for e in out} == {Status.OK}


@pytest.mark.parametrize("status", SILENT)
def test_an_estimator_without_numbers_contradicts_nobody(status):
    """While one is silent the other is neither contradicted nor changed, and has the headline."""
    out = listen(
        [says(t, "armax", 7.0, 8.0), says(t, "fopdt", 5.0, 6.0, status if t >= 3.0 else Status.OK)]
        for t in TIMES
    )
    assert {e.status for e in out} == {Status.OK, status}
    assert {e.estimator for e in out if e.headline and e.t >= 3.0} == {"armax"}
    for e in out:
        if e.status is status:
            assert e == says(e.t, "fopdt", 0, 0, status)


def test_an_old_estimate_contradicts_nobody_and_holds_no_headline():
    """What was said longer ago than MAX_AGE_S is about another time."""
    state = agreement.State()
    for t in TIMES[:20]:
        state, _ = agreement.step(state, both(t, (7.0, 8.0), (5.0, 6.0)))
    alone = []
    for t in TIMES[20:]:
        state, checked = agreement.step(state, [says(t, "armax", 7.0, 8.0)])
        alone += checked
    limit = TIMES[19] + agreement.MAX_AGE_S
    assert {e.t for e in alone if e.status is Status.INCONSISTENT} == {e.t for e in alone if e.t <= limit}
    assert {e.t for e in alone if e.headline} == {e.t for e in alone if e.t > limit}


@pytest.mark.parametrize(
    ("armax", "fopdt", "read"),
    [
        (Status.OK, Status.OK, "fopdt"),
        (Status.OK, Status.CONVERGING, "armax"),
        (Status.NOT_EXCITED, Status.OK, "fopdt"),
        (Status.CONVERGING, Status.NOT_EXCITED, ""),
    ],
)
def test_the_headline_follows_its_rule(armax, fopdt, read):
    """FOPDT where it is ok, else ARMAX where it is, else none."""
    out = listen([says(t, "armax", 5.0, 6.0, armax), says(t, "fopdt", 5.0, 6.0, fopdt)] for t in TIMES)
    assert {e.estimator for e in out if e.headline} == ({read} if read else set())


def test_two_that_speak_at_different_times_do_not_share_the_headline():
    """ARMAX, a quarter of a second after FOPDT, does not take the headline from it."""
    turns = [
        [says(t / 4, "fopdt" if t % 2 else "armax", 5.0, 6.0)] for t in range(1, 40)
    ]  # fopdt speaks first
    assert {e.estimator for e in listen(turns) if e.headline} == {"fopdt"}


def test_a_new_estimator_takes_part_by_itself():
    """One that HEADLINE_ORDER does not name is compared, and read where those named are silent."""
    out = listen([says(t, "third", 5.0, 6.0), says(t, "armax", 9.0, 9.5)] for t in TIMES)
    assert out[-1].status is out[-2].status is Status.INCONSISTENT
    assert "by third" in out[-1].says
    out = listen([says(t, "third", 5.0, 6.0), says(t, "armax", 0, 0, Status.CONVERGING)] for t in TIMES)
    assert out[-2].headline


def test_nobody_is_read_while_two_contradict_each_other():
    """FOPDT, whose interval spans both others, is not contradicted, and not the headline either."""
    out = listen(
        [says(t, "armax", 7.0, 8.0), says(t, "fopdt", 4.0, 9.0), says(t, "third", 5.0, 6.0)] for t in TIMES
    )
    late = [e for e in out if e.t >= agreement.PERSISTENCE_S]
    assert {e.estimator for e in late if e.status is Status.OK} == {"fopdt"}
    assert not any(e.headline for e in late)


bands = st.tuples(st.floats(-10, 10), st.floats(0, 5)).map(lambda x: band(x[0], x[0] + x[1]))
channels = st.builds(
    lambda K, lag: Channel(K, tau_plus_dead_time=lag),
    st.one_of(bands, st.just(Interval())),
    st.one_of(bands, st.just(Interval())),
)
spoken = st.lists(
    st.tuples(
        st.sampled_from(["armax", "fopdt", "third"]),
        st.sampled_from([*SILENT, Status.OK, Status.OK]),
        channels,
    ),
    max_size=3,
    unique_by=lambda x: x[0],
)


@pytest.mark.slow("estimates over whole drives")
@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.floats(0.1, 3.0), spoken), max_size=40))
def test_whatever_they_say_no_number_is_touched_and_one_is_read_at_most(turns):
    """Only an ok estimate changes, only in status, sentence and headline; steps are pure and survive pickling."""
    state, t = agreement.State(), 0.0
    for wait, said in turns:
        t += wait
        estimates = [Estimate(t, name, status, "K only", {"a": ch}) for name, status, ch in said]
        before = pickle.dumps(state)
        new, checked = agreement.step(state, estimates)
        assert pickle.dumps(state) == before
        again = agreement.step(pickle.loads(before), estimates)
        assert exact(again) == exact((new, checked))
        state = new
        assert sum(e.headline for e in checked) <= 1
        assert not (
            any(e.headline for e in checked) and any(e.status is Status.INCONSISTENT for e in checked)
        )
        for e, judged in zip(estimates, checked, strict=True):
            plain = judged._replace(status=e.status, says=e.says, headline=False)
            assert exact(plain) == exact(e)
            if e.status is not Status.OK:
                assert judged == e
        contradicted = [e for e in checked if e.status is Status.INCONSISTENT]
        for e in contradicted:
            others = [x for x in state.latest if x.estimator != e.estimator]
            assert any(_apart(e, x) for x in others)


def _apart(a, b):
    """Written anew: some interval of one lies wholly outside the other's."""
    pairs = itertools.product(("a",), ("K", "tau_plus_dead_time"))
    bounds = [(getattr(a.channels[n], w), getattr(b.channels[n], w)) for n, w in pairs]
    return any(max(x.low, y.low) > min(x.high, y.high) for x, y in bounds)


def test_steering_is_read_from_armax():
    """FOPDT, of too low an order for steering, never carries its headline, and cannot take it from ARMAX."""
    lane = {"channel": "lateral_offset"}
    out = listen(both(t, (-1.0, -0.8), (-0.9, -0.7), **lane) for t in TIMES)
    assert {(e.estimator, e.headline) for e in out} == {("armax", True), ("fopdt", False)}
    out = listen(both(t, (-1.0, -0.8), (-0.6, -0.4), **lane) for t in TIMES)
    late = [e for e in out if e.t > agreement.PERSISTENCE_S]
    assert {(e.estimator, e.status, e.headline) for e in late} == {
        ("armax", Status.OK, True),
        ("fopdt", Status.INCONSISTENT, False),
    }
    assert "use ARMAX" in late[-1].says
    alone = listen([says(t, "fopdt", -0.6, -0.4, **lane)] for t in TIMES)
    assert not any(e.headline for e in alone)


def test_models_with_a_cause_count_for_the_gain_of_every_estimator() -> None:
    """FOPDT finds them; the interval of ARMAX holds the gain by the model that is as likely as none, and says no sign."""
    known = {"range_rate": Channel(Interval(4.0, 3.6, 4.4), status=Identifiable.GAIN_ONLY)}
    fopdt = Estimate(60.0, "fopdt", Status.OK, "range rate: K only", known)
    armax = fopdt._replace(estimator="armax")
    others = {"range_rate": (OtherGain(1.0, 1.0, 0.0, 0.7, 0.1),)}
    _, (alone, _) = agreement.step(agreement.State(), (armax, fopdt))
    state, (now, _) = agreement.step(agreement.State(), (armax, fopdt._replace(other_gains=others)))
    _, (later,) = agreement.step(state, (armax._replace(t=60.5),))
    assert alone.channels == known
    assert now.channels["range_rate"].K.low < 2.8 < 4.4 <= now.channels["range_rate"].K.high
    assert later.channels == now.channels


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_end_that_was_lowered_to_zero_stays_there(sign: float) -> None:
    """A gain that was quoted by chance may be small; that is no gain of unknown sign, whatever a cause makes of it."""
    K = Interval(sign * 2.0, *sorted((0.0, sign * 4.0)))
    e = Estimate(1.0, "armax", Status.OK, "", {"range_rate": Channel(K, status=Identifiable.GAIN_ONLY)})
    wide = agreement.averaged(e, {"range_rate": (OtherGain(0.5, 1.0, 0.0, 1.5, 0.8),)}).channels["range_rate"]
    assert wide.status is Identifiable.GAIN_ONLY
    assert min(abs(wide.K.low), abs(wide.K.high)) == 0.0
    assert max(abs(wide.K.low), abs(wide.K.high)) > 4.0


def test_models_that_are_not_likely_leave_a_skewed_interval_as_it_is() -> None:
    """Intervals of gains reach farther to one side than to the other; a model of odds 1e-6 changes neither end."""
    K = Interval(4.0, 3.7, 4.8)
    e = Estimate(1.0, "armax", Status.OK, "", {"range_rate": Channel(K, status=Identifiable.GAIN_ONLY)})
    wide = (
        agreement.averaged(e, {"range_rate": (OtherGain(1e-6, 0.9, 0.1, 0.9, 0.1),)}).channels["range_rate"].K
    )
    assert np.allclose(wide, K, rtol=0.0, atol=1e-4)


def test_an_average_over_models_holds_95_percent_and_no_more(seed: int) -> None:
    """Of a million draws of the models, 2.5 % lie beyond each end that was widened, and fewer beyond the others."""
    rng = np.random.default_rng(seed)
    below, above = rng.uniform(0.05, 0.5, 2)
    K = Interval(4.0, 4.0 - NORMAL_QUANTILE * below, 4.0 + NORMAL_QUANTILE * above)
    odds, means, sds = rng.uniform(0.0, 1.0, 3), rng.uniform(2.5, 6.0, 3), rng.uniform(0.05, 0.5, 3)
    z, kind = rng.normal(size=1_000_000), rng.choice(4, 1_000_000, p=np.r_[1.0, odds] / (1.0 + odds.sum()))
    # two halves of one weight each, as wide as the interval is on their side
    own = 4.0 + z * np.where(z < 0.0, below, above)
    draws = np.where(kind == 0, own, np.r_[0.0, means][kind] + z * np.r_[1.0, sds][kind])
    wide = model_average.widened(K, means, sds, odds)
    for beyond, moved in ((draws < wide.low, wide.low < K.low), (draws > wide.high, wide.high > K.high)):
        assert np.mean(beyond) <= 0.0259
        assert np.mean(beyond) >= 0.0241 or not moved
