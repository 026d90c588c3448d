"""Episodes of constructed drives, and drives that have none: reported, never raised."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from scipy.signal import periodogram

from canid.values.types import LearnGate, Trace
from canid_study.artifact import ClaimVerdict, Study
from canid_study.grover import drive_analysis, episodes, grover
from canid_study.grover.drive_analysis import DriveAnalysis, drive_of
from canid_study.grover.settings import GroverSettings

DT = 0.1
QUICK = GroverSettings(max_order=3, max_fitted=4, draws=10)


def drive(seed: int, minutes: float = 4.0, *, K1: float = 5.0, K2: float = 6.0, noise: float = 0.3) -> Trace:
    """An open-loop drive: random inputs, a driver without lag, every sample usable."""
    rng = np.random.default_rng(seed)
    n = round(minutes * 60 / DT)
    smooth = [np.convolve(rng.standard_normal(n + 29), np.ones(30) / 30.0, "valid") for _ in range(3)]
    error, rate = 0.8 * smooth[0], 3.0 * smooth[1]
    output = 12.0 + K1 * error + K2 * rate + noise * smooth[2]
    speed = np.full(n, 20.0)
    headway = 2.0 + error
    return Trace(
        DT,
        np.arange(n) * DT,
        output,
        np.column_stack([error, rate]),
        ("headway_error", "range_rate"),
        (LearnGate.OPEN,) * n,
        np.ones(n, dtype=bool),
        np.zeros(n, dtype=np.int64),
        {"pedal": output, "speed": speed, "headway": headway, "gap": headway * speed, "range_rate": rate},
    )


def without(trace: Trace, gate: LearnGate, *spans: tuple[float, float]) -> Trace:
    """The same with a closed gate in some seconds."""
    gates, learn = list(trace.gate), trace.learn.copy()
    for start, stop in spans:
        for k in range(round(start / DT), round(stop / DT)):
            gates[k], learn[k] = gate, False
    return trace._replace(gate=tuple(gates), learn=learn)


def test_episodes_end_at_brakes_new_leads_and_gaps() -> None:
    """A stretch is cut where the brake is pressed, where another lead is followed, and where a sample is missing."""
    trace = without(drive(1), LearnGate.BRAKE, (50.0, 52.0))
    segment = trace.segment.copy()
    segment[round(100 / DT) :] = 1
    inputs = trace.inputs.copy()
    inputs[round(140 / DT)] = np.nan
    found = episodes.episodes_of(
        trace._replace(segment=segment, inputs=inputs), GroverSettings(max_episode=1000.0)
    )
    edges = [(round(e.t, 1), round(e.t + e.length, 1)) for e in found.episodes]
    assert edges == [(0.0, 50.0), (52.0, 100.0), (100.0, 140.0), (140.1, 240.0)]
    assert [e.number for e in found.episodes] == [1, 2, 3, 4]


def test_long_stretches_are_cut_and_short_ones_counted() -> None:
    """No episode is longer than the largest or shorter than the least length, and none of a stretch is lost."""
    trace = without(drive(2), LearnGate.BRAKE, (10.0, 11.0), (150.0, 151.0))
    found = episodes.episodes_of(trace, GroverSettings(min_episode=20.0, max_episode=60.0))
    assert all(20.0 <= e.length <= 60.0 + DT for e in found.episodes)
    assert sum(e.length for e in found.episodes) == pytest.approx(139.0 + 89.0)
    assert found.too_short == 1


def test_what_is_said_of_an_episode_is_so() -> None:
    """Headway, speed, correlation and standard deviations are those of its samples."""
    trace = drive(3, 1.0)
    (one,) = episodes.episodes_of(trace).episodes
    assert one.speed == 20.0
    assert one.headway == pytest.approx(float(trace.signals["headway"].mean()))
    assert one.correlation == pytest.approx(float(np.corrcoef(trace.inputs.T)[0, 1]))
    assert one.sd[2] == pytest.approx(float(trace.output.std()))
    # second route: scipy's periodogram, and where its sum passes 95 %
    for u, band in zip(trace.inputs.T, one.band, strict=True):
        f, power = periodogram(u, 1.0 / DT, detrend="linear", scaling="spectrum")
        assert band == pytest.approx(float(f[np.cumsum(power) < 0.95 * power.sum()].max()), abs=1.5 / 60.0)


def test_the_route_comes_from_either_kind_of_position() -> None:
    """East and north in m, or latitude and longitude; without either there is no map."""
    trace = drive(4, 1.0)
    n = len(trace.t)
    assert episodes.route(trace) is None
    metres = {"east": np.arange(n) + 5.0, "north": np.zeros(n)}
    lon = 16.8 + np.arange(n) / 111_195 / math.cos(math.radians(46.9))
    degrees = {"lat": np.full(n, 46.9), "lon": lon}
    one, other = (episodes.route(trace._replace(signals={**trace.signals, **at})) for at in (metres, degrees))
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(one.east, other.east, atol=1e-6)


# --- a whole study -----------------------------------------------------------------------------------------


def consistent(study: Study) -> None:
    """Every row has its columns, every file of a row exists, every name is used once."""
    for table in study.tables:
        assert all(len(row) == len(table.columns) for row in table.rows), table.name
    files = {f"tables/{t.name}.csv" for t in study.tables} | {f"figures/{f.name}.svg" for f in study.figures}
    assert {file for a in study.artifacts for file in a.files} <= files
    names = [a.name for a in study.artifacts]
    assert len(names) == len(set(names))
    for figure in study.figures:
        for curve in (c for panel in figure.panels for c in panel.curves):
            assert curve.x.shape == curve.y.shape


def test_a_study_has_a_row_for_each_equation_table_and_figure(seed: int) -> None:
    """Equations 2.1 to 2.9, Tables 1 and 2, Figures 8 and 10 to 20, sections 4.1 to 4.5."""
    study = grover.study({"a": drive(seed, 2.0), "b": drive(seed + 1, 2.0, K2=4.0)}, QUICK)
    consistent(study)
    names = {a.name for a in study.artifacts}
    wanted = {f"eq. 2.{k}" for k in range(1, 10)} | {"Table 1", "Table 2", "Fig. 8"}
    wanted |= {f"Fig. {k}" for k in range(10, 21)} | {"sec. 4.1", "sec. 4.3", "sec. 4.5", "claim G5"}
    assert wanted <= names
    fleet = next(t for t in study.tables if t.name == "drives")
    at = fleet.columns.index("joint K2")
    assert [row[at] for row in fleet.rows] == pytest.approx([6.0, 4.0], rel=0.1)


def test_one_episode_has_no_validation_and_says_so() -> None:
    """One episode: no next one, no further figures, no error."""
    study = grover.study({"a": drive(5, 0.8)}, QUICK)
    consistent(study)
    by_name = {a.name: a for a in study.artifacts}
    assert by_name["sec. 4.5"].verdict is ClaimVerdict.NOT_CHECKABLE
    assert by_name["Fig. 18"].verdict is ClaimVerdict.NOT_CHECKABLE
    assert "fig_12" in {f.name for f in study.figures}


def _no_lead(trace: Trace) -> Trace:
    return without(trace, LearnGate.NO_LEAD, (0.0, trace.t[-1] + DT))


def _braking(trace: Trace) -> Trace:
    return without(trace, LearnGate.BRAKE, (0.0, trace.t[-1] + DT))


def _lane(trace: Trace) -> Trace:
    return trace._replace(inputs=trace.inputs[:, :1], input_names=("lateral_offset",))


def _nothing_measured(trace: Trace) -> Trace:
    return trace._replace(inputs=np.full_like(trace.inputs, np.nan))


def _empty(trace: Trace) -> Trace:
    return trace._replace(
        t=trace.t[:0], output=trace.output[:0], inputs=trace.inputs[:0], gate=(), learn=trace.learn[:0],
        segment=trace.segment[:0], signals={},
    )  # fmt: skip


def _gaps(trace: Trace) -> Trace:
    inputs = trace.inputs.copy()
    inputs[::100] = np.nan
    return trace._replace(inputs=inputs)


@pytest.fixture(scope="module")
def good() -> DriveAnalysis:
    return drive_of("good", drive(7, 1.0), QUICK)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (_no_lead, "no vehicle ahead"),
        (_braking, "brake"),
        (_lane, "car_following"),
        (_nothing_measured, "no 20 s"),
        (_empty, "no 20 s"),
        (_gaps, "longest stretch"),
    ],
)
def test_a_drive_without_episodes_is_reported(good: DriveAnalysis, spoil, says: str) -> None:  # type: ignore[no-untyped-def]
    """Alone it gives a study without rows that says why; among others it is skipped and changes nothing."""
    alone = grover.study({"bad": spoil(drive(6))}, QUICK)
    assert alone.artifacts == ()
    assert says in " ".join(alone.says)
    assert alone.skipped[0].log == "bad"
    with_bad = grover.combined(
        [good, drive_of("bad", spoil(drive(6)), QUICK)], {"good": DT, "bad": DT}, QUICK
    )
    assert with_bad.artifacts == grover.combined([good], {"good": DT}, QUICK).artifacts
    assert {s.log for s in with_bad.skipped} == {"bad"}


@pytest.mark.parametrize("which", ["output", "headway error", "range rate"])
def test_a_constant_signal_is_skipped(which: str) -> None:
    """Nothing responds to what does not move."""
    trace = drive(8, 1.0)
    inputs, output = trace.inputs.copy(), trace.output.copy()
    if which == "output":
        output[:] = 12.0
    else:
        inputs[:, ("headway error", "range rate").index(which)] = 0.5
    found = drive_of("x", trace._replace(inputs=inputs, output=output), QUICK)
    assert found.episodes == ()
    assert any(f"{which} is constant" in s.why for s in found.skipped)
    assert grover.study({"x": trace._replace(inputs=inputs, output=output)}, QUICK).artifacts == ()


def test_an_acceleration_is_an_output_too() -> None:
    """Without a pedal the study is that of the acceleration, and says so."""
    trace = drive(9, 2.0)
    signals = {role: column for role, column in trace.signals.items() if role != "pedal"}
    found = drive_of("x", trace._replace(signals={**signals, "accel": trace.output}), QUICK)
    assert found.output == "accel"
    assert drive_analysis.unit_of(found.output) == "m/s²"
    assert found.analyses


def test_the_gate_leaves_out_what_it_says(seed: int) -> None:
    """With a gate of 99.9 % no episode of a noisy driver is left, and each is reported."""
    found = drive_of("x", drive(seed, 2.0, noise=5.0), QUICK._replace(gate_fit=99.9))
    assert found.analyses == ()
    assert all("gate" in s.why for s in found.skipped)
    assert len(found.skipped) == len(found.episodes)


def test_drives_can_be_run_by_another_map() -> None:
    """What a process pool is handed can be pickled, and the order of its results is the drives'."""
    passed = []

    def run(function, *columns):  # type: ignore[no-untyped-def]
        passed.extend(pickle.loads(pickle.dumps((function, a))) for a in zip(*columns, strict=True))
        return [pickle.loads(pickle.dumps(f(*a))) for f, a in passed]

    progress: list[tuple[int, int]] = []
    drives = {"a": drive(10, 1.0), "b": drive(11, 1.0)}
    study = grover.study(drives, QUICK, lambda done, total: progress.append((done, total)), run=run)
    assert progress == [(1, 2), (2, 2)]
    assert study.artifacts == grover.study(drives, QUICK).artifacts
