"""The study of lane keeping on bad input, and on printed drivers whose truth is known."""

import numpy as np
import pytest

from canid.models.effects import NOT_IN_ARMAX
from canid.models.simulation.car import Car
from canid.models.simulation.lane import Steering, keep_lane
from canid_study.artifact import ClaimVerdict
from canid_study.chen_ulsoy import chen_ulsoy, printed_drivers, reproduction, steering_distribution
from canid_study.chen_ulsoy.chen_ulsoy import ChenUlsoySettings
from canid_study.chen_ulsoy.driver_analysis import driver_of
from canid_study.chen_ulsoy.segments import planar_trace, segments_of
from canid_study.printed_numbers import STEERING_TABLES
from tests.seeds import mostly

# repetitions are what takes the time
QUICK = ChenUlsoySettings(constant_repetitions=3)


# fitted to the means and standard deviations of Table 1 (estimation), as the study's of Table 2
TABLE_1 = steering_distribution.Parameters(
    m1=1.21763, lns1=-0.861004, m2=0.00961511, lns2=0.0951714, atanh_r=-2.61285,
    mb=1.29203, lnsb=-0.694625, mz=-1.27717, lnsz=-0.184393, atanh_rb=1.11204,
)  # fmt: skip


def trace_of(simulation, dt=0.1):
    """What a log of the drive holds, without a log: the true offset and angle on the grid."""
    step = round(dt / simulation.dt)
    y, angle = (simulation.columns[r][::step] for r in ("lateral_offset", "steering_angle"))
    t = dt * np.arange(len(y))
    return planar_trace(t)._replace(t=t, output=angle, inputs=y[:, None])


def lane(seed, minutes=9.0, steering=Steering(), dt=0.1):  # noqa: B008
    return trace_of(keep_lane(minutes, seed, steering, Car(), {}, ()), dt)


@pytest.fixture(scope="module")
def one():
    """One driver of eight minutes, analysed with a null band."""
    return driver_of(("S1", [("a.blf", lane(7))], QUICK._replace(bootstraps=20)))


def test_segments_are_minutes_of_the_log_and_the_first_is_left_out(seed):
    """Segment k holds the seconds from 60 k on, with the paper's sign and without the mean."""
    trace = lane(seed % 1000, 4.0)
    found = segments_of([("a", trace)], QUICK)
    assert found.segments.number.tolist() == [0, 1, 2]
    y = -trace.inputs[600:2400, 0]
    assert found.segments.error.ravel() == pytest.approx(y - y.mean())
    assert found.segments.angle[1] == pytest.approx(trace.output[1200:1800])


def test_gaps_and_standing_signals_are_rejected_by_reason_and_keep_their_place():
    """NaN in minute 2, a jump of the clock in 4, a still offset in 6, unusable samples in 7: four of eight are left."""
    trace = lane(3)
    y, t, learn = trace.inputs.copy(), trace.t.copy(), trace.learn.copy()
    y[1300, 0] = np.nan
    y[3600:4200, 0] = 0.1
    learn[4500] = False
    t = np.delete(t, slice(2500, 2530))
    cut = {
        "t": t,
        "output": np.delete(trace.output, slice(2500, 2530)),
        "inputs": np.delete(y, slice(2500, 2530), axis=0),
    }
    cut |= {
        "learn": np.delete(learn, slice(2500, 2530)),
        "segment": trace.segment[30:],
        "gate": trace.gate[30:],
    }
    found = segments_of([("a", trace._replace(**cut))], QUICK)
    assert found.segments.number.tolist() == [0, 2, 4, 7]
    assert found.counted == 8
    reasons = {one.why: one.what for one in found.skipped}
    assert len(reasons) == 2
    assert any("2, 4, 7" in what for what in reasons.values())
    assert any(what.startswith("segment 6") for what in reasons.values())


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t: t._replace(input_names=("headway_error", "range_rate")), "generic_lane"),
        (lambda t: t._replace(inputs=np.full_like(t.inputs, np.nan)), "lateral offset"),
        (lambda t: t._replace(output=np.full_like(t.output, np.nan)), "steering angle"),
        (lambda t: t._replace(inputs=np.zeros_like(t.inputs)), "segments"),
        (lambda t: t._replace(output=np.full_like(t.output, 3.0)), "segments"),
        (lambda t: t._replace(t=t.t[:1500], output=t.output[:1500], inputs=t.inputs[:1500]), "segments"),
        (lambda t: t._replace(t=t.t[:700], output=t.output[:700], inputs=t.inputs[:700]), "first segment"),
        (lambda t: t._replace(dt=0.3), "resampled"),
        (lambda t: t._replace(t=t.t[:0], output=t.output[:0], inputs=t.inputs[:0]), "lateral offset"),
    ],
)
def test_a_log_that_is_no_use_is_reported_and_never_averaged_in(change, word):
    """Bad next to good: the good driver's table is as alone; bad alone: no artifact, and what to do."""
    bad = change(lane(4))
    made = chen_ulsoy.study({"bad": [("bad.blf", bad)]}, QUICK)
    assert made.artifacts == ()
    assert any(word in one.why for one in made.skipped), made.skipped
    assert "bad" in made.says[0]


