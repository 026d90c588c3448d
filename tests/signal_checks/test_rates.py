"""Slow, coarse and late signals are named, and leave quotable what they do not touch; good ones stay silent."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm
from scipy.stats import t as student

from canid.signals.samples import reading_spans
from canid.signals.samples.reading_spans import ReadingSpan
from canid.signals.signal_checks import delayed_rate, signal_checks, slow_signals
from canid.signals.signal_checks.blocks import Block
from canid.values.types import Channel, Driver, Estimate, Identifiable, Interval, SignalFinding, Status
from tests.seeds import mostly
from tests.signal_checks.synthetic import DT, Array, Columns, changed, findings, following, samples

OWN = frozenset(
    (
        "input_slow",
        "output_slow",
        "output_held",
        "range_rate_coarse",
        "speed_coarse",
        "range_rate_late",
        "gap_late",
        "accel_late",
        "speed_late",
    )
)


def with_spans(columns: Columns, lost: Array | None = None) -> tuple[SignalFinding, ...]:
    """Run the checks along a drive, with what its readings show of their rate; of `lost` samples there are none."""
    t = DT * np.arange(len(columns["gap"]))
    rows = np.arange(len(t)) if lost is None else np.flatnonzero(~lost)
    came = []
    for role in ("pedal", "speed", "gap", "range_rate"):
        _, over = reading_spans.step(reading_spans.init(), role, t[rows], columns[role][rows], rows)
        came += [(row, span) for row, span in over]
    came.sort(key=lambda item: item[0])
    state, reports = signal_checks.init(), []
    for k, sample in enumerate(samples(columns)):
        while came and came[0][0] <= k:
            state = signal_checks.put(state, came.pop(0)[1])
        state, report = signal_checks.step(state, sample, Driver(), DT)
        reports += [] if report is None else [report]
    return signal_checks.episodes(reports)


@pytest.mark.parametrize(
    ("role", "kind", "gains"),
    [("lateral_offset", "hold", False), ("lateral_offset", "line", True), ("gap", "hold", True)],
)
def test_an_offset_that_is_held_shows_no_gain(role: str, kind: str, gains: bool) -> None:
    """The wheel moves it within the hold, before it is recorded: K of 0.2 s was 1.4 and 1.6 times the truth."""
    state, found = slow_signals.init(), None
    for k in range(3):
        span = ReadingSpan(role, 10.0 * k + 10.0, 0.2, kind, 0.0, 2.0)
        block = Block(span.t, DT, np.zeros((10, 10)), (), (), True, True, spans=(span,))
        state, found = slow_signals.step("input_slow", state, block)
    assert found is not None
    assert found.delays_only == gains


def lagged(x: Array, seconds: float) -> Array:
    """A lag of first order."""
    out, y = np.empty(len(x)), x[0]
    for k, value in enumerate(x.tolist()):
        out[k] = y
        y += (value - y) * DT / seconds
    return out


def delayed(x: Array, seconds: float) -> Array:
    """A pure delay."""
    k = np.arange(len(x), dtype=np.float64)
    return np.interp(k - seconds / DT, k, x)


def joined(every: int):
    """Lines between every so many values."""
    return lambda x: np.interp(np.arange(len(x)), np.arange(len(x))[::every], x[::every])


def stepped(size: float):
    """Values in steps."""
    return lambda x: np.round(x / size) * size


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize(
    ("role", "seconds", "name"),
    [("range_rate", 0.2, "range_rate_late"), ("range_rate", 0.5, "range_rate_late"), ("gap", 0.2, "gap_late"),
     ("accel", 0.3, "accel_late")],
)  # fmt: skip
@pytest.mark.parametrize("how", [lagged, delayed])
@mostly(0.9)
def test_a_late_signal_is_measured(role: str, seconds: float, name: str, how, seed: int) -> None:
    """Its name and sign; the delay that is said is the one planted."""
    found = findings(changed(role, lambda x: how(x, seconds))(following(seed, 10.0)))
    one = next(one for one in found if one.name == name)
    assert float(one.says.split(" is ")[1].split(" s")[0]) == pytest.approx(seconds, abs=0.04)
    assert one.withholds_delays == (role != "accel")
    assert not one.withholds


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize("rule", ["forward", "backward"])
@pytest.mark.parametrize("digits", [2, 4])
def test_half_a_step_of_a_simulation_is_no_delay(rule: str, digits: int, seed: int) -> None:
    """Of Euler's rule the gap is 0.05 s late or early; where a sensor measures it with 5 cm of noise, 0.05 s is named."""
    columns = following(seed, 10.0)
    x = columns["range_rate"] = np.round(columns["range_rate"], 3)
    steps = np.concatenate([[0.0], x[:-1]]) if rule == "forward" else x
    gap = columns["gap"][0] + DT * np.cumsum(steps)
    noise = 0.05 * np.random.default_rng([seed, 2]).standard_normal(len(x))
    late = ("gap_late", "range_rate_late")
    assert not [one for one in findings({**columns, "gap": np.round(gap, digits)}) if one.name in late]
    assert [one for one in findings({**columns, "gap": gap + noise}) if one.name in late]


