"""A limited range rate is called limited, its samples are not learned from, and no other fault is made of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive import drive_parameters, drive_reader
from canid.analysis.tables.arrays import from_arrays
from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.table import open_table
from canid.models.pipeline import pipeline
from canid.signals.samples import reading_spans
from canid.signals.samples.trace_assembly import trace as assembled
from canid.signals.signal_checks import signal_checks, standing
from canid.signals.signal_checks.check import Found
from canid.signals.signal_checks.drive_time import behind_a_lead, fitted_trace
from canid.signals.signal_checks.whole_drive_limits import with_limits
from canid.values.frame_columns import chunks
from canid.values.types import (
    QUOTED,
    Driver,
    Estimate,
    LearnGate,
    OutputFilter,
    Sample,
    SignalFinding,
    SignalReport,
    Trace,
)
from tests.exact import exact
from tests.fixtures.measured_logs import MEASURED, needs_measured
from tests.plants.outside_drives import drawn_drive, write_table
from tests.samples.radar import T, frames, vehicle
from tests.seeds import mostly
from tests.signal_checks.synthetic import DT, Columns, findings, following
from tests.tables.reading import read_table

CLIPPED = "reports/47-clipped-rate/clip_11.csv"
ROLES = ("pedal", "speed", "gap", "range_rate", "accel")


def drive(seed: int, low: float, high: float) -> tuple[Columns, Trace]:
    """A drive of eight minutes with a range rate between limits."""
    drive = following(seed, 8.0)
    columns = {role: drive[role] for role in ROLES}
    columns["range_rate"] = np.clip(columns["range_rate"], low, high)
    time = DT * np.arange(len(columns["gap"]))
    return columns, from_arrays(time=time, output="pedal", units={"accel": "m/s2"}, **columns)


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize(
    ("low", "high", "says"),
    [(-0.6, 0.6, "±0.6"), (-1.0, 1.0, "±1"), (-0.4, 99.0, "-0.4"), (-99.0, 0.5, "0.5")],
)
def test_a_limited_range_rate_is_called_limited(low: float, high: float, says: str, seed: int) -> None:
    """With its value, before another check makes a scale, a contradiction or a frozen value of it."""
    columns, trace = drive(seed, low, high)
    assert {finding.name.split("_limited")[0] for finding in trace.findings} == {"range_rate"}
    last = trace.findings[-1]
    assert last.says == f"range_rate is limited at {says} m/s"
    assert last.withholds
    # until then the finding itself withholds: samples come later than the readings that show the limit
    known = trace.t > last.raised + 3.0
    limited = np.array([gate is LearnGate.LIMITED for gate in trace.gate])
    at = np.isin(columns["range_rate"], (low, high))
    at = at[np.rint(trace.t / DT).astype(int)]
    assert (limited == at)[known].mean() > 0.98
    # a sample at the very instant of the first reading at the limit may still hold the one before
    stays = at & np.roll(at, 1) & known
    assert not trace.learn[stays].any()
    assert not trace.learn[np.roll(stays, 10) & known].any(), (
        "the response to what was there is still in the output"
    )
    assert trace.learn[known].any()
    assert behind_a_lead(trace.gate).mean() > 0.99


def test_what_stands_at_a_limit_has_come(seed: int) -> None:
    """A reading at a limit is left out, and is none that was lost: a signal does not become slow by brief stays there."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(1001)
    for _ in range(5):
        # stays of one to three readings, shorter than a pause: on average every second reading
        stays = np.concatenate(
            [[False] * rng.integers(1, 4) + [True] * rng.integers(1, 4) for _ in range(600)]
        )
        at = stays[: len(time)].astype(bool)
        rate = np.where(at, np.inf, rng.standard_normal(len(time)))
        _, spans = reading_spans.step({}, "range_rate", time, rate, np.arange(len(time)))
        assert len(spans) == 10
        assert max(span.update for _, span in spans) < 1.01 * DT
        # what is missing is missing
        lost = np.where(at, np.nan, rate)
        _, spans = reading_spans.step({}, "range_rate", time, lost, np.arange(len(time)))
        assert min(span.update for _, span in spans) > 1.5 * DT