def test_one_driver_of_two_is_analysed_as_alone(one):
    """A driver with two minutes next to a good one: skipped, and the good one's numbers are the same."""
    good = [("a.blf", lane(7))]
    both = chen_ulsoy.study({"S1": good, "short": [("b.blf", lane(8, 3.0))]}, QUICK)
    table = next(t for t in both.tables if t.name == "table_1")
    assert {row[0] for row in table.rows} == {"S1"}
    assert table.rows[0][3] == pytest.approx(float(one.model[one.number % 2 == 0, 0].mean()))
    assert any(s.log == "short" and s.what == "the driver" for s in both.skipped)


def test_two_drivers_in_one_folder_are_found(one):
    """Logs of two different drivers are not averaged; two of the same driver are."""
    other = Steering((-1.5, 0.56), (-1.5, 1.4), 0.3)
    mixed = driver_of(("S1", [("a.blf", lane(7)), ("b.blf", lane(9, 9.0, other))], QUICK))
    assert "not of one driver" in mixed.why
    assert mixed.equal_logs < 1e-3
    same = driver_of(("S1", [("a.blf", lane(7)), ("b.blf", lane(10))], QUICK))
    assert same.why == ""
    assert len(same.number) == 16


def test_everything_that_is_published_has_its_row_and_files(one):
    """Equations 1-5, both tables, figures 4-14 and the claims; every file that a row names is there."""
    made = chen_ulsoy.made([one], QUICK)
    names = " ".join(a.name for a in made.artifacts)
    wanted = [f"eq. {k}" for k in range(1, 6)] + [f"Fig. {k}" for k in range(4, 15)] + ["Table 1", "Table 2"]
    assert all(
        w in names
        for w in [*wanted, "stationary", "anti-aliasing", "coherence", "orders", "structured", "|Delta|"]
    )
    files = {f"tables/{t.name}.csv" for t in made.tables} | {f"figures/{f.name}.svg" for f in made.figures}
    assert {file for a in made.artifacts for file in a.files} <= files
    for table in made.tables:
        assert all(len(row) == len(table.columns) for row in table.rows), table.name
        assert len(set(table.columns)) == len(table.columns)


def test_a_constant_driver_shows_no_change(one):
    """Eight minutes of Table 1's driver: 0 among the variances between minutes, and the null band holds its Delta."""
    made = chen_ulsoy.made([one], QUICK)
    rows = next(t for t in made.tables if t.name == "structured").rows
    assert sum(row[5] <= 0.0 for row in rows) >= 3
    assert one.drift.p_value > 0.001
    assert one.excess.share < 0.3
    assert one.joint.model == pytest.approx([-1.2623, 0.3697, 4.134, -4.0337], rel=0.35)


def test_the_order_of_drivers_and_a_process_pool_change_nothing(one):
    """`run` may return in its own way; the result is that of map."""
    logs = {"S1": [("a.blf", lane(7))], "S2": [("b.blf", lane(11))]}
    done = []
    made = chen_ulsoy.study(
        logs, QUICK, lambda k, n: done.append((k, n)), run=lambda f, jobs: [f(j) for j in jobs]
    )
    assert done == [(1, 2), (2, 2)]
    again = chen_ulsoy.study(dict(reversed(logs.items())), QUICK)
    first, second = (
        {r[0]: r[3:] for r in next(t for t in s.tables if t.name == "table_1").rows} for s in (made, again)
    )
    assert first["S2"] == pytest.approx(second["S2"])