@mostly(0.9)
def test_the_interval_of_the_delay_holds_the_truth(seed: int) -> None:
    """Of four standard deviations, without and with a delay; noise of the rate alone gives none."""
    for seconds in (0.0, 0.15):
        columns = changed("range_rate", lambda x, s=seconds: delayed(x, s))(following(seed, 8.0))
        columns["range_rate"] = columns["range_rate"] + 0.2 * np.random.default_rng(
            [seed, 1]
        ).standard_normal(len(columns["gap"]))
        state = signal_checks.init()
        for sample in samples(columns):
            state, _ = signal_checks.step(state, sample, Driver(), DT)
        own = next(
            inner
            for check, inner in zip(signal_checks.CHECKS, state.checks, strict=True)
            if check is delayed_rate.CHECKS[0]
        )
        value, sd = delayed_rate.delay(own)
        assert sd < 0.05
        assert abs(value - seconds) < 4.0 * sd


@pytest.mark.parametrize("role", ["gap", "range_rate"])
@mostly(0.9)
def test_a_lag_of_a_tenth_of_a_second_is_found(role: str, seed: int) -> None:
    """A filter that runs at the samples delays by 0.058 s on average, which moves dead times by half an interval."""
    columns = following(seed, 10.0)
    keep = np.exp(-DT / 0.1)
    start = keep * columns[role][:1]
    lag, _ = lfilter([1.0 - keep], [1.0, -keep], columns[role], zi=start)
    found = {one.name: one for one in findings({**columns, role: lag})}
    assert found[f"{role}_late"].withholds_delays


def test_the_interval_of_a_delay_is_of_students_t() -> None:
    """For the degrees of freedom that the clusters have; too few of them decide nothing."""
    for clusters in (4.0, 7.0, 14.0, 41.0, 120.0):
        state = delayed_rate.init()._replace(sums=(0.0, clusters, 0.0, 0.0, clusters))
        for normal in (1.96, delayed_rate.SIGMAS):
            exact = student.isf(norm.sf(normal), clusters - 1.0)
            assert delayed_rate.interval_sigmas(state, normal) == pytest.approx(exact, rel=0.04)
    # one manoeuvre in a drive
    alone = delayed_rate.init()._replace(sums=(0.5, 1.0, 0.25, 0.5, 1.0))
    assert delayed_rate.interval_sigmas(alone, 1.96) == np.inf


@pytest.mark.parametrize(
    ("role", "name", "delays"),
    [("pedal", "output_slow", True), ("gap", "input_slow", False), ("range_rate", "input_slow", False)],
)
@mostly(0.9)
def test_what_is_joined_by_lines_is_named(role: str, name: str, delays: bool, seed: int) -> None:
    """At 2 Hz; a slow output leaves the gains, a slow input leaves nothing."""
    found = {one.name: one for one in with_spans(changed(role, joined(5))(following(seed)))}
    one = found[name]
    assert role.replace("_", " ") in one.says
    assert "2 Hz, joined by lines" in one.says
    assert (one.withholds, one.withholds_delays) == (not delays, delays)


