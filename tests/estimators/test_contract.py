"""Every entry of ESTIMATORS keeps the contract of an estimator; a new one is tested by being in the list."""

import math
import pickle
import random
from itertools import pairwise

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from canid.mathematics.estimators import ESTIMATORS, status
from canid.models.saving.state_codec import codec
from canid.signals.vehicle import schema
from canid.values.types import Identifiable, LearnGate, Sample, Status
from tests.exact import exact

DT = 0.1
NAMES = ("headway_error", "range_rate")
SILENT = (Status.NO_DRIVER, Status.NO_LEAD, Status.STALE, Status.CONVERGING, Status.NOT_EXCITED)


@pytest.fixture(params=ESTIMATORS, ids=[method.name for method in ESTIMATORS])
def method(request):
    return request.param


@pytest.fixture
def estimator(method):
    return method.make(NAMES, DT)


def numbers(channel):
    return [x for interval in channel[:4] for x in interval]


def check(estimate):
    """What must hold of any estimate."""
    assert set(estimate.channels) <= {*NAMES, "lateral_offset"}
    assert estimate.says.strip()
    for c in estimate.channels.values():
        if estimate.status in SILENT:
            assert all(map(math.isnan, numbers(c)))
            assert c.status is Identifiable.NOT
            continue
        quoted = {
            Identifiable.OK: ("K", "tau", "dead_time", "tau_plus_dead_time"),
            Identifiable.SUM_ONLY: ("K", "tau_plus_dead_time"),
            Identifiable.GAIN_ONLY: ("K",),
            Identifiable.NOT: (),
        }[c.status]
        for name in quoted:
            assert all(map(math.isfinite, getattr(c, name)))
        # what may not be quoted is there for what it is worth, or was not estimated
        for interval in c[:4]:
            if not math.isnan(interval.value):
                assert interval.low <= interval.value <= interval.high
    if estimate.status is Status.OK:
        assert any(c.status is not Identifiable.NOT for c in estimate.channels.values())
        assert set(estimate.excitation) == set(estimate.channels)
        assert estimate.used > 0
        assert math.isfinite(estimate.fit_percent)


def test_names_are_unique_and_belong_to_the_estimator():
    """A bound estimator keeps its name, and no two are alike."""
    assert len({method.name for method in ESTIMATORS}) == len(ESTIMATORS)
    for method in ESTIMATORS:
        assert method.make(NAMES, DT).name == method.name
        assert method.make(("lateral_offset",), DT).init() is not None


@pytest.mark.slow("estimates over whole drives")
def test_finds_the_planted_gain_and_keeps_the_form(estimator, driven, estimates):
    """Over 4 min of following every estimate is well formed, some give K, and the last K of range rate is right."""
    right, quoted = 0, 0
    for seed in range(3):
        found, _ = estimates(estimator, driven(seed, 240.0))
        for estimate in found:
            check(estimate)
            assert estimate.estimator == estimator.name
        spoken = [e for e in found if e.status is Status.OK]
        assert len(spoken) > 0.2 * len(found)
        K = spoken[-1].channels["range_rate"].K
        if not math.isnan(K.value):
            quoted += 1
            right += K.low <= 5.6 <= K.high
            assert abs(K.value / 5.6 - 1) < 0.6
    assert quoted >= 2
    assert right >= quoted - 1


@pytest.mark.slow("estimates over whole drives")
def test_speaks_every_half_second_and_at_once_when_the_kind_changes(estimator, driven, estimates):
    """Estimates are 0.5 s apart, or come with a new kind of status."""
    found, _ = estimates(estimator, driven(1, 60.0, shut=((30.03, 41.0),)))
    assert found[0].t == 0.0
    for a, b in pairwise(found):
        assert b.t - a.t <= 0.5 + 1e-9
        assert b.status is not a.status or abs(b.t - a.t - 0.5) < 1e-9
    assert any(e.t == 30.1 and e.status is Status.NO_DRIVER for e in found)