def test_a_finer_trace_is_resampled_and_the_difference_stated():
    """At 20 Hz: with and without an anti-aliasing filter; of the smooth simulated signals the parameters differ little."""
    found = driver_of(("S1", [("a.blf", lane(7, 9.0, dt=0.05))], QUICK))
    assert found.aliasing is not None
    coarse = driver_of(("S1", [("a.blf", lane(7))], QUICK))
    assert coarse.aliasing is None
    assert np.abs(found.aliasing.difference[:2]).max() < 0.5


def test_the_drawn_distribution_gives_the_printed_tables():
    """Means and standard deviations of Tables 1 and 2 within 4 % of a standard deviation: 100,000 draws."""
    for parameters, table in (
        (TABLE_1, STEERING_TABLES[0]),
        (printed_drivers.TABLE_2, STEERING_TABLES[2]),
    ):
        x = steering_distribution.draw(parameters, np.random.default_rng(1), 100_000)
        sd = np.array(table.sd)
        assert x.mean(axis=1) == pytest.approx(table.mean, abs=0.04 * sd.max())
        assert np.abs(x.mean(axis=1) - table.mean).max() < 0.04 * sd.max()
        assert x.std(axis=1) == pytest.approx(sd, rel=0.04)


def test_a_schedule_changes_the_driver_by_the_minute():
    """The first minute is that of its own driver alone, the second is not; without a schedule nothing changes."""
    first, second = Steering(c=0.0), Steering((-1.5, 0.56), (-1.5, 1.4), 0.0)
    alone = keep_lane(2.0, 5, first, Car(), {}, ()).columns["steering_angle"]
    both = keep_lane(2.0, 5, first, Car(), {}, (), schedule=(first, second))
    angle = both.columns["steering_angle"]
    assert np.array_equal(angle[:5990], alone[:5990])
    assert not np.allclose(angle[6100:], alone[6100:])
    assert np.array_equal(
        keep_lane(2.0, 5, first, Car(), {}, (), schedule=(first,)).columns["steering_angle"], alone
    )
    assert both.truth["schedule"][1]["a"] == (-1.5, 0.56)


@mostly(0.95)
def test_drawn_drivers_come_back(seed):
    """Two changing drivers of 45 min: the corrected std of b1 is nearer to the drawn one than 25 %, all four above 0."""
    drives = printed_drivers.drives(seed % 1000, 2, 45.0, loop=printed_drivers.Loop(c1=0.3))
    made = {name: (trace_of(d), d.truth) for name, d in drives}
    study = reproduction.study(made, QUICK)
    rows = {row[0]: row for row in next(t for t in study.tables if t.name == "recovered").rows}
    for row in rows.values():
        assert row[1] == 0.3
        assert row[7] == pytest.approx(row[5], rel=0.3)
    names = [a.name for a in study.artifacts]
    assert names[0] == "reproduction: a1, c1 0.3"
    b1 = next(
        r for r in next(t for t in study.tables if t.name == "structured").rows if r[:2] == ["all", "b1"]
    )
    assert b1[5] > 0.0


@mostly(0.95)
def test_planted_effects_exceed_their_null(seed):
    """A second lag of 0.3 s in |Delta|, a dead zone of 0.2 m in the test of the innovations: 45 min each."""
    planted = NOT_IN_ARMAX.items()
    for (effect, strength), word in zip(planted, ("by |Delta|", "innovations"), strict=True):
        drives = printed_drivers.drives(seed % 1000, 1, 45.0, kind="constant", hide={effect: strength})
        made = {name: (trace_of(d), d.truth) for name, d in drives}
        study = reproduction.study(made, QUICK._replace(bootstraps=40))
        row = study.artifacts[0]
        assert row.verdict is ClaimVerdict.HOLDS, row
        assert word in row.why
        assert study.failed == ()