@pytest.mark.parametrize(
    ("role", "step", "every", "name"),
    [("pedal", 0.1, 5, "output_slow"), ("gap", 0.05, 5, "input_slow"), ("range_rate", 0.02, 5, "input_slow"),
     ("gap", 0.02, 3, "input_slow")],
)  # fmt: skip
@mostly(0.9)
def test_lines_that_were_rounded_are_named(role: str, step: float, every: int, name: str, seed: int) -> None:
    """Joined first, and written with the decimals of the file behind that, which hides single bends."""
    columns = changed(role, joined(every))(following(seed))
    found = {one.name: one for one in with_spans(changed(role, stepped(step))(columns))}
    assert "joined by lines" in found[name].says


@pytest.mark.parametrize("kind", ["line", "hold"])
@mostly(0.9)
def test_an_output_of_every_second_sample_leaves_the_gains(kind: str, seed: int) -> None:
    """Windows do not leave out the samples between its readings, as the fit of the whole drive does."""
    between = joined(2) if kind == "line" else lambda x: np.repeat(x[::2], 2)[: len(x)]
    found = {one.name: one for one in with_spans(changed("pedal", between)(following(seed)))}
    assert set(found) & OWN == {"output_slow"}
    assert found["output_slow"].withholds_delays
    assert "5 Hz" in found["output_slow"].says


@pytest.mark.parametrize("by_clock", [True, False])
@mostly(0.9)
def test_a_pedal_that_its_driver_holds_is_not_slow(by_clock: bool, seed: int) -> None:
    """Moved every 0.3 to 1 s it has a finding of its own, which leaves the gains; every 0.6 s it is the recorder's."""
    rng = np.random.default_rng([seed, 5])
    waits = np.full(2000, 0.6) if by_clock else rng.uniform(0.3, 1.0, 2000)

    def held(x: Array) -> Array:
        t, at = DT * np.arange(len(x)), np.cumsum(waits)
        newest = at[np.maximum(np.searchsorted(at, t, side="right") - 1, 0)]
        return x[np.minimum(np.ceil(newest / DT - 1e-9).astype(int), len(x) - 1)]

    found = {one.name: one for one in with_spans(changed("pedal", held)(following(seed)))}
    assert set(found) & OWN == ({"output_slow"} if by_clock else {"output_held"})
    one = found["output_slow" if by_clock else "output_held"]
    assert (one.withholds, one.withholds_delays) == (by_clock, not by_clock)
    assert "even to some 5 %" in (one.remedy if by_clock else one.says)
    assert "driver" in (one.remedy if by_clock else one.says)


@pytest.mark.parametrize(("lost", "named"), [(0.05, False), (0.25, True), (0.4, True)])
@mostly(0.9)
def test_lost_rows_leave_the_gains(lost: float, named: bool, seed: int) -> None:
    """Most intervals are those of a full rate, and the usual instant lies in a longer one."""
    columns = following(seed)
    gone = np.random.default_rng([seed, 2]).random(len(columns["gap"])) < lost
    found = [one for one in with_spans(columns, gone) if one.name in OWN]
    assert {one.name for one in found} == ({"input_slow", "output_slow"} if named else set())
    assert all(one.withholds_delays and not one.withholds for one in found), found


@mostly(0.9)
def test_steps_that_some_noise_averages_over_leave_the_gains(seed: int) -> None:
    """Steps of 0.3 of the movement: noise of a sixth of a step averages too little, and half a step enough."""
    columns = following(seed, 5.0)
    smoothed = lagged(columns["range_rate"], 0.3)
    size = 0.3 * float(np.std(smoothed))
    white = np.random.default_rng([seed, 3]).standard_normal(len(smoothed))
    for share, expected in ((1 / 6, [(False, True)]), (1 / 2, [])):
        noisy = smoothed + share * size * white
        given = changed("range_rate", lambda _, noisy=noisy, size=size: stepped(size)(noisy))(columns)
        named = [one for one in with_spans(given) if one.name == "range_rate_coarse"]
        assert [(one.withholds, one.withholds_delays) for one in named] == expected, share