@pytest.mark.slow("whole drives through the pipeline")
def test_a_long_memory_forgets_what_it_learned_of_a_wrong_signal(tmp_path: Path, seed: int) -> None:
    """ARMAX rests on nothing from before a finding that withholds; the windows of the drive are the live estimates."""
    driven = drawn_drive("Helly", seed, seconds=200.0)
    rate = np.clip(np.round(driven.columns["range_rate"], 1), -0.6, 0.6)
    path = write_table(
        driven._replace(columns={**driven.columns, "range_rate": rate}), tmp_path / "drive.csv"
    )
    unsmoothed = Driver(output="pedal", output_filter=OutputFilter("none"))
    table = open_table(path, ColumnMap(driver=unsmoothed))
    live = {
        (item.estimator, round(item.t, 6)): item
        for _, _, out in drive_reader.run(table.log, table.vehicle)
        for item in out
        if isinstance(item, Estimate)
    }
    trace = drive_reader.read_drive(path, table.vehicle, estimating=False, log=table.log).trace
    times = sorted(signal_checks.forgotten_at(trace.findings))
    assert times, "nothing is found"
    after = [e for (name, t), e in live.items() if name == "armax" and t > times[0] and e.used == e.used]
    assert after
    for each in after:
        last = max(t for t in times if t < each.t)
        assert each.used <= each.t - last + 2 * DT
    along = drive_parameters.windows(trace, **table.vehicle.estimators)
    assert len(along) > 20
    for each in along:
        assert exact(live[each.estimator, round(each.t, 6)]) == exact(each)


@pytest.mark.slow("the windows of a drive")
@mostly(0.9)
def test_estimates_go_on_from_when_a_limit_is_known(seed: int) -> None:
    """They collect data at once, and no estimator rests on what came before."""
    _, trace = drive(seed, -0.6, 0.6)
    raised = max(finding.raised for finding in trace.findings)
    soon = [e for e in drive_parameters.windows(trace) if 0.0 < e.t - raised < signal_checks.HOLD_S]
    assert {e.estimator for e in soon if e.used > 0.0} == {"fopdt", "armax"}
    quoted = {(n, p) for e in soon for n, c in e.channels.items() for p in QUOTED[c.status]}
    assert quoted <= {("range_rate", "K")}
    assert all(e.used <= e.t - raised + DT for e in soon if e.used == e.used)


def test_another_limit_of_a_signal_is_another_finding() -> None:
    """Estimators forget what they learned at the second one as well, however soon it comes."""
    state, news = {}, []
    for t, limit in ((20.0, 0.8), (40.0, 1.0)):
        found = Found("range_rate_limited", ("range_rate",), t - 9.0, f"limited at {limit}", "")
        state, new = standing.step(
            state, {"limit": found}, t, frozenset({"range_rate"}), 60.0, frozenset({"limit"})
        )
        news += new
    assert sorted(signal_checks.forgotten_at(news)) == [20.0, 40.0]


@pytest.mark.long("takes whole drives")
def test_without_a_limit_nothing_is_found(seed: int) -> None:
    """The same drive, in coarse steps too."""
    columns, trace = drive(seed, -99.0, 99.0)
    assert trace.findings == ()
    assert LearnGate.LIMITED not in trace.gate
    columns["range_rate"] = np.round(columns["range_rate"] / 0.25) * 0.25
    time = DT * np.arange(len(columns["gap"]))
    coarse = from_arrays(time=time, output="pedal", units={"accel": "m/s2"}, **columns)
    assert coarse.findings == ()
    assert LearnGate.LIMITED not in coarse.gate


@pytest.mark.long("takes whole drives")
def test_a_limit_holds_over_the_whole_drive(seed: int) -> None:
    """What came before it was known is learned from as well, and is what it would be without a limit."""
    columns, limited = drive(seed, -1.0, 1.0)
    _, sound = drive(seed, -99.0, 99.0)
    known = max(finding.raised for finding in limited.findings)
    fitted = fitted_trace(limited)
    at = np.isin(columns["range_rate"], (-1.0, 1.0))[np.rint(fitted.t / DT).astype(int)]
    early = fitted.learn & (fitted.t < known)
    assert not (early & at).any()
    assert early.sum() > 0.25 * (fitted.t < known).sum()
    same, rows, others = np.intersect1d(np.rint(limited.t / DT), np.rint(sound.t / DT), return_indices=True)
    assert len(same) > 0.99 * len(sound.t)
    error = (limited.inputs[rows] - sound.inputs[others])[early[rows]]
    # a smoothed value is never worse than one reading of the radar, noise 0.08 m/s, however few readings it has
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.08
    assert np.abs(error).max() < 5 * 0.08