@pytest.mark.slow("estimates over whole drives")
def test_same_answer_wherever_the_stream_is_cut(estimator, driven, estimates):
    """The state survives pickling at any sample, and the estimates are equal to the last bit."""
    samples = driven(2, 50.0, shut=((30.0, 33.0),), gate=LearnGate.BRAKE)
    whole, _ = estimates(estimator, samples)
    for cut in (1, 203, 311):
        first, state = estimates(estimator, samples[:cut])
        rest, _ = estimates(estimator, samples[cut:], pickle.loads(pickle.dumps(state)))
        assert exact(first + rest) == exact(whole)


@pytest.mark.slow("estimates over whole drives")
def test_a_step_changes_nothing_it_was_given(estimator, driven):
    """State and sample are the same bytes after the step, and the same step again gives the same."""
    state = estimator.init()
    for k, sample in enumerate(driven(3, 40.0)):
        before = pickle.dumps(state) if k % 50 in (4, 5, 6) else None
        new, estimate = estimator.step(state, sample)
        if before is not None:
            assert pickle.dumps(state) == before
            again = estimator.step(pickle.loads(before), sample)
            assert exact(again) == exact((new, estimate))
        state = new


@pytest.mark.slow("estimates over whole drives")
@pytest.mark.parametrize("gate", [g for g in LearnGate if g in status._AT_ONCE], ids=lambda g: g.name)
def test_what_ends_the_following_silences_at_once(estimator, driven, estimates, gate):
    """Cruise, no lead, standstill, stale: the very first such sample takes all numbers away."""
    found, _ = estimates(estimator, driven(0, 60.0, shut=((50.0, 99.0),), gate=gate))
    first = next(e for e in found if e.t >= 50.0)
    assert first.t == 50.0
    assert first.status is status._AT_ONCE[gate]
    assert first.says == gate.value
    for e in found:
        check(e)
        assert e.t < 50.0 or e.status is first.status


@pytest.mark.slow("estimates over whole drives")
@pytest.mark.parametrize(
    "gate", [LearnGate.BRAKE, LearnGate.PEDAL_FLOOR, LearnGate.TARGET_CHANGE], ids=lambda g: g.name
)
def test_a_brief_interruption_keeps_the_estimate_and_a_long_one_does_not(estimator, driven, estimates, gate):
    """For 5 s the estimate stands; then it is taken back with the gate's sentence."""
    found, _ = estimates(estimator, driven(0, 80.0, shut=((60.0, 90.0),), gate=gate))
    kept = [e for e in found if 60.0 <= e.t < 65.0 - 1e-9]
    assert kept
    assert {e.status for e in kept} == {Status.OK}
    gone = [e for e in found if e.t >= 65.0 + 1e-9]
    want = Status.NO_LEAD if gate is LearnGate.TARGET_CHANGE else Status.NO_DRIVER
    assert {e.status for e in gone} == {want}


@pytest.mark.slow("estimates over whole drives")
def test_comes_back_clean_after_cruise(estimator, driven, estimates):
    """After cruise, during which the pedal does something else, the answers are those of the person."""
    samples = [
        s._replace(output=90.0) if s.gate is LearnGate.CRUISE else s
        for s in driven(4, 170.0, shut=((60.0, 90.0),))
    ]
    found, _ = estimates(estimator, samples)
    assert found[-1].status is Status.OK
    K = found[-1].channels["range_rate"].K
    assert math.isnan(K.value) or (K.low <= 5.6 <= K.high)
    assert abs(K.value / 5.6 - 1) < 0.5 or math.isnan(K.value)


def test_constant_inputs_are_not_excited_and_it_says_so(estimator, estimates):
    """When nothing moves, the status is not_excited with a sentence that names an input and a remedy."""
    still = [
        Sample(k * DT, 20.0 + 0.1 * (k % 7), (0.3, 0.0), LearnGate.OPEN, True, 0, {}) for k in range(400)
    ]
    found, _ = estimates(estimator, still)
    assert {e.status for e in found} == {Status.CONVERGING, Status.NOT_EXCITED}
    assert "drive with varying speed" in found[-1].says
    assert "hardly moved" in found[-1].says
    for e in found:
        check(e)