def test_a_finding_that_gets_worse_withholds_more(seed: int) -> None:
    """An input at 4 Hz leaves the gains; from when it comes at 2 Hz nothing is left."""
    columns = following(seed)
    role, half = columns["gap"], len(columns["gap"]) // 2
    slower = np.where(np.arange(len(role)) < half, np.repeat(role[::2], 2)[: len(role)], joined(5)(role))
    found = [one for one in with_spans({**columns, "gap": slower}) if one.name == "input_slow"]
    assert [(one.withholds, one.withholds_delays) for one in found] == [(False, True), (True, False)]
    assert found[0].until == found[1].raised


@pytest.mark.long("takes whole drives")
@mostly(0.9)
def test_coarse_steps_without_noise_are_named(seed: int) -> None:
    """Steps of the size of the movement; not fine ones, and not coarse ones that noise averages over."""
    columns = following(seed, 5.0)
    # the coarsest have one or two values in ten seconds
    for factor in (1.0, 1.5, 2.5):
        size = factor * float(np.std(columns["range_rate"]))
        quiet = changed("range_rate", lambda x, size=size: stepped(size)(lagged(x, 0.3)))(columns)
        named = [one for one in with_spans(quiet) if one.name == "range_rate_coarse"]
        assert len(named) == 1, (factor, named)
        # it stands to the end
        assert np.isnan(named[0].until), (factor, named)
    for size in (0.1, 0.25):
        fine = changed("range_rate", stepped(size))(columns)
        assert "range_rate_coarse" not in {one.name for one in with_spans(fine)}


@mostly(0.9)
def test_a_coarse_speed_is_named_where_no_acceleration_knows_it(seed: int) -> None:
    """In steps of 0.4 of the headway's movement, not of 0.1; and never as a frozen one."""
    columns = following(seed, 5.0)
    headway = columns["gap"] / columns["speed"]
    unit = float(np.std(headway) * np.mean(columns["speed"]) / np.mean(headway))
    bare = {role: x for role, x in columns.items() if role != "accel"}
    for given, share, expected in ((bare, 0.4, {"speed_coarse"}), (bare, 0.1, set()), (columns, 0.4, set())):
        named = {one.name for one in with_spans(changed("speed", stepped(share * unit))(given))}
        assert named & {"speed_coarse", "speed_frozen"} == expected, (share, named)


@pytest.mark.parametrize("step", [0.5, 1.0, 2.0])
@mostly(0.9)
def test_a_coarse_speed_is_not_frozen(step: float, seed: int) -> None:
    """A car that stays within a step for 15 s, with a pedal that moves by 8 % meanwhile."""
    columns = following(seed, 8.0)
    t = DT * np.arange(len(columns["gap"]))
    calm = (
        20.0
        + 0.3 * (columns["speed"] - 20.0)
        + 0.02 * np.random.default_rng([seed, 4]).standard_normal(len(t))
    )
    kept = {role: columns[role] for role in ("gap", "range_rate", "lead_valid")}
    moving = {**kept, "pedal": 20.0 + 4.0 * np.sin(t), "speed": stepped(step)(calm)}
    names = {one.name for one in with_spans(moving)}
    assert "speed_frozen" not in names


@mostly(0.95)
def test_good_signals_raise_nothing(seed: int) -> None:
    """Full rate, fine steps, no delay."""
    found = with_spans(following(seed, 8.0))
    assert not OWN & {one.name for one in found}, found


def test_delays_alone_are_withheld_where_gains_hold() -> None:
    """The gain stays quotable, tau and dead time do not, and the sentence says why."""
    one = Interval(5.0, 4.0, 6.0)
    channel = Channel(one, one, one, one, Identifiable.OK)
    estimate = Estimate(70.0, "fopdt", Status.OK, "fine", {"range_rate": channel}, headline=True)
    late = SignalFinding(
        "range_rate_late", ("gap",), 0.0, 60.0, "it is late", "map another", False, withholds_delays=True
    )
    shown = signal_checks.withheld(estimate, [late])
    assert shown.channels["range_rate"].status is Identifiable.GAIN_ONLY
    assert shown.status is Status.OK
    assert "it is late" in shown.says
    wrong = late._replace(withholds=True, withholds_delays=False)
    assert signal_checks.withheld(estimate, [late, wrong]).status is Status.INCONSISTENT