@pytest.mark.long("takes whole drives")
@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-0.6, 99.0)])
def test_the_input_at_a_limit_is_what_the_gap_shows(low: float, high: float, seed: int) -> None:
    """The driver's answer outlasts a limit: in the history its value is no measurement, whether it was known or not."""
    columns, limited = drive(seed, low, high)
    sound_columns, sound = drive(seed, -99.0, 99.0)
    fitted = fitted_trace(limited)
    _, rows, others = np.intersect1d(np.rint(fitted.t / DT), np.rint(sound.t / DT), return_indices=True)
    at = np.isin(columns["range_rate"], (low, high))[np.rint(fitted.t[rows] / DT).astype(int)]
    assert at.sum() > 100
    error = (fitted.inputs[rows] - sound.inputs[others])[at]
    assert np.isfinite(error).all()
    cut = (sound_columns["range_rate"] - columns["range_rate"])[np.rint(fitted.t[rows] / DT).astype(int)][at]
    assert np.sqrt(np.mean(error[:, 1] ** 2)) < 0.4 * np.sqrt(np.mean(cut**2))
    # what is learned from is as it was
    _, same, first = np.intersect1d(np.rint(fitted.t / DT), np.rint(limited.t / DT), return_indices=True)
    assert np.array_equal(fitted.inputs[same][fitted.learn[same]], limited.inputs[first][fitted.learn[same]])


@pytest.mark.long("takes whole drives")
def test_what_is_passed_later_is_no_limit_of_the_whole_drive(seed: int) -> None:
    """Then the finding covers all of its time, as any other does."""
    _, limited = drive(seed, -1.0, 1.0)
    reported = limited.signals["range_rate_reported"].copy()
    reported[-1] = 1.5
    passed = limited._replace(signals={**limited.signals, "range_rate_reported": reported})
    first, last = passed.findings[0], passed.findings[-1]
    assert last.raised < passed.t[-1] - 60.0
    covered = (passed.t >= max(first.since, 0.0)) & (passed.t < last.raised)
    assert not fitted_trace(passed).learn[covered].any()


def test_a_gap_that_stands_at_its_limit_is_not_frozen() -> None:
    """Over the whole drive: what was called frozen before the limit was known is the limit, at another value it is not."""
    gap = np.array([40.0] * 100 + [60.0] * 100 + [50.0] * 400)
    rows = [
        Sample(DT * k, 20.0, (0.0, 0.0), LearnGate.OPEN, True, 0, {"gap_reported": x})
        for k, x in enumerate(gap.tolist())
    ]
    limit = SignalFinding("gap_limited_above", ("gap",), 10.0, 45.0, "", "", True)
    frozen = [
        SignalFinding("gap_frozen", ("gap",), begin, begin + 4.0, "", "", True) for begin in (0.0, 10.0, 21.0)
    ]
    drive = assembled(rows, Driver(), DT)._replace(findings=(*frozen, limit))
    assert [each.withholds for each in with_limits(drive).findings] == [True, False, True, False]


@pytest.mark.parametrize("sides", [(True, False), (False, True), (True, True)])
def test_a_limited_acceleration_fits_the_speed(sides: tuple[bool, bool], seed: int) -> None:
    """It is censored at its limit, whatever share of the time: no unit and no scale is made of it; of a wrong unit it is."""
    columns = following(seed)
    columns = {role: columns[role] for role in ROLES}
    rng = np.random.default_rng(seed)
    for share in rng.uniform(0.05, 0.6, 3):
        low, high = np.quantile(columns["accel"], (share / sum(sides), 1.0 - share / sum(sides)))
        accel = np.clip(columns["accel"], low if sides[0] else -9.0, high if sides[1] else 9.0)
        assert findings(columns | {"accel": accel}) == ()
    wrong = findings(columns | {"accel": accel, "speed": 3.6 * columns["speed"]})
    assert {"speed_unit", "accel_scale"} & {finding.name for finding in wrong}


@pytest.mark.long("takes whole drives")
def test_chunks_do_not_matter(tmp_path: Path, seed: int) -> None:
    """Samples and findings are the same live, in chunks of some frames, to the last bit."""
    car = vehicle(tmp_path)
    several = frames(np.zeros(len(T), bool), None, seed, limit=0.4, sd=9.0)
    runs = []
    for size in (4096, 7):
        running = pipeline.build(car, estimating=False)
        state, out = running.init(), []
        for chunk in chunks(several, size):
            state, made = running.step(state, chunk)
            out += [item for _, item in made if isinstance(item, Sample | SignalReport)]
        runs.append(out)
    says = [f.says for item in runs[0] if isinstance(item, SignalReport) for f in item.findings]
    assert "range_rate is limited at ±0.4 m/s" in says
    assert any(isinstance(item, Sample) and item.gate is LearnGate.LIMITED for item in runs[0])
    assert exact(runs[0]) == exact(runs[1])


@pytest.mark.long("takes whole drives")
@needs_measured
def test_a_clipped_drive() -> None:
    """Limited to ±0.8 m/s; what is left of it is enough to learn from."""
    trace = read_table(MEASURED / CLIPPED)
    assert [finding.says for finding in trace.findings] == ["range_rate is limited at ±0.8 m/s"]
    assert trace.learn.sum() * trace.dt > 300.0