@pytest.mark.slow("estimates over whole drives")
def test_missing_samples_and_values_cost_data_only(estimator, driven, estimates):
    """Lost grid times, NaN outputs and inputs: estimates go on, well formed."""
    holes = [
        s._replace(output=math.nan)
        if 300 <= k < 304
        else s._replace(inputs=(math.nan, s.inputs[1]))
        if 500 <= k < 503
        else s
        for k, s in enumerate(driven(5, 180.0))
        if not 600 <= k < 615
    ]
    found, _ = estimates(estimator, holes)
    for e in found:
        check(e)
    assert found[-1].status is Status.OK


numbers_or_not = st.one_of(st.floats(-1e6, 1e6), st.sampled_from([math.nan, math.inf, -math.inf, 0.0]))
garbage = st.lists(
    st.tuples(
        numbers_or_not,
        numbers_or_not,
        numbers_or_not,
        st.sampled_from(LearnGate),
        st.booleans(),
        st.integers(0, 2),
    ),
    min_size=1,
    max_size=25,
)


@pytest.mark.slow("estimates over whole drives")
@settings(max_examples=15, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(pieces=garbage)
def test_nothing_that_a_stream_may_hold_makes_it_raise(estimator, driven, estimates, pieces):
    """Any numbers, NaN and infinities, gates and segments, for whole seconds at a time, in a live stream."""
    t, samples = 0.0, list(driven(6, 30.0))
    t = samples[-1].t
    for output, a, b, gate, learn, segment in pieces:
        for i in range(12):
            t += DT
            wobble = 1.0 + 0.01 * i
            samples.append(Sample(t, output * wobble, (a * wobble, b), gate, learn, segment, {}))
    found, _ = estimates(estimator, samples)
    for e in found:
        check(e)


@pytest.mark.slow("estimates over whole drives")
def test_lane_keeping_has_one_input(method, driven, estimates):
    """With lateral offset alone the same estimators run and find the planted gain."""
    lateral = [0.3 * s.inputs[1] for s in driven(7, 120.0)]
    wheel, x, moved, seen, samples = 0.0, 0.0, 0.0, [0.0, 0.0], []
    rng = random.Random(1)
    for k, pushed in enumerate(lateral):
        # the car answers its wheel
        seen.append(pushed + moved)
        x += (1 - math.exp(-DT / 0.4)) * (seen[k] - x)
        wheel = 0.8 * wheel + 0.1 * rng.gauss(0.0, 1.0)
        samples.append(Sample(k * DT, 12.0 * x + wheel, (seen[-1],), LearnGate.OPEN, True, 0, {}))
        moved = 0.9 * moved - 0.02 * (12.0 * x + wheel)
    found, _ = estimates(method.make(("lateral_offset",), DT), samples)
    assert found[-1].status is Status.OK
    K = found[-1].channels["lateral_offset"].K
    assert K.low <= 12.0 <= K.high
    assert abs(K.value / 12.0 - 1) < 0.1
    for e in found:
        check(e)
        assert "lead" not in e.says
        assert "follow" not in e.says


def test_wrong_settings_are_a_wrong_call(method):
    """No inputs, or a grid without a step, raise at once."""
    with pytest.raises(ValueError, match="inputs"):
        method.make((), DT)
    with pytest.raises(ValueError, match="dt"):
        method.make(NAMES, 0.0)


@pytest.mark.slow("estimates over whole drives")
def test_the_state_is_saved_and_restored(estimator, driven, estimates):
    """Its annotations give it a plain form; a restored state goes on to the last bit, and is of its own setup."""
    samples = driven(2, 40.0)
    _, state = estimates(estimator, samples[:300])
    state_codec = codec(type(state))
    restored = state_codec.decode(state_codec.encode(state))
    assert list(estimator.check_state(restored)) == []
    assert exact(estimates(estimator, samples[300:], restored)) == exact(
        estimates(estimator, samples[300:], state)
    )


def test_the_settings_are_checked_by_their_type(method):
    """The defaults pass as a section of a vehicle file, and an unknown key gets a hint."""
    settings, mistakes = schema.parse_settings(method.settings, {}, method.name)
    assert (settings, mistakes) == (method.settings(), [])
    key = method.settings._fields[0]
    _, mistakes = schema.parse_settings(method.settings, {f"{key}x": 1}, method.name)
    assert mistakes == [f'{method.name}.{key}x: unknown key (did you mean "{key}"?)']
